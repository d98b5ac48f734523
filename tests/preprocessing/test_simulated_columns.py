"""Simulated columns: what diverges is told though it is finite, and long steps are divided."""

import warnings

import numpy as np
import pytest
from sklearn.compose import TransformedTargetRegressor
from sklearn.linear_model import LinearRegression, Ridge
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import StandardScaler

from sklearn_pgnn import PhysicsModel, PhysicsModelTransformer
from sklearn_pgnn.exceptions import SimulationWarning
from sklearn_pgnn.simulation.simulate import SMALL

UNSTABLE = PhysicsModel({"y": "V"}, {"y": "(u + y)/T"}, {"T": 0.1}, {"u": "V"}, name="unstable")
SHORT, LONG = np.arange(60) * 0.01, np.arange(700) * 0.01  # e**6, e**70
CLOCK = np.concatenate([SHORT, LONG, SHORT])
X = np.column_stack([CLOCK, np.full(CLOCK.size, 0.01)])
#: the machine has a controller, which the model lacks
Y = np.concatenate([0.01 * np.expm1(SHORT / 0.1), np.sin(LONG), 0.01 * np.expm1(SHORT / 0.1)])
SECOND = (np.arange(CLOCK.size) >= SHORT.size) & (np.arange(CLOCK.size) < CLOCK.size - SHORT.size)


@pytest.mark.parametrize("unit", [1.0, 1e-4], ids=["own unit", "another unit"])
def test_a_finite_divergence_is_told_and_becomes_the_first_row(unit):
    transformer = PhysicsModelTransformer(UNSTABLE, append=False).fit(X, unit * Y)
    message = (
        r"^trajectory '1': the simulation of 'unstable' diverges: 'y' is .* at t = [\d.]+ s, more "
        r"than 1000 times the largest value in fit\. Remedy: .*Its rows get the values of its "
        r"first row\.$"
    )
    with pytest.warns(SimulationWarning, match=message):
        found = transformer.transform(X)[:, 0]
    assert not found[SECOND].any()
    assert found[~SECOND] == pytest.approx(Y[~SECOND], rel=1e-3)


def test_without_y_what_exceeds_the_simulation_of_the_fit_is_told():
    transformer = PhysicsModelTransformer(UNSTABLE, append=False).fit(X[: SHORT.size])
    with pytest.warns(SimulationWarning, match="trajectory '1': .* diverges"):
        found = transformer.transform(X)
    assert np.abs(found).max() < 10


def test_a_divergence_does_not_spoil_the_scaler_behind():
    pipeline = make_pipeline(PhysicsModelTransformer(UNSTABLE), StandardScaler(), Ridge(1e-6))
    with pytest.warns(SimulationWarning, match="diverges"):
        pipeline.fit(X, np.where(SECOND, 0.0, Y))
    assert pipeline.score(X[: SHORT.size], Y[: SHORT.size]) > 0.9


def test_a_standardised_target_makes_no_large_unit_a_divergence():
    tank = PhysicsModel({"p": "Pa"}, {"p": "(k*u - p)/T"}, {"k": 1e7, "T": 0.5}, {"u": "V"})
    t = np.arange(400) * 0.01
    table = np.column_stack([t, np.sin(t)])
    y = tank.simulate(t, table[:, 1]).y[:, 0] + 1e4
    inner = make_pipeline(PhysicsModelTransformer(tank, append=False), LinearRegression())
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        score = TransformedTargetRegressor(inner, transformer=StandardScaler()).fit(table, y)
    assert score.score(table, y) == pytest.approx(1.0)


def test_several_divergences_are_one_warning():
    table = np.vstack([X, X])
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        PhysicsModelTransformer(UNSTABLE).fit(X, Y).transform(table)
    assert len(caught) == 1
    assert str(caught[0].message).endswith("first row. So do those of 1 more: 4.")


# -- long steps ------------------------------------------------------------------------------------

SWING = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "-k*x - d*v + u"},
    {"k": 2500.0, "d": 5.0},
    {"u": "N"},
)
TIMES = np.arange(480) * 0.01
ROWS = np.column_stack([TIMES, np.repeat(np.random.default_rng(0).normal(size=24), 20)])
SLOW = np.arange(480) % 10 == 0
GAP = (np.arange(480) <= 100) | (np.arange(480) >= 115)


@pytest.mark.parametrize("rows", [SLOW, GAP], ids=["slower", "gap"])
def test_a_long_step_is_integrated_like_the_short_ones(rows):
    transformer = PhysicsModelTransformer(SWING, append=False).fit(ROWS)
    whole = transformer.transform(ROWS)[rows]
    error = np.abs(transformer.transform(ROWS[rows]) - whole).max(axis=0)
    assert np.all(error < SMALL * np.ptp(whole, axis=0))


def test_a_gap_in_the_fit_makes_no_other_step_finer():
    transformer = PhysicsModelTransformer(SWING, append=False)
    assert transformer.fit(ROWS[GAP]).substeps_ == transformer.fit(ROWS).substeps_
