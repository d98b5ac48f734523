"""Where the catalogue ends: the hidden input is smoothed, placed, and described by a formula."""

import json
import pickle
from dataclasses import dataclass

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel, effects, systems
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.diagnosis.term_choice import _slope_by, leading_terms
from sklearn_pgnn.diagnosis.unexplained import tells_time
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.physics.effects.formula import Formula
from sklearn_pgnn.simulation.hidden_input import find_hidden_input
from sklearn_pgnn.simulation.linear_response import linear_responses
from sklearn_pgnn.simulation.windows import evaluate
from sklearn_pgnn.trajectories import read_records

RECORDS = {"n_records": 5, "sample_rate": 100.0}


def hide(target, term, coefficient, seed=1):
    effect = Formula(target, (term,), (coefficient,))
    return make_hidden_effect(systems.cart_on_spring(), effect, random_state=seed, **RECORDS)


@dataclass(frozen=True)
class Ground:
    problem: object
    x: np.ndarray
    spread: np.ndarray


def ground(model, X, y):
    problem = build_problem(model, read_records(model, X, y))
    estimate = problem.states.estimate(model)
    return Ground(problem, estimate.x, estimate.spread)


# -- the parts -------------------------------------------------------------------------------------


def test_a_hidden_force_is_smoothed_to_within_its_own_errors():
    lag = PhysicsModel({"x": "V"}, {"x": "(u - x)/T"}, {"T": 0.5}, {"u": "V"})
    t = np.arange(0, 20, 0.02)
    hidden = 0.8 * np.sin(0.9 * t)
    u = np.sign(np.sin(0.5 * t))
    x = lag.simulate(t, u + 0.5 * hidden).y[:, 0]
    y = x + 0.01 * np.random.default_rng(0).standard_normal(t.size)
    found = ground(lag, np.column_stack([t, u]), y)
    smoothed = find_hidden_input(
        lag, found.problem.windows, "x", found.x, found.spread, 1.0, found.problem.period
    )
    inner = slice(50, -50)
    deviation = (smoothed.values - hidden)[inner] / smoothed.errors[inner]
    assert np.sqrt(np.mean(deviation**2)) < 1.5
    assert np.corrcoef(smoothed.values[inner], hidden[inner])[0, 1] > 0.97


@pytest.mark.parametrize("channel", ["v", "force", "position"])
def test_linear_responses_are_those_of_small_added_inputs(channel):
    cart = systems.cart_on_spring()
    hidden = make_hidden_effect(cart, None, random_state=0, n_records=2, sample_rate=100.0)
    problem = ground(hidden.prior, hidden.X, hidden.y).problem
    model, windows = hidden.prior, problem.windows
    x0 = problem.states.estimate(model).x[windows.starts]
    theta = np.ones((windows.t.size, 1))
    responses, by_state = linear_responses(model, windows, x0, channel, theta)
    small = 1e-4
    base = evaluate(model, windows, x0, ()).residual
    moved = evaluate(model + Formula(channel, ("1",), (small,)), windows, x0, ()).residual
    np.testing.assert_allclose(responses[:, :, 0], (base - moved) / small, atol=1e-6)
    pushed = evaluate(model, windows, x0 + small * np.array([0.0, 1.0]), ()).residual
    np.testing.assert_allclose(by_state[:, :, 1], (base - pushed) / small, atol=1e-6)


@pytest.mark.parametrize("size", [1.0, 1e-5])
def test_the_slope_by_a_parameter_depends_on_no_unit(size):
    """Compare with the slope that sensitivities give, of a cart whose forces have another size."""
    numbers = {"m": 2.0 * size, "d": 0.5 * size}
    cart = PhysicsModel({"v": "m/s"}, {"v": "(F - d*v)/m"}, numbers, {"F": "N"}, inertia={"v": "m"})
    rig = cart + effects.CoulombFriction("v", level=0.4 * size)
    t = np.arange(0, 30, 0.05)
    force = size * (2 * np.sin(0.7 * t) + np.sin(1.9 * t))
    y = rig.simulate(t, force, substeps=4).y
    noise = 1e-3 * np.random.default_rng(0).normal(size=y.shape)
    fitter = HypothesisFitter(
        build_problem(cart, read_records(cart, np.column_stack([t, force]), y + noise))
    )
    friction = fitter.first_fit(fitter.subsample(fitter.base()), effects.CoulombFriction("v"))
    trial = fitter.fit_all(friction, fitter.base())
    windows, gram = fitter.problem.windows, trial.fit.evaluation.gram.sum(axis=0)
    for place in range(len(trial.fit.freedoms)):
        slope = np.nan_to_num(_slope_by(fitter.problem, trial, place)) / windows.scale
        assert np.sum(slope**2) == pytest.approx(gram[place, place], rel=0.05)


@pytest.mark.core
def test_the_leading_terms_are_the_true_ones():
    rng = np.random.default_rng(0)
    columns = rng.standard_normal((400, 12))
    target = 3.0 * columns[:, 7] - 0.5 * columns[:, 2] + 1e-3 * rng.standard_normal(400)
    one, two = leading_terms(columns, target, 2)
    assert list(np.flatnonzero(one)) == [7]
    np.testing.assert_allclose(two[[7, 2]], [3.0, -0.5], atol=1e-3)


@pytest.mark.core
def test_a_term_is_chosen_for_what_it_explains_together_with_those_before():
    rng = np.random.default_rng(0)
    x, v, other = rng.standard_normal((3, 400))
    # after the first column the third is more like the rest, but only the second makes it up
    columns = np.column_stack([x + 0.05 * v, x, other + 0.3 * v])
    _, two = leading_terms(columns, x + v, 2)
    np.testing.assert_allclose(two, [20.0, -19.0, 0.0], atol=1e-9)


@pytest.mark.core
def test_columns_that_are_sums_of_the_terms_taken_are_no_terms():
    x, v = np.random.default_rng(0).standard_normal((2, 100))
    columns = np.column_stack([x, 3 * x, v, x - v])
    found = leading_terms(columns, x + 2 * v, 4)
    assert len(found) == 2
    np.testing.assert_allclose(columns @ found[-1], x + 2 * v)


def test_leading_terms_are_those_of_pysindy():
    pysindy = pytest.importorskip("pysindy")
    x, v = np.random.default_rng(0).standard_normal((2, 500))
    columns = np.column_stack([x, v, x * v, x**3, v**3, np.abs(x), x * np.abs(x), np.sin(x)])
    target = np.tanh(x) * v + 0.3 * x**3 + 0.1 * v
    theirs = pysindy.FROLS(max_iter=4, alpha=1e-12)
    size = np.linalg.norm(columns, axis=0)
    theirs.fit(columns / size, target[:, None])
    ours = leading_terms(columns, target, 4)
    np.testing.assert_allclose(
        ours, np.reshape(theirs.history_[1:], (4, -1)) / size, rtol=1e-8, atol=1e-10
    )


def test_a_formula_of_unknown_quantities_is_refused():
    with pytest.raises(ModelError, match="term of 'v'"):
        systems.cart_on_spring() + Formula("v", ("nobody**2",), (1.0,))


# -- the whole -------------------------------------------------------------------------------------


@pytest.fixture(scope="module")
def friction_that_grows_with_the_deflection():
    hidden = hide("v", "v*x**2", -24.0)
    return hidden, ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y)


@pytest.mark.slow
@pytest.mark.core
def test_what_has_no_name_is_placed_and_described(friction_that_grows_with_the_deflection):
    _, diagnosis = friction_that_grows_with_the_deflection
    assert diagnosis.verdict_ == "unexplained"
    assert diagnosis.causes_ == ()
    part = diagnosis.discrepancy_
    assert part.target == "v"
    assert set(part.quantities) == {"x", "v"}
    assert part.effect.terms == ("v*x**2",)
    assert abs(part.effect.coefficients[0] / -24.0 - 1) < 0.03
    assert part.share > 0.7
    assert part.error < 1.05
    assert diagnosis.data_quality_ == ()


@pytest.mark.slow
@pytest.mark.core
def test_parameters_are_those_of_the_model_with_the_formula(
    friction_that_grows_with_the_deflection,
):
    hidden, diagnosis = friction_that_grows_with_the_deflection
    for name, found in diagnosis.parameters_.items():
        assert found.value == diagnosis.discrepancy_.model.parameters[name].value
        assert found.value == pytest.approx(hidden.truth.parameters[name].value, rel=0.05)


@pytest.mark.slow
def test_its_formula_mends_the_model(friction_that_grows_with_the_deflection):
    hidden, diagnosis = friction_that_grows_with_the_deflection
    mended = ModelDiagnosis(diagnosis.discrepancy_.model).fit(hidden.X, hidden.y)
    assert mended.verdict_ == "model_adequate"
    assert mended.discrepancy_ is None


@pytest.mark.core
@pytest.mark.slow
def test_it_is_said_in_json_and_survives_pickling(friction_that_grows_with_the_deflection):
    _, diagnosis = friction_that_grows_with_the_deflection
    said = json.loads(json.dumps(diagnosis.to_dict(), allow_nan=False))["unexplained"]
    assert said["target"] == "v"
    assert said["formula"].endswith("*v*x**2")
    assert pickle.loads(pickle.dumps(diagnosis)).to_dict() == diagnosis.to_dict()


@pytest.mark.core
@pytest.mark.slow
def test_the_report_shows_it(friction_that_grows_with_the_deflection, tmp_path):
    _, diagnosis = friction_that_grows_with_the_deflection
    diagnosis.to_html(tmp_path / "report.html")
    text = (tmp_path / "report.html").read_text()
    assert "lacks something that no known effect explains" in text
    assert "What no cause explains" in text


@pytest.mark.slow
def test_a_model_with_a_formula_may_miss_another_term():
    hidden = hide("v", "v*x**2", -24.0)
    first = Formula("v", ("x**2",), (0.1,))
    diagnosis = ModelDiagnosis(hidden.prior + first, catalogue=(effects.ConstantLoad,))
    diagnosis.fit(hidden.X, hidden.y)
    part = diagnosis.discrepancy_
    assert part.effect.terms == ("v*x**2",)
    assert part.effect.names() == {"c2": "c2_v"}
    assert set(part.model.parameters) == {*hidden.prior.parameters, "c1_v", "c2_v"}


@pytest.mark.slow
def test_a_bent_sensor_is_told_from_a_force():
    """By its formula, where the catalogue has no such sensor."""
    hidden = hide("position", "x**2", 0.25)
    others = [kind for kind in effects.CATALOGUE if kind is not effects.SensorCurvature]
    diagnosis = ModelDiagnosis(hidden.prior, catalogue=others).fit(hidden.X, hidden.y)
    assert diagnosis.verdict_ == "unexplained"
    assert (diagnosis.discrepancy_.target, diagnosis.discrepancy_.effect.terms) == (
        "position",
        ("x**2",),
    )


@pytest.mark.slow
def test_a_bent_sensor_is_named_and_its_interval_holds_the_curvature():
    hidden = hide("position", "x**2", 0.25)
    diagnosis = ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y)
    (cause,) = diagnosis.causes_
    assert (cause.effect, cause.target) == ("sensor_curvature", "position")
    curvature = cause.parameters["curvature"]
    assert curvature.low < 0.25 < curvature.high
    assert diagnosis.discrepancy_ is None


@pytest.mark.slow
def test_nothing_nameless_is_seen_where_a_known_effect_is_hidden():
    hidden = make_hidden_effect(
        systems.cart_on_spring(), "coulomb_friction", random_state=3, **RECORDS
    )
    diagnosis = ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y)
    assert diagnosis.discrepancy_ is None
    assert diagnosis.to_dict()["unexplained"] is None


@pytest.mark.slow
def test_two_known_causes_are_not_given_up_for_a_formula_of_as_many_numbers():
    pendulum = PhysicsModel(
        {"phi": "rad", "w": "rad/s"},
        {"phi": "w", "w": "(M - d*w - k*sin(phi))/J"},
        {"J": 0.12, "d": 0.1, "k": 2.5},
        {"M": "N m"},
        {"angle": "phi"},
        inertia={"w": "J"},
    )
    truth = (effects.QuadraticDrag("w", 0.05), effects.SensorBias("angle", -0.015))
    hidden = make_hidden_effect(pendulum, truth, amplitude=1.5, random_state=1, **RECORDS)
    catalogue = (effects.Cogging, effects.QuadraticDrag, effects.SensorBias)
    diagnosis = ModelDiagnosis(hidden.prior, catalogue=catalogue).fit(hidden.X, hidden.y)
    assert {cause.effect for cause in diagnosis.causes_} == {effect.id for effect in truth}
    assert diagnosis.discrepancy_ is None


@pytest.mark.slow
def test_a_sensor_that_sees_the_magnitude_is_named():
    cart = PhysicsModel(
        {"v": "m/s"},
        {"v": "(F - d*v)/m"},
        {"m": 2.0, "d": 1.0},
        {"F": "N"},
        {"speed": "v"},
        inertia={"v": "m"},
    )
    hidden = make_hidden_effect(cart, "sensor_rectification", random_state=0, **RECORDS)
    diagnosis = ModelDiagnosis(hidden.prior).fit(hidden.X, hidden.y)
    assert [cause.effect for cause in diagnosis.causes_] == ["sensor_rectification"]


def test_states_tell_the_time_where_all_records_are_the_same_motion():
    ball = PhysicsModel({"h": "m", "v": "m/s"}, {"h": "v", "v": "-9.81"}, outputs={"y": "h"})
    cart, told = systems.cart_on_spring(), []
    for model, starts in ((ball, [[30.0, 0.0], [31.0, 0.1], [29.0, 0.0]]), (cart, [None] * 3)):
        X, y, rng = [], [], np.random.default_rng(0)
        for i, x0 in enumerate(starts):
            t = np.arange(200) / 50.0
            u = rng.normal(size=(200, len(model.inputs)))
            y.append(model.simulate(t, u, x0=x0).y[:, 0] + 1e-3 * rng.normal(size=200))
            inputs = dict(zip(model.inputs, u.T, strict=True))
            X.append(pd.DataFrame({"trajectory": i, "t": t, **inputs}))
        records = read_records(model, pd.concat(X), np.concatenate(y))
        fitter = HypothesisFitter(build_problem(model, records))
        told.append(tells_time(fitter.problem, fitter.base()))
    assert told == [True, False]
