"""When a formula takes the place of causes that have a name."""

from types import SimpleNamespace

import numpy as np
import pytest

from sklearn_pgnn import effects, systems
from sklearn_pgnn.diagnosis.formula_selection import FormulaSelection, _takes_the_place
from sklearn_pgnn.estimation.criterion import SelectionCriterion
from sklearn_pgnn.estimation.residuals import Residuals


def trial_of(n_parameters, squares, n_causes=1):
    hypothesis = SimpleNamespace(n_parameters=n_parameters, causes=(None,) * n_causes)
    return SimpleNamespace(hypothesis=hypothesis, squares=squares)


def takes_the_place(trial, causes, leaves="noise", n_terms=1, part=()):
    """Return whether a formula takes the place of causes, by the squares that each leaves."""
    formula = SimpleNamespace(trial=trial, effect=SimpleNamespace(terms=("x",) * n_terms))

    def held_out(trial):
        return SimpleNamespace(windows=Residuals(np.array([trial.squares]), np.ones(1), np.ones(1)))

    compare = SimpleNamespace(
        refutes=lambda better, worse: better.squares < 0.5 * worse.squares,
        is_nameable=lambda trial: leaves != "noise",
        leaves_much=lambda trial: leaves == "much",
    )
    search = SimpleNamespace(
        compare=compare,
        has_structure=lambda trial: leaves == "structure",
        fitter=SimpleNamespace(held_out=held_out),
        criterion=SelectionCriterion(alpha=0.01, smallest_share=0.05, n_candidates=20),
    )
    return _takes_the_place(search, formula, [*part, causes])


@pytest.mark.parametrize("leaves", ["noise", "coloured noise"])
def test_a_formula_that_says_it_all_takes_the_place_if_it_is_simpler_or_clearly_nearer(leaves):
    causes = trial_of(3, squares=10.0)
    assert takes_the_place(trial_of(2, squares=11.0), causes, leaves)
    assert takes_the_place(trial_of(4, squares=2.0), causes, leaves)
    assert not takes_the_place(trial_of(4, squares=9.0), causes, leaves)
    assert not takes_the_place(trial_of(2, squares=30.0), causes, leaves)


def test_a_formula_of_more_terms_than_causes_is_no_simpler():
    one, two = (trial_of(5, squares=10.0, n_causes=count) for count in (1, 2))
    assert takes_the_place(trial_of(2, squares=11.0), two, n_terms=2)
    assert not takes_the_place(trial_of(2, squares=11.0), one, n_terms=2)
    assert takes_the_place(trial_of(2, squares=2.0), one, n_terms=2)


def test_a_formula_is_no_simpler_than_the_part_of_the_causes_that_says_as_much():
    """Beside a load a drift was named by chance: the load is no law without a name for that."""
    both, formula = trial_of(2, squares=10.0, n_causes=2), trial_of(1, squares=11.0)
    for squares, takes in ((11.0, False), (30.0, True)):
        assert takes_the_place(formula, both, part=[trial_of(1, squares)]) is takes
    assert takes_the_place(formula, both, part=[trial_of(2, squares=11.0)])


@pytest.mark.parametrize("leaves", ["structure", "much"])
def test_a_formula_that_leaves_more_takes_a_place_only_where_the_causes_leave_far_more(leaves):
    causes = trial_of(3, squares=10.0)
    assert not takes_the_place(trial_of(2, squares=4.0), causes, leaves)
    assert takes_the_place(trial_of(2, squares=2.0), causes, leaves)


def is_law(*terms):
    """Return whether a search is over with a formula for the rate of a cart's velocity."""
    stiffness = effects.QuadraticStiffness("v"), effects.CubicStiffness("v")
    formula = SimpleNamespace(
        effect=effects.Formula("v", terms, (1.0,) * len(terms)), trial=trial_of(2, squares=1.0)
    )
    search = SimpleNamespace(
        compare=SimpleNamespace(is_nameable=lambda trial: trial.squares > 1.0),
        current=trial_of(3, squares=10.0),
        fitter=SimpleNamespace(problem=SimpleNamespace(prior=systems.cart_on_spring())),
        ladder=SimpleNamespace(candidates=stiffness),
    )
    selection = FormulaSelection()
    selection._alone = lambda search: formula
    return selection.is_law(search)


def test_a_sum_of_what_has_names_does_not_end_the_search():
    assert is_law("x**2", "v*x")
    assert not is_law("x**2", "x**3")
