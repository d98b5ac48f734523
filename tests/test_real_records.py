"""Measured records, as a person gives them: CSV files and a prior."""

import numpy as np
import pandas as pd
import pytest
from mechanisms import integrate

from sklearn_pgnn import ModelDiagnosis, PhysicsModelRegressor, effects
from sklearn_pgnn.inspection.report import render_report
from sklearn_pgnn.physics import Parameter, PhysicsModel
from sklearn_pgnn.trajectories import read_files
from sklearn_pgnn.trajectories.reader import read_records


@pytest.fixture(scope="module")
def emps() -> PhysicsModel:
    return PhysicsModel(
        name="EMPS",
        states={"q": "m", "v": "m/s"},
        inputs={"tau": "N"},
        outputs={"q_m": "q"},
        parameters={"M": {"value": 95, "unit": "kg"}, "Fv": {"value": 203, "unit": "N s/m"}},
        equations={"q": "v", "v": "(tau - Fv*v)/M"},
        inertia={"v": "M"},
        columns={"tau": "u_force_N"},
    )


@pytest.fixture(scope="module")
def emps_files(real_data):
    return [real_data / "emps" / f"emps_{name}.csv" for name in ("train", "test")]


@pytest.mark.slow
def test_emps_is_read_as_two_records(emps, emps_files):
    X, y = read_files(emps_files, emps)
    assert list(X) == ["trajectory", "t", "tau"]
    assert list(y) == ["q_m"]
    records = read_records(emps, X, y)
    assert [record.name for record in records] == ["emps_train", "emps_test"]
    for record in records:
        assert record.t.size == 24_841
        np.testing.assert_allclose(np.diff(record.t), 1e-3, atol=1e-6)
        assert np.all(np.isnan(record.x0))


def test_emps_numbers_are_those_in_the_file(emps, emps_files):
    X, y = read_files(emps_files, emps)
    for path, rows in zip(
        emps_files, X.groupby("trajectory", sort=False).groups.values(), strict=True
    ):
        table = np.genfromtxt(path, delimiter=",", names=True)
        np.testing.assert_array_equal(X["t"][rows], table["t"])
        np.testing.assert_array_equal(X["tau"][rows], table["u_force_N"])
        np.testing.assert_array_equal(y["q_m"][rows], table["q_m"])


def test_emps_has_the_published_mass_and_friction(emps, emps_files):
    r"""The balance of momentum over windows, apart from the package's own fit.

    .. math:: M\,\Delta v + F_v\,\Delta q + F_c \int \mathrm{sign}(v)\,dt + F_0\,T = \int \tau\,dt
    """
    X, y = read_files(emps_files[:1], emps)
    q, tau, step = y["q_m"].to_numpy(), X["tau"].to_numpy(), 1e-3
    v = np.convolve(q, [1, *[0] * 19, -1], "same") / (20 * step)

    def over_windows(signal):
        return (signal[400:] - signal[:-400])[100:-100]

    def integral(signal):
        return np.cumsum(signal) * step

    terms = [v, q, integral(np.tanh(v / 1e-3)), integral(np.ones(q.size))]
    balance = np.column_stack([over_windows(term) for term in terms])
    M, Fv, Fc, _ = np.linalg.lstsq(balance, over_windows(integral(tau)), rcond=None)[0]
    assert [M, Fv, Fc] == pytest.approx([95.1, 203.5, 20.4], rel=0.05)


#: ids of effects that hold a machine still while it is driven a little
STILL = {"coulomb_friction", "stribeck_friction", "asymmetric_friction", "input_dead_zone"}


@pytest.fixture(scope="module")
def hoop() -> PhysicsModel:
    return PhysicsModel(
        name="hoop",
        states={"y": "V"},
        inputs={"u": ""},
        parameters={
            "K": Parameter("K", 11.6, bounds=(0.1, 1000.0), spread=0.5),
            "T": Parameter("T", 1.6, unit="s", bounds=(0.01, 100.0), spread=0.5),
        },
        equations={"y": "(K*u - y)/T"},
    )


@pytest.mark.slow
def test_hoop_has_dry_friction_and_its_steps_are_foretold(hoop, real_data):
    """The refitted prior leaves 1.0 V on the steps that are held out."""
    learn, held_out = (
        pd.read_csv(real_data / "ball_and_hoop" / f"{name}StepSequence.csv")
        for name in ("random", "fixed")
    )
    diagnosis = ModelDiagnosis(hoop).fit(learn[["t", "u"]], learn["y"])
    assert STILL & {cause.effect for cause in diagnosis.causes_}
    model = diagnosis.extended_model_
    start = {"y": held_out["y"].iloc[0]}
    x0 = [start.get(state, 0.0) for state in model.states]
    y = model.simulate(held_out["t"], held_out[["u"]], x0).y[:, 0]
    assert np.sqrt(np.mean((y - held_out["y"]) ** 2)) < 0.6


@pytest.mark.slow
def test_drives_have_a_sensor_that_sees_the_magnitude(real_data):
    """Four hundred samples do not tell it from a spring that is stiffer on one side."""
    model = PhysicsModel(
        name="drives",
        states={"v": "", "w": "", "z": ""},
        inputs={"u": "V"},
        outputs={"y": "z"},
        parameters={"k": 0.9, "alpha": 4.9, "xi": 0.15, "w0": 22.9},
        equations={
            "z": "w",
            "w": "-w0**2*z - 2*xi*w0*w + k*w0**2*v",
            "v": "alpha*(u - v)",
        },
    )
    table = pd.read_csv(real_data / "coupled_electric_drives" / "ced_unif.csv").iloc[:400]
    X = pd.concat(
        pd.DataFrame({"trajectory": n, "t": table["t"], "u": table[f"u1{n}"]}) for n in (1, 2)
    )
    y = np.concatenate([table[f"z1{n}"] for n in (1, 2)])
    diagnosis = ModelDiagnosis(model).fit(X, y)
    (cause,) = diagnosis.causes_
    assert diagnosis.verdict_ == "ambiguous"
    assert "sensor_rectification" in {cause.effect, *(each.effect for each in cause.confused_with)}


def tanks():
    """Return two tanks; nobody has measured the flows, so that their spread has no end."""
    names = ("k1", "k2", "k3", "k4")
    flows = {k: Parameter(k, 0.05, bounds=(1e-4, 10.0), spread=np.inf) for k in names}
    return PhysicsModel(
        name="tanks",
        states={"x1": "V", "x2": "V"},
        inputs={"u": "V"},
        outputs={"y": "x2"},
        parameters=flows,
        equations={"x1": "k4*u - k1*sqrt(x1)", "x2": "k2*sqrt(x1) - k3*sqrt(x2)"},
    )


@pytest.mark.slow
def test_tanks_run_over_and_their_sensor_ends(real_data):
    """The prior alone is 0.8 V off in the free run of the record that is held out."""
    learn, held_out = (
        pd.read_csv(real_data / "cascaded_tanks" / f"cts_{name}.csv") for name in ("train", "test")
    )
    diagnosis = ModelDiagnosis(tanks()).fit(learn[["t", "u_V"]].to_numpy(), learn["y_V"])
    found = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    assert found & {("overflow", "x1"), ("state_limit", "x1")}
    assert ("sensor_saturation", "y") in found
    model = diagnosis.extended_model_
    start = PhysicsModelRegressor(model, free=[], window_length="trajectory")
    start.fit(learn[["t", "u_V"]].to_numpy(), learn["y_V"])
    y = model.simulate(held_out["t"], held_out[["u_V"]], start.initial_states_[0]).y[:, 0]
    assert np.sqrt(np.mean((y - held_out["y_V"])[50:] ** 2)) < 0.6


@pytest.mark.slow
def test_the_scale_of_the_tanks_sensor_is_bent(real_data):
    """Where the model knows that both tanks can run over, a free run comes three times as near."""
    model = tanks() + effects.Overflow("x1", 8.0, 0.25, 0.6) + effects.StateLimit("x2", 10.0, 0.25)
    learn = pd.read_csv(real_data / "cascaded_tanks" / "cts_train.csv")
    diagnosis = ModelDiagnosis(model).fit(learn[["t", "u_V"]].to_numpy(), learn["y_V"])
    found = {(cause.effect, cause.target) for cause in diagnosis.causes_}
    assert ("sensor_curvature", "y") in found
    gain = diagnosis.gain_["y"]
    assert gain.free_run_extended < 0.5 * gain.free_run_refitted


# -- what an early end, and few candidates, leave --------------------------------------------------


def diagnosed(folder, model="model.yaml", records="train*.csv", **options):
    prior = PhysicsModel.from_yaml(folder / model)
    X, y = read_files(sorted(folder.glob(records)), prior)
    return ModelDiagnosis(prior, **options).fit(X, y)


@pytest.mark.slow
def test_both_of_two_candidates_are_named(real_data):
    """A formula that leaves ten times the noise, its k at a bound, takes no place of theirs."""
    catalogue = ("input_dead_zone", "coulomb_friction")
    found = diagnosed(real_data / "model_car", catalogue=catalogue)
    assert {cause.effect for cause in found.causes_} == set(catalogue)
    threshold = found.causes_[0].parameters["threshold"]
    assert threshold.value == pytest.approx(0.164, rel=0.3)
    assert 1.1 < found.parameters_["k"].value < 99.0
    assert found.discrepancy_ is None


@pytest.mark.slow
def test_a_lag_in_an_output_with_feed_through_is_followed_by_what_a_sensor_hides(cases):
    catalogue = ("actuator_lag", "sensor_rectification")
    found = diagnosed(cases / "feed_through", catalogue=catalogue, max_causes=2)
    assert found.stopped_ is None
    assert "u_lagged" in found.extended_model_.states
    assert "u_lagged" in found.discrepancy_.formula  # which the model without the lag lacks
    assert "actuator lag" in render_report(found)


@pytest.mark.slow
@pytest.mark.parametrize("limit", [30.0, 60.0])
def test_an_unfinished_search_names_nothing_for_certain(cases, limit):
    found = diagnosed(cases / "crane", "crane_fr.yaml", "crane_?.csv", time_limit=limit)
    if not found.complete_:
        assert found.verdict_ in ("provisional", "model_adequate")
        assert not found.tested_
        assert all(np.isnan(cause.probability) for cause in found.causes_)
    else:  # the frictions are in the model: nothing is missing
        assert (found.verdict_, found.causes_) == ("model_adequate", ())


@pytest.mark.slow
def test_bouc_wen_is_named_and_predicts_the_test_signals_of_the_benchmark(real_data):
    """The law of the benchmark, with the numbers of its authors, integrated here.

    Its test signals are a multisine of 5 to 150 Hz and 50 N, and a sweep from 20 to 50 Hz of 40 N.
    """
    model = PhysicsModel.from_yaml(real_data / "bouc_wen" / "bw.yaml")
    X, y = read_files([real_data / "bouc_wen" / "train_short.csv"], model)
    catalogue = ["hysteretic_spring", "hysteresis", "cubic_stiffness", "coulomb_friction"]
    found = ModelDiagnosis(model, catalogue=catalogue, n_jobs=1).fit(X[:2048], y[:2048])
    assert [cause.effect for cause in found.causes_] == ["hysteretic_spring"]
    assert found.hold_ == "foh"
    extended, fine = found.extended_model_, 20

    def rates(x, u):
        q, v, z = x
        bent = 5e4 * v - 1e3 * (0.8 * abs(v) * z - 1.1 * v * abs(z))
        return v, (u - 5e4 * q - 10 * v - z) / 2, bent

    t = np.arange(3000) / 750
    lines = np.arange(5, 150, 0.5)
    phases = np.random.default_rng(0).uniform(0, 2 * np.pi, lines.size)
    wave = [50 * np.sqrt(2 / lines.size), 2 * np.pi * lines, phases]
    for force, most in (
        (lambda t: wave[0] * np.cos(np.outer(t, wave[1]) + wave[2]).sum(axis=1), 1.0e-5),
        (lambda t: 40 * np.sin(2 * np.pi * (20 * t + 30 / 8 * t**2)), 1.5e-5),
    ):
        middles = np.arange(t.size * fine) / (750 * fine) + 0.5 / (750 * fine)
        steps = integrate(rates, np.zeros((3, 1)), middles, force(middles)[None], steps=1)
        truth = steps[0, 0, ::fine]
        error = extended.simulate(t, force(t), np.zeros(3)).y[:, 0] - truth
        assert np.sqrt(np.mean(error**2)) < most
