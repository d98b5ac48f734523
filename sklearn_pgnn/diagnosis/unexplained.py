"""Where no cause of the catalogue will do: where something is missing, and what it depends on."""

import re
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from itertools import combinations

import numpy as np
import sympy
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.model_selection import GroupKFold, cross_val_predict

from sklearn_pgnn.diagnosis.leading_terms import leading_terms
from sklearn_pgnn.estimation.budgets import (
    FOLDS,
    LEAVES,
    MOST_TERMS,
    OWN,
    RESOLUTION,
    SAMPLES,
    TREES,
)
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.fitted_records import as_judged
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.hidden_input import HiddenInput, find_hidden_input
from sklearn_pgnn.simulation.linear_response import linear_responses, without_states
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.window_fit import ParameterPrior, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import evaluate


@dataclass(frozen=True)
class MissingPart:
    """Something that is missing in a model and that the catalogue has no name for.

    Parameters
    ----------
    target : str
        The state in whose rate it is missing, or the input or output.
    quantities : tuple of str
        What it depends on.
    share : float
        Share of its smoothed course that they explain, on records not used for it; from 0 to 1.
    effect : Formula
        Terms that describe it; any model plus the effect has them.
    error : float
        Error over windows that the re-tuned prior with these terms leaves, in units of the noise.
    model : PhysicsModel
        The model with the terms, fitted together.
    course : ndarray of shape (n_samples,)
        Its smoothed course [unit of the target; per second for a state].

    Examples
    --------
    >>> from sklearn_pgnn import effects, systems
    >>> cart, drag = systems.cart_on_spring(), effects.Formula("v", ("v*x**2",), (-24.0,))
    >>> part = MissingPart("v", ("v", "x"), 0.98, drag, 1.1, cart + drag, np.zeros(3))
    >>> part.formula
    '-24*v*x**2'
    >>> spring = effects.Formula("v", ("1", "x"), (0.5, -2.0))
    >>> MissingPart("v", ("x",), 0.98, spring, 1.1, cart + spring, np.zeros(3)).formula
    '0.5 - 2*x'
    """

    target: str
    quantities: tuple[str, ...]
    share: float
    effect: Formula
    error: float
    model: PhysicsModel = field(repr=False)
    course: np.ndarray = field(repr=False)

    @property
    def formula(self) -> str:
        """The terms with their coefficients, as text."""
        pairs = zip(self.effect.coefficients, self.effect.terms, strict=True)
        written = (f"{value:.4g}" + (f"*{term}" if term != "1" else "") for value, term in pairs)
        return " + ".join(written).replace("+ -", "- ")

    def to_dict(self) -> dict:
        """Return it as plain data, as ``diagnosis.json`` holds it.

        Returns
        -------
        dict
            Target, quantities, share, formula and error.
        """
        return {
            "target": self.target,
            "quantities": list(self.quantities),
            "explained_share": self.share,
            "formula": self.formula,
            "error_over_noise": self.error,
        }


@dataclass(frozen=True)
class Proposal:
    """A formula for what is missing at a channel, fitted on all windows.

    Parameters
    ----------
    hidden : HiddenInput
        The hidden input that it describes.
    effect : Formula
        The terms.
    trial : FittedHypothesis
        The hypothesis that it stands beside, with its terms fitted.
    """

    hidden: HiddenInput
    effect: Formula
    trial: FittedHypothesis


def propose(
    problem: EstimationProblem,
    base: FittedHypothesis,
    channel: str,
    each_step: Callable[[], None] | None = None,
) -> list[Proposal]:
    """Find the hidden input of a channel, and formulas for it with one term, with two, and more.

    The terms are those whose effect on the outputs, along the trajectories of the model and with
    its parameters and initial states re-tuned, explains most of the residuals.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    base : FittedHypothesis
        The model without it.
    channel : str
        The place.
    each_step : callable, optional
        Called before every run of the filter and every step of a fit; what it raises ends both.

    Returns
    -------
    list of Proposal
        Empty where no smoother ran to the end.

    Raises
    ------
    SimulationError
        If the responses to the terms leave the finite numbers.
    """
    model, hidden = base.fit.model, _hidden_input(problem, base, channel, each_step)
    if not np.all(np.isfinite(hidden.values)):
        return []
    table = _samples(problem, model, hidden)
    terms = _terms(problem.prior, table)
    columns = np.column_stack([evaluate_samples(term, table, hidden.values.size) for term in terms])
    own = _independent(columns[:: max(1, len(columns) // SAMPLES)])
    columns, terms = columns[:, own], [terms[i] for i in own]
    formulas = [
        _formula(model, channel, terms, c) for c in _telling_terms(problem, base, channel, columns)
    ]
    fitted = [_proposal(problem, base, hidden, formula, each_step) for formula in formulas]
    return [proposal for proposal in fitted if proposal.trial.fit.usable]


def propose_again(
    problem: EstimationProblem,
    base: FittedHypothesis,
    proposal: Proposal,
    each_step: Callable[[], None] | None = None,
) -> Proposal | None:
    """Fit a formula that was found on other records.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    base : FittedHypothesis
        The model without it.
    proposal : Proposal
        The formula.
    each_step : callable, optional
        As in `propose`.

    Returns
    -------
    Proposal or None
        None where it cannot be fitted on these records.
    """
    effect = proposal.effect
    hidden = _hidden_input(problem, base, effect.target, each_step)
    again = _proposal(problem, base, hidden, effect, each_step)
    return again if again.trial.fit.usable and np.all(np.isfinite(hidden.values)) else None


def _hidden_input(problem, base, channel, each_step) -> HiddenInput:
    """Smooth what acts at a channel and is not in the model."""
    model, scales = base.fit.model, problem.scales
    estimate = problem.states.estimate(model)
    return find_hidden_input(
        model,
        problem.windows,
        channel,
        estimate.x,
        estimate.spread,
        scales.rate.get(channel, scales.typical[channel]),
        problem.period,
        each_step,
    )


def _proposal(problem, base, hidden: HiddenInput, formula: Formula, each_step) -> Proposal:
    """Fit a formula beside a model."""
    fit = _fit(problem, base, formula, each_step)
    found = _at_fit(formula, fit) if fit.usable else formula
    return Proposal(hidden, found, FittedHypothesis(base.hypothesis.plus(formula), fit))


def describe(problem: EstimationProblem, proposal: Proposal) -> MissingPart:
    """Describe what is missing.

    Parameters
    ----------
    problem : EstimationProblem
        The problem.
    proposal : Proposal
        The formula that was chosen.

    Returns
    -------
    MissingPart
        The description.
    """
    effect, hidden, fit = proposal.effect, proposal.hidden, proposal.trial.fit
    table = _samples(problem, fit.model, hidden)
    text = " ".join(effect.terms)
    quantities = tuple(name for name in table if re.search(rf"\b{re.escape(name)}\b", text))
    rows = slice(None, None, max(1, hidden.values.size // SAMPLES))
    share = 0.0
    if quantities:
        columns = np.column_stack([table[name][rows] for name in quantities])
        share = _explained(columns, hidden.values[rows], _groups(problem)[rows])
    model = as_judged(problem, fit)
    error = proposal.trial.times_noise
    return MissingPart(effect.target, quantities, share, effect, error, model, hidden.values)


def _fit(problem, base, effect, each_step) -> WindowFit:
    """Fit a model with a formula on all windows, its other parameters with it."""
    model = effect.apply(base.fit.model)
    free = [
        ParameterPrior(name, -np.inf, np.inf, value, np.inf, max(abs(value), 1e-12))
        for name, value in zip(effect.names().values(), effect.coefficients, strict=True)
    ]
    return fit_windows(
        model,
        problem.windows,
        (*base.fit.freedoms, *free),
        *problem.states.expected_starts(model, problem.windows),
        x0_start=base.fit.x0,
        each_step=each_step,
    )


def _at_fit(effect, fit) -> Formula:
    """Return a formula with its fitted coefficients."""
    values = (fit.model.parameters[name].value for name in effect.names().values())
    return replace(effect, coefficients=tuple(values))


def _samples(problem, model, hidden) -> dict[str, np.ndarray]:
    """Return the states, smoothed with the hidden input, the inputs as they act, and the time."""
    table = {name: hidden.states[:, i] for i, name in enumerate(model.states)}
    acting = problem.windows.acting_inputs(model)
    table |= {name: acting[:, i] for i, name in enumerate(model.inputs)}
    return {**table, "t": problem.windows.t}


def _groups(problem) -> np.ndarray:
    """Deal the samples into groups: records, or stretches of a few records."""
    windows = problem.windows
    record = windows.record_at(np.arange(windows.t.size))
    if record.max() + 1 >= FOLDS:
        return record
    return np.arange(windows.t.size) * 2 * FOLDS // windows.t.size


def _explained(columns, values, groups) -> float:
    """Return the share of a variance that some quantities explain on groups not seen."""
    forest = HistGradientBoostingRegressor(max_iter=TREES, max_leaf_nodes=LEAVES, random_state=0)
    found = cross_val_predict(forest, columns, values, groups=groups, cv=GroupKFold(FOLDS))
    return float(max(0.0, 1.0 - np.mean((values - found) ** 2) / np.var(values)))


def library_size(model: PhysicsModel) -> int:
    """Return the number of terms that a formula may be made of at a place."""
    return len(_terms(model, (*model.states, *model.inputs, "t")))


def _terms(model: PhysicsModel, quantities) -> list[sympy.Expr]:
    """Return the library: functions of one quantity, and products of functions of two."""
    single = [_functions(model, name) for name in quantities]
    found = [sympy.Integer(1), *(term for functions in single for term in functions)]
    for one, other in combinations(single, 2):
        found += [a * b for a in one for b in other]
    return list(dict.fromkeys(found))


def _functions(model, name) -> list[sympy.Expr]:
    """Return functions of one quantity."""
    if name == "t":
        return [TIME]
    q = symbol(name)
    found = [q, sympy.Abs(q), q**2, q * sympy.Abs(q), q**3]
    if name in model.states and is_velocity(model, name):
        found.append(sympy.sign(q))
    if model.unit(name) == "rad":
        found += [sympy.sin(q), sympy.cos(q), sympy.sin(2 * q), sympy.cos(2 * q)]
    return found


def _telling_terms(problem, base, channel, columns) -> list[np.ndarray]:
    """Choose the terms by their effect on the outputs, what re-tuning explains projected out."""
    windows, fit = problem.windows, base.fit
    responses, by_state = linear_responses(fit.model, windows, fit.evaluation.x0, channel, columns)
    tuned = [_slope_by(problem, base, freedom) for freedom in fit.freedoms]
    block = np.concatenate([responses, np.stack(tuned, axis=-1)] if tuned else [responses], axis=-1)
    table = np.concatenate([fit.evaluation.residual[..., None], block], axis=-1)
    table = without_states(windows, table, by_state)
    target, moved, known = np.split(table, [1, 1 + columns.shape[1]], axis=1)
    basis = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))[0]
    before = np.linalg.norm(moved, axis=0)
    moved, target = (part - basis @ (basis.T @ part) for part in (moved, target))
    seen = np.flatnonzero(np.linalg.norm(moved, axis=0) > OWN * before)
    path = leading_terms(moved[:, seen], target[:, 0], MOST_TERMS)
    full = np.zeros((len(path), columns.shape[1]))
    full[:, seen] = path
    return list(full)


def _slope_by(problem, base, freedom) -> np.ndarray:
    """Return the change of the outputs by a parameter, for a small step."""
    fit, value = base.fit, base.fit.model.parameters[freedom.name].value
    moved = freedom.beside(value, 1e-3 * freedom.scale)
    model = fit.model.with_parameters(**{freedom.name: moved})
    change = fit.evaluation.residual - evaluate(model, problem.windows, fit.x0, ()).residual
    return change / (moved - value)


def _formula(model, channel, terms, values) -> Formula:
    chosen = np.flatnonzero(values)
    return Formula(
        channel,
        tuple(to_text(terms[i]) for i in chosen),
        tuple(float(values[i]) for i in chosen),
        Formula.next_number(model, channel),
    )


def _independent(columns) -> list[int]:
    """Return the columns that are not sums of those before them."""
    own: list[int] = []
    basis = np.empty((len(columns), 0))
    for i, column in enumerate(columns.T):
        size = np.linalg.norm(column)
        rest = column - basis @ (basis.T @ column)
        rest = rest - basis @ (basis.T @ rest)
        if np.isfinite(size) and np.linalg.norm(rest) > RESOLUTION * size:
            own.append(i)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return own
