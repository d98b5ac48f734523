"""How a model is to be simulated belongs to it, and everything that simulates asks it."""

import pickle

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn import (
    ModelDiagnosis,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    effects,
)
from sklearn_pgnn.datasets import make_hidden_effect
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.exceptions import ModelError
from sklearn_pgnn.inspection.numbers import free_run_error
from sklearn_pgnn.simulation import simulate
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.simulation.simulate import simulate_records
from sklearn_pgnn.trajectories import read_records

SAID = {"hold": "foh", "substeps": 4}
T = np.arange(60) / 9.0
F = np.sin(0.7 * T) + np.sin(2.9 * T)
X = pd.DataFrame({"t": T, "F": F})


def oscillator(**changes):
    """A lightly damped oscillator, seen nine times a period."""
    said = {
        "states": {"x": "m", "v": "m/s"},
        "inputs": {"F": "N"},
        "parameters": {"m": 1.0, "d": 0.2, "k": 39.5},
        "equations": {"x": "v", "v": "(F - d*v - k*x)/m"},
        "outputs": {"position": "x"},
        "inertia": {"v": "m"},
    }
    return PhysicsModel(**(said | changes))


SMOOTH = oscillator(simulation=SAID)
TOLD = SMOOTH.simulate(T, F, hold="foh", substeps=4).y


# -- the model says it -----------------------------------------------------------------------------


def test_it_is_part_of_the_model(tmp_path):
    assert dict(SMOOTH.simulation) == SAID
    assert oscillator() != SMOOTH
    assert hash(SMOOTH) != hash(oscillator())
    assert SMOOTH.replace(simulation={}) == oscillator()
    assert pickle.loads(pickle.dumps(SMOOTH)) == SMOOTH
    assert PhysicsModel.from_dict(SMOOTH.to_dict()) == SMOOTH
    assert "simulation: {hold: foh, substeps: 4}\n" in SMOOTH.to_yaml(tmp_path / "model.yaml")
    assert PhysicsModel.from_yaml(tmp_path / "model.yaml") == SMOOTH


def test_effects_and_other_values_keep_it():
    extended = SMOOTH.with_parameters(d=0.3) + effects.CubicStiffness("v", stiffness=2.0)
    assert dict(extended.simulation) == SAID
    numbers = oscillator(simulation={"substeps": np.int64(4)})
    assert numbers == oscillator(simulation={"substeps": 4})


@pytest.mark.parametrize(
    ("simulation", "message"),
    [
        ({"hold": "linear"}, "simulation.hold: expected one of zoh, foh, got 'linear'."),
        ({"substeps": 0}, "simulation.substeps: expected an integer >= 1 and <= 10000, got 0."),
        ({"substeps": 2.0}, "simulation.substeps: expected an integer >= 1 and <= 10000, got 2.0."),
        (
            {"substeps": True},
            "simulation.substeps: expected an integer >= 1 and <= 10000, got True.",
        ),
        ({"step": 2}, "simulation: unknown name 'step'; expected one of hold, substeps, method."),
        ("foh", "simulation: expected names and values, got 'foh'."),
    ],
)
def test_what_it_cannot_be(simulation, message):
    with pytest.raises(ModelError) as refused:
        oscillator(simulation=simulation)
    assert str(refused.value) == message


@pytest.mark.parametrize(
    ("line", "message"),
    [
        ("{hold: linear}", "4:14: simulation.hold: expected one of zoh, foh, got 'linear'."),
        (
            "{substeps: 2.5}",
            "4:24: simulation.substeps: expected an integer >= 1, got '2.5'.",
        ),
        (
            "{hold: foh, substeps: 0}",
            "4:25: simulation.substeps: expected an integer >= 1 and <= 10000, got 0.",
        ),
        (
            "{step: 2}",
            "4:14: simulation: unknown name 'step'; expected one of hold, substeps, method.",
        ),
        ("foh", "4:13: simulation: expected names and values, got 'foh'."),
    ],
)
def test_a_model_file_says_where_it_is_wrong(line, message, tmp_path):
    file = tmp_path / "model.yaml"
    file.write_text(f'states: [x]\nequations: {{x: "u"}}\ninputs: [u]\nsimulation: {line}\n')
    with pytest.raises(ModelError) as refused:
        PhysicsModel.from_yaml(file)
    assert str(refused.value) == f"{file}:{message}"


# -- everything asks it ----------------------------------------------------------------------------


def test_a_simulation_asks_the_model_unless_it_is_told():
    held = simulate(oscillator(), T, F, substeps=1).y
    assert np.array_equal(simulate(SMOOTH, T, F).y, TOLD)
    assert np.array_equal(simulate(SMOOTH, T, F, hold="zoh", substeps=1).y, held)
    assert np.abs(TOLD - held).max() > 0.05 * np.ptp(TOLD)
    assert np.array_equal(simulate_records(SMOOTH, read_records(SMOOTH, X)), TOLD)


def test_windows_ask_the_model_unless_they_are_told():
    records = read_records(SMOOTH, X, TOLD)
    windows = window_records(SMOOTH, records).windows
    assert (windows.hold, windows.substeps) == ("foh", 4)
    windows = window_records(SMOOTH, records, hold="zoh", substeps=2).windows
    assert (windows.hold, windows.substeps) == ("zoh", 2)


def test_transformer_and_regressors_ask_the_model_unless_they_are_told():
    transformer = PhysicsModelTransformer(SMOOTH, outputs=["position"], append=False)
    assert np.array_equal(transformer.fit_transform(X), TOLD)
    told = PhysicsModelTransformer(SMOOTH, append=False, hold="zoh", substeps=2).fit(X)
    assert (told.hold_, told.substeps_) == ("zoh", 2)
    residual = ResidualRegressor(SMOOTH).fit(X, TOLD)
    assert (residual.hold_, residual.substeps_) == ("foh", 4)
    assert residual.predict(X) == pytest.approx(TOLD, abs=1e-9)
    fitted = PhysicsModelRegressor(SMOOTH.with_parameters(k=39.0), free=["k"]).fit(X, TOLD)
    assert fitted.parameters_["k"].value == pytest.approx(39.5, rel=1e-4)
    assert dict(fitted.model_.simulation) == SAID


def test_a_fitted_model_carries_how_it_was_fitted():
    prior = oscillator().with_parameters(k=39.0)
    fitted = PhysicsModelRegressor(prior, free=["k"], hold="foh", substeps=4).fit(X, TOLD)
    assert dict(fitted.model_.simulation) == SAID
    assert fitted.model_.simulate(T, F).y == pytest.approx(fitted.predict(X))


def test_sparse_equations_carry_how_they_were_identified():
    pytest.importorskip("pysindy")
    from sklearn_pgnn import SINDYcRegressor

    t = np.arange(3000) / 200
    force = np.sin(2 * t) + np.sin(5.1 * t)
    table = pd.DataFrame({"t": t, "F": force})
    y = SMOOTH.simulate(t, force).y
    fitted = SINDYcRegressor(SMOOTH, library="model").fit(table, y)
    assert (fitted.hold_, fitted.substeps_) == ("foh", 4)
    assert dict(fitted.model_.simulation) == SAID
    assert fitted.model_.simulate(t, force).y == pytest.approx(fitted.predict(table))
    stepwise = SINDYcRegressor(SMOOTH, library="model", discrete=True).fit(table, y)
    assert stepwise.model_.simulation["substeps"] == 1


def test_a_network_asks_the_model_unless_it_is_told():
    pytest.importorskip("skorch")
    from sklearn_pgnn import PGNNLRegressor

    options = {"max_epochs": 1, "rollout_epochs": 0, "refine": None, "random_state": 0}
    trained = PGNNLRegressor(SMOOTH, **options).fit(X, TOLD)
    assert (trained.hold_, trained.substeps_) == ("foh", 4)
    assert (trained.step_.hold, trained.step_.substeps) == ("foh", 4)
    told = PGNNLRegressor(SMOOTH, hold="zoh", substeps=2, **options).fit(X, TOLD)
    assert (told.step_.hold, told.step_.substeps) == ("zoh", 2)


def test_the_integrator_behind_hidden_effects_asks_the_model():
    fine = simulate(SMOOTH, T, F, substeps=32).y[:, 0]
    _, y = integrate(SMOOTH, T, F[None, :, None], substeps=16)
    assert y[0, :, 0] == pytest.approx(fine, abs=1e-5)
    late = SMOOTH + effects.InputDelay("F", delay=0.23)
    _, y = integrate(late, T, F[None, :, None], substeps=64)
    assert y[0, :, 0] == pytest.approx(simulate(late, T, F, substeps=64).y[:, 0], abs=1e-3)


def test_hidden_effects_are_hidden_as_the_model_says():
    options = {"n_records": 1, "duration": 5, "sample_rate": 9, "noise": 0.0, "random_state": 0}
    hidden = make_hidden_effect(SMOOTH, None, parameter_error=0.0, **options)
    assert dict(hidden.prior.simulation) == SAID
    y = simulate(hidden.prior, hidden.X["t"], hidden.X["F"]).y
    assert y == pytest.approx(hidden.y.to_numpy(), abs=2e-2 * np.ptp(y))


def test_a_free_run_that_leaves_the_finite_numbers_has_words():
    assert free_run_error(float("inf")) == "diverges"


# -- states that start settled ---------------------------------------------------------------------


def cart(speed="v"):
    """A user's cart, whose own velocity may have a name that ends like an actuator's state."""
    return PhysicsModel(
        states={"x": "m", speed: "m/s"},
        inputs={"F": "N"},
        parameters={"m": 1.0, "d": 2.0, "k": 40.0},
        equations={"x": speed, speed: f"(F - d*{speed} - k*x)/m"},
        inertia={speed: "m"},
    )


def test_a_state_of_ones_own_is_no_actuators_whatever_its_name():
    table = X.assign(F=F + 3.0)
    mine, plain = cart("F_lagged"), cart()
    expected = plain.simulate(T, table["F"]).y
    for simulated in (
        mine.simulate(T, table["F"]).y,
        simulate_records(mine, read_records(mine, table)),
        PhysicsModelTransformer(mine, append=False, substeps=1).fit_transform(table).to_numpy(),
        integrate(mine, T, table["F"].to_numpy()[None, :, None], substeps=20)[1][0],
    ):
        assert simulated == pytest.approx(expected, abs=2e-2)
        assert simulated[0, 1] == 0.0
    states = [
        window_records(m, read_records(m, table, expected[:, :1])).states.estimate(m).x
        for m in (mine.replace(outputs={"y": "x"}), plain.replace(outputs={"y": "x"}))
    ]
    assert np.array_equal(*states)


@pytest.mark.parametrize(
    "effect",
    [
        effects.ActuatorLag("F", 0.3),
        effects.InputRateLimit("F", 5.0, 0.1),
        effects.InputBacklash("F", 0.2, 0.1),
    ],
    ids=lambda effect: effect.id,
)
def test_an_actuators_own_state_starts_settled_and_stays_so_in_files(effect, tmp_path):
    model = cart() + effect
    (state,) = model.settled
    assert model.settled[state] == "F"
    model.to_yaml(tmp_path / "model.yaml")
    read = PhysicsModel.from_yaml(tmp_path / "model.yaml")
    assert read == model
    assert read.simulate(T, F + 3.0).x[0].tolist() == [0.0, 0.0, F[0] + 3.0]
    assert np.array_equal(
        simulate_records(read, read_records(cart(), X.assign(F=F + 3.0))),
        read.simulate(T, F + 3.0).y,
    )
    assert effect.id not in {
        kind.id for kind in effects.CATALOGUE if "F" in kind.targets(read) and kind is type(effect)
    }


def test_an_actuators_state_finds_a_name_beside_ones_own():
    mine = cart("F_lagged") + effects.ActuatorLag("F", 0.3)
    plain = cart() + effects.ActuatorLag("F", 0.3)
    assert tuple(mine.states) == ("x", "F_lagged", "F_lagged_2")
    assert dict(mine.settled) == {"F_lagged_2": "F"}
    assert np.array_equal(mine.simulate(T, F).x, plain.simulate(T, F).x)
    assert effects.ActuatorLag.targets(cart("F_lagged")) == ("F",)
    assert effects.ActuatorLag.targets(mine) == ()


@pytest.mark.slow
def test_the_name_of_a_state_changes_neither_verdict_nor_numbers():
    t = np.arange(1500) / 50
    force = 3.0 + 4 * np.sin(1.3 * t) + 3 * np.sin(3.7 * t) + 2 * np.sin(9.1 * t)
    rig = cart() + effects.ActuatorLag("F", 0.15)
    y = rig.simulate(t, force, substeps=4).y[:, 0]
    y += 1e-3 * np.random.default_rng(0).standard_normal(t.size)
    catalogue = [effects.ActuatorLag, effects.InputGain]
    mine, plain = (
        ModelDiagnosis(model.replace(outputs={"y": "x"}), catalogue=catalogue).fit(
            np.c_[t, force], y
        )
        for model in (cart("F_lagged"), cart())
    )
    assert [(c.effect, c.target) for c in plain.causes_] == [("actuator_lag", "F")]
    assert mine.verdict_ == plain.verdict_
    assert mine.causes_ == plain.causes_
    assert mine.gain_ == plain.gain_
    assert mine.free_run_ == plain.free_run_


@pytest.mark.parametrize(
    ("settled", "message"),
    [
        (
            {"x": "u"},
            "settled: 'x' expects an input, or a state that is not settled itself, got 'u'.",
        ),
        ({"y": "F"}, "settled: unknown name 'y'; expected one of x, v."),
    ],
)
def test_what_settles_is_a_state_at_an_input(settled, message):
    with pytest.raises(ModelError) as refused:
        cart().replace(settled=settled)
    assert str(refused.value) == message


def test_a_stepper_starts_settled_unless_it_is_told():
    pytest.importorskip("skorch")
    from sklearn_pgnn import PGNNLRegressor

    model = oscillator() + effects.ActuatorLag("F", 0.3)
    options = {"max_epochs": 1, "rollout_epochs": 0, "refine": None, "random_state": 0}
    table = X.assign(F=F + 3.0)
    trained = PGNNLRegressor(model, **options).fit(table, model.simulate(T, F + 3.0).y)
    steps = trained.stepper()
    stepped = [steps.output(table["F"][0])]
    for now, after in zip(table["F"][:20], table["F"][1:21], strict=True):
        steps.step(now)
        stepped.append(steps.output(after))
    assert np.concatenate(stepped) == pytest.approx(trained.predict(table)[:21].ravel(), abs=1e-6)
    assert trained.stepper([0.1, 0.0, 1.0]).output(5.0) == pytest.approx([0.1])
