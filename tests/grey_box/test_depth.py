"""Depths of the recipe see and start by what is visible, and nothing behind it."""

from types import SimpleNamespace

import numpy as np
import pandas as pd
import pytest
from sklearn.base import BaseEstimator

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.grey_box.depth import (
    FittedDepth,
    find_initial_state,
    find_unknown_starts,
    fit_network,
    states_met,
)
from sklearn_pgnn.grey_box.tables import PlainTable

LAG = PhysicsModel({"v": "V"}, {"v": "(u - v)/T"}, {"T": 1.0}, {"u": "V"})


class Witness(BaseEstimator):
    """An estimator that keeps what it was given."""

    def __init__(self, model=None, time_column="time"):
        self.model = model
        self.time_column = time_column

    def fit(self, X, y):
        """Keep it."""
        self.X_, self.y_ = X, y
        return self


class Tuning(BaseEstimator):
    """A network that has tuned its model, and adds 1 V to what that says."""

    def __init__(self):
        self.model_ = LAG.with_parameters(T=2.0)
        self.parameters_ = {"T": "the network's"}

    def predict_states(self, X):
        """Return the run of the model."""
        starts = X.groupby("trajectory")["v"].transform("first")
        return (starts * np.exp(-X["t"] / 2.0)).to_numpy()[:, None]

    def predict(self, X):
        """Return the run, and 1 V."""
        return 1.0 + self.predict_states(X)


def beginnings():
    """Return two trajectories at rest in their input; of the second no start is told."""
    X = pd.DataFrame({"trajectory": np.repeat([0, 1], 9), "t": np.tile(np.arange(9) * 0.1, 2)})
    y = np.concatenate([1.0 + start * np.exp(-X["t"][:9] / 2.0) for start in (1.5, 2.0)])
    return PlainTable(X.assign(u=0.0), y[:, None], np.array([[1.5], [np.nan]]))


def tuned_depth():
    """Return a network on a physical model that was fitted before it."""
    before = {"T": "the physics'", "K": "the physics'"}
    usual = LAG.replace(initial_state={"v": 1.5})
    physics = SimpleNamespace(model_=usual, parameters_=before)
    return FittedDepth(Tuning(), physics, np.array([[1.5], [np.nan]]))


def test_the_model_of_a_depth_is_the_one_that_its_network_has_tuned():
    fitted = tuned_depth()
    assert fitted.model.parameters["T"].value == 2.0
    assert fitted.model.initial_state == {"v": 1.5}
    assert fitted.parameters == {"T": "the network's"}  # K is none of its model


def test_a_start_is_found_by_what_predicts():
    fitted, table = tuned_depth(), beginnings()
    met, noise = states_met(fitted, table), np.array([1e-4])
    assert met[:, 0].tolist() == fitted.estimator.predict_states(
        table.starting(LAG, table.told)[:9]
    ).ravel().tolist()  # fmt: skip
    found = find_unknown_starts(fitted, table, table.told, met, 5, noise)
    np.testing.assert_allclose(found, [[1.5], [2.0]], atol=1e-3)
    usual = find_unknown_starts(fitted, table, table.told, met, 0, noise)
    assert usual.ravel().tolist() == [1.5, 1.5]


def test_a_network_gets_a_trajectory_until_its_last_visible_measurement():
    X = pd.DataFrame({"trajectory": np.repeat([0, 1, 2], 5), "t": np.tile(np.arange(5.0), 3)})
    X["u"] = 0.0
    table = PlainTable(X, np.arange(15.0)[:, None], np.zeros((3, 1)))
    visible = np.ones(15, dtype=bool)
    visible[[3, 4]] = False  # the end of the first
    visible[6] = False  # within the second
    visible[10:] = False  # the whole third
    physics = SimpleNamespace(model_=LAG)
    fitted = FittedDepth(None, physics, np.array([[1.0], [2.0], [np.nan]]))
    got = fit_network(Witness(), "network", fitted, table, visible).estimator
    assert got.X_["trajectory"].tolist() == [0] * 3 + [1] * 5
    assert got.X_["v"].dropna().tolist() == [1.0, 2.0]
    np.testing.assert_array_equal(got.y_.ravel(), [0, 1, 2, 5, np.nan, 7, 8, 9])
    assert got.model is not None
    assert got.time_column is None  # the table calls the time "t"


T = np.arange(20) * 0.1
MET = np.random.default_rng(0).normal(size=(50, 2))


def swing(starts):
    """Return the position of an oscillator that starts in several states at once."""
    position, speed = starts[:, :1], starts[:, 1:]
    return (position * np.cos(T) + speed * np.sin(T))[..., None]


def test_what_is_not_told_is_found():
    y = swing(np.array([[0.5, -0.3]]))[0]
    y[3:6] = np.nan
    found = find_initial_state(swing, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert found == pytest.approx([0.5, -0.3], abs=1e-4)
    half = find_initial_state(swing, np.array([0.5, np.nan]), y, MET, np.array([1e-3]))
    assert half == pytest.approx([0.5, -0.3], abs=1e-4)
    assert half[0] == 0.5


def test_a_start_that_diverges_is_none():
    def breaking(starts):
        return np.where(starts[:, :1, None] > 1.0, np.nan, swing(starts))

    y = swing(np.array([[0.9, 0.2]]))[0]
    found = find_initial_state(breaking, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert found == pytest.approx([0.9, 0.2], abs=1e-3)


def test_few_runs_are_asked_for_at_once():
    asked = []

    def counted(starts):
        asked.append(len(starts))
        return swing(starts)

    y = swing(np.array([[0.5, -0.3]]))[0]
    find_initial_state(counted, np.full(2, np.nan), y, MET, np.array([1e-3]))
    assert asked[0] == 50
    assert len(asked) < 100
