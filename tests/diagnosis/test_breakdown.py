"""A candidate whose fit breaks down is left out and named; what was found so far is never lost."""

import json
import re
from dataclasses import dataclass

import numpy as np
import pytest
from schemas import faults
from sklearn.exceptions import NotFittedError
from sledge import SLEDGE as CART

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis import formula_selection, model_diagnosis
from sklearn_pgnn.diagnosis.investigation import Investigation
from sklearn_pgnn.diagnosis.search import Search
from sklearn_pgnn.estimation import fitting, progress, window_fitter
from sklearn_pgnn.estimation.progress import AFTER_TESTS, BEST, Progress, TimeIsUp
from sklearn_pgnn.exceptions import DiagnosisWarning
from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.inspection.words import unusable_sentence, verdict_sentence
from sklearn_pgnn.physics.effect import Effect, quantity
from sklearn_pgnn.physics.expressions import symbol
from sklearn_pgnn.record_quality import checks
from sklearn_pgnn.record_quality.finding import Finding
from sklearn_pgnn.trajectories import read_files

CANDIDATES = (effects.CoulombFriction, effects.ConstantLoad)


class OnVelocity(Effect):
    """What the contrived candidates share: they act on v, and start at once."""

    @classmethod
    def targets(cls, model):
        return ("v",)

    @classmethod
    def starts(cls, target, model, scales):
        return (cls(target, strength=0.1),)


@dataclass(frozen=True)
class Chaotic(OnVelocity):
    """A hidden state that stays small while its slopes grow by some decades in every step."""

    id = "chaotic"
    strength: float = quantity("ch", "m/s^2")

    def rewrite(self, model, p):
        hidden = symbol("hidden")
        rate = model.equations["v"] + p["strength"] * hidden
        equations = {**model.equations, "v": rate, "hidden": "sin(1e5*hidden) + v"}
        return {"states": {**model.states, "hidden": ""}, "equations": equations}


@dataclass(frozen=True)
class Broken(OnVelocity):
    """Drag by the third power, of which `break_fits` makes a candidate that cannot be fitted."""

    id = "broken"
    strength: float = quantity("br", "1/m")

    def rewrite(self, model, p):
        rate = model.equations["v"] - p["strength"] * symbol("v") ** 3
        return {"equations": {**model.equations, "v": rate}}


@dataclass(frozen=True)
class Unstarted(Broken):
    """A candidate that breaks down before there is anything to fit."""

    id = "unstarted"
    error = np.linalg.LinAlgError("Eigenvalues did not converge")

    @classmethod
    def starts(cls, target, model, scales):
        raise cls.error


def records(level=0.4):
    t = np.arange(0, 60, 0.05)
    F = 2 * np.sin(0.7 * t) + np.sin(1.9 * t)
    rig = CART + effects.CoulombFriction("v", level=level)
    v = rig.simulate(t, F, substeps=5).y + 1e-3 * np.random.default_rng(0).normal(size=(t.size, 1))
    return np.column_stack([t, F]), v


def diagnose(**options):
    return ModelDiagnosis(CART, **{"catalogue": CANDIDATES, **options}).fit(*records())


def break_fits(monkeypatch, error, after=0):
    """Let every fit of a model with the broken candidate raise an error."""
    calls, fit = [], window_fitter.fit_windows

    def breaking(model, *args, **options):
        if "br_v" in model.parameters:
            calls.append(model)
            if len(calls) > after:
                raise error
        return fit(model, *args, **options)

    monkeypatch.setattr(window_fitter, "fit_windows", breaking)
    return calls


def named(diagnosis):
    return [(cause.effect, cause.target) for cause in diagnosis.causes_]


# -- no candidate ends a diagnosis -----------------------------------------------------------------


@pytest.mark.filterwarnings("error::RuntimeWarning")
def test_a_candidate_whose_slopes_explode_is_unusable_and_the_search_goes_on(capfd):
    diagnosis = diagnose(catalogue=(*CANDIDATES, Chaotic))
    assert named(diagnosis) == [("coulomb_friction", "v")]
    (lost,) = {(candidate.effect, candidate.target) for candidate in diagnosis.unusable_}
    assert lost == ("chaotic", "v")
    assert "dominated by rounding errors in" in diagnosis.unusable_[0].reason
    assert capfd.readouterr().err == ""  # LAPACK complains there
    assert not any(tried.effect == "chaotic" for tried in diagnosis.candidates_)


@pytest.mark.slow
def test_a_record_on_which_a_candidate_broke_down_gets_its_verdict(real_data, capfd):
    """A lag of a fifth of a millisecond at 5 ms: bounded states, slopes of 1e20 times the noise.

    The force of such a damper levels off; its hysteresis is not among the candidates, and stays.
    """
    folder = real_data / "mr_damper"
    model = PhysicsModel.from_yaml(folder / "damper.yaml")
    X, y = read_files([folder / "damper.csv"], model)
    inputs = (effects.InputSaturation, effects.InputBacklash)
    catalogue = (*inputs, effects.RateLimit, effects.WrongParameter)
    diagnosis = ModelDiagnosis(model, catalogue=catalogue, hold="zoh").fit(X, y)
    assert diagnosis.complete_
    assert named(diagnosis) == [("input_saturation", "v")]
    assert diagnosis.remaining_.times_noise["F"] > 2.0
    assert diagnosis.verdict_ == "ambiguous"  # what is left may act in its place
    assert diagnosis.causes_[0].outside > 0.5
    assert np.isfinite(diagnosis.gain_["F"].extended)
    assert capfd.readouterr().err == ""


@pytest.mark.slow
@pytest.mark.parametrize(
    "error", [np.linalg.LinAlgError("SVD did not converge"), FloatingPointError("overflow")]
)
def test_a_candidate_whose_fit_breaks_down_is_unusable_and_the_search_goes_on(monkeypatch, error):
    break_fits(monkeypatch, error)
    diagnosis = diagnose(catalogue=(Broken, *CANDIDATES))
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.unusable_[0] == ("broken", "v", str(error))
    data = json.loads(json.dumps({**diagnosis.to_dict(), "version": ""}))
    assert data["unusable"][0]["reason"] == str(error)
    assert faults("diagnosis", data) == []
    said = unusable_sentence(diagnosis)
    assert "broken on v" in said
    assert said in render_report(diagnosis)
    assert "Broken on v</td><td>" + str(error) in render_report(diagnosis)


def test_a_candidate_that_cannot_even_begin_is_unusable_too():
    diagnosis = diagnose(catalogue=(Unstarted, *CANDIDATES))
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.unusable_[0] == ("unstarted", "v", "Eigenvalues did not converge")


@pytest.mark.slow
def test_a_candidate_that_breaks_down_later_is_not_named(monkeypatch):
    """Its first look is fine, and it is the best of all until it is fitted on all windows."""
    calls = break_fits(monkeypatch, np.linalg.LinAlgError("SVD did not converge"), after=1)
    diagnosis = diagnose(catalogue=(Broken,))
    assert len(calls) > 1
    assert named(diagnosis) == []
    assert diagnosis.unusable_[0].effect == "broken"


def test_what_can_be_fitted_from_another_start_is_usable(monkeypatch):
    calls, fit = [], window_fitter.fit_windows

    def breaking(model, *args, **options):
        if "L_F" in model.parameters or "I_v" in model.parameters:
            calls.append(model)
        if len(calls) == 1:
            calls.append(model)
            raise np.linalg.LinAlgError("SVD did not converge")
        return fit(model, *args, **options)

    monkeypatch.setattr(window_fitter, "fit_windows", breaking)
    diagnosis = diagnose(catalogue=(*CANDIDATES, effects.InputSaturation))
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.unusable_ == ()
    assert unusable_sentence(diagnosis) == ""


@pytest.mark.slow
def test_a_place_without_a_formula_is_said_so(monkeypatch):
    def breaking(*args):
        raise np.linalg.LinAlgError("SVD did not converge")

    monkeypatch.setattr(formula_selection, "propose", breaking)
    diagnosis = diagnose(catalogue=(effects.ConstantLoad,))
    assert diagnosis.verdict_ == "unexplained"
    assert ("formula", "v", "SVD did not converge") in diagnosis.unusable_


def test_the_quality_of_the_records_may_break_down(monkeypatch):
    def breaking(*args):
        raise np.linalg.LinAlgError("Singular matrix")

    monkeypatch.setattr(model_diagnosis, "check_data_quality", breaking)
    diagnosis = diagnose()
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.unusable_ == (("quality of the records", "", "Singular matrix"),)
    assert "quality of the records" in render_report(diagnosis)


# -- what was found so far is kept -----------------------------------------------------------------


class Bug(Exception):
    """A mistake in the program."""


def failing(*args, **options):
    raise Bug("what now")


def fit_in_spite_of_a_failure(diagnosis, X, y):
    """Fit; the error of the stage that failed is the cause of the warning."""
    with pytest.warns(DiagnosisWarning, match="a stage of the diagnosis failed .*Remedy: ") as told:
        diagnosis.fit(X, y)
    (warning,) = (w.message for w in told if isinstance(w.message, DiagnosisWarning))
    return warning.__cause__


@pytest.mark.parametrize("error", [Bug("what now"), KeyError("br_v")])
def test_a_bug_in_a_candidate_is_told_and_the_best_so_far_is_kept(monkeypatch, error):
    break_fits(monkeypatch, error)
    diagnosis = ModelDiagnosis(CART, catalogue=(effects.CoulombFriction, Broken))
    assert fit_in_spite_of_a_failure(diagnosis, *records()) is error
    assert diagnosis.verdict_ == "provisional"
    assert diagnosis.stopped_ == f"unexpected {type(error).__name__}: {error}, at 'cause 1'"
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.candidates_[0].effect == "coulomb_friction"
    assert diagnosis.to_dict()["stopped"] == diagnosis.stopped_
    assert verdict_sentence(diagnosis).startswith(f"Ended early ({diagnosis.stopped_})")
    assert "Coulomb friction" in render_report(diagnosis)


def test_a_cause_that_was_found_is_kept_where_the_program_fails_later(monkeypatch):
    monkeypatch.setattr(fitting.HypothesisFitter, "polish", failing)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES)
    fit_in_spite_of_a_failure(diagnosis, *records())
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.gain_["v"].explained_share > 0.9
    assert diagnosis.stopped_.startswith("unexpected Bug: what now, at ")
    assert not diagnosis.complete_
    assert "Coulomb friction" in render_report(diagnosis)


def test_what_is_provisional_has_no_probability(monkeypatch):
    monkeypatch.setattr(fitting.HypothesisFitter, "polish", failing)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES)
    fit_in_spite_of_a_failure(diagnosis, *records())
    (cause,) = diagnosis.causes_
    assert diagnosis.verdict_ == "provisional"
    assert not cause.tested
    assert not diagnosis.tested_
    assert np.isnan(cause.probability)
    assert "provisional" in repr(cause)
    data = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))
    assert (data["tested"], data["causes"][0]["tested"]) == (False, False)
    assert data["causes"][0]["probability"] is None
    assert diagnosis.causes_frame()["probability"].isna().all()
    page = render_report(diagnosis)
    assert "not tested: the search did not finish" in page
    assert "nan" not in page.replace("finance", "").lower().split("</style>")[-1].split()
    assert "not tested" in cause._repr_html_()


@pytest.mark.parametrize("stage", ["choose", "_in_fine_steps", "_try_slopes"])
def test_a_stage_after_the_search_that_fails_leaves_its_result(monkeypatch, stage):
    place = formula_selection.FormulaSelection if stage == "choose" else Investigation
    monkeypatch.setattr(place, stage, failing)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES)
    assert isinstance(fit_in_spite_of_a_failure(diagnosis, *records()), Bug)
    assert "unexpected Bug: what now" in diagnosis.stopped_
    assert diagnosis.gain_["v"].refitted > 0
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.tested_ == (stage != "choose")
    assert render_report(diagnosis)


def test_of_a_cause_that_cannot_be_described_nothing_is_said(monkeypatch):
    def describe(search, result, errors):
        return failing() if result.steps else ()

    monkeypatch.setattr(model_diagnosis, "name_causes", describe)
    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES)
    assert isinstance(fit_in_spite_of_a_failure(diagnosis, *records()), Bug)
    assert (diagnosis.verdict_, diagnosis.causes_) == ("provisional", ())
    assert diagnosis.gain_["v"].refitted > 0
    assert render_report(diagnosis)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["check_data_quality", "are_same"])
def test_a_bug_after_the_search_does_not_lose_its_result(monkeypatch, name):
    monkeypatch.setattr(model_diagnosis, name, failing)
    catalogue = (effects.InputBias, effects.ConstantLoad) if name == "are_same" else CANDIDATES
    X, y = records(level=0.0)
    diagnosis = ModelDiagnosis(CART, catalogue=catalogue)
    if name == "are_same":
        y = (CART + effects.InputBias("F", bias=0.3)).simulate(X[:, 0], X[:, 1]).y
        y = y + 1e-3 * np.random.default_rng(0).normal(size=y.shape)
    fit_in_spite_of_a_failure(diagnosis, X, y)
    assert diagnosis.stopped_.startswith("unexpected Bug: what now, at ")
    assert diagnosis.complete_
    assert "the search was complete" in verdict_sentence(diagnosis)
    assert len(diagnosis.causes_) == (name == "are_same")
    assert render_report(diagnosis)


def test_an_interrupt_keeps_the_best_so_far():
    def progress(stage, done, total):
        if stage == "other causes":
            raise KeyboardInterrupt

    diagnosis = ModelDiagnosis(CART, catalogue=CANDIDATES, progress=progress)
    with pytest.raises(KeyboardInterrupt):
        diagnosis.fit(*records())
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.stopped_ == "interrupted, at 'other causes'"


def test_nothing_is_kept_of_an_earlier_fit_where_nothing_was_found():
    def progress(stage, done, total):
        raise KeyboardInterrupt

    diagnosis = diagnose().set_params(progress=progress)
    with pytest.raises(KeyboardInterrupt):
        diagnosis.fit(*records())
    assert not hasattr(diagnosis, "verdict_")
    with pytest.raises(NotFittedError):
        diagnosis.to_dict()


def stages_until_the_end(monkeypatch, limit):
    """Diagnose by a clock that moves on by a second whenever progress is told."""
    seen = []
    monkeypatch.setattr(progress, "monotonic", lambda: float(len(seen)))
    diagnosis = diagnose(time_limit=limit, progress=lambda *said: seen.append(said))
    return diagnosis, [stage for stage, _, _ in seen]


def test_a_time_limit_that_is_never_enough_leaves_the_re_tuned_model(monkeypatch):
    diagnosis, stages = stages_until_the_end(monkeypatch, 1e-3)
    assert diagnosis.verdict_ == "provisional"
    assert diagnosis.causes_ == ()
    assert diagnosis.stopped_.startswith("time limit, at ")
    assert stages[-1] == "experiments that separate"
    assert diagnosis.gain_["v"].refitted > 0
    assert "no cause was found yet" in verdict_sentence(diagnosis)
    assert diagnosis.to_dict()["stopped"] == diagnosis.stopped_
    assert render_report(diagnosis)


@pytest.mark.slow
def test_every_time_limit_gives_the_best_until_then(monkeypatch):
    whole, stages = stages_until_the_end(monkeypatch, 1e9)
    assert whole.stopped_ is None
    known = []
    for share in (0.3, 0.8, 0.95):
        diagnosis, _ = stages_until_the_end(monkeypatch, share * len(stages))
        assert diagnosis.stopped_.startswith("time limit, at ")
        assert set(named(diagnosis)) <= {("coulomb_friction", "v")}
        assert json.dumps(diagnosis.to_dict(), allow_nan=False)
        known.append(len(diagnosis.causes_))
    assert known == sorted(known)
    assert known[0] == 0
    assert known[-1] == 1


def end_with_a_needless_cause(monkeypatch, reserve):
    """Diagnose with a search that ends with a cause that is not there, by a clock of told steps."""
    friction, needless = effects.CoulombFriction("v"), effects.ConstantLoad("v")
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    monkeypatch.setattr(progress, "RESERVE", reserve)
    monkeypatch.setattr(progress, "MOST_RESERVED", np.inf)

    def run(self, begin=None):
        for cause in (friction, needless):
            first = self.fitter.first_fit(self.fitter.subsample(self.current), cause)
            self.current = self.fitter.fit_all(self.fitter.converge(first), self.current)
        now[0], self.progress.counts = 1000.0 * (1 - reserve), True
        with pytest.raises(TimeIsUp):
            self.progress.tick()
        return self.so_far()

    def tell(*_):
        now[0] += now[0] > 0

    monkeypatch.setattr(Search, "run", run)
    return diagnose(time_limit=1000.0, progress=tell)


def test_what_was_found_until_the_time_is_up_is_named_beside_the_others(monkeypatch):
    diagnosis = end_with_a_needless_cause(monkeypatch, reserve=0.9)
    assert named(diagnosis) == [("coulomb_friction", "v")]
    assert diagnosis.verdict_ == "provisional"


def test_where_the_reserve_does_not_suffice_what_was_found_is_provisional_all_the_same(monkeypatch):
    diagnosis = end_with_a_needless_cause(monkeypatch, reserve=0.0)
    assert set(named(diagnosis)) == {("coulomb_friction", "v"), ("constant_load", "v")}
    assert diagnosis.verdict_ == "provisional"
    assert not diagnosis.to_dict()["tested"]
    assert diagnosis.stopped_ == "time limit, at 'candidates'"


def test_the_checks_of_the_records_end_with_the_time_and_keep_what_they_found(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])

    def late(*_):
        now[0] = 200.0
        return Finding("outliers", "v", "one", 1.0, "none")

    monkeypatch.setattr(checks, "find_quantisation", late)
    monkeypatch.setattr(checks, "find_closed_loop", lambda *_: pytest.fail("too late"))
    diagnosis = diagnose(time_limit=100.0)
    assert diagnosis.stopped_ == "time limit, at 'quality of the records'"
    assert diagnosis.complete_
    assert [finding.kind for finding in diagnosis.data_quality_] == ["outliers"]


@pytest.mark.parametrize("limit", [0, -1.0, "soon", float("nan")])
def test_a_time_limit_that_is_none_is_refused(limit):
    with pytest.raises(ValueError, match="time_limit: expected a time above 0 s or None, got"):
        diagnose(time_limit=limit)


def test_a_search_ends_before_the_time_and_what_needs_a_result_ends_with_it(monkeypatch):
    now = [0.0]
    monkeypatch.setattr(progress, "monotonic", lambda: now[0])
    clock = Progress(None, 100.0)
    clock.counts = True
    now[0] = 79.0
    assert not clock.tick()
    now[0] = 81.0
    with pytest.raises(TimeIsUp):
        clock.begin("here")
    assert clock.ended == "time limit, at 'here'"
    clock.counts = False
    assert not clock.tick()
    with clock.spare_time(AFTER_TESTS):
        clock.step()
        now[0] = 91.0
        clock.step()
        pytest.fail("too late")
    assert not clock.tick()
    now[0] = 101.0
    assert clock.tick()  # a fit ends with what it has


def test_what_is_left_out_for_an_error_is_told():
    clock, error = Progress(), Bug("what now")
    clock.begin("here")
    with clock.kept():
        raise error
    assert (clock.failed, clock.ended) == (error, "unexpected Bug: what now, at 'here'")


# -- progress --------------------------------------------------------------------------------------


def test_a_diagnosis_names_its_stages_and_every_step_of_a_fit_is_told(monkeypatch):
    said, fits, fit = [], [], window_fitter.fit_windows

    def counted(*args, **options):
        before = len(said)
        found = fit(*args, **options)
        fits.append(len(said) - before)
        return found

    monkeypatch.setattr(window_fitter, "fit_windows", counted)
    diagnose(progress=lambda *args: said.append(args))
    assert min(fits) >= 1
    assert sum(fits) > len(fits)
    assert all(0 <= done <= total for _, done, total in said)
    stages = list(dict.fromkeys(stage for stage, _, _ in said if not stage.startswith(BEST)))
    assert [s for s in stages if s not in ("structure of what is left", "pairs", "formula")] == [
        "reading the records",
        "wiring",
        "window length",
        "candidates",
        "cause 1",
        "needless causes",
        "other causes",
        "inputs between samples",
        "integration steps",
        "held-out error",
        "quality of the records",
        "experiments that separate",
    ]
    ends = {stage: (done, total) for stage, done, total in said}
    assert ends["cause 1"] == (3, 4)  # two candidates: a look at each, and the nearer to its end


def test_the_best_so_far_is_told_while_the_search_goes_on():
    said = []
    diagnosis = diagnose(progress=lambda *args: said.append(args))
    stages = [stage for stage, _, _ in said]
    told = [stage for stage in stages if stage.startswith(BEST)]
    (cause,) = diagnosis.causes_
    name = effects.by_id(cause.effect).title(cause.target)
    assert re.fullmatch(rf"{BEST}error (0\.9|1\.)\d* times the noise with {name}", told[-1])
    assert stages.index("cause 1") < stages.index(told[-1]) < stages.index("held-out error")
    left = [float(stage.removeprefix(f"{BEST}error ").split()[0]) for stage in told]
    assert left == sorted(left, reverse=True)


@pytest.mark.slow
def test_the_search_for_more_is_told_too():
    said = []
    rig = CART.replace(equations={"v": "(F - d*v - 0.3*cos(3*v))/m"})
    X, _ = records()
    y = rig.simulate(X[:, 0], X[:, 1]).y + 1e-3 * np.random.default_rng(0).normal(size=(len(X), 1))
    ModelDiagnosis(
        CART, catalogue=CANDIDATES, hold="zoh", progress=lambda *args: said.append(args)
    ).fit(X, y)
    stages = {stage for stage, _, _ in said}
    assert {"structure of what is left", "pairs", "formula"} <= stages
