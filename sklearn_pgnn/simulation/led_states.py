r"""States added to the prior that inputs alone drive: led from a record's start to its windows.

The initial state of every window is fitted. For the memory of an actuator that would be a freedom
that no machine has: its inputs are known from the record's start on. Let :math:`\varphi_w(c, p)` be
the value of such states at the start of window :math:`w` if they are :math:`c` at the start of the
record. Every window fits its own value :math:`c_w` of the record's start, expected where the states
are settled, in place of :math:`x_w = \varphi_w(c_w, p)`. So a start that the states have forgotten
is no freedom.
"""

import warnings
from dataclasses import dataclass
from functools import lru_cache
from typing import TYPE_CHECKING

import numpy as np

from sklearn_pgnn.physics.expressions import TIME, symbol
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.parameter import Parameter
from sklearn_pgnn.simulation.simulate import settled_start, simulate_acting

if TYPE_CHECKING:
    from sklearn_pgnn.simulation.windows import ShootingWindows

#: share of an error in a record's start below which its effect on a window does not matter
REMEMBERED = 1e-9


@dataclass(frozen=True)
class Lead:
    """The led states at the starts of the records and of the windows.

    `states` are their indices among the model's, and `numbers` the indices, among the parameters
    that are differentiated by, of those in their rates. `start` are the states at the start of
    every window's record, and `reached` those at the start of every window, of shape (n_windows,
    n_led); `slopes`, (n_windows, n_led, n_numbers + n_led), are the derivatives of the latter by
    the parameters, then by the start.
    """

    states: list[int]
    numbers: list[int]
    start: np.ndarray
    reached: np.ndarray
    slopes: np.ndarray

    def initial_states(self, x0: np.ndarray) -> np.ndarray:
        """Return the windows' initial states, to first order in the record's start."""
        there = x0.copy()
        there[:, self.states] = self.reached + self._moved(x0)
        return there

    def remembers(self, x0: np.ndarray) -> np.ndarray:
        """Return the windows on which another record's start of the led states has an effect."""
        size = np.abs(self.reached) + np.abs(x0[:, self.states] - self.start)
        return (np.abs(self._moved(x0)) > REMEMBERED * size).any(axis=1)

    def _moved(self, x0: np.ndarray) -> np.ndarray:
        """Return how far other starts of the record move the windows' starts, to first order."""
        off = x0[:, self.states] - self.start
        return np.einsum("wij,wj->wi", self.slopes[..., len(self.numbers) :], off)

    def by_record(self, slopes: np.ndarray, window: int) -> np.ndarray:
        """Return derivatives by the record's start in the place of a window's."""
        found = slopes.copy()
        by_start = self.slopes[window, :, len(self.numbers) :]
        found[..., self.states] = slopes[..., self.states] @ by_start
        return found

    def chain(self, gram: np.ndarray, n_p: int) -> np.ndarray:
        """Return products of derivatives by the records' starts in the place of the windows'."""
        led = n_p + np.array(self.states)
        by = np.tile(np.eye(gram.shape[-1]), (len(gram), 1, 1, 1))
        by[:, 0, led[:, None], [*self.numbers, *led]] = self.slopes
        return np.swapaxes(by, -1, -2) @ gram @ by


def led_states(model: PhysicsModel, windows: "ShootingWindows") -> tuple[str, ...]:
    """Name the states of a model that the starts of records lead to the windows."""
    if windows.states is None or set(model.states) <= set(windows.states):
        return ()
    given = frozenset((*model.inputs, *model.parameters))
    return _driven(tuple(model.equations.items()), given, windows.states)


def n_free_states(model: PhysicsModel, windows: "ShootingWindows") -> int:
    """Return the number of states that are free at the start of every window."""
    return len(model.states) - len(led_states(model, windows))


@lru_cache(maxsize=1024)
def _driven(equations, given, states) -> tuple[str, ...]:
    rates, symbols = dict(equations), {symbol(name) for name in given} | {TIME}
    driven = set(rates) - set(states)
    while True:
        allowed = symbols | {symbol(state) for state in driven}
        kept = {state for state in driven if rates[state].free_symbols <= allowed}
        if kept == driven:
            return tuple(state for state in rates if state in driven)
        driven = kept


def lead(
    model: PhysicsModel, windows: "ShootingWindows", wrt: tuple[str, ...], x0: np.ndarray
) -> Lead | None:
    """Simulate the led states from the starts of the records to the windows."""
    led = led_states(model, windows)
    if not led:
        return None
    alone = _alone(model, led)
    own = tuple(name for name in wrt if name in alone.parameters)
    start, reached = (np.empty((len(windows), len(led))) for _ in range(2))
    slopes = np.empty((len(windows), len(led), len(own) + len(led)))
    at = windows.starts - windows.bounds[windows.record]
    for record in np.unique(windows.record):
        which = np.flatnonzero(windows.record == record)
        run = _run(alone, windows, int(record), at[which].max() + 1, own)
        start[which], reached[which] = run.x[0], run.x[at[which]]
        slopes[which] = run.sensitivities[at[which]]
    states, places = list(model.states), [wrt.index(name) for name in own]
    found = Lead([states.index(state) for state in led], places, start, reached, slopes)
    for w in np.flatnonzero(found.remembers(x0) & (at > 0)):
        begin = x0[w, found.states]
        run = _run(alone, windows, int(windows.record[w]), at[w] + 1, own, begin)
        start[w], reached[w], slopes[w] = begin, run.x[-1], run.sensitivities[-1]
    return found


def _run(alone: PhysicsModel, windows: "ShootingWindows", record: int, count: int, wrt, begin=None):
    """Simulate so many samples of a record; by default from where its first inputs settle it."""
    first = windows.bounds[record]
    span = slice(first, first + count)
    if begin is None:
        begin = np.array(list(settled_start(alone, windows.u[first]).values()))
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # windows that begin nowhere are lost
        return simulate_acting(
            alone,
            windows.t[span],
            windows.acting_in_record(alone, record)[:count],
            begin,
            wrt=wrt,
            **windows.options_in(record),
        )


def _alone(model: PhysicsModel, led: tuple[str, ...]) -> PhysicsModel:
    """Return the model of the led states only."""
    equations = tuple((state, model.equations[state]) for state in led)
    delays, settled = tuple(model.delays.items()), tuple(model.settled.items())
    begun = tuple((state, model.initial_state[state]) for state in led)
    alone = _model_of(equations, tuple(model.inputs), delays, settled, begun)
    return alone.with_parameters(**{n: model.parameters[n].value for n in alone.parameters})


@lru_cache(maxsize=256)
def _model_of(equations, inputs, delays, settled, begun) -> PhysicsModel:
    states = dict(equations)
    held = {str(name) for rate in states.values() for name in rate.free_symbols}
    held |= set(dict(delays).values())
    numbers = sorted(held - {*states, *inputs, str(TIME)})
    return PhysicsModel(
        dict.fromkeys(states, ""),
        states,
        {name: Parameter(name, 1.0) for name in numbers},
        dict.fromkeys(inputs, ""),
        delays=dict(delays),
        initial_state=dict(begun),
        settled={state: followed for state, followed in settled if state in states},
    )


def initial_states(model: PhysicsModel, windows: "ShootingWindows", x0: np.ndarray) -> np.ndarray:
    """Return the initial states of windows, including led states."""
    led = lead(model, windows, (), x0)
    return x0 if led is None else led.initial_states(x0)


def start_values(model: PhysicsModel, windows: "ShootingWindows", x: np.ndarray) -> np.ndarray:
    """Return the initial states of windows, of led ones that of the record."""
    x0, states = x[windows.starts], list(model.states)
    for place in (states.index(state) for state in led_states(model, windows)):
        x0[:, place] = x[windows.bounds[windows.record], place]
    return x0
