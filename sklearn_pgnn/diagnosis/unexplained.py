"""Where no cause of the catalogue will do: where something is missing, and what it depends on."""

from dataclasses import dataclass
from itertools import combinations

import numpy as np
import sympy

from sklearn_pgnn.diagnosis.fitting import Trial
from sklearn_pgnn.diagnosis.setting import Setting
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.physics.effects.rates import is_velocity, positions
from sklearn_pgnn.physics.expressions import TIME, symbol, to_text
from sklearn_pgnn.physics.model import PhysicsModel
from sklearn_pgnn.simulation.hidden_input import HiddenInput, find_hidden_input
from sklearn_pgnn.simulation.linear_response import linear_responses
from sklearn_pgnn.simulation.pointwise import evaluate_samples
from sklearn_pgnn.simulation.window_fit import Freedom, WindowFit, fit_windows
from sklearn_pgnn.simulation.windows import evaluate

#: samples on which a hidden input is described, and folds of the description
SAMPLES, FOLDS = 4000, 5
#: a further quantity, or a further term, must explain so much more of the hidden input
WORTH = 0.03
#: part of a term, relative to it, that those before it must leave
DEPENDENT = 1e-5
#: most quantities and terms of a description
MOST_QUANTITIES, MOST_TERMS = 3, 3


@dataclass(frozen=True)
class MissingPart:
    """Something that is missing in a model and that the catalogue has no name for.

    Parameters
    ----------
    target : str
        The state in whose rate it is missing, or the input or output.
    quantities : tuple of str
        What it depends on, the most telling first.
    share : float
        Share of its variance that they explain, on samples not used for it; between 0 and 1.
    effect : Formula
        Terms that describe it; ``model + part.effect`` has them.
    error_share : float
        Share of the error power above the noise that the model with these terms leaves, of what
        the re-tuned prior leaves.
    """

    target: str
    quantities: tuple[str, ...]
    share: float
    effect: Formula
    error_share: float

    @property
    def formula(self) -> str:
        """The terms with their coefficients, as text."""
        pairs = zip(self.effect.coefficients, self.effect.terms, strict=True)
        return " + ".join(f"{value:.4g}*{term}" for value, term in pairs)


@dataclass(frozen=True)
class Description:
    """A hidden input and terms that may describe it.

    Parameters
    ----------
    hidden : HiddenInput
        The hidden input.
    effect : Formula
        The terms.
    """

    hidden: HiddenInput
    effect: Formula


def channels(model: PhysicsModel) -> tuple[str, ...]:
    """Name the places where something may be missing: rates, inputs and outputs.

    The rate of a position is its velocity by definition; an input that enters only one rate is
    that rate's.
    """
    known = set(positions(model).values())
    states = tuple(state for state in model.states if state not in known)
    several = tuple(
        name
        for name in model.inputs
        if sum(symbol(name) in rate.free_symbols for rate in model.equations.values()) > 1
    )
    return (*states, *several, *(name for name in model.outputs if name not in model.states))


def propose(setting: Setting, base: Trial, channel: str) -> tuple[Description, ...]:
    """Find the hidden input of a channel, and formulas for it with one term, with two, and more.

    The terms are those whose effect on the outputs, along the trajectories of the model and with
    its parameters and initial states re-tuned, explains most of the residuals.

    Parameters
    ----------
    setting : Setting
        The ground of the diagnosis.
    base : Trial
        The model without it.
    channel : str
        The place.

    Returns
    -------
    tuple of Description
        Empty where no smoother ran to the end.
    """
    model, scales = base.fit.model, setting.scales
    estimate = setting.states.estimate(model)
    size = scales.rate[channel] if channel in scales.rate else scales.typical[channel]
    hidden = find_hidden_input(
        model, setting.windows, channel, estimate.x, estimate.spread, size, setting.period
    )
    if not np.all(np.isfinite(hidden.values)):
        return ()
    table = _samples(setting, model, hidden)
    terms = _terms(setting.prior, table)
    columns = np.column_stack([evaluate_samples(term, table, hidden.values.size) for term in terms])
    own = _independent(columns[:: max(1, len(columns) // SAMPLES)])
    columns, terms = columns[:, own], [terms[i] for i in own]
    path = _telling_terms(setting, base, channel, columns)
    return tuple(Description(hidden, _formula(channel, terms, values)) for values in path)


def fit_formula(setting: Setting, base: Trial, effect: Formula) -> WindowFit:
    """Fit a model with a formula on all windows, its other parameters with it.

    Parameters
    ----------
    setting : Setting
        The ground of the diagnosis.
    base : Trial
        The model without the formula.
    effect : Formula
        The formula and where its coefficients start.

    Returns
    -------
    WindowFit
        The fit.
    """
    model = effect.apply(base.fit.model)
    free = [
        Freedom(name, -np.inf, np.inf, value, np.inf, max(abs(value), 1e-12))
        for name, value in zip(effect.names().values(), effect.coefficients, strict=True)
    ]
    estimate = setting.states.estimate(model)
    return fit_windows(
        model,
        setting.windows,
        (*base.fit.freedoms, *free),
        estimate.x[setting.windows.starts],
        estimate.spread,
        x0_start=base.fit.x0,
    )


def _samples(setting, model, hidden) -> dict[str, np.ndarray]:
    """Give the states, smoothed with the hidden input, the inputs as they act, and the time."""
    table = {name: hidden.states[:, i] for i, name in enumerate(model.states)}
    acting = setting.windows.acting_inputs(model)
    table |= {name: acting[:, i] for i, name in enumerate(model.inputs)}
    return {**table, "t": setting.windows.t}


def _terms(model: PhysicsModel, quantities) -> list[sympy.Expr]:
    """Give the library: functions of one quantity, and products of functions of two."""
    single = [_functions(model, name) for name in quantities]
    found = [sympy.Integer(1), *(term for functions in single for term in functions)]
    for one, other in combinations(single, 2):
        found += [a * b for a in one for b in other]
    return list(dict.fromkeys(found))


def _functions(model, name) -> list[sympy.Expr]:
    """Give functions of one quantity."""
    if name == "t":
        return [TIME]
    q = symbol(name)
    found = [q, sympy.Abs(q), q**2, q * sympy.Abs(q), q**3]
    if name in model.states and is_velocity(model, name):
        found.append(sympy.sign(q))
    if model.unit(name) == "rad":
        found += [sympy.sin(q), sympy.cos(q), sympy.sin(2 * q), sympy.cos(2 * q)]
    return found


def _telling_terms(setting, base, channel, columns) -> list[np.ndarray]:
    """Choose the terms by their effect on the outputs, what re-tuning explains projected out."""
    from sklearn_pgnn.estimators.sindyc_formula import leading_terms  # noqa: PLC0415  (pysindy)

    windows, fit = setting.windows, base.fit
    responses, by_state = linear_responses(fit.model, windows, fit.x0, channel, columns)
    tuned = [_slope_by(setting, base, freedom) for freedom in fit.freedoms]
    block = np.concatenate([responses, np.stack(tuned, axis=-1)] if tuned else [responses], axis=-1)
    table = np.concatenate([fit.evaluation.residual[..., None], block], axis=-1)
    table = _without_states(windows, table, by_state)
    target, moved, known = np.split(table, [1, 1 + columns.shape[1]], axis=1)
    basis = np.linalg.qr(known / np.maximum(np.linalg.norm(known, axis=0), 1e-300))[0]
    moved, target = (part - basis @ (basis.T @ part) for part in (moved, target))
    seen = np.flatnonzero(np.linalg.norm(moved, axis=0) > 0)
    path = leading_terms(moved[:, seen], target[:, 0], MOST_TERMS)
    full = np.zeros((len(path), columns.shape[1]))
    full[:, seen] = path
    return list(full)


def _slope_by(setting, base, freedom) -> np.ndarray:
    """Give the change of the outputs by a parameter, for a small step."""
    fit, value = base.fit, base.fit.model.parameters[freedom.name].value
    step = 1e-3 * freedom.scale
    step = step if value + step <= freedom.high else -step
    moved = fit.model.with_parameters(**{freedom.name: value + step})
    return (fit.evaluation.residual - evaluate(moved, setting.windows, fit.x0, ()).residual) / step


def _without_states(windows, table, by_state) -> np.ndarray:
    """Lay windows and outputs end to end, less what the initial states explain."""
    rows = []
    for a, n in zip(windows.starts, windows.lengths, strict=True):
        part, known = table[a : a + n] / windows.scale[:, None], by_state[a : a + n]
        part = np.nan_to_num(part).reshape(-1, table.shape[-1])
        basis = np.linalg.qr((known / windows.scale[:, None]).reshape(-1, known.shape[-1]))[0]
        rows.append(part - basis @ (basis.T @ part))
    return np.concatenate(rows)


def _formula(channel, terms, values) -> Formula:
    chosen = np.flatnonzero(values)
    return Formula(
        channel,
        tuple(to_text(terms[i]) for i in chosen),
        tuple(float(values[i]) for i in chosen),
    )


def _independent(columns) -> list[int]:
    """Give the columns that are not sums of those before them."""
    own: list[int] = []
    basis = np.empty((len(columns), 0))
    for i, column in enumerate(columns.T):
        size = np.linalg.norm(column)
        rest = column - basis @ (basis.T @ column)
        rest = rest - basis @ (basis.T @ rest)
        if np.isfinite(size) and np.linalg.norm(rest) > DEPENDENT * size:
            own.append(i)
            basis = np.column_stack([basis, rest / np.linalg.norm(rest)])
    return own
