"""What records can tell of parameters, and lags: laws that hold for any machine."""

import numpy as np
import pandas as pd
import pytest
from sledge import NOISE, SLEDGE, STEP, drive

from sklearn_pgnn import PhysicsModel, PhysicsModelRegressor
from sklearn_pgnn.exceptions import FitWarning
from sklearn_pgnn.inspection import identifiability
from sklearn_pgnn.record_quality.information import finer, tell
from sklearn_pgnn.simulation.record_windows import window_records
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core

LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 2.0, "T": 0.5}, {"u": "V"})


def levels(model, step, hold, samples=400, noise=0.02, late=0.0, seed=0):
    """Return X and y of a model under held levels, its output late by so many samples."""
    rng, fine = np.random.default_rng(seed), 16
    u = np.repeat(rng.uniform(-1, 1, samples // hold + 1), hold)[:samples]
    settled = np.concatenate([np.full(20, u[0]), u])
    t = step / fine * np.arange(-20 * fine, samples * fine)
    run = model.simulate(t, np.repeat(settled, fine)).y[:, 0]
    clock = step * np.arange(samples)
    y = np.interp(clock - late * step, t, run) + noise * rng.normal(size=samples)
    return pd.DataFrame({"t": clock, "u": u}), pd.DataFrame({"y": y})


def told(model, X, y):
    """Return the verdicts by parameter."""
    return {each.name: each for each in identifiability(model, X, y).parameters}


def test_the_interval_is_that_of_a_fit():
    X, y = drive()
    found = PhysicsModelRegressor(SLEDGE).fit(X, y).parameters_
    for name, each in told(SLEDGE, X, y).items():
        low, high = each.estimate.low, each.estimate.high
        assert each.verdict == "identifiable"
        assert each.reason == each.remedy == ""
        assert (low, high) == pytest.approx((found[name].low, found[name].high), rel=1e-4)
        size = SLEDGE.parameters[name].value
        assert each.half_width == pytest.approx((high - low) / 2 / size, rel=0.02)


def test_four_times_the_records_halve_the_interval():
    one, four = (told(SLEDGE, *drive(n_records=4, samples=n)) for n in (300, 1200))
    X, y = zip(*(drive(samples=300, seed=seed) for seed in range(4)), strict=True)
    X = pd.concat([x.assign(trajectory=x["trajectory"] + 4 * i) for i, x in enumerate(X)])
    many = told(SLEDGE, X, pd.concat(y))
    for name in SLEDGE.parameters:
        assert many[name].half_width == pytest.approx(one[name].half_width / 2, rel=0.25)
        assert four[name].half_width < one[name].half_width


def test_units_do_not_matter():
    X, y = levels(LAG, 0.1, 20, late=1.3)
    plain = identifiability(LAG, X, y)
    other = LAG.replace(outputs={"y": "1000*y"}, parameters={"K": 2.0, "T": 0.5})
    scaled = identifiability(other, X, 1000 * y)
    for one, two in zip(plain.parameters, scaled.parameters, strict=True):
        assert two.half_width == pytest.approx(one.half_width, rel=0.01)
    assert scaled.lags[0].samples == pytest.approx(plain.lags[0].samples, abs=1e-3)


def test_parameters_that_are_told_only_together_are_named_with_each_other():
    model = PhysicsModel(
        {"y": "V"}, {"y": "(K*L*u - y)/T"}, {"K": 2.0, "L": 3.0, "T": 0.5, "z": 1.0}, {"u": "V"}
    )
    found = told(model, *levels(model, 0.1, 20))
    assert found["K"].collinear_with == ("L",)
    assert found["L"].collinear_with == ("K",)
    assert found["K"].verdict == found["L"].verdict == found["z"].verdict == "not"
    assert found["K"].half_width == np.inf
    assert "a known value of L" in found["K"].remedy
    assert found["z"].reason.startswith("never excited")
    assert found["T"].verdict == "identifiable"


def test_a_parameter_whose_input_rests_is_not_told():
    model = SLEDGE.replace(
        equations={"v": "(F - d*v + b*G)/m"}, inputs={"F": "N", "G": "N"},
        parameters={"m": 2.0, "d": 0.5, "b": 1.0},
    )  # fmt: skip
    X, y = drive()
    found = told(model, X.assign(G=0.0), y)
    assert found["b"].verdict == "not"
    assert found["b"].reason.startswith("never excited")
    assert found["m"].verdict == found["d"].verdict == "identifiable"


def test_richer_inputs_are_proposed_where_they_help():
    t = 0.05 * np.arange(600)
    u = 1 + 0.5 * np.sin(0.1 * t)
    settled = LAG.replace(initial_state={"y": 2.0})
    y = settled.simulate(t, u).y + 0.1 * np.random.default_rng(0).normal(size=(600, 1))
    found = identifiability(LAG, np.c_[t, u], y)
    T = found.parameters[1]
    assert T.verdict != "identifiable"
    assert "many frequencies" in T.remedy
    assert "many frequencies: T would be identifiable" in found.best_record
    assert f"{found.best_record}." in found.remarks[-1]


def test_a_time_constant_faster_than_the_samples_asks_for_a_rate():
    X, y = levels(LAG, 3.0, 1, noise=0.1)
    found = told(LAG, X, y)
    assert found["K"].verdict == "identifiable"
    assert found["T"].verdict != "identifiable"
    assert found["T"].reason == "the sampling is too slow for it"
    rate = float(found["T"].remedy.split()[2])
    again = told(LAG, *levels(LAG, 1 / rate, round(3 * rate), round(1200 * rate), noise=0.1))
    assert again["T"].verdict == "identifiable"


def test_a_wrong_model_is_not_trusted():
    rough = SLEDGE.replace(equations={"v": "(F - d*v - 3*tanh(20*v))/m"})
    found = identifiability(SLEDGE, *drive(rough))
    assert found.times_noise > 2
    assert "hold only as far as the model does" in found.remarks[-1]
    assert found.lags == ()


@pytest.mark.parametrize("late", [-3.7, -0.4, 0.0, 0.25, 1.5, 12.0])
def test_a_lag_is_found_to_a_fifth_of_a_sample(late):
    found = identifiability(LAG, *levels(LAG, 0.1, 20, late=late, seed=3))
    if late == 0.0:
        assert found.lags == ()
        return
    (lag,) = found.lags
    assert lag.samples == pytest.approx(late, abs=0.2)
    assert lag.low <= 0.1 * late <= lag.high
    assert ("later" if late > 0 else "earlier") in " ".join(found.remarks)


def test_a_lag_like_a_fast_time_constant_is_said_to_be_confused_with_it():
    fast = LAG.with_parameters(T=0.08)
    (lag,) = identifiability(fast, *levels(fast, 0.1, 20, late=0.5, noise=0.002)).lags
    assert "T" in lag.confused_with


def test_an_uneven_clock_tells_no_lag():
    X, y = levels(LAG, 0.1, 20, late=2.0)
    kept = np.random.default_rng(0).random(len(X)) > 0.1
    assert identifiability(LAG, X[kept], y[kept]).lags == ()


def test_the_outputs_of_a_free_motion_are_late_relative_to_each_other():
    swing = PhysicsModel(
        {"x": "m", "v": "m/s"}, {"x": "v", "v": "-k*x"}, {"k": 4.0}, outputs={"a": "x", "b": "v"}
    )
    t = STEP * np.arange(1000)
    y = np.c_[np.cos(2 * t), -2 * np.sin(2 * (t - 3 * STEP))]
    y += NOISE * np.random.default_rng(0).normal(size=y.shape)
    (lag,) = identifiability(swing, t[:, None], y).lags
    assert (lag.output, lag.samples) == ("b", pytest.approx(3.0, abs=0.2))


def test_no_free_parameters_and_a_model_that_diverges_are_no_error():
    X, y = drive(n_records=1)
    known = SLEDGE.replace(equations={"v": "(F - v/2)/2"}, parameters={}, inertia={})
    assert identifiability(known, X, y).parameters == ()
    wild = SLEDGE.replace(equations={"v": "F/m + d*1e3*v**3"})
    assert {each.verdict for each in told(wild, X, y).values()} <= {"not", "weak", "identifiable"}


def test_finer_windows_end_where_the_windows_do():
    X, y = drive(n_records=2, samples=100)
    windows = window_records(SLEDGE, read_records(SLEDGE, X, y)).windows
    fine = finer(windows, 4)
    assert np.array_equal(fine.t[fine.starts], windows.t[windows.starts])
    assert fine.bounds.tolist() == [0, 397, 794]
    assert (fine.starts + fine.lengths)[-1] == 794
    assert np.array_equal(fine.u[fine.starts], windows.u[windows.starts])
    known = tell(SLEDGE, read_records(SLEDGE, X, y))
    same = known.under(finer(known.found.windowed.windows, 1), known.found.fit.x0)
    assert same == pytest.approx(known.information, rel=1e-9)


def test_a_state_that_nobody_measures_has_a_scale_of_its_own_in_a_check_and_in_a_fit():
    chain = PhysicsModel(
        {"x": "V", "z": "V"}, {"x": "(K*u - x)/T", "z": "(L*x - z)/S"},
        {"K": 2.0, "L": 3.0, "T": 0.3, "S": 1.0}, {"u": "V"}, outputs={"y": "z"},
    )  # fmt: skip
    X, y = levels(chain, 0.05, 17, noise=0.01)
    found = told(chain, X, y)
    assert {name: each.verdict == "identifiable" for name, each in found.items()} == {
        "K": False, "L": False, "T": True, "S": True
    }  # fmt: skip
    assert found["K"].collinear_with == ("L",)
    with pytest.warns(FitWarning, match="do not determine K, L"):
        fitted = PhysicsModelRegressor(chain, search="local").fit(X, y).parameters_
    assert fitted["K"].high == np.inf
    assert fitted["T"].high - fitted["T"].low < 0.1
