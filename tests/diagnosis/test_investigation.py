"""The course of a diagnosis: what is looked at, in what integration steps, and what is shown."""

import pickle

import numpy as np
import pandas as pd
import pytest
from servo import SERVO, STEP, follow_steps
from sledge import SLEDGE as CART

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects
from sklearn_pgnn.diagnosis import investigation
from sklearn_pgnn.estimation.progress import TimeIsUp

FAN = PhysicsModel({"v": "rad/s"}, {"v": "(K*u - v)/T"}, {"K": 2.0, "T": 0.3}, {"u": "V"})
DRY = effects.CoulombFriction("v", level=3.0)


def spin(least):
    """Return a record of a fan with dry friction, at voltages from the least on."""
    rng, t = np.random.default_rng(0), 0.01 * np.arange(1500)
    u = np.repeat(rng.uniform(least, 8.0, size=15), 100)
    y = (FAN + DRY).simulate(t, u, [0.0]).y[:, 0] + 0.02 * rng.normal(size=t.size)
    return pd.DataFrame({"t": t, "u": u}), y


@pytest.mark.parametrize(
    ("least", "catalogue", "looked_at"),
    [
        (2.0, ("coulomb_friction", "asymmetric_friction"), {"coulomb_friction"}),
        (-8.0, ("coulomb_friction", "asymmetric_friction"), None),
        (2.0, ("asymmetric_friction",), None),
    ],
)
def test_what_records_cannot_tell_from_a_special_case_is_not_looked_at(least, catalogue, looked_at):
    diagnosis = ModelDiagnosis(FAN, catalogue=catalogue).fit(*spin(least))
    assert {tried.effect for tried in diagnosis.candidates_} == (looked_at or set(catalogue))
    assert diagnosis.verdict_ == "cause_named"


@pytest.mark.slow
def test_steps_are_so_fine_as_the_retuned_prior_needs_not_only_the_prior():
    """A servo that is far quicker than its model thinks: a coarse step over it is another lag."""
    true, guessed = 0.6 * STEP, 10 * STEP
    slow = SERVO.replace(parameters={"G": 1.0, "T": {"value": guessed, "spread": np.inf}})
    found = ModelDiagnosis(slow).fit(*follow_steps(slow.with_parameters(T=true)))
    assert (found.verdict_, found.causes_) == ("model_adequate", ())
    assert found.substeps_ > 1
    retuned = found.parameters_["T"]
    assert retuned.low <= true <= retuned.high


# -- where the time is up --------------------------------------------------------------------------


def end(*_, **__):
    raise TimeIsUp


@pytest.mark.parametrize(
    ("where", "left"),
    [("FormulaSelection.choose", "structure"), ("find_structure", "disturbance")],
)
def test_a_model_is_not_adequate_where_time_ends_before_what_is_left_is_explained(
    monkeypatch, where, left
):
    monkeypatch.setattr(f"{investigation.__name__}.{where}", end)
    found = ModelDiagnosis(FAN, catalogue=("input_bias",)).fit(*spin(-8.0))
    assert (found.remaining_.kind, found.verdict_) == (left, "provisional")
    assert not found.complete_


def test_what_was_found_with_held_inputs_is_provisional_where_a_better_hold_came_to_no_end(
    monkeypatch,
):
    """The records refute that inputs were held: what explains them so may stand in for a slope."""
    search = investigation.Search.run

    def cut_short_on_slopes(self, begin=None):
        is_held = self.fitter.problem.windows.hold == "zoh"
        return search(self, begin) if is_held else self.so_far()

    monkeypatch.setattr(investigation.Search, "run", cut_short_on_slopes)
    rng, t = np.random.default_rng(0), 0.05 * np.arange(600)
    u = 6.0 * np.sin(2.0 * t) + 2.0 * np.sin(5.1 * t)
    y = (FAN + DRY).simulate(t, u, [0.0], hold="foh", substeps=8).y[:, 0]
    y += 0.01 * rng.normal(size=t.size)
    found = ModelDiagnosis(FAN, catalogue=("coulomb_friction",)).fit(
        pd.DataFrame({"t": t, "u": u}), y
    )
    assert (found.verdict_, found.complete_, found.hold_) == ("provisional", False, "zoh")
    assert [(cause.effect, cause.tested) for cause in found.causes_] == [
        ("coulomb_friction", False)
    ]


T = np.arange(0, 30, 0.02)
X = np.column_stack([T, 2 * np.sin(0.7 * T) + np.sin(1.9 * T)])
RIG = CART + effects.CoulombFriction("v", level=0.4)
Y = RIG.simulate(T, X[:, 1], substeps=5).y
Y = Y + 1e-3 * np.random.default_rng(0).normal(size=Y.shape)


def diagnosis(**options):
    return ModelDiagnosis(CART, catalogue=["coulomb_friction"], max_causes=1, **options)


def test_silent_unless_asked(capsys):
    diagnosis().fit(X, Y)
    assert "".join(capsys.readouterr()) == ""


def test_lines_tell_the_stage_and_the_best_so_far(capsys):
    told = []
    found = diagnosis(verbose=1, progress=lambda *step: told.append(step)).fit(X, Y)
    lines = capsys.readouterr().out.splitlines()
    assert all(line.startswith("[ModelDiagnosis] ") for line in lines)
    assert any("simulating the candidates" in line for line in lines)
    best = [line for line in lines if "best candidate so far: error" in line]
    assert "with Coulomb friction on v" in best[-1]
    assert {stage for stage, *_ in told} > {"candidates", "held-out error"}  # as without verbose
    assert not [name for name in vars(found) if name == "_show"]
    found.progress = None
    assert pickle.loads(pickle.dumps(found)).causes_[0].effect == "coulomb_friction"


def test_a_terminal_gets_a_bar(capsys, monkeypatch):
    monkeypatch.setenv("TTY_COMPATIBLE", "1")
    diagnosis(verbose=1).fit(X, Y)
    shown = capsys.readouterr().out
    assert "\x1b[" in shown  # the line is written over again
    assert "s  simulating the candidates" in shown  # with how long it took


def test_detectable_sizes_show_it_too(capsys):
    found = diagnosis().fit(X, Y).set_params(verbose=1)
    found.detectability(["quadratic_drag"], sizes=(1,), n_repeats=10)
    assert "[ModelDiagnosis] effects ..." in capsys.readouterr().out


@pytest.mark.parametrize("method", ["fit", "detectability"])
def test_a_display_ends_with_an_error(method, capsys):
    found = diagnosis(verbose=1)
    with pytest.raises(ValueError, match=r"None|fitted"):
        found.fit(X, None) if method == "fit" else found.detectability()
    assert found._show is None
