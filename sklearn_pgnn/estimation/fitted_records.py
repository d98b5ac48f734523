"""Data for the plots of a diagnosis: the records, and the fit of each model to them."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace

import numpy as np

from sklearn_pgnn.estimation.budgets import SMALL_CHANGE
from sklearn_pgnn.estimation.problem import EstimationProblem, with_prior_spreads
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.free_starts import fit_starts
from sklearn_pgnn.simulation.record_windows import CLEARLY
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit
from sklearn_pgnn.simulation.windows import ShootingWindows


@dataclass(frozen=True)
class FittedWindows:
    """A model on windows: initial states, and residuals, measured minus simulated."""

    model: PhysicsModel
    x0: np.ndarray
    residual: np.ndarray
    freedoms: tuple[ParameterPrior, ...]


@dataclass(frozen=True)
class DiagnosisRecords:
    """The records of a diagnosis and the fits of the models to them.

    `states` are the prior's as estimated from the records, of shape (n_samples, n_states), and
    `starts`, by model, its states at the start of every record in a free run, (n_records,
    n_states). `fits` has the ``"prior"``, the ``"refitted"`` prior, the ``"extended"`` model, and
    where there is a formula the model with the causes and the ``"formula"``. The causes are in the
    order in which they apply.
    """

    windows: ShootingWindows
    names: tuple[str, ...]
    states: np.ndarray
    starts: Mapping[str, np.ndarray]
    fits: Mapping[str, FittedWindows]
    problem: EstimationProblem
    causes: tuple[Effect, ...]

    @property
    def best(self) -> str:
        """The model that holds all that was found."""
        return "formula" if "formula" in self.fits else "extended"


def keep_records(
    problem: EstimationProblem,
    fits: Mapping[str, WindowFit],
    causes: tuple[Effect, ...],
    names: Iterable[str],
) -> DiagnosisRecords:
    """Collect the data for the plots: the fits, and where their free runs begin."""
    windows, known = replace(problem.windows, threads=1), {}
    for fit in fits.values():
        if id(fit) not in known:
            begun = record_starts(problem, fit.model, fit.x0)
            known[id(fit)] = fit_starts(fit.model, problem.windows, problem.states, begun)
    return DiagnosisRecords(
        windows=windows,
        names=tuple(map(str, names)),
        states=problem.states.estimate(problem.prior).x,
        starts={which: known[id(fit)] for which, fit in fits.items()},
        fits={
            which: FittedWindows(fit.model, fit.x0, fit.evaluation.residual, fit.freedoms)
            for which, fit in fits.items()
        },
        problem=replace(problem, windows=windows),
        causes=causes,
    )


def record_starts(problem: EstimationProblem, model: PhysicsModel, x0: np.ndarray) -> np.ndarray:
    """Return the initial state of every record: as recorded, else as fitted to its first window.

    States that inputs settle are settled unless the first samples tell clearly otherwise.
    """
    windows, states = problem.windows, list(model.states)
    starts = x0[np.searchsorted(windows.starts, windows.bounds[:-1])].copy()
    for state in _settled_by_inputs(model):
        column, rest = states.index(state), _settled(model, windows, state)
        driver = windows.u[:, list(model.inputs).index(model.settled[state])]
        near = np.abs(starts[:, column] - rest) < SMALL_CHANGE * float(np.std(driver))
        starts[near, column] = rest[near]
    for start, told in zip(starts, problem.states.told, strict=True):
        start[[states.index(state) for state in told]] = list(told.values())
    return starts


def _settled_by_inputs(model: PhysicsModel) -> tuple[str, ...]:
    """Name the states that start at the first value of an input."""
    return tuple(state for state, followed in model.settled.items() if followed in model.inputs)


def _settled(model: PhysicsModel, windows: ShootingWindows, state: str) -> np.ndarray:
    """Return where every record settles a state: at the first value of the input it follows."""
    return windows.u[windows.bounds[:-1], list(model.inputs).index(model.settled[state])]


def as_judged(problem: EstimationProblem, fit: WindowFit | FittedWindows) -> PhysicsModel:
    """Return a fitted model with the settings of its evaluation, for the user.

    These are its hold and substeps, the prior's spreads, and as `initial_state` the fitted start of
    the first record in the states that were not recorded and do not start settled.
    """
    model, windows = with_prior_spreads(fit.model, problem.prior), problem.windows
    starts = record_starts(problem, model, fit.x0)
    begun = _begun_elsewhere(model, windows, starts)
    settled = {state: name for state, name in model.settled.items() if state not in begun}
    (start,) = fit_starts(model, windows, problem.states, starts, last=1)
    first = dict(zip(model.states, start.tolist(), strict=True))
    found = {s: v for s, v in first.items() if s not in {*problem.states.told[0], *settled}}
    return model.replace(
        initial_state={**model.initial_state, **found, **begun},
        settled=settled,
        simulation={"hold": windows.hold, **windows.steps.settings},
    )


def _begun_elsewhere(
    model: PhysicsModel, windows: ShootingWindows, starts: np.ndarray
) -> dict[str, float]:
    """Return the settled states that begin all records clearly nearer to one value, and that one.

    So does an actuator at rest whose command steps in the first sample.
    """
    found = {}
    for state in _settled_by_inputs(model):
        start = starts[:, list(model.states).index(state)]
        off = np.mean((start - _settled(model, windows, state)) ** 2)
        if np.var(start) < CLEARLY * off:
            found[state] = float(start.mean())
    return found
