r"""Shooting windows: records cut into short windows, each with its own initial state.

A free-run simulation of a lightly damped machine forgets nothing, so its error has many local
minima. Over short windows it has few (multiple shooting). Every window's initial state is a
nuisance: it is fitted with the parameters and projected out of their normal equations.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise

import numpy as np
from numba import njit, types

from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.callbacks import report_calls
from sklearn_pgnn.simulation.compiled import compile_model
from sklearn_pgnn.simulation.inputs import delayed_inputs, mean_inputs
from sklearn_pgnn.simulation.led_states import lead
from sklearn_pgnn.simulation.simulate import parameter_values
from sklearn_pgnn.simulation.stepping import OPTIONS, fill, run_windows, usual_interval
from sklearn_pgnn.simulation.substeps import EXPLICIT, Steps
from sklearn_pgnn.threads import kept_pool

#: batches of windows per thread, and least steps of one: fewer take less long than handing over
PARTS, LEAST = 4, 2000
#: relative rounding of a double
EPSILON = np.finfo(float).eps

_F1, _F2, _F4 = types.float64[::1], types.float64[:, ::1], types.float64[:, :, :, ::1]


@dataclass(frozen=True)
class ShootingWindows:
    """Concatenated records, and their windows on which a model is evaluated.

    Times [s], inputs as commanded, and outputs, NaN where there is none, have a row per sample of
    all records, one after the other; `bounds`, of shape (n_records + 1,), is where each record
    begins, and the end. `starts` and `lengths` are the first sample and the number of samples of
    every window. Residuals are divided by `scale`, the noise of every output. Intervals longer than
    usual take more than `substeps`; the squares of `blocks` of a window are summed apart, for
    statistics.

    Every window begins `states` anew, None meaning all; others that inputs alone drive are led from
    the start of the record, see `sklearn_pgnn.simulation.led_states`.
    """

    t: np.ndarray
    u: np.ndarray
    y: np.ndarray
    bounds: np.ndarray
    starts: np.ndarray
    lengths: np.ndarray
    scale: np.ndarray
    hold: str = "zoh"
    substeps: int = 1
    threads: int = 1
    blocks: int = 1
    states: tuple[str, ...] | None = None
    method: str = EXPLICIT

    def __len__(self):
        return self.starts.size

    @property
    def steps(self) -> Steps:
        """How the model goes from sample to sample."""
        return Steps(self.method, self.substeps)

    @property
    def record(self) -> np.ndarray:
        """Index of every window's record."""
        return self.record_at(self.starts)

    def record_at(self, sample):
        """Return the index of the record that a sample, or every one of some, belongs to."""
        return np.searchsorted(self.bounds, sample, side="right") - 1

    @property
    def rows(self) -> np.ndarray:
        """The samples of the windows, window by window."""
        spans = zip(self.starts, self.lengths, strict=True)
        return np.concatenate([np.arange(a, a + n) for a, n in spans])

    @cached_property
    def usual_intervals(self) -> np.ndarray:
        """Usual sample interval [s] of every window's record; a longer one takes more steps."""
        of_records = [usual_interval(self.t[a:b]) for a, b in pairwise(self.bounds)]
        return np.array(of_records)[self.record]

    def options_in(self, record: int) -> dict[str, object]:
        """Return how to simulate a part of a record, for `simulate_acting`."""
        usual = usual_interval(self.t[slice(*self.bounds[record : record + 2])])
        return {**self.steps._asdict(), "hold": self.hold, "usual": usual}

    def select(self, which) -> "ShootingWindows":
        """Return the windows of a mask or of indices."""
        some = replace(self, starts=self.starts[which], lengths=self.lengths[which])
        vars(some)["usual_intervals"] = self.usual_intervals[which]  # the records are the same
        return some

    @property
    def block_edges(self) -> np.ndarray:
        """First sample of every block, and the end of the window, of shape (n_windows, n + 1)."""
        shares = np.arange(self.blocks + 1)
        return self.starts[:, None] + -(-self.lengths[:, None] * shares // self.blocks)

    def sum_blocks(self, values: np.ndarray) -> np.ndarray:
        """Sum a quantity of every sample over every block of every window."""
        start = np.zeros((1, values.shape[1]))
        total = np.concatenate([start, np.cumsum(np.nan_to_num(values), axis=0)])
        return np.diff(total[self.block_edges], axis=1)

    def thin(self, factor: int) -> "ShootingWindows":
        """Return the windows with fewer samples; held inputs are averaged in between."""
        edges = np.unique([*self.bounds, *self.starts, *(self.starts + self.lengths)])
        kept = np.concatenate([np.arange(a, b, factor) for a, b in pairwise(edges)])
        lengths = -(-self.lengths // factor)
        is_held = self.hold == "zoh"
        return replace(
            self,
            t=self.t[kept],
            u=mean_inputs(self.t, self.u, kept, self.bounds) if is_held else self.u[kept],
            y=self.y[kept],
            bounds=np.searchsorted(kept, self.bounds),
            starts=np.searchsorted(kept, self.starts),
            lengths=lengths,
        )

    def acting_inputs(self, model: PhysicsModel) -> np.ndarray:
        """Return the inputs with the model's delays applied, record by record."""
        if not model.delays:
            return self.u
        records = range(len(self.bounds) - 1)
        return np.concatenate([self.acting_in_record(model, record) for record in records])

    def acting_in_record(self, model: PhysicsModel, record: int) -> np.ndarray:
        """Return one record's inputs with the model's delays applied."""
        of = slice(*self.bounds[record : record + 2])
        return delayed_inputs(model, self.t[of], self.u[of], self.hold == "foh")


@dataclass(frozen=True)
class Evaluation:
    """Residuals and squares of a model on the windows.

    `block_gram`, of shape (n_windows, n_blocks, q + 1, q + 1), has per block the products of the
    columns ``[dy/dp, dy/dx0, residual]`` in units of the noise; where the window diverged, or is
    lost to rounding, the squares are infinite and all other products zero. Residuals are measured
    minus simulated outputs, NaN outside the windows; `x0`, of shape (n_windows, n_states), is where
    the windows begin.
    """

    block_gram: np.ndarray
    residual: np.ndarray
    x0: np.ndarray

    @cached_property
    def gram(self) -> np.ndarray:
        """The products summed over every window, of shape (n_windows, q + 1, q + 1)."""
        one = self.block_gram.shape[1] == 1  # nothing to sum, and nothing to keep twice
        return self.block_gram[:, 0] if one else self.block_gram.sum(axis=1)

    @cached_property
    def squares(self) -> np.ndarray:
        """Sum of squared residuals of every window, in units of the noise."""
        return self.block_squares.sum(axis=1)

    @property
    def block_squares(self) -> np.ndarray:
        """Sum of squared residuals of every block, of shape (n_windows, n_blocks)."""
        return self.block_gram[:, :, -1, -1]

    def select(self, which) -> "Evaluation":
        """Return the evaluation of the windows of a mask or indices; its residuals are all."""
        return Evaluation(self.block_gram[which], self.residual, self.x0[which])

    def replaced(self, windows: ShootingWindows, which, other: "Evaluation", part) -> "Evaluation":
        """Return the evaluation with windows `which` replaced by windows `part` of another."""
        gram, residual, x0 = self.block_gram.copy(), self.residual.copy(), self.x0.copy()
        gram[which], x0[which] = other.block_gram[part], other.x0[part]
        for a, n in zip(windows.starts[which], windows.lengths[which], strict=True):
            residual[a : a + n] = other.residual[a : a + n]
        return Evaluation(gram, residual, x0)


@njit(types.void(_F4, _F1, _F2), **OPTIONS)
def _lose_arbitrary(gram, values, x0):
    """Discard the windows in which rounding errors move outputs beyond the noise."""
    n, blocks, size = gram.shape[:3]
    for w in range(n):
        known = True
        for i in range(size - 1):
            square = 0.0
            for j in range(blocks):
                square += gram[w, j, i, i]
            at = values[i] if i < values.size else x0[w, i - values.size]
            known = known and EPSILON * abs(at) * math.sqrt(square) <= 1.0
        for j in range(blocks):
            for i in range(size):
                for k in range(size):
                    known = known and math.isfinite(gram[w, j, i, k])
        if not known:
            fill(gram[w], 0.0)
            for j in range(blocks):
                gram[w, j, -1, -1] = math.inf


def evaluate(model: PhysicsModel, windows: ShootingWindows, x0, wrt: tuple[str, ...]) -> Evaluation:
    r"""Simulate every window from its initial state, with sensitivities.

    A window is lost to rounding where rounding a parameter or an initial state, :math:`\theta_i`,
    moves its outputs by more than the noise :math:`\sigma`,

    .. math:: \varepsilon |\theta_i| \, |\partial y / \partial \theta_i| > \sigma,

    with the rounding :math:`\varepsilon` of a double: the simulation is then arbitrary.
    """
    function, source = compile_model(model, tuple(wrt), windows.method)
    u, p = windows.acting_inputs(model), parameter_values(model)
    q = len(wrt) + len(model.states)
    gram = np.zeros((len(windows), windows.blocks, q + 1, q + 1))
    residual = np.full(windows.y.shape, np.nan)
    dry, usual = source.dry, windows.usual_intervals
    x0 = np.ascontiguousarray(x0, dtype=float)
    led = lead(model, windows, wrt, x0)
    begun = x0 if led is None else led.initial_states(x0)

    def run(part):
        run_windows(
            function.argument,
            windows.t,
            u,
            windows.hold == "foh",
            windows.y,
            windows.starts[part],
            windows.lengths[part],
            usual[part],
            p,
            begun[part],
            windows.scale,
            dry,
            windows.substeps,
            source.size,
            len(wrt),
            gram[part],
            residual,
        )

    in_parts(run, windows)
    report_calls()
    if led is not None:
        with np.errstate(over="ignore", invalid="ignore"):  # windows that are lost
            gram = led.chain(gram, len(wrt))
    values = np.array([model.parameters[name].value for name in wrt], dtype=float)
    _lose_arbitrary(gram, values, x0)
    return Evaluation(gram, residual, begun)


def in_parts(run: Callable[[slice], None], windows: ShootingWindows) -> None:
    """Work on windows, on as many threads as they say."""
    parts = _parts(windows)
    left = iter(parts)

    def work():
        for part in left:
            run(part)

    others = range(min(windows.threads, len(parts)) - 1)
    helpers = [kept_pool(windows.threads).submit(work) for _ in others]
    work()
    for each in helpers:
        each.result()


def _parts(windows: ShootingWindows) -> list[slice]:
    """Deal windows to threads, several parts to each: some windows take longer."""
    if windows.threads == 1:
        return [slice(None)]
    count, steps = len(windows), int(windows.lengths.sum()) * windows.substeps
    most = max(1, min(PARTS * windows.threads, count, steps // LEAST))
    edges = np.linspace(0, count, most + 1).astype(int)
    return [slice(a, b) for a, b in pairwise(edges)]
