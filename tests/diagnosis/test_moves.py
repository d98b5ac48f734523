"""Laws of the moves from one hypothesis to another."""

from rubbing_sledge import CRITERION, KINDS, fitted, fresh_fitter
from sledge import SLEDGE, drive

from sklearn_pgnn import effects
from sklearn_pgnn.diagnosis.comparison import Comparison
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.diagnosis.moves import Moves
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records


def moves_of(fitter, kinds=KINDS):
    """Return the moves among a few candidates."""
    candidates = tuple(kind(kind.targets(SLEDGE)[0]) for kind in kinds)
    same = dict.fromkeys(candidates, ())
    return Moves(Comparison(fitter, CRITERION), Ladder(fitter, CRITERION, candidates, same))


def test_a_cause_is_added_that_the_criterion_names():
    fitter = fresh_fitter()
    found = next(moves_of(fitter).add(fitter.base()))
    assert [c.id for c in found.hypothesis.causes] == ["coulomb_friction"]


def test_a_cause_that_is_nothing_beside_another_is_dropped():
    fitter = fresh_fitter()
    both = fitted(fitter, effects.CoulombFriction, effects.ConstantLoad)
    assert [c.id for c in moves_of(fitter).drop(both).hypothesis.causes] == ["coulomb_friction"]


def test_a_cause_that_a_better_one_refutes_is_replaced():
    fitter = fresh_fitter()
    dragged = fitted(fitter, effects.QuadraticDrag)
    found = next(moves_of(fitter).replace(dragged))
    assert [c.id for c in found.hypothesis.causes] == ["coulomb_friction"]


def test_of_few_candidates_the_set_is_taken_that_hides_in_the_records():
    """Friction and a load, each named beside the other, wherever the search stands."""
    rig = SLEDGE + effects.CoulombFriction("v", level=0.4) + effects.ConstantLoad("v", 0.3)
    fitter = HypothesisFitter(build_problem(SLEDGE, read_records(SLEDGE, *drive(rig, n_records=3))))
    moves = moves_of(fitter, KINDS[:3])
    true = {effects.CoulombFriction("v"), effects.ConstantLoad("v")}
    for start in (fitter.base(), fitted(fitter, effects.QuadraticDrag)):
        (found,) = moves.any_of_few_sets(start, most=3)
        assert set(found.hypothesis.causes) == true
    assert list(moves.any_of_few_sets(found, most=3)) == []
