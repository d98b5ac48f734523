"""Laws of the search: one answer to one question, whatever was asked before and in what units."""

import pytest
from rubbing_sledge import CRITERION, KINDS, LEVEL, fitted, fresh_fitter, rubbing
from sledge import SLEDGE, drive

from sklearn_pgnn import ModelDiagnosis, effects
from sklearn_pgnn.diagnosis.ladder import Ladder
from sklearn_pgnn.diagnosis.search import Search
from sklearn_pgnn.diagnosis.search_result import SearchResult
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem, with_substeps
from sklearn_pgnn.estimation.progress import TimeIsUp
from sklearn_pgnn.physics.effects import frequent_first
from sklearn_pgnn.trajectories import read_records

SLEDGE_CAUSES = tuple(kind(kind.targets(SLEDGE)[0]) for kind in KINDS)


def diagnose(X, y, model=SLEDGE, catalogue=KINDS):
    return ModelDiagnosis(model, catalogue=catalogue).fit(X, y)


@pytest.fixture(scope="module")
def plain():
    return diagnose(*rubbing())


# -- the same records, told otherwise --------------------------------------------------------------


@pytest.mark.slow
def test_the_hidden_friction_is_named_with_its_size(plain):
    assert plain.verdict_ == "cause_named"
    (cause,) = plain.causes_
    assert (cause.effect, cause.target, cause.confused_with) == ("coulomb_friction", "v", ())
    assert cause.parameters["level"].low <= LEVEL <= cause.parameters["level"].high
    assert cause.probability > 0.99
    assert plain.remaining_.kind == "noise"


def assert_same(found, expected, unit=1.0):
    """Check that a diagnosis says the same, its forces in another unit."""
    assert (found.verdict_, found.complete_) == (expected.verdict_, True)
    one, other = found.causes_[0], expected.causes_[0]
    assert [(c.effect, c.target) for c in found.causes_] == [(other.effect, other.target)]
    assert one.confused_with == other.confused_with
    level, same = one.parameters["level"], other.parameters["level"]
    assert level.value == pytest.approx(unit * same.value, rel=2e-3)
    assert level.high - level.low == pytest.approx(unit * (same.high - same.low), rel=0.1)
    assert one.probability == pytest.approx(other.probability, abs=1e-3)
    assert found.remaining_.kind == expected.remaining_.kind


@pytest.mark.slow
def test_the_order_of_the_candidates_does_not_matter(plain):
    assert_same(diagnose(*rubbing(), catalogue=KINDS[::-1]), plain)


@pytest.mark.slow
def test_what_imitates_others_has_to_refute_them(plain):
    found = diagnose(*rubbing(), catalogue=(effects.InputCurve, *KINDS))
    assert_same(found, plain)
    assert "input_curve" in {tried.effect for tried in found.candidates_}


@pytest.mark.slow
def test_the_order_of_the_records_does_not_matter(plain):
    X, y = rubbing()
    last = X.index[::-1].to_numpy().reshape(3, -1)[:, ::-1].ravel()
    assert_same(diagnose(X.loc[last], y.loc[last]), plain)


@pytest.mark.slow
def test_the_unit_of_an_output_does_not_matter():
    X, y = rubbing()
    found = [
        diagnose(X, (unit * y).rename(columns={"v": "speed"}), SLEDGE.replace(outputs=outputs))
        for unit, outputs in ((10, {"speed": "10*v"}), (1000, {"speed": "1000*v"}))
    ]
    assert_same(*found)


@pytest.mark.slow
def test_the_units_of_the_whole_model_do_not_matter(plain):
    """Newtons as millinewtons: mass and damping in grams, the same speeds."""
    X, y = rubbing()
    values = {name: 1e3 * p.value for name, p in SLEDGE.parameters.items()}
    small = SLEDGE.replace(parameters=values)
    assert_same(diagnose(X.assign(F=1e3 * X["F"]), y, small), plain, unit=1e3)


@pytest.mark.slow
def test_the_origin_of_the_time_does_not_matter(plain):
    X, y = rubbing()
    assert_same(diagnose(X.assign(t=X["t"] + 1.7e9), y), plain)


@pytest.mark.slow
def test_a_gap_in_a_record_does_not_matter(plain):
    X, y = rubbing()
    lost = (X["trajectory"] == 1) & X["t"].between(4.0, 6.0)
    found = diagnose(X[~lost], y[~lost])
    assert found.verdict_ == plain.verdict_
    assert [c.effect for c in found.causes_] == ["coulomb_friction"]
    level = found.causes_[0].parameters["level"]
    assert level.low <= LEVEL <= level.high


@pytest.mark.slow
def test_more_records_make_it_more_certain(plain):
    X, y = drive(SLEDGE + effects.CoulombFriction("v", level=LEVEL), n_records=6, seed=1)
    (more,), (less,) = diagnose(X, y).causes_, plain.causes_
    assert (more.effect, more.probability) == ("coulomb_friction", pytest.approx(1.0, abs=1e-3))
    one, other = more.parameters["level"], less.parameters["level"]
    assert one.high - one.low < other.high - other.low


# -- what a finer look may change ------------------------------------------------------------------


def search_of(problem, *candidates):
    """Return a search among some candidates, where nothing asks for dear moves or formulas."""
    fitter = HypothesisFitter(problem)
    return Search(fitter, candidates, CRITERION, 3, lambda _: False, lambda _: False)


def found_with(search, *causes):
    """Return what a search that has ended with some causes found, no rival beside them."""
    trial = search.fitter.base()
    for cause in causes:
        first = search.fitter.first_fit(search.fitter.subsample(trial), cause)
        trial = search.fitter.fit_all(search.fitter.converge(first), trial)
    assert trial.fit.usable
    return SearchResult(search.fitter.base(), [trial], {cause: [] for cause in causes})


@pytest.mark.slow
def test_in_finer_steps_a_play_of_no_width_becomes_the_lag_that_it_is():
    lag, play = effects.ActuatorLag("F"), effects.InputBacklash("F")
    X, y = drive(SLEDGE + effects.ActuatorLag("F", 0.05), n_records=3)
    search = search_of(build_problem(SLEDGE, read_records(SLEDGE, X, y)), lag, play)
    found, same = found_with(search, play), effects.InputDelay("F")
    search.same[lag] = (same,)  # what is the same in the equations may stand in its place there
    finer = HypothesisFitter(with_substeps(search.fitter.problem, 4))
    refined = search.in_steps_of(finer, found)
    assert refined.final.hypothesis.causes == (lag,)
    assert refined.rivals == {lag: [(same, 0.0)]}


@pytest.mark.slow
def test_in_finer_steps_a_cause_that_is_not_needed_there_is_dropped():
    lag, drag = effects.ActuatorLag("F"), effects.QuadraticDrag("v")
    X, y = drive(SLEDGE + effects.ActuatorLag("F", 0.05), n_records=3)
    search = search_of(build_problem(SLEDGE, read_records(SLEDGE, X, y)), lag, drag)
    found = found_with(search, lag, drag)
    finer = HypothesisFitter(with_substeps(search.fitter.problem, 4))
    assert search.in_steps_of(finer, found).final.hypothesis.causes == (lag,)


@pytest.mark.slow
def test_a_cause_that_is_named_is_likelier_than_none():
    """Alone either of two causes may say little; each is named beside the other one."""
    rig = SLEDGE + effects.CoulombFriction("v", level=LEVEL) + effects.QuadraticDrag("v", 0.2)
    search = search_of(
        build_problem(SLEDGE, read_records(SLEDGE, *drive(rig, n_records=3))),
        *(kind("v") for kind in KINDS[:3]),
    )
    result = search.run()
    assert {cause.id for cause in result.evidence} == {"coulomb_friction", "quadratic_drag"}
    for cause, evidence in result.evidence.items():
        assert evidence > CRITERION.to_name
        mine, none = CRITERION.probabilities([evidence])
        assert mine > none
        without = result.final.hypothesis.without(cause)
        fitted = next(
            trial
            for trial in search.fitter._trials.values()
            if set(trial.hypothesis.causes) == set(without.causes)
        )
        assert evidence == pytest.approx(search.compare.evidence(fitted, result.final))


# -- the most probable of a group ------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.parametrize("wrong", ["quadratic_drag", "constant_load", "wrong_parameter"])
def test_a_likelier_cause_takes_the_place_of_the_one_that_was_accepted(search, wrong):
    kind = next(kind for kind in KINDS if kind.id == wrong)
    search.current = fitted(search.fitter, kind)
    result = search._result(complete=True)
    assert [cause.id for cause in result.final.hypothesis.causes] == ["coulomb_friction"]
    for cause, others in result.rivals.items():
        values = [value for _, value in others]
        mine, *theirs, _ = CRITERION.probabilities([*values, result.evidence[cause]])
        assert all(CRITERION.alpha <= chance <= mine for chance in theirs)


def test_a_cause_that_is_improbable_beside_what_cannot_be_named_is_not_named(search, monkeypatch):
    search.current = fitted(search.fitter, effects.QuadraticDrag)
    monkeypatch.setattr(search, "_named_in_place", lambda final, trial, tried: None)
    result = search._result(complete=True)
    assert result.final.hypothesis.causes == ()


def test_what_tells_no_more_than_carrying_on_names_nothing(search, monkeypatch):
    search.current = fitted(search.fitter, effects.CoulombFriction)
    monkeypatch.setattr(search.fitter, "predicts_nothing", lambda trial, smallest_share: True)
    assert search._result(complete=True).steps == []


# -- where a search ends ---------------------------------------------------------------------------


@pytest.fixture
def search():
    fitter = fresh_fitter()
    candidates = tuple(kind(kind.targets(SLEDGE)[0]) for kind in KINDS)
    return Search(fitter, candidates, CRITERION, 3, lambda trial: False, lambda search: False)


def test_a_search_that_time_ends_names_nothing_that_is_nothing(search):
    search.current = fitted(search.fitter, effects.CoulombFriction, effects.ConstantLoad)
    assert [c.id for c in search.so_far().final.hypothesis.causes] == ["coulomb_friction"]


def test_a_search_that_time_ends_returns_the_best_that_stands(search):
    rubbed = fitted(search.fitter, effects.CoulombFriction)
    search._standing = rubbed
    search.current = fitted(search.fitter, effects.ConstantLoad)  # no load hides in the records
    assert search.so_far().final.hypothesis == rubbed.hypothesis


# -- where the time is up --------------------------------------------------------------------------


def searched_until(cause, monkeypatch):
    """Search until a candidate was looked at, and no further."""
    step = Ladder.step

    def step_and_end(self, fit):
        if self.progress.counts and cause in fit.hypothesis.causes:
            raise TimeIsUp
        return step(self, fit)

    monkeypatch.setattr(Ladder, "step", step_and_end)
    search = Search(
        fresh_fitter(), SLEDGE_CAUSES, CRITERION, 4, lambda trial: True, lambda search: False
    )
    return search.run()


def test_what_was_looked_at_until_the_time_is_up_is_found_if_it_is_named(monkeypatch):
    friction = effects.CoulombFriction("v")
    found = searched_until(friction, monkeypatch)
    assert found.final.hypothesis.causes == (friction,)
    assert not found.complete


def test_nothing_is_found_where_the_time_is_up_before(monkeypatch):
    found = searched_until(frequent_first(SLEDGE_CAUSES)[0], monkeypatch)
    assert (found.final.hypothesis.causes, found.complete) == ((), False)


def test_frequent_causes_are_looked_at_first(monkeypatch):
    """The rare ones were not, where the time is up."""
    found = searched_until(effects.CoulombFriction("v"), monkeypatch)
    assert effects.QuadraticDrag("v") not in found.alone
