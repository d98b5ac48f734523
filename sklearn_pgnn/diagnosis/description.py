"""Describe a formula: the quantities that the missing part depends on, and how strongly."""

import re
from dataclasses import replace

import numpy as np
from sklearn.model_selection import GroupKFold, cross_val_predict

from sklearn_pgnn.diagnosis.trees import boosted_trees, groups_of
from sklearn_pgnn.diagnosis.unexplained import (
    KnownTerms,
    MissingPart,
    Proposal,
    hidden_input,
    smoothed_samples,
)
from sklearn_pgnn.estimation.budgets import FOLDS, SAMPLES
from sklearn_pgnn.estimation.fitted_records import as_judged
from sklearn_pgnn.estimation.problem import EstimationProblem
from sklearn_pgnn.estimation.same_in_equations import (
    already_holds,
    expressed_parameters,
    same_causes,
)
from sklearn_pgnn.physics.effect import Effect
from sklearn_pgnn.physics.effects import CATALOGUE, WrongParameter
from sklearn_pgnn.physics.effects.formula import Formula, known_part
from sklearn_pgnn.physics.model import PhysicsModel

#: largest relative difference between coefficients that count as in proportion: what lies beyond is
#: less than a twentieth of their power
SPREAD = 0.05**0.5


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


def _explained(columns: np.ndarray, values: np.ndarray, groups: np.ndarray) -> float:
    """Return the share of a variance that some quantities explain on held-out groups."""
    cv = GroupKFold(FOLDS)
    found = cross_val_predict(boosted_trees(), columns, values, groups=groups, cv=cv)
    return float(max(0.0, 1.0 - np.mean((values - found) ** 2) / np.var(values)))


def known_terms(model: PhysicsModel, formula: Formula) -> tuple[KnownTerms, ...]:
    """Return the terms of a formula that have a name, each under one.

    A name for several terms, whose coefficients must be in its proportion, comes before names for
    single ones, a parameter of the model before an effect, and a free one before a fixed one. A
    term with a state that a cause added has no name.
    """
    formula = known_part(formula, model)
    terms = tuple(replace(formula, terms=(t,), coefficients=(1.0,)) for t in formula.terms)
    found: list[KnownTerms] = []
    expressed = expressed_parameters(model, terms) if terms else {}
    for name in sorted(expressed, key=lambda name: -np.count_nonzero(expressed[name])):
        own = np.flatnonzero(expressed[name])
        told = tuple(formula.terms[i] for i in own)
        ratios = np.array(formula.coefficients)[own] / expressed[name][own]
        if np.ptp(ratios) <= SPREAD * abs(ratios.mean()) and _names(found).isdisjoint(told):
            found.append(KnownTerms(told, WrongParameter.id, name, is_parameter=True))
    for term, effect in _same_effects(model, terms).items():
        if term not in _names(found):
            found.append(KnownTerms((term,), effect.id, effect.target))
    return tuple(found)


def _names(found: list[KnownTerms]) -> set[str]:
    """Return the terms that have a name."""
    return {term for known in found for term in known.terms}


def _same_effects(model: PhysicsModel, terms: tuple[Formula, ...]) -> dict[str, Effect]:
    """Return the first effect of the catalogue that is the same in the equations as each term."""
    effects = [kind(target) for kind in CATALOGUE for target in kind.targets(model)]
    able = tuple(effect for effect in effects if not already_holds(model, effect))
    classes = same_causes(model, (*able, *terms))
    named = {first: others for first, others in classes.items() if first in able}
    return {t.terms[0]: first for t in terms for first, others in named.items() if t in others}
