"""Integration steps are doubled until they are enough, and it is said where they never are."""

import warnings

import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.free_run import substeps_for
from sklearn_pgnn.simulation.substeps import MAX_SUBSTEPS
from sklearn_pgnn.trajectories import read_records

pytestmark = pytest.mark.core


def lag(time_constant):
    model = PhysicsModel({"y": "V"}, {"y": "(u - y)/T"}, {"T": time_constant}, {"u": "V"})
    return model, read_records(model, [[float(k), float(k % 2)] for k in range(20)])


def test_a_slow_machine_needs_few_steps_and_says_nothing():
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        assert substeps_for(*lag(100.0)) < MAX_SUBSTEPS


def test_a_machine_far_quicker_than_its_samples_is_told_so():
    with pytest.warns(SimulationWarning, match=r"still changes with 32 .* Remedy: .*set substeps"):
        assert substeps_for(*lag(0.02)) == MAX_SUBSTEPS
