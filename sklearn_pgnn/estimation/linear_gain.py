r"""What every candidate leaves of the residuals, to first order, before any of them is fitted.

A candidate at one of its starts changes the rates and the outputs along the trajectories of a
hypothesis. With the linear response :math:`e` of the outputs to that and :math:`E` to changes of
its own parameters it leaves

.. math:: \min_{p, x_0, a, b} |r - S_p p - S_x x_0 - e a - E b|^2

of the residuals :math:`r`, with the sensitivities to the parameters that are not at a limit and to
every window's initial state. This ranks candidates; a fit decides. What adds states or delays has
no such response and is not ranked, nor is anything beside functions without an equation.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass
from itertools import chain

import numpy as np
import sympy

from sklearn_pgnn.estimation.budgets import ROUNDING
from sklearn_pgnn.estimation.fitted_hypothesis import SubsampleFit
from sklearn_pgnn.estimation.hypothesis_models import HypothesisModels
from sklearn_pgnn.estimation.likely_places import windows_looked_at
from sklearn_pgnn.physics.effect import Effect, Scales
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.added_response import AddedResponse, Addition
from sklearn_pgnn.simulation.pointwise import numpy_function, sample_table
from sklearn_pgnn.simulation.windows import ShootingWindows

#: numbers in a table of responses, of some candidates at a time. More take more memory
TABLE = 4_000_000
#: change of a parameter by which its slope is found, relative to its size
SLOPE_STEP = 1e-2


@dataclass(frozen=True)
class Left:
    """Squares by output and by window, before and after a candidate is added to first order."""

    before: np.ndarray  # of shape (n_windows, n_outputs)
    after: np.ndarray

    @property
    def share(self) -> float:
        """The share of all squares that is left."""
        return float(self.after.sum() / max(self.before.sum(), np.finfo(float).tiny))

    def evidence(self, counts: np.ndarray) -> float:
        """Return the logarithm of the likelihoods' ratio, with effective samples by output."""
        before, after = self.before.sum(axis=0), self.after.sum(axis=0)
        told = before > 0.0
        ratio = before[told] / np.maximum(after[told], ROUNDING * before[told])
        return float(0.5 * counts[told] @ np.log(ratio))


class LinearGain:
    """The first-order gain of candidates that are added to a hypothesis."""

    def __init__(
        self,
        models: HypothesisModels,
        scales: Scales,
        ground: SubsampleFit,
        tick: Callable[[], object] = lambda: None,
    ):
        self.models, self.scales, self.ground, self.tick = models, scales, ground, tick

    def left(self, windows: ShootingWindows, candidates: Iterable[Effect]) -> dict[Effect, Left]:
        """Return what the candidates leave that can be ranked."""
        fit = self.ground.fit
        some = windows_looked_at(windows, fit.evaluation.squares, len(fit.model.states))
        if not some.size or fit.model.opaque_functions:
            return {}
        windows = windows.select(some)
        response = AddedResponse(fit.model, windows, fit.evaluation.x0[some])
        if not response.is_finite:
            return {}
        rates = _Rates(fit.model, windows, response.x)
        residual = response.without_states(fit.evaluation.residual[..., None])
        tuned = response.to(list(rates.slopes(fit.model, self._tuned)))
        window = np.repeat(np.arange(len(windows)), windows.lengths)
        table = _Table(np.concatenate([tuned, residual], axis=-1), window)
        size = max(1, TABLE // windows.y.size)
        asked = ((c, a) for c in candidates for a in self._starts(rates, c))
        found: dict[Effect, Left] = {}
        for block in _blocks(asked, size):
            self.tick()
            responses = response.to(list(chain.from_iterable(a for _, a in block)))
            ends = np.cumsum([len(additions) for _, additions in block])
            for (cause, _), part in zip(block, np.split(responses, ends[:-1], -1), strict=True):
                left = table.left(part)
                if left is not None and (cause not in found or left.share < found[cause].share):
                    found[cause] = left
        return found

    @property
    def _tuned(self) -> list[str]:
        """The parameters that can still change: those not at a limit."""
        fit = self.ground.fit
        pairs = zip(fit.freedoms, fit.values, strict=True)
        return [free.name for free, value in pairs if free.low < value < free.high]

    def _starts(self, rates: "_Rates", cause: Effect) -> Iterator[list[Addition]]:
        """Yield the additions by a candidate at each of its starts, then by its parameters."""
        known, own = self.ground.fit.model, cause.names()
        for order in self.models.orders(self.ground.hypothesis, cause):
            model = self.models.extend(order, known)
            if model.states != known.states or model.delays != known.delays:
                return
            for start in cause.proposals(self.models.problem.prior, self.scales):
                values = {name: getattr(start, field) for field, name in own.items()}
                given = {name: value for name, value in values.items() if value is not None}
                there = model.with_parameters(**given)
                yield [rates.change(there), *rates.slopes(there, list(own.values()))]


def _blocks(asked, size: int) -> Iterator[list]:
    """Yield some candidates at a time, of about so many columns."""
    block, count = [], 0
    for each in asked:
        block.append(each)
        count += len(each[1])
        if count >= size:
            yield block
            block, count = [], 0
    if block:
        yield block


class _Rates:
    """The rates and outputs of models along known trajectories."""

    def __init__(self, model: PhysicsModel, windows: ShootingWindows, x: np.ndarray):
        self.model, self.size = model, windows.t.size
        acting = windows.acting_inputs(model)
        self.known = sample_table(model, windows, x)
        self.known |= dict(zip(model.inputs, acting.T, strict=False))
        self._values: dict[sympy.Expr, np.ndarray] = {}
        self._functions: dict[sympy.Expr, tuple] = {}

    def change(self, model: PhysicsModel) -> Addition:
        """Return what another model adds."""
        before, after = _rows(self.model), _rows(model)
        moved = [i for i, row in enumerate(after) if row != before[i]]
        values = {name: p.value for name, p in model.parameters.items()}
        same = all(values[name] == p.value for name, p in self.model.parameters.items())
        if not same:
            names = {n for n, p in self.model.parameters.items() if values[n] != p.value}
            moved = [i for i, row in enumerate(after) if row != before[i] or _has(row, names)]
        return Addition(
            tuple((i, self._at(after[i], values) - self._as_known(before[i])) for i in moved)
        )

    def slopes(self, model: PhysicsModel, names: list[str]) -> Iterator[Addition]:
        """Yield what a small change of each of some parameters adds, made larger."""
        values = {name: p.value for name, p in model.parameters.items()}
        for name in names:
            step = SLOPE_STEP * (abs(values[name]) or 1.0)
            moved = {**values, name: values[name] + step}
            rows = [(i, row) for i, row in enumerate(_rows(model)) if _has(row, {name})]
            yield Addition(
                tuple((i, (self._at(e, moved) - self._at(e, values)) / step) for i, e in rows)
            )

    def _as_known(self, expression: sympy.Expr) -> np.ndarray:
        if expression not in self._values:
            self._values[expression] = self._at(expression, {})
        return self._values[expression]

    def _at(self, expression: sympy.Expr, values: dict[str, float]) -> np.ndarray:
        if expression not in self._functions:
            names = tuple(sorted(map(str, expression.free_symbols)))
            self._functions[expression] = names, numpy_function(names, expression)
        names, function = self._functions[expression]
        of = {**self.known, **values}
        with np.errstate(all="ignore"):
            found = function(*(np.broadcast_to(np.asarray(of[n], float), self.size) for n in names))
        return np.nan_to_num(np.broadcast_to(np.asarray(found, dtype=float), self.size))


def _rows(model: PhysicsModel) -> list[sympy.Expr]:
    return [*model.equations.values(), *model.outputs.values()]


def _has(expression: sympy.Expr, names: set[str]) -> bool:
    return any(symbol(name) in expression.free_symbols for name in names)


class _Table:
    """Residuals, less what parameters and initial states explain, to which columns are fitted."""

    def __init__(self, tuned: np.ndarray, window: np.ndarray):
        self.shape, self.window = tuned.shape[:2], window
        flat = tuned.reshape(-1, tuned.shape[-1])
        self.basis = _basis(flat[:, :-1])
        self.residual = self._without(flat[:, -1:])[:, 0]
        self.before = self._squares(self.residual)

    def left(self, columns: np.ndarray) -> Left | None:
        """Return what columns leave; None where they say nothing."""
        flat = columns.reshape(-1, columns.shape[-1])
        if not np.isfinite(flat).all():
            return None
        basis = _basis(self._without(flat))
        rest = self.residual - basis @ (basis.T @ self.residual)
        return Left(self.before, self._squares(rest))

    def _without(self, flat: np.ndarray) -> np.ndarray:
        return flat - self.basis @ (self.basis.T @ flat)

    def _squares(self, residual: np.ndarray) -> np.ndarray:
        squares = residual.reshape(self.shape) ** 2
        found = np.zeros((self.window[-1] + 1, self.shape[1]))
        np.add.at(found, self.window, squares)
        return found


def _basis(columns: np.ndarray) -> np.ndarray:
    """Return an orthonormal basis of columns, each scaled to length one, without rounding."""
    size = np.linalg.norm(columns, axis=0)
    scaled = columns[:, size > 0.0] / size[size > 0.0]
    gram = scaled.T @ scaled
    spread, directions = np.linalg.eigh(gram)
    kept = spread > ROUNDING * max(spread.max(initial=0.0), np.finfo(float).tiny)
    return scaled @ (directions[:, kept] / np.sqrt(spread[kept]))
