"""Describe a formula: the quantities that the missing part depends on, and how strongly."""

import re

import numpy as np
from sklearn.model_selection import GroupKFold, cross_val_predict

from sklearn_pgnn.diagnosis.known_terms import known_terms
from sklearn_pgnn.diagnosis.trees import boosted_trees, groups_of
from sklearn_pgnn.diagnosis.unexplained import (
    MissingPart,
    Proposal,
    hidden_input,
    smoothed_samples,
)
from sklearn_pgnn.estimation.budgets import FOLDS, SAMPLES
from sklearn_pgnn.estimation.fitted_records import as_judged
from sklearn_pgnn.estimation.problem import EstimationProblem


def describe(problem: EstimationProblem, proposal: Proposal) -> MissingPart:
    """Describe what is missing."""
    effect, hidden, fit = proposal.effect, proposal.hidden, proposal.trial.fit
    table = smoothed_samples(problem, fit.model, hidden)
    text = " ".join(effect.terms)
    quantities = tuple(name for name in table if re.search(rf"\b{re.escape(name)}\b", text))
    rows = np.arange(0, hidden.values.size, max(1, hidden.values.size // SAMPLES))
    share = 0.0
    if quantities:
        columns = np.column_stack([table[name][rows] for name in quantities])
        groups = groups_of(problem.windows.record_at(rows))
        share = _explained(columns, hidden.values[rows], groups)
    model = as_judged(problem, fit)
    error = proposal.trial.times_noise
    known = known_terms(problem.prior, effect)
    left = hidden_input(problem, proposal.trial, effect.target).values
    return MissingPart(effect.target, quantities, share, effect, error, model, left, known)


def _explained(columns, values, groups) -> float:
    """Return the share of a variance that some quantities explain on held-out groups."""
    cv = GroupKFold(FOLDS)
    found = cross_val_predict(boosted_trees(), columns, values, groups=groups, cv=cv)
    return float(max(0.0, 1.0 - np.mean((values - found) ** 2) / np.var(values)))
