"""The rigs and their hidden effects, judged by the laws they must keep."""

import ast
import re
import sys
from functools import cache
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from blocked import run_without
from rubbing_machines import cart_pendulum, stacked_blocks, two_link_arm
from scipy.integrate import solve_ivp
from scipy.io import savemat
from snippets import ROOT, blocked, read_page

import sklearn_pgnn.datasets
from sklearn_pgnn import PhysicsModelRegressor
from sklearn_pgnn.datasets import (
    golf_robot_plant,
    load_cascaded_tanks,
    load_coupled_drives,
    load_emps,
    load_silverbox,
    make_cart,
    make_golf_robot,
    make_hidden_effect,
    make_servo_valve,
    make_two_tanks,
    servo_valve_plant,
)
from sklearn_pgnn.datasets.excitation import EXCITATIONS
from sklearn_pgnn.datasets.integrator import integrate
from sklearn_pgnn.physics import PhysicsModel, effects, systems


def oven():
    """Return an oven in a room whose temperature is recorded."""
    return PhysicsModel(
        {"T": "K"},
        {"T": "(P - k*T)/C"},
        {"C": 2.0, "k": 0.5},
        {"P": "W", "T_room": "K"},
        name="oven",
    )


def shaft():
    """Return two inertias on a shaft."""
    return PhysicsModel(
        {"a": "rad", "b": "rad", "v": "rad/s", "w": "rad/s"},
        {"a": "v", "b": "w", "v": "(u - d*v - k*(a - b))/J", "w": "(k*(a - b) - d*w)/J"},
        {"J": 0.01, "k": 3.0, "d": 0.02},
        {"u": "N m"},
        inertia={"v": "J", "w": "J"},
        name="shaft",
    )


def kiln():
    """Return a body that loses heat to a room whose temperature is recorded."""
    return PhysicsModel(
        {"T": "degC"},
        {"T": "(P + k*(T_room - T))/C"},
        {"C": 2.0, "k": 0.5},
        {"P": "W", "T_room": "degC"},
        name="kiln",
    )


def cell():
    """Return a cell whose voltage shows its charge, and its current at once."""
    return PhysicsModel(
        {"z": ""},
        {"z": "(I - k*z)/Q"},
        {"Q": 5.0, "k": 0.5, "R0": 0.2, "c": 1.0},
        {"I": "A"},
        {"V": "c*z + R0*I"},
        name="cell",
    )


SYSTEMS = {"golf": systems.golf_robot, "cart": systems.cart_on_spring, "tanks": systems.two_tanks}
#: short records of every system, for what does not need long ones
SHORT = {
    "golf": {"n_records": 3, "duration": 4.0, "sample_rate": 200.0},
    "cart": {"n_records": 3, "duration": 4.0, "sample_rate": 200.0},
    "tanks": {"n_records": 3, "duration": 1000.0, "sample_rate": 0.2, "noise": 0.01},
    "oven": {"n_records": 3, "duration": 20.0, "sample_rate": 20.0},
    "shaft": {"n_records": 3, "duration": 4.0, "sample_rate": 200.0},
    "kiln": {"n_records": 3, "duration": 20.0, "sample_rate": 20.0},
    "cell": {"n_records": 3, "duration": 20.0, "sample_rate": 20.0},
}
#: systems that effects are hidden in
HOSTS = {**SYSTEMS, "oven": oven, "shaft": shaft, "kiln": kiln, "cell": cell}
#: every effect on the first system that it may act on and that shows it: the golf robot's damping
#: is too small to show that it changes, and what is behind the upper tank is hidden
HIDEABLE = [
    next((system, kind.id) for system, model in HOSTS.items() if kind.targets(model()))
    for kind in effects.CATALOGUE
    if kind not in (effects.ParameterSlope, effects.RadiationLoss, effects.SecondStore)
] + [("oven", "parameter_slope"), ("kiln", "radiation_loss"), ("kiln", "second_store")]


def pendulum(**parameters):
    """Return the golf robot without dry friction."""
    return systems.golf_robot().with_parameters(mu=0.0, **parameters)


def sliding_block(level=0.5):
    """Return a block of 2 kg on a dry surface."""
    block = PhysicsModel(
        {"x": "m", "v": "m/s"}, {"x": "v", "v": "F/m"}, {"m": 2.0}, {"F": "N"}, inertia={"v": "m"}
    )
    return block + effects.CoulombFriction("v", level=level)


def lag(delay=None):
    """Return a first-order lag with a delayed input."""
    model = PhysicsModel({"x": "V"}, {"x": "(u - x)/T"}, {"T": 0.5}, {"u": "V"})
    return model if delay is None else model + effects.InputDelay("u", delay=delay)


#: the equations once more, written by hand
BY_HAND = {
    "golf": lambda x, u, p: [
        x[1],
        (-p["m"] * p["g"] * p["a"] * np.sin(x[0]) - p["d"] * x[1] + 4 * u) / p["J"],
    ],
    "cart": lambda x, u, p: [x[1], (u - p["k"] * x[0] - p["d"] * x[1]) / p["m"]],
    "tanks": lambda x, u, p: [
        p["k4"] * u - p["k1"] * np.sqrt(x[0]),
        p["k2"] * np.sqrt(x[0]) - p["k3"] * np.sqrt(x[1]),
    ],
}


def by_scipy(rates, t, u, x0, **options):
    """Simulate one record with SciPy's solver, interval by interval."""
    options = {"rtol": 1e-9, "atol": 1e-11, **options}
    states = [np.asarray(x0, dtype=float)]
    for k in range(t.size - 1):
        solved = solve_ivp(lambda _, x, held: rates(x, held), t[k : k + 2], states[-1],
                           args=(u[k],), **options)  # fmt: skip
        states.append(solved.y[:, -1])
    return np.array(states)


def values(model):
    """Return the parameters as plain numbers."""
    return {name: p.value for name, p in model.parameters.items()}


def records(X):
    """Return the row numbers of every trajectory."""
    return list(X.groupby("trajectory").indices.values())


# -- the integrator ------------------------------------------------------------------------------


def test_the_method_is_of_fourth_order():
    t = np.linspace(0, 3, 16)
    u = 0.1 * np.sin(np.arange(16.0))[None, :, None]
    exact = integrate(pendulum(), t, u, substeps=64)[1]
    errors = [np.abs(integrate(pendulum(), t, u, substeps=n)[1] - exact).max() for n in (2, 4)]
    assert 12 < errors[0] / errors[1] < 20


@pytest.mark.slow
@pytest.mark.parametrize(
    "friction",
    [
        effects.CoulombFriction("omega", level=0.05),
        effects.StribeckFriction("omega", level=0.03, peak=0.1, velocity=0.1),
        effects.AsymmetricFriction("omega", 0.06, 0.03, 0.02, 0.01),
    ],
)
def test_finer_steps_agree_through_stick_and_slip(friction):
    truth = systems.golf_robot() + friction
    t = np.arange(1000) / 200
    u = 0.2 * np.sin(2 * np.pi * np.outer([0.3, 0.5, 1.1], t))[..., None]
    y, finer = (integrate(truth, t, u, substeps=n)[1] for n in (2, 20))
    assert np.abs(y - finer).max() < 1e-5 * np.ptp(y)


@pytest.mark.slow
def test_without_friction_the_energy_stays():
    model = pendulum(d=0.0)
    t = np.arange(2000) / 100
    (x,), _ = integrate(model, t, None, [[1.4, 0.0]], substeps=10)
    p = values(model)
    energy = p["J"] * x[:, 1] ** 2 / 2 + p["m"] * p["g"] * p["a"] * (1 - np.cos(x[:, 0]))
    assert np.ptp(energy) < 1e-8 * energy[0]


def test_a_sliding_block_stops_where_the_law_says_and_stays():
    t = np.linspace(0, 10, 41)
    (x,), _ = integrate(sliding_block(level=0.5), t, np.zeros((1, 41, 1)), [[0.0, 1.0]])
    slides = t < 4.0
    np.testing.assert_allclose(x[slides, 1], 1 - 0.25 * t[slides], atol=1e-12)
    np.testing.assert_allclose(x[t >= 4.0], np.broadcast_to([2.0, 0.0], (25, 2)), atol=1e-12)


def test_a_block_that_leaves_rest_and_stops_within_a_step_comes_to_rest():
    level, start = 0.5, 1.0
    push = effects.PeriodicDisturbance("v", sine=0.0, cosine=-level - 1e-6, frequency=1.0)
    t = start + np.arange(100) / 100
    (x,), _ = integrate(sliding_block(level) + push, t, np.zeros((1, 100, 1)), [[0.0, 0.0]])
    assert np.isfinite(x).all()
    assert np.abs(x[t < 1.4, 1]).max() < 1e-6


def test_blocks_come_to_rest_one_on_the_other_and_then_on_the_ground():
    t = np.arange(0, 4, 0.013)
    model = stacked_blocks(F=0.6, G=0.4)
    model = model.replace(outputs={"a": model.equations["v1"]})
    (x,), (a,) = integrate(model, t, np.zeros((1, t.size, 1)), [[2.0, 0.5]])
    meet = 1.5 / 0.7  # apart: -0.6 and (0.6 - 0.4)/2 m/s^2, then together -0.4/3
    together = np.maximum(2 - 0.6 * meet - 0.4 / 3 * (t - meet), 0)
    expected = np.where(t < meet, [2 - 0.6 * t, 0.5 + 0.1 * t], together)
    np.testing.assert_allclose(x.T, expected, atol=1e-9)
    slowing = np.where(t < meet, -0.6, np.where(together > 0, -0.4 / 3, 0.0))
    np.testing.assert_allclose(a[:, 0], slowing, atol=1e-9)


@pytest.mark.parametrize("machine", [cart_pendulum, two_link_arm])
def test_frictions_that_act_on_each_other_agree_with_the_simulation(machine):
    t = np.arange(0, 3, 0.01)
    model = machine()
    u = 1.2 * np.sin(2.0 * t)[:, None] * np.arange(1, len(model.inputs) + 1)
    x0 = [0.0, 0.2, 0.0, 0.0]
    ((x,), _), run = integrate(model, t, u[None], [x0]), model.simulate(t, u, x0, substeps=4)
    assert np.any(x[1:] == 0)
    np.testing.assert_allclose(x, run.x, atol=1e-4)


@pytest.mark.slow
def test_a_stuck_club_stays_until_the_torque_breaks_it_away():
    t = np.arange(3000) / 500
    p = values(systems.golf_robot())
    level = p["r"] * p["mu"] * p["m"] * p["g"] / 4
    u = np.stack([np.full(3000, 0.99 * level), np.full(3000, 1.01 * level)])[..., None]
    (below, above), _ = integrate(systems.golf_robot(), t, u)
    assert (below == 0).all()
    assert above[-1, 0] > 1e-3


def test_dry_friction_agrees_with_a_steep_smooth_one_in_a_stiff_solver():
    model = systems.golf_robot()
    p = values(model)
    t = np.arange(200) / 100
    u = 0.3 * np.sin(2 * np.pi * 0.9 * t)

    def rates(x, held):
        load = max(p["m"] * p["a"] * x[1] ** 2 + p["m"] * p["g"] * np.cos(x[0]), 0)
        friction = p["r"] * p["mu"] * np.tanh(x[1] / 1e-6) * load
        smooth = BY_HAND["golf"](x, held, p)
        return [smooth[0], smooth[1] - friction / p["J"]]

    expected = by_scipy(rates, t, u, [0, 0], method="Radau", rtol=1e-7, atol=1e-9)
    (x,), _ = integrate(model, t, u[None, :, None])
    np.testing.assert_allclose(x[:, 0], expected[:, 0], atol=2e-5)


@pytest.mark.parametrize("samples", [1, 7])
def test_a_delay_of_whole_samples_shifts_exactly(samples):
    t = np.arange(200) * 0.05
    u = np.random.RandomState(0).standard_normal((2, 200, 1))
    late = integrate(lag(samples * 0.05), t, u)[1]
    shifted = np.concatenate([np.repeat(u[:, :1], samples, axis=1), u[:, :-samples]], axis=1)
    np.testing.assert_allclose(late, integrate(lag(), t, shifted)[1], atol=1e-14)


def test_a_delay_between_samples_shifts_in_time():
    t = np.arange(100) * 0.05
    u = np.where(t >= 0.5, 1.0, 0.0)[None, :, None]
    y = integrate(lag(0.123), t, u)[1][0, :, 0]
    after = np.maximum(t - 0.5 - 0.123, 0)
    np.testing.assert_allclose(y, 1 - np.exp(-after / 0.5), atol=1e-8)


def test_a_record_on_its_own_is_the_record_among_others():
    t = np.arange(500) / 100
    u = 0.2 * np.random.RandomState(0).standard_normal((4, 500, 1))
    together = integrate(systems.golf_robot(), t, u)[1]
    alone = integrate(systems.golf_robot(), t, u[2:3])[1]
    np.testing.assert_allclose(together[2:3], alone, atol=1e-12)


def test_the_rigs_import_nothing_of_what_they_test():
    folder = Path(sklearn_pgnn.datasets.__file__).parent
    for file in folder.glob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            names = [a.name for a in node.names] if isinstance(node, ast.Import) else []
            names += [node.module] if isinstance(node, ast.ImportFrom) else []
            for name in names:
                assert not name.startswith(("sklearn_pgnn.simulation", "numba")), file.name


# -- hidden effects ------------------------------------------------------------------------------


@pytest.mark.parametrize("system", SYSTEMS)
def test_with_nothing_hidden_the_records_are_those_of_the_model(system):
    model = pendulum() if system == "golf" else SYSTEMS[system]()
    options = {**SHORT[system], "noise": 0.0, "parameter_error": 0.0, "n_records": 1}
    hidden = make_hidden_effect(model, random_state=0, **options)
    assert hidden.truth == hidden.prior == model
    X = hidden.X
    x0, u = X[list(model.states)].iloc[0], X[list(model.inputs)].to_numpy()[:, 0]
    p = values(model)
    x = by_scipy(lambda x, held: BY_HAND[system](x, held, p), X["t"].to_numpy(), u, x0)
    measured = x[:, 1] if system == "tanks" else x[:, 0]
    np.testing.assert_allclose(hidden.y.to_numpy()[:, 0], measured, atol=1e-6)


@cache
def nothing_hidden(system):
    """Return the records of a system that hides nothing; nobody may change them."""
    return make_hidden_effect(HOSTS[system](), None, random_state=1, **SHORT[system])


@pytest.mark.slow
@pytest.mark.parametrize(("system", "kind"), HIDEABLE)
def test_every_effect_of_the_catalogue_can_be_hidden(system, kind):
    model, options = HOSTS[system](), SHORT[system]
    hidden = make_hidden_effect(model, kind, random_state=1, **options)
    assert hidden.effect.id == kind
    assert hidden.truth == model + hidden.effect
    assert np.isfinite(hidden.y.to_numpy()).all()
    assert list(hidden.X.columns) == ["trajectory", "t", *model.inputs, *model.states]
    if system == "golf":
        assert hidden.y.abs().to_numpy().max() < 1.5
    change = np.sqrt(np.mean((hidden.y - nothing_hidden(system).y).to_numpy() ** 2))
    assert change > 3 * options.get("noise", 1e-3)


@pytest.mark.slow
def test_a_seed_gives_the_same_records_and_another_seed_others():
    one, same, other = (
        make_hidden_effect(effect="random", random_state=seed, **SHORT["golf"])
        for seed in (4, 4, 5)
    )
    pd.testing.assert_frame_equal(one.X, same.X)
    pd.testing.assert_frame_equal(one.y, same.y)
    assert one.effect == same.effect
    assert one.prior == same.prior
    assert not one.y.equals(other.y)


@pytest.mark.parametrize("seed", range(5))
def test_the_prior_is_off_within_the_error_and_never_right(seed):
    hidden = make_hidden_effect(random_state=seed, n_records=1, duration=1.0, sample_rate=100.0)
    truth, prior = values(hidden.truth), values(hidden.prior)
    for name in hidden.prior.free_parameters:
        assert 0 < abs(prior[name] / truth[name] - 1) <= 0.07
    assert prior["g"] == truth["g"]


def test_states_are_known_at_the_start_only():
    X = make_hidden_effect(random_state=0, **SHORT["golf"]).X
    for rows in records(X):
        states = X[["phi", "omega"]].iloc[rows]
        assert states.iloc[0].notna().all()
        assert states.iloc[1:].isna().all(axis=None)
        assert X["t"].iloc[rows].is_monotonic_increasing


def test_an_effect_is_hidden_as_it_is_given():
    effect = effects.InputBias("torque", bias=0.02)
    hidden = make_hidden_effect(effect=effect, random_state=0, **SHORT["golf"])
    assert hidden.effect is effect
    assert hidden.truth.parameters["bu_torque"].value == 0.02


@pytest.mark.slow
def test_several_effects_are_hidden_one_after_the_other():
    bias = effects.InputBias("torque", bias=0.02)
    hidden = make_hidden_effect(effect=[bias, "cubic_stiffness"], random_state=0, **SHORT["golf"])
    assert hidden.effect is bias
    assert [effect.id for effect in hidden.effects] == ["input_bias", "cubic_stiffness"]
    assert hidden.truth == systems.golf_robot() + bias + hidden.effects[1]


@pytest.mark.slow
def test_the_noise_is_as_large_as_asked():
    options = {**SHORT["golf"], "random_state": 0}
    quiet, noisy = (make_hidden_effect(noise=level, **options).y for level in (0.0, 0.02))
    assert (noisy - quiet).to_numpy().std() == pytest.approx(0.02, rel=0.05)


@pytest.mark.parametrize("kind", EXCITATIONS)
def test_an_excitation_keeps_to_the_amplitude(kind):
    hidden = make_hidden_effect(
        systems.two_tanks(), excitation=kind, amplitude=2.0, random_state=0, **SHORT["tanks"]
    )
    assert hidden.X["pump"].between(1 - 1e-9, 5 + 1e-9).all()
    assert (hidden.X["pump"] - 3).abs().max() == pytest.approx(2.0, rel=0.01)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"effect": "gremlins"}, "effect: expected .*coulomb_friction.* got 'gremlins'"),
        ({"excitation": "noise"}, "excitation: expected .*chirp.* got"),
        ({"noise": -1.0}, "noise: expected a number >= 0"),
        ({"noise": {"omega": 1.0}}, "noise: expected .*phi_measured"),
        ({"parameter_error": 1.0}, r"parameter_error: expected a number in \[0, 1\)"),
        ({"n_records": 0}, "n_records: expected a number > 0"),
    ],
)
def test_what_makes_no_records_is_refused(options, said):
    with pytest.raises(ValueError, match=said):
        make_hidden_effect(random_state=0, **{**SHORT["golf"], **options})


def test_a_machine_that_runs_away_is_refused():
    cart, runaway = systems.cart_on_spring(), effects.LinearStiffness("v", stiffness=-1e5)
    with pytest.raises(ValueError, match=r"record 0 becomes non-finite .* a smaller effect"):
        make_hidden_effect(cart, runaway, n_records=2, duration=5.0, amplitude=1.0)


# -- ready rigs ----------------------------------------------------------------------------------


@pytest.mark.slow
def test_golf_robot_records():
    X, y = make_golf_robot(n_records=3, duration=3.0)
    assert len(records(X)) == 3
    assert np.diff(X["t"].iloc[:3000]) == pytest.approx(1e-3)
    assert 0.3 < y["phi_measured"].abs().max() < 1.5
    X_ref, y_ref = make_golf_robot(duration=3.0, reference=True)
    assert len(records(X_ref)) == 1
    assert not np.allclose(y_ref, y.iloc[:3000])


@pytest.mark.slow
def test_the_golf_robot_plant_sticks_and_then_slips():
    p = values(systems.golf_robot())
    sliding = p["r"] * p["mu"] * p["m"] * p["g"] * 1.02 / 4
    t = np.arange(2000) / 500
    ramp = np.minimum(t / 2.0, 1.0)
    u = np.stack([1.2 * sliding * ramp, 1.6 * sliding * ramp])[..., None]
    (below, above), _ = integrate(golf_robot_plant(), t, u, substeps=8)
    yields = -1.5 * p["r"] * p["mu"] / 40.0 * np.log(1 - 1.2 / 1.5)
    assert below[-1, 0] == pytest.approx(yields, rel=0.1)
    assert above[-1, 0] > 3 * yields


def test_servo_valve_records():
    X, y = make_servo_valve()
    assert len(records(X)) == 10
    assert X["voltage"].abs().max() <= 10
    assert y["y_measured"].abs().max() < 1.0


def test_the_servo_valve_plant_is_limited():
    t = np.arange(200) / 2000
    u = np.stack([np.full(200, 10.0), np.full(200, -10.0)])[..., None]
    _, y = integrate(servo_valve_plant(), t, u, substeps=20)
    assert np.diff(y[..., 0], axis=1).max() <= 200 / 2000 + 1e-9
    assert np.diff(y[..., 0], axis=1).min() >= -185 / 2000 - 1e-9
    assert np.abs(y).max() < 1.0
    assert y[0, -1, 0] > -y[1, -1, 0]


def test_the_pump_of_the_tanks_passes_through_its_dead_zone():
    tanks = make_two_tanks()
    assert tanks.effect == effects.InputDeadZone("pump", threshold=0.8)
    assert tanks.X["pump"].min() < 0.4
    u = tanks.X["pump"].to_numpy().reshape(4, -1, 1)
    x, _ = integrate(tanks.truth, np.arange(600.0), u)
    assert x.min() > 0.1


def test_the_cart_hides_what_is_asked():
    assert make_cart(n_records=1, duration=2.0, effect=None).effect is None
    assert make_cart(n_records=1, duration=2.0, effect="cogging").effect.id == "cogging"


# -- loaders of public benchmarks, on small files in the benchmarks' own format --------------------

RNG = np.random.default_rng(0)
EMPS = {
    name: {key: RNG.normal(size=(n, 1)) for key in ("vir", "qm", "qg")}
    | {"t": 1e-3 * np.arange(n)[:, None]}
    for name, n in (("DATA_EMPS.mat", 60), ("DATA_EMPS_PULSES.mat", 50))
}
TANKS = {key: RNG.normal(size=(70, 1)) for key in ("uEst", "yEst", "uVal", "yVal")} | {"Ts": 4.0}
SILVERBOX = {key: RNG.normal(size=(1, 127_500)) for key in ("V1", "V2")}
DRIVES = {key: RNG.normal(size=(500, 1)) for key in ("u11", "z11", "u12", "z12")}
LOADERS = [load_emps, load_cascaded_tanks, load_coupled_drives, load_silverbox]


@pytest.fixture
def home(tmp_path):
    """Lay the files where `nonlinear_benchmarks` keeps them."""
    places = {
        "EMPS": EMPS,
        "Cascaded_Tanks/CascadedTanksFiles": {"dataBenchmark.mat": TANKS},
        "CED": {"DATAUNIF.MAT": DRIVES},
        "Silverbox/SilverboxFiles": {"SNLS80mV.mat": SILVERBOX},
    }
    for folder, files in places.items():
        (tmp_path / folder).mkdir(parents=True)
        for name, variables in files.items():
            savemat(tmp_path / folder / name, variables, appendmat=False)
    # the package takes files for downloaded where it sees the archive they came in
    for archive in (
        "EMPS/EMPS.zip",
        "Cascaded_Tanks/CascadedTanksFiles.zip",
        "CED/FULLTEXT01.zip",
        "Silverbox/SilverboxFiles.zip",
    ):
        (tmp_path / archive).touch()
    return tmp_path


def test_emps_is_in_newtons_and_metres(home):
    emps = load_emps(data_home=home)
    np.testing.assert_allclose(
        emps.X_train["force"], 35.15065188 * EMPS["DATA_EMPS.mat"]["vir"].T[0]
    )
    np.testing.assert_array_equal(emps.y_train["position"], EMPS["DATA_EMPS.mat"]["qm"][:, 0])
    test = EMPS["DATA_EMPS_PULSES.mat"]
    np.testing.assert_array_equal(emps.X_test["t"], test["t"][:, 0])
    np.testing.assert_allclose(emps.X_test["force"], 35.15065188 * test["vir"][:, 0])
    np.testing.assert_array_equal(emps.y_test["position"], test["qm"][:, 0])


def test_tanks_have_a_file_for_both_records(home):
    tanks = load_cascaded_tanks(data_home=home)
    for X, y, name in (
        (tanks.X_train, tanks.y_train, "Est"),
        (tanks.X_test, tanks.y_test, "Val"),
    ):
        np.testing.assert_array_equal(X["t"], 4.0 * np.arange(70))
        np.testing.assert_array_equal(X["pump"], TANKS[f"u{name}"][:, 0])
        np.testing.assert_array_equal(y["level"], TANKS[f"y{name}"][:, 0])


def test_the_silverbox_is_learned_from_multisines_and_judged_beyond_them(home):
    box = load_silverbox(data_home=home)
    u, y = SILVERBOX["V1"][0], SILVERBOX["V2"][0]
    np.testing.assert_array_equal(box.X_train["drive"], u[40_650 : 40_650 + 65_062])
    for name, rows in {
        "multisine": slice(40_650 + 65_062, 127_400),
        "arrow": slice(100, 40_575),
        "arrow_within": slice(100, 32_100),
    }.items():
        mine = (box.X_test["trajectory"] == name).to_numpy()
        np.testing.assert_array_equal(box.X_test["drive"][mine], u[rows])
        np.testing.assert_array_equal(box.y_test["response"][mine], y[rows])


def test_nobody_claims_to_know_the_flows_of_the_tanks(home):
    prior = load_cascaded_tanks(data_home=home).prior
    assert {parameter.spread for parameter in prior.parameters.values()} == {np.inf}


def test_the_drives_test_goes_on_where_training_ends(home):
    drives = load_coupled_drives(data_home=home)
    for X, y, rows in (
        (drives.X_train, drives.y_train, slice(0, 400)),
        (drives.X_test, drives.y_test, slice(400, 500)),
    ):
        for name, u, z in (("low", "u11", "z11"), ("high", "u12", "z12")):
            mine = (X["trajectory"] == name).to_numpy()
            np.testing.assert_allclose(X["t"][mine], 0.02 * np.arange(500)[rows])
            np.testing.assert_array_equal(X["voltage"][mine], DRIVES[u][rows, 0])
            np.testing.assert_array_equal(y["pulses"][mine], DRIVES[z][rows, 0])


@pytest.mark.parametrize(
    ("name", "load", "gain"),
    [
        ("EMPS", load_emps, 35.15065188),
        ("Cascaded_Tanks", load_cascaded_tanks, 1.0),
        ("CED", load_coupled_drives, 1.0),
        ("Silverbox", load_silverbox, 1.0),
    ],
)
def test_records_splits_and_windows_are_those_of_the_package(home, name, load, gain):
    package = pytest.importorskip("nonlinear_benchmarks")
    theirs = getattr(package, name)(dir_placement=home, always_return_tuples_of_datasets=True)
    ours = load(data_home=home)
    for X, y, records in (
        (ours.X_train, ours.y_train, theirs[0]),
        (ours.X_test, ours.y_test, theirs[1]),
    ):
        assert X["trajectory"].nunique() == len(records)
        u, z = (np.concatenate([getattr(r, key) for r in records]) for key in "uy")
        np.testing.assert_allclose(X.iloc[:, 2], gain * u)
        np.testing.assert_array_equal(y.iloc[:, 0], z)
        assert X["t"].diff()[1] == pytest.approx(records[0].sampling_time)
    assert {r.state_initialization_window_length for r in theirs[1]} == {ours.initial_window}


def test_files_may_lie_in_the_folder_itself(home):
    assert len(load_emps(data_home=home / "EMPS").X_test) == 50


@pytest.mark.parametrize("load", LOADERS)
def test_a_missing_file_is_named_with_its_folder(load, tmp_path):
    with pytest.raises(
        FileNotFoundError, match=rf"expected \w+\.(mat|MAT) in {re.escape(str(tmp_path))}.*Remedy"
    ):
        load(data_home=tmp_path)


def test_a_strange_file_is_refused(tmp_path):
    savemat(tmp_path / "dataBenchmark.mat", {"Ts": 4.0, "uEst": np.ones((5, 1))})
    with pytest.raises(ValueError, match=r"'yEst' is missing.*Remedy"):
        load_cascaded_tanks(data_home=tmp_path)


def test_without_folder_and_package_the_remedy_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "nonlinear_benchmarks", None)
    with pytest.raises(ImportError, match=r"sklearn-pgnn\[benchmarks\]"):
        load_emps()


@pytest.mark.slow
def test_the_snippet_of_the_documentation_runs(home, tmp_path):
    (snippet,) = read_page(ROOT / "docs" / "public_benchmarks.rst")
    assert snippet.needs == {"benchmarks"}
    assert "load_emps()" in snippet.code
    program = snippet.code.replace("load_emps()", f"load_emps(data_home={str(home)!r})")
    result = run_without(blocked(snippet.needs), program, tmp_path)
    assert result.returncode == 0, result.stderr


@pytest.mark.parametrize("load", LOADERS)
def test_the_prior_reads_the_tables(load, home):
    data = load(data_home=home)
    regressor = PhysicsModelRegressor(data.prior, free=(), search="local")
    assert regressor.fit(data.X_train, data.y_train).predict(data.X_test).shape == data.y_test.shape
