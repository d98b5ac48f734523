"""Describe a formula: the quantities that the missing part depends on, and how strongly."""

import re

import numpy as np
from sklearn.ensemble import HistGradientBoostingRegressor
from sklearn.model_selection import GroupKFold, cross_val_predict

from sklearn_pgnn.diagnosis.unexplained import MissingPart, Proposal, smoothed_samples
from sklearn_pgnn.estimation.budgets import FOLDS, LEAVES, SAMPLES, TREES
from sklearn_pgnn.estimation.fitted_records import as_judged
from sklearn_pgnn.estimation.problem import EstimationProblem


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
    table = smoothed_samples(problem, fit.model, hidden)
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


def _groups(problem) -> np.ndarray:
    """Assign the samples to groups: records, or stretches of a few records."""
    windows = problem.windows
    record = windows.record_at(np.arange(windows.t.size))
    if record.max() + 1 >= FOLDS:
        return record
    return np.arange(windows.t.size) * 2 * FOLDS // windows.t.size


def _explained(columns, values, groups) -> float:
    """Return the share of a variance that some quantities explain on held-out groups."""
    forest = HistGradientBoostingRegressor(max_iter=TREES, max_leaf_nodes=LEAVES, random_state=0)
    found = cross_val_predict(forest, columns, values, groups=groups, cv=GroupKFold(FOLDS))
    return float(max(0.0, 1.0 - np.mean((values - found) ** 2) / np.var(values)))
