"""Pictures and report of a diagnosis: what they show, and what they refuse to carry."""

import re
from copy import copy
from dataclasses import replace
from xml.etree import ElementTree

import matplotlib.pyplot as plt
import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.diagnosis import Remaining, Rival, Structure, Tried
from sklearn_pgnn.inspection import DiagnosisDisplay, plot_diagnosis
from sklearn_pgnn.inspection.equations import PAGE, equations_of
from sklearn_pgnn.inspection.evidence import find_evidence
from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.inspection.words import rivals_or_none, verdict_sentence

INJECTED = "<script>alert(1)</script>"


def cart(name="cart", mass_unit="kg"):
    return PhysicsModel(
        states={"x": "m", "v": "m/s"},
        equations={"x": "v", "v": "(F - k*x - d*v)/m"},
        parameters={
            "m": {"value": 2.0, "unit": mass_unit},
            "k": {"value": 10.0, "unit": "N/m"},
            "d": {"value": 1.0, "unit": "N s/m"},
        },
        inputs={"F": "N"},
        outputs={"position": "x"},
        inertia={"v": "m"},
        name=name,
    )


def records(truth, n_records=5, seed=0):
    """Simulate records of a cart finely, with a little noise."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, 8, 0.02)
    tables, outputs = [], []
    for i in range(n_records):
        force = 4 * np.sin((1.3 + 0.4 * i) * t) + 3 * np.sin((3.1 + i) * t) + 2 * (t % 3 > 2)
        run = truth.simulate(t, force, substeps=4).check()
        tables.append(pd.DataFrame({"trajectory": i, "t": t, "F": force}))
        outputs.append(run.y + 1e-4 * rng.standard_normal(run.y.shape))
    return pd.concat(tables, ignore_index=True), np.concatenate(outputs)


def diagnose(effect, catalogue, model=None):
    model = cart() if model is None else model
    truth = model if effect is None else model + effect
    return ModelDiagnosis(model, catalogue=catalogue).fit(*records(truth))


@pytest.fixture(scope="module")
def friction():
    catalogue = (effects.CoulombFriction, effects.InputBias)
    model = cart(name=f"cart {INJECTED}", mass_unit=f"kg{INJECTED}")
    return diagnose(effects.CoulombFriction("v", level=1.0), catalogue, model)


@pytest.fixture(scope="module")
def report(friction, tmp_path_factory):
    path = tmp_path_factory.mktemp("report") / "report.html"
    friction.to_html(path)
    assert list(path.parent.iterdir()) == [path]
    return path.read_text(encoding="utf-8")


# -- the report ------------------------------------------------------------------------------------


@pytest.mark.slow
@pytest.mark.core
def test_the_report_needs_nothing_else(report):
    assert not re.search(r"<(link|iframe|object|img)\b|<[^>]*\b(src|href)=", report)
    assert report.count("<script") == 1
    assert "url(" not in report
    assert "@import" not in report


@pytest.mark.slow
def test_names_of_the_model_are_escaped(report):
    assert "alert(1)</script>" not in report
    for text in ("cart &lt;script&gt;alert(1)&lt;/script&gt;", "kg&lt;script&gt;"):
        assert text in report


@pytest.mark.core
def test_the_verdict_comes_first_and_everything_is_there(report, friction):
    headings = re.findall(r"<h[12][^>]*>\s*([^<]*)", report)
    order = ["Cart", "What is missing", "Parameters", "Measured", "Evidence", "Equations"]
    found = [next(i for i, h in enumerate(headings) if h.startswith(name)) for name in order]
    assert found == sorted(found)
    text = re.sub(r"<[^>]+>", "", report)
    assert text.index("lacks Coulomb friction on v") < text.index("What is missing")
    cause = friction.causes_[0]
    for what in (cause.summary, cause.check, "Fc_v", "nothing:", "input bias of F", "windows of"):
        assert what in text
    assert "Fc_v*sign(v)" in text
    assert report.count("<math") > 4


def test_a_candidate_that_makes_it_worse_has_no_percentage(friction):
    changed = copy(friction)
    changed.candidates_ = (Tried("sensor_rectification", "position", 207.99, 150.0, 290.0),)
    text = render_report(changed)
    assert "makes it worse" in text
    assert "20799" not in text


def test_a_report_says_as_a_screen_does_what_a_parameter_at_its_limit_means(friction):
    pinned, found = copy(friction), friction.parameters_
    pinned.parameters_ = found | {"k": replace(found["k"], value=11.0)}
    said = "k lies at the end of what the spread in the model file allowed"
    assert said in render_report(pinned)
    assert said not in render_report(friction)


def test_how_sure_a_cause_is_and_what_is_left_are_said(friction):
    changed = copy(friction)
    rival = Rival("input_bias", "F", 0.125)
    changed.causes_ = (replace(friction.causes_[0], probability=0.875, confused_with=(rival,)),)
    changed.remaining_ = Remaining("structure", {"position": 3.0}, Structure("v", 0.9, 0.0, ("v",)))
    gain = friction.gain_["position"]
    changed.gain_ = {"position": replace(gain, extended=3.0 * gain.noise)}
    text = " ".join(re.sub(r"<[^>]+>", "", render_report(changed)).split())
    assert "Probability: 88 %" in text
    assert "Confused with: input bias of F (12 %)" in text
    left = "What is left is structure (3.00 × the white noise of position): it depends on v"
    assert text.index(left) < text.index("What is missing")


def test_a_report_says_as_a_screen_does_that_a_cause_was_compared_with_none(friction):
    early = copy(friction)
    early.causes_ = (replace(friction.causes_[0], probability=1.0, confused_with=()),)
    early.complete_ = False
    said = rivals_or_none(early.causes_[0], complete=False)
    assert said.startswith("not known")
    assert f"Confused with: {said}." in re.sub(r"<[^>]+>", "", render_report(early))


# -- equations -------------------------------------------------------------------------------------


def test_minus_signs_are_no_hyphens_and_units_have_superscripts(report, friction):
    assert "<mo>-</mo>" not in report
    assert "<mn>-" not in report
    assert "<mo>&#x2212;</mo>" in report
    changed = copy(friction)
    changed.parameters_ = {"m": replace(friction.parameters_["m"], unit="kg m^2")}
    text = render_report(changed)
    assert "kg m²" in text
    assert "m^2)" not in text


def test_a_long_sum_may_break_between_its_terms():
    names = ("force", "stiffness", "damping", "friction", "cubic", "load")
    force = "force - stiffness*x - damping*v - friction*sign(v) - cubic*x**3 + load"
    model = PhysicsModel(
        {"x": "m", "v": "m/s"},
        {"x": "v", "v": f"({force})/mass"},
        dict.fromkeys(("stiffness", "damping", "friction", "cubic", "load", "mass"), 1.0),
        {"force": "N"},
    )
    short, long = (equation.mathml for equation in equations_of(model, model))
    assert short.count("<math") == 1
    pieces = long.split("</math> ")
    assert len(pieces) == 6
    assert all(xml.count("(") == xml.count(")") for xml in pieces[1:-1])
    assert sorted(n for n in names for piece in pieces if f"<mi>{n}</mi>" in piece) == sorted(names)
    assert long.count("<mi>mass</mi>") == 1
    for piece in long.replace("</math> ", "</math>\n").splitlines():
        ElementTree.fromstring(piece)


def test_what_cannot_break_says_how_wide_it_is():
    product = "*".join(f"parameter_{i}" for i in range(12))
    model = PhysicsModel({"y": "V"}, {"y": product}, {f"parameter_{i}": 2.0 for i in range(12)})
    (equation,) = equations_of(model, model)
    assert len(product) > PAGE
    assert f'class="pages-{-(-len(product) // PAGE)}"' in equation.mathml


# -- the picture -----------------------------------------------------------------------------------


@pytest.fixture(autouse=True)
def closed():
    """Close what a test has drawn."""
    yield
    plt.close("all")


@pytest.mark.core
def test_pictures_are_shown_by_pyplot_but_not_those_of_a_report(friction, tmp_path):
    friction.to_html(tmp_path / "report.html")
    assert plt.get_fignums() == []
    display = friction.plot()
    assert display.figure_ is plt.gcf()
    assert plt.get_fignums() == [display.figure_.number]


@pytest.mark.core
def test_the_picture_has_curves_errors_and_evidence(friction):
    display = plot_diagnosis(friction)
    assert isinstance(display, DiagnosisDisplay)
    assert len(display.axes_) == 3
    assert [len(axes.lines) for axes in display.axes_[:2]] == [3, 2]
    assert display.axes_[0].get_ylabel() == "position [m]"


def test_the_picture_can_show_windows_new_records_and_a_given_figure(friction):
    from matplotlib.figure import Figure

    figure = Figure()
    display = DiagnosisDisplay.from_estimator(friction, kind="windows", record=1, figure=figure)
    assert display.figure_ is figure
    X, y = records(friction.extended_model_, n_records=1, seed=1)
    new = DiagnosisDisplay.from_estimator(friction, X, y)
    left = {which: np.std(y - c) for which, c in new.comparison.simulated.items()}
    assert left["extended"] < 0.1 * left["prior"]


@pytest.mark.parametrize(
    ("options", "what"),
    [
        ({"kind": "dream"}, "kind"),
        ({"record": 7}, "record"),
        ({"X": [[0.0, 0.0]], "kind": "windows"}, "windows"),
    ],
)
def test_what_cannot_be_drawn_is_refused(friction, options, what):
    with pytest.raises(ValueError, match=what):
        DiagnosisDisplay.from_estimator(friction, **options)


def evidence_of(effect, model=None):
    """Return the diagnosis that looked for a hidden effect only, and the evidence for it."""
    diagnosis = diagnose(effect, (type(effect),), model)
    return diagnosis, find_evidence(diagnosis, diagnosis.causes_[0])


# -- the evidence: the points of the records lie on the law that was hidden ------------------------

HIDDEN = [
    (effects.CoulombFriction("v", level=1.0), "v", lambda v: np.sign(v)),
    (effects.CubicStiffness("v", stiffness=15.0), "x", lambda x: 15.0 * x**3),
    (effects.ConstantLoad("v", load=2.0), "v", lambda v: 2.0 + 0 * v),
    (
        effects.InputDeadZone("F", threshold=1.5),
        "F",
        lambda u: np.maximum(u - 1.5, 0) + np.minimum(u + 1.5, 0),
    ),
    (effects.InputSaturation("F", limit=4.0), "F", lambda u: np.clip(u, -4, 4)),
    (effects.SensorGain("position", error=0.2), "position", lambda y: 0.2 * y),
    (
        effects.PeriodicDisturbance("v", sine=1.0, frequency=2.5),
        "time within a period",
        lambda t: np.sin(2 * np.pi * 2.5 * t),
    ),
]


@pytest.mark.slow
@pytest.mark.parametrize(("effect", "over", "law"), HIDDEN, ids=lambda v: getattr(v, "id", ""))
def test_the_evidence_lies_on_the_hidden_law(effect, over, law):
    free = ("m", "k", "d") if effect.id != "sensor_gain" else ()
    model = cart()
    model = model.with_parameters(
        **{n: replace(p, fixed=True) for n, p in model.parameters.items() if n not in free}
    )
    _, evidence = evidence_of(effect, model)
    assert over in evidence.x_label
    x, y = evidence.points
    expected = law(x)
    good = np.isfinite(y)
    # moments of sticking and turning are not on the law
    assert np.median(np.abs(y - expected)[good]) < 0.1 * np.max(np.abs(expected[good]))
    line = evidence.lines[-1]
    inner = np.abs(line.x) > 0.02 * np.ptp(line.x)
    assert np.allclose(line.y[inner], law(line.x[inner]), atol=0.2 * np.max(np.abs(line.y)))


@pytest.mark.slow
def test_a_limit_of_a_rate_is_shown_over_the_rate_without_it():
    _, evidence = evidence_of(effects.RateLimit("v", limit=2.0))
    x, y = evidence.points
    beyond = np.isfinite(x) & (np.abs(x) > 3.0)
    assert np.median(np.abs(np.abs(y[beyond]) - 2.0)) < 0.1
    _, law = evidence.lines
    assert np.allclose(law.y, np.clip(law.x, -2.0, 2.0), atol=0.05)


@pytest.mark.slow
def test_a_force_that_remembers_is_drawn_as_its_loop():
    effect = effects.Hysteresis("v", level=1.0, deflection=0.05)
    _, evidence = evidence_of(effect)
    assert "x" in evidence.x_label
    (loop,) = evidence.lines
    x, force = (values[: 5 * loop.x.size].reshape(5, -1) for values in evidence.points)
    record = [np.array_equal(one, loop.x) for one in x].index(True)
    assert np.nanmedian(np.abs(force[record] - loop.y)) < 0.1 * np.ptp(loop.y)


@pytest.mark.slow
def test_a_drifting_parameter_is_shown_over_time():
    _, evidence = evidence_of(effects.ParameterDrift("k", rate=0.1))
    t, k = evidence.points
    good = np.isfinite(k)
    assert np.median(np.abs(k / (10.0 * (1 + 0.1 * t)) - 1)[good]) < 0.1
    (law,) = evidence.lines
    assert np.allclose(law.y, 10.0 * (1 + 0.1 * law.x), rtol=0.05)


@pytest.mark.slow
def test_a_parameter_that_depends_on_a_state_is_shown_over_it():
    effect = effects.ParameterSlope("d(x)", slope=0.5)
    diagnosis, evidence = evidence_of(effect)
    assert "d that changes with x" in verdict_sentence(diagnosis)
    assert evidence.x_label.startswith("x ")
    x, d = evidence.points
    good = np.isfinite(d)
    assert np.polyfit(x[good], d[good], 1)[0] > 0
    (law,) = evidence.lines
    value = diagnosis.extended_model_.parameters
    expected = value["d"].value * (1 + value["slope_d_x"].value * law.x)
    np.testing.assert_allclose(law.y, expected, rtol=1e-9)


def test_a_parameter_that_cannot_act_while_the_input_is_zero_is_shown_elsewhere():
    amplifier = PhysicsModel({"y": ""}, {"y": "(K*u - y)/0.3"}, {"K": 2.0}, {"u": "V"})
    bent = amplifier + effects.ParameterSaturation("K(u)", bend=-0.2)
    t = 0.02 * np.arange(1500)
    u = np.where(t % 4 < 2, 0.0, np.sin(3 * t) + np.sin(t))
    y = bent.simulate(t, u).y[:, 0] + 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    X = pd.DataFrame({"t": t, "u": u})
    diagnosis = ModelDiagnosis(amplifier, catalogue=["parameter_saturation"]).fit(X, y)
    with np.errstate(all="raise"):
        evidence = find_evidence(diagnosis, diagnosis.causes_[0])
    assert np.isfinite(evidence.points).all()
    assert "K that changes with the size of u" in verdict_sentence(diagnosis)


@pytest.mark.slow
def test_friction_under_load_is_shown_over_the_load():
    _, evidence = evidence_of(effects.LoadFriction("v", level=0.5, share=0.2))
    assert "abs(F)" in evidence.x_label
    (law,) = evidence.lines
    away = np.abs(law.x) > 0.1
    expected = 0.5 * np.sign(law.x) + 0.2 * law.x
    np.testing.assert_allclose(law.y[away], expected[away], atol=0.05)
    load, force = evidence.points
    error = force - (0.5 * np.sign(load) + 0.2 * load)
    assert np.nanmedian(np.abs(error)) < 0.15


@pytest.mark.slow
@pytest.mark.parametrize(
    "effect",
    [effects.SensorDelay("position", delay=0.1), effects.ActuatorLag("F", time_constant=0.15)],
    ids=lambda effect: effect.id,
)
def test_what_is_late_is_shown_in_time(effect):
    _, evidence = evidence_of(effect)
    assert evidence.x_label == "t [s]"
    _, seen = evidence.points
    at_once, late = (np.nanstd(seen - line.y) for line in evidence.lines)
    assert late < 0.5 * at_once


@pytest.mark.slow
def test_a_wrong_parameter_adds_what_was_missing():
    _, evidence = evidence_of(effects.WrongParameter("k", value=14.0))
    x, y = evidence.points
    good = np.isfinite(x) & np.isfinite(y)
    assert np.polyfit(x[good], y[good], 1)[0] == pytest.approx(1.0, abs=0.1)


@pytest.mark.slow
def test_where_states_are_not_seen_the_error_is_shown_over_time():
    tanks = systems.two_tanks()
    truth = tanks + effects.InputDeadZone("pump", threshold=1.0)
    t = np.arange(0, 600, 2.0)
    pump = 3 + 1.5 * np.sin(0.05 * t) + (t % 200 > 100)
    y = truth.simulate(t, pump).y + 1e-3 * np.random.default_rng(0).standard_normal((t.size, 1))
    X = np.column_stack([t, pump])
    diagnosis = ModelDiagnosis(tanks, catalogue=(effects.InputDeadZone,)).fit(X, y)
    evidence = find_evidence(diagnosis, diagnosis.causes_[0])
    assert evidence.points is None
    without, left = evidence.lines
    assert np.nanstd(left.y) < 0.5 * np.nanstd(without.y)
