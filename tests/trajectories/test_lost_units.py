"""A table that was standardised never reaches a simulation, and no record of its own is refused."""

import warnings

import numpy as np
import pandas as pd
import pytest
from sklearn.base import clone
from sklearn.compose import TransformedTargetRegressor
from sklearn.model_selection import KFold, cross_val_score
from sklearn.pipeline import make_pipeline
from sklearn.preprocessing import RobustScaler, StandardScaler

from sklearn_pgnn import (
    ConformalRegressor,
    GreyBoxRegressor,
    ModelDiagnosis,
    PGNNLRegressor,
    PhysicsModel,
    PhysicsModelRegressor,
    PhysicsModelTransformer,
    ResidualRegressor,
    SINDYcRegressor,
    datasets,
    systems,
)
from sklearn_pgnn.model_selection import TrajectoryKFold
from sklearn_pgnn.trajectories import read_records
from sklearn_pgnn.trajectories.lost_units import refuse_standardised

LAG = PhysicsModel({"y": "V"}, {"y": "(K*u - y)/T"}, {"K": 1.0, "T": 2.0}, {"u": "V"})
NETWORK = {"max_epochs": 1, "refine": None, "substeps": 1}
ESTIMATORS = [
    PhysicsModelTransformer(LAG),
    PhysicsModelRegressor(LAG),
    ResidualRegressor(LAG),
    SINDYcRegressor(LAG),
    PGNNLRegressor(LAG, **NETWORK),
    ModelDiagnosis(LAG),
]
EXPECTED = r"X: the time is standardised.*Remedy: let time, inputs.*make_pgnn_pipeline"


def records(n_records=6, seed=0):
    """Return arrays of records of several lengths, each with its own clock."""
    rng = np.random.default_rng(seed)
    tables, outputs = [], []
    for i in range(n_records):
        t = np.arange(0, 20 + 4 * (i % 3), 0.1)
        u = 5 + 3 * np.sin((0.3 + 0.2 * i) * t) + rng.normal(size=t.size)
        tables.append(np.column_stack([t, u]))
        outputs.append(1.1 * LAG.simulate(t, u).y[:, 0])
    return np.concatenate(tables), np.concatenate(outputs)


X, Y = records()


@pytest.mark.parametrize("estimator", ESTIMATORS[:-1], ids=lambda e: type(e).__name__)
def test_a_standardised_table_is_refused_after_the_fit_too(estimator):
    fitted = clone(estimator).fit(X, Y)
    use = fitted.transform if hasattr(fitted, "transform") else fitted.predict
    with pytest.raises(ValueError, match=EXPECTED):
        use(StandardScaler().fit_transform(X))


@pytest.mark.parametrize("scaler", [StandardScaler(), RobustScaler()], ids=["standard", "robust"])
@pytest.mark.parametrize("estimator", ESTIMATORS, ids=lambda e: type(e).__name__)
def test_a_scaler_before_a_simulation_is_refused(estimator, scaler):
    with pytest.raises(ValueError, match=EXPECTED):
        make_pipeline(scaler, estimator).fit(X, Y)


@pytest.mark.parametrize("scaler", [StandardScaler(), RobustScaler()], ids=["standard", "robust"])
@pytest.mark.parametrize("cv", [TrajectoryKFold(3), KFold(3)], ids=["trajectories", "rows"])
def test_folds_of_a_scaled_array_are_refused(scaler, cv):
    scaled = scaler.fit_transform(X)
    network = PGNNLRegressor(LAG, **NETWORK)
    for estimator in (network, ResidualRegressor(LAG)):
        with pytest.raises(ValueError, match=EXPECTED):
            cross_val_score(estimator, scaled, Y, cv=cv, error_score="raise")


@pytest.mark.parametrize(
    "records",
    [
        (systems.golf_robot(), datasets.make_golf_robot(sample_rate=100, duration=3)),
        (systems.servo_valve(), datasets.make_servo_valve(n_records=3)),
        (systems.two_tanks(), datasets.make_two_tanks()),
    ],
    ids=["golf", "valve", "tanks"],
)
@pytest.mark.parametrize("offset", [0.0, -1.0, 1.7e9], ids=["from 0", "from -1 s", "time stamps"])
def test_records_of_the_rigs_are_none(records, offset):
    model, made = records
    table, y = made[:2] if isinstance(made, tuple) else (made.X, made.y)
    refuse_standardised(model, read_records(model, table.assign(t=table["t"] + offset), y))


@pytest.mark.parametrize("begin", [0.0, -1.0, -10.0, 100.0])
def test_inputs_of_unit_variance_are_none(begin):
    t = np.arange(0, 20, 0.1)
    for u in (np.sqrt(2) * np.sin(np.pi * t), np.random.default_rng(0).normal(size=t.size)):
        table = np.column_stack([t + begin, (u - u.mean()) / u.std()])
        refuse_standardised(LAG, read_records(LAG, table))


def square(level):
    return level * np.where(np.arange(200) % 40 < 20, 1.0, -1.0)


@pytest.mark.parametrize("scale", [1.0, 2.5])
@pytest.mark.parametrize(
    "u",
    [square(1.0), square(0.5), np.linspace(-1, 1, 200), np.repeat([0.5, -0.5, 0.0], 80)],
    ids=["1 V", "0.5 V", "ramp", "levels"],
)
def test_an_input_between_set_levels_is_none(u, scale):
    t = scale * np.arange(u.size) / 10
    read = read_records(LAG, np.column_stack([t, u]), LAG.simulate(t, u).y)
    refuse_standardised(LAG, read, energies=True)


@pytest.mark.parametrize("energies", [True, False])
@pytest.mark.parametrize("u", [3 * np.sin(np.arange(200)), square(2.0), np.zeros(200)])
def test_a_clock_from_minus_one_to_one_second_is_none(u, energies):
    for samples in (200, 201):
        t, force = np.linspace(-1, 1, samples), np.resize(u, samples)
        read = read_records(LAG, np.column_stack([t, force]))
        refuse_standardised(LAG, read, energies=energies)


@pytest.mark.parametrize("scaler", [StandardScaler(), RobustScaler()], ids=["standard", "robust"])
@pytest.mark.parametrize(
    "u", [square(24.0), 5 + 3 * np.sin(np.arange(200))], ids=["square", "sine"]
)
def test_one_scaled_trajectory_is_refused(scaler, u):
    scaled = scaler.fit_transform(np.column_stack([np.arange(200) / 50, u]))
    with pytest.raises(ValueError, match=EXPECTED):
        refuse_standardised(LAG, read_records(LAG, scaled))


@pytest.mark.parametrize("scaler", [StandardScaler(), RobustScaler()], ids=["standard", "robust"])
def test_an_input_that_was_scaled_alone_has_no_energy(scaler):
    u = scaler.fit_transform(X[:, 1:])
    read = read_records(LAG, np.column_stack([X[:, 0], u]), Y)
    refuse_standardised(LAG, read)
    with pytest.raises(ValueError, match=r"input 'u' is standardised.*Remedy.*lambda_phy=0"):
        refuse_standardised(LAG, read, energies=True)


UNITLESS = (
    "y: expected y in physical units, got mean 0 and deviation 1, as a scaler leaves them: no "
    "parameters of the model can follow numbers without a unit. Remedy: fit y as measured; "
    "TransformedTargetRegressor(regressor, func=..., inverse_func=...) converts units, and "
    "StandardScaler is for what has none."
)


def told(call):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        call()
    return [str(each.message) for each in caught if "physical units" in str(each.message)]


@pytest.mark.parametrize(
    "estimator", [PhysicsModelRegressor(LAG), GreyBoxRegressor(LAG, depths=("prior", "fitted"))]
)
def test_a_model_that_is_fitted_to_outputs_without_a_unit_tells_so(estimator):
    scaled = TransformedTargetRegressor(estimator, transformer=StandardScaler())
    assert told(lambda: scaled.fit(X, Y)) == [UNITLESS]
    halved = TransformedTargetRegressor(
        estimator, func=lambda y: y / 2, inverse_func=lambda y: 2 * y
    )
    assert told(lambda: halved.fit(X, Y)) == []


@pytest.mark.parametrize("as_y", [np.asarray, pd.Series, lambda y: pd.DataFrame({"y": y})])
@pytest.mark.parametrize(
    "estimator",
    [ResidualRegressor(LAG), ConformalRegressor(ResidualRegressor(LAG))],
    ids=lambda e: type(e).__name__,
)
def test_a_target_may_be_scaled_around_what_learns_the_rest(estimator, as_y):
    scaled = TransformedTargetRegressor(estimator, transformer=StandardScaler())
    assert scaled.fit(X, as_y(Y)).score(X, Y) > 0.95


def test_a_network_without_a_model_has_no_units():
    scaled = pd.DataFrame(StandardScaler().fit_transform(X), columns=["t", "u"])
    assert PGNNLRegressor(**NETWORK).fit(scaled, Y).model is None
