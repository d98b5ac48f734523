"""Missing parts that no cause of the catalogue explains: where, and what they depend on."""

from collections.abc import Container, Iterable, Mapping
from contextlib import suppress
from dataclasses import dataclass, field, replace
from functools import lru_cache
from itertools import combinations
from typing import NamedTuple

import numpy as np
import sympy

from sklearn_pgnn.diagnosis.term_choice import independent, telling_terms
from sklearn_pgnn.diagnosis.trees import share_predicted
from sklearn_pgnn.estimation.budgets import MOST_QUANTITIES, SAMPLES
from sklearn_pgnn.estimation.fitted_hypothesis import FittedHypothesis
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.effects.rates import is_velocity
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.physics.places import typical_at
from sklearn_pgnn.simulation.hidden_input import HiddenInput, find_hidden_input
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.window_fit import EachStep, ParameterPrior, WindowFit, fit_windows


class KnownTerms(NamedTuple):
    """Terms of a formula that have a name: together they act as one cause does.

    For a parameter of the model the effect is ``"wrong_parameter"`` and the target its name.
    """

    terms: tuple[str, ...]
    effect: str
    target: str
    is_parameter: bool = False


@dataclass(frozen=True)
class MissingPart:
    """A missing part of a model that is not in the catalogue.

    Parameters
    ----------
    target : str
        The port at which it is missing, the state in whose rate, or the input or output.
    quantities : tuple of str
        The quantities it depends on.
    share : float
        Share of its smoothed trajectory that they explain, on held-out records; from 0 to 1.
    effect : Formula
        Terms that describe it; a model plus this effect contains them.
    error : float
        Held-out error over windows of the model with these terms, in units of the noise.
    model : PhysicsModel
        The model with the terms, fitted together.
    left : ndarray of shape (n_samples,)
        What the records show there beside the terms, smoothed with the parameters fitted with
        them, see `sklearn_pgnn.physics.places.unit_at`.
    known : tuple of KnownTerms, default=()
        The terms that a parameter of the model or an effect of the catalogue expresses.

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
    left: np.ndarray = field(repr=False)
    known: tuple[KnownTerms, ...] = ()

    @property
    def has_names(self) -> bool:
        """Whether parameters or effects of the catalogue express every term."""
        return {term for each in self.known for term in each.terms} == set(self.effect.terms)

    @property
    def formula(self) -> str:
        """The terms with their coefficients, as text."""
        pairs = zip(self.effect.coefficients, self.effect.terms, strict=True)
        written = (f"{value:.4g}" + (f"*{term}" if term != "1" else "") for value, term in pairs)
        return " + ".join(written).replace("+ -", "- ")

    def to_dict(self) -> dict:
        """Return the missing part as plain data, as in ``diagnosis.json``.

        Returns
        -------
        dict
            Target, quantities, share, formula, error, and the terms that have a name.
        """
        return {
            "target": self.target,
            "quantities": list(self.quantities),
            "explained_share": self.share,
            "formula": self.formula,
            "error_over_noise": self.error,
            "known_terms": [
                {"terms": list(each.terms), "effect": each.effect, "target": each.target}
                for each in self.known
            ],
        }


@dataclass(frozen=True)
class Proposal:
    """A formula for what is missing at a channel of a trial, fitted on all windows."""

    hidden: HiddenInput
    effect: Formula
    trial: FittedHypothesis


def propose(
    problem: EstimationProblem,
    base: FittedHypothesis,
    channel: str,
    each_step: EachStep = None,
    timed: bool = True,
) -> list[Proposal]:
    """Estimate the hidden input of a channel, and formulas for it with one, two, and more terms.

    The terms are those whose effect on the outputs, along the trajectories of the model and with
    its parameters and initial states re-tuned, explains most of the residuals; functions of the
    time are among them if it is `timed`.
    """
    model, hidden = base.fit.model, hidden_input(problem, base, channel, each_step)
    if not np.all(np.isfinite(hidden.values)):
        return []
    table = smoothed_samples(problem, model, hidden)
    if not timed:
        del table["t"]
    leading = leading_quantities(problem.prior, table, hidden.values)
    terms = term_library(problem.prior, table, leading)
    columns = np.column_stack([evaluate_samples(term, table, hidden.values.size) for term in terms])
    own = independent(columns[:: max(1, len(columns) // SAMPLES)])
    columns, terms = columns[:, own], [terms[i] for i in own]
    formulas = [
        _formula(model, channel, terms, c) for c in telling_terms(problem, base, channel, columns)
    ]
    fitted = []
    for formula in formulas:
        with suppress(ModelError):  # beside a friction under load signs may multiply
            fitted.append(_proposal(problem, base, hidden, formula, each_step))
    return [proposal for proposal in fitted if proposal.trial.fit.usable]


def tells_time(problem: EstimationProblem, base: FittedHypothesis) -> bool:
    """Return whether states and inputs tell most of the time: all records are the same motion."""
    model, windows = base.fit.model, problem.windows
    known = np.column_stack([problem.states.values(model), windows.acting_inputs(model)])
    record = windows.record_at(np.arange(windows.t.size))
    if np.unique(record).size < 2 or not np.isfinite(known).all():
        return False
    time = windows.t - windows.t[windows.bounds[record]]
    return share_predicted(known, time, record) > 0.5


def propose_again(
    problem: EstimationProblem,
    base: FittedHypothesis,
    proposal: Proposal,
    each_step: EachStep = None,
) -> Proposal | None:
    """Fit a formula again that was found on other records."""
    effect = proposal.effect
    hidden = hidden_input(problem, base, effect.target, each_step)
    again = _proposal(problem, base, hidden, effect, each_step)
    return again if again.trial.fit.usable and np.all(np.isfinite(hidden.values)) else None


def hidden_input(
    problem: EstimationProblem, base: FittedHypothesis, channel: str, each_step: EachStep = None
) -> HiddenInput:
    """Estimate by smoothing what acts at a channel and is not in the model."""
    model = base.fit.model
    estimate = problem.states.estimate(model)
    return find_hidden_input(
        model,
        problem.windows,
        channel,
        estimate.x,
        estimate.spread,
        typical_at(model, channel, problem.scales),
        problem.period,
        each_step,
    )


def _proposal(
    problem: EstimationProblem,
    base: FittedHypothesis,
    hidden: HiddenInput,
    formula: Formula,
    each_step: EachStep,
) -> Proposal:
    """Fit a formula added to a model."""
    fit = _fit(problem, base, formula, each_step)
    found = formula
    if fit.usable:
        values = (fit.model.parameters[name].value for name in formula.names().values())
        found = replace(formula, coefficients=tuple(values))
    return Proposal(hidden, found, FittedHypothesis(base.hypothesis.plus(formula), fit))


def _fit(
    problem: EstimationProblem, base: FittedHypothesis, effect: Formula, each_step: EachStep
) -> WindowFit:
    """Fit a model with a formula on all windows, together with its other parameters."""
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


def smoothed_samples(
    problem: EstimationProblem, model: PhysicsModel, hidden: HiddenInput
) -> dict[str, np.ndarray]:
    """Return the states, smoothed with the hidden input, the inputs as they act, and the time."""
    table = {name: hidden.states[:, i] for i, name in enumerate(model.states)}
    acting = problem.windows.acting_inputs(model)
    table |= {name: acting[:, i] for i, name in enumerate(model.inputs)}
    return {**table, "t": problem.windows.t}


@lru_cache(maxsize=16)
def library_size(model: PhysicsModel) -> int:
    """Return the number of terms that a formula may be made of at a place."""
    return len(term_library(model, (*model.states, *model.inputs, "t")))


def _formula(
    model: PhysicsModel, channel: str, terms: list[sympy.Expr], values: np.ndarray
) -> Formula:
    chosen = np.flatnonzero(values)
    return Formula(
        channel,
        tuple(to_text(terms[i]) for i in chosen),
        tuple(float(values[i]) for i in chosen),
        Formula.next_number(model, channel),
    )


def term_library(
    model: PhysicsModel, quantities: Iterable[str], leading: Container[str] | None = None
) -> list[sympy.Expr]:
    """Return functions of one quantity, and products of functions of two, of the leading ones.

    >>> lag = PhysicsModel({"y": "V"}, {"y": "-y"})
    >>> term_library(lag, ["y"])
    [1, y, Abs(y), y**2, y*Abs(y), y**3]
    >>> two = PhysicsModel({"v": "m/s", "w": "rad/s"}, {"v": "-v", "w": "-w"})
    >>> any(len(term.atoms(sympy.sign)) > 1 for term in term_library(two, two.states))
    False
    """
    single = {name: _functions(model, name) for name in quantities}
    found = [sympy.Integer(1), *(term for functions in single.values() for term in functions)]
    joined = (of for name, of in single.items() if leading is None or name in leading)
    for one, other in combinations(joined, 2):
        found += [a * b for a in one for b in other if {a.func, b.func} != {sympy.sign}]
    return list(dict.fromkeys(found))


def leading_quantities(
    model: PhysicsModel, table: Mapping[str, np.ndarray], hidden: np.ndarray
) -> list[str]:
    """Return the quantities whose own functions explain most of a hidden input.

    Products of all pairs of many quantities are more than records of any length can tell apart.
    """
    if len(table) <= MOST_QUANTITIES:
        return list(table)
    some = slice(None, None, max(1, hidden.size // SAMPLES))
    sought = hidden[some] - hidden[some].mean()

    def left(name: str) -> float:
        known = {name: table[name][some]}
        terms = [sympy.Integer(1), *_functions(model, name)]
        columns = np.column_stack([evaluate_samples(e, known, sought.size) for e in terms])
        columns = columns / np.maximum(np.abs(columns).max(axis=0), np.finfo(float).tiny)
        rest = sought - columns @ np.linalg.lstsq(columns, sought)[0]
        return float(rest @ rest)

    return sorted(table, key=left)[:MOST_QUANTITIES]


def _functions(model: PhysicsModel, name: str) -> list[sympy.Expr]:
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
