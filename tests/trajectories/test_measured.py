"""Outputs that never change in a record are told, and do not count for the noise."""

import warnings

import numpy as np
import pytest

from sklearn_pgnn import (
    PhysicsModel,
    PhysicsModelRegressor,
    ResidualRegressor,
    SINDYcRegressor,
)
from sklearn_pgnn.exceptions import RecordWarning
from sklearn_pgnn.inspection import first_look
from sklearn_pgnn.simulation.record_windows import output_noise
from sklearn_pgnn.trajectories import read_records

LAG = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": 2.0}, {"u": "V"})
NOISE = 0.01
DEAD = (
    "output 'y' has one value only throughout trajectory '0' (0.1 V), trajectory '2' (0.1 V): it "
    "changes in other trajectories, and there inputs change. Remedy: if its sensor was dead, leave "
    "the output empty (NaN) there, or leave these trajectories out; if the machine stood still, "
    "none is needed."
)
ALL_DEAD = (
    "y: output 'y' has one value only in every trajectory in which it was measured: its noise "
    "cannot be estimated, and counts as 1 V. Remedy: a trajectory in which it changes, or a model "
    "without this output if its sensor is dead; PhysicsModelRegressor and ModelDiagnosis take the "
    "noise as noise_std."
)


def records(dead, drive=1.0):
    """Return three records, of which some have the constant output 0.1."""
    t = np.arange(0, 20, 0.1)
    u = drive * np.sin(t)
    run = LAG.simulate(t, u).y[:, 0] + NOISE * np.random.default_rng(0).normal(size=t.size)
    y = [np.full(t.size, 0.1) if i in dead else run for i in range(3)]
    return np.tile(np.column_stack([t, u]), (3, 1)), np.concatenate(y)


def told(fit):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        fit()
    said = [str(each.message) for each in caught if each.category is RecordWarning]
    return [each for each in said if "one value only" in each]


REGRESSORS = [PhysicsModelRegressor(LAG, search="local"), ResidualRegressor(LAG)]
REGRESSORS += [SINDYcRegressor(LAG)]


@pytest.mark.parametrize("regressor", REGRESSORS, ids=lambda each: type(each).__name__)
def test_every_estimator_tells_of_a_dead_sensor_and_of_noise_that_is_not_known(regressor):
    assert told(lambda: regressor.fit(*records((0, 2)))) == [f"y: {DEAD}"]
    assert regressor.noise_ == pytest.approx([NOISE], rel=0.3)
    assert told(lambda: regressor.fit(*records((0, 1, 2)))) == [ALL_DEAD]
    assert regressor.noise_.tolist() == [1.0]
    assert told(lambda: regressor.fit(*records(()))) == []


def test_a_network_tells_it_too():
    pgnnl = pytest.importorskip("sklearn_pgnn.estimators.pgnnl")
    net = pgnnl.PGNNLRegressor(LAG, max_epochs=1, refine=None)
    assert told(lambda: net.fit(*records((0, 2)))) == [f"y: {DEAD}"]


def test_a_noise_that_is_told_need_not_be_estimated():
    regressor = PhysicsModelRegressor(LAG, search="local", noise_std=0.5)
    assert told(lambda: regressor.fit(*records((0, 1, 2)))) == []
    assert regressor.noise_.tolist() == [0.5]


def test_what_is_at_rest_without_any_input_is_not_dead():
    X, y = records((0,))
    X[:200, 1] = 0.0
    assert told(lambda: ResidualRegressor(LAG).fit(X, y)) == []


def test_records_without_the_output_do_not_count_for_its_noise():
    X, y = records(())
    y[200:] = np.nan
    (found,) = output_noise(read_records(LAG, X, y, to_fit=False))
    assert found == pytest.approx(NOISE, rel=0.3)


def test_a_first_look_tells_it():
    look = first_look(LAG, *records((0, 2)))
    assert DEAD in look.warnings
    assert look.outputs[0].noise == pytest.approx(NOISE, rel=0.3)
    nothing = first_look(LAG, *records((0, 1, 2)))
    assert any("output 'y' is 0.1 V in every sample" in said for said in nothing.warnings)
    assert np.isnan(nothing.outputs[0].noise)
