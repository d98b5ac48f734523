"""Laws of what is left: noise of any colour has no structure, a part of the physics has."""

import numpy as np
import pandas as pd
import pytest
from scipy.signal import lfilter
from servo import SERVO, follow_sines
from sledge import NOISE, SLEDGE, drive

from sklearn_pgnn import PhysicsModel, effects
from sklearn_pgnn.diagnosis.structure import IN_RECORD, find_structure, is_positive
from sklearn_pgnn.diagnosis.trees import groups_of
from sklearn_pgnn.estimation.budgets import STRETCHES
from sklearn_pgnn.estimation.fitting import HypothesisFitter
from sklearn_pgnn.estimation.problem import build_problem
from sklearn_pgnn.trajectories import read_records

ALPHA, SHARE = 0.01, 0.05


def left_by(signal, noise=1.0, rig=SLEDGE, seed=0):
    """Return a problem whose sensor shows a signal beside white noise, and its re-tuned prior."""
    X, y = drive(rig, n_records=8, samples=250, noise=noise * NOISE, seed=seed)
    problem = build_problem(SLEDGE, read_records(SLEDGE, X, y + signal.reshape(-1, 1)))
    return problem, HypothesisFitter(problem).base()


@pytest.fixture(scope="module")
def X():
    """Return the inputs of eight records of a sledge."""
    return drive(n_records=8, samples=250)[0]


def noise_of(kind, rng, records=8, samples=250):
    """Return noise of a sensor, every record's drawn by itself."""
    draws = rng.standard_normal((records, samples))
    if kind == "first order":
        draws = lfilter([1], [1, -0.95], draws, axis=1)
    elif kind == "wandering":
        draws = np.cumsum(draws, axis=1)
    return draws.ravel()


# -- no structure ----------------------------------------------------------------------------------


@pytest.mark.parametrize("alpha", [0.01, 0.1])
@pytest.mark.parametrize("groups", [3, 8])
def test_shares_without_any_meaning_are_taken_for_some_as_rarely_as_alpha_says(alpha, groups):
    draws = np.random.default_rng(0).normal(size=(4000, groups))
    rate = np.mean([is_positive(shares, np.ones(groups), alpha) for shares in draws])
    assert rate == pytest.approx(alpha, abs=3 * np.sqrt(alpha / len(draws)))


@pytest.mark.parametrize("alpha", [0.01, 0.1])
@pytest.mark.parametrize("spread", [0.5, 2.0])
def test_so_they_are_where_some_groups_are_louder(alpha, spread):
    rng = np.random.default_rng(0)
    powers = np.exp(spread * rng.normal(size=(4000, 8)))
    found = [is_positive(rng.normal(size=8), power, alpha) for power in powers]
    assert np.mean(found) <= alpha + 3 * np.sqrt(alpha / len(powers))


def test_one_group_proves_nothing():
    assert not is_positive(np.array([0.9]), np.ones(1), ALPHA)
    assert not is_positive(np.array([]), np.array([]), ALPHA)
    assert not is_positive(np.zeros(8), np.ones(8), ALPHA)
    assert not is_positive(np.array([0.9, 0.0, 0.0]), np.array([1e3, 1e-3, 1e-3]), ALPHA)


def test_a_quiet_group_that_is_badly_predicted_does_not_hide_what_the_loud_ones_share():
    shares, powers = np.array([0.8, 0.9, 0.7, 0.8, 0.75, -20.0]), np.array([10.0] * 5 + [0.01])
    assert is_positive(shares, powers, ALPHA)
    assert is_positive(shares, 1e6 * powers, ALPHA)
    assert not is_positive(shares, np.ones(6), ALPHA)


@pytest.mark.slow
@pytest.mark.parametrize("kind", ["white", "first order", "wandering"])
def test_noise_of_any_colour_has_no_structure(kind):
    rng, draws, alpha = np.random.default_rng(0), 6, 0.05
    signals = [NOISE * noise_of(kind, rng) for _ in range(draws)]
    found = [find_structure(*left_by(signal), alpha, SHARE) for signal in signals]
    assert sum(structure.is_significant for structure in found) <= 1


def test_what_one_record_has_and_no_other_is_no_structure():
    offsets = np.random.default_rng(1).normal(size=8)
    assert not find_structure(*left_by(NOISE * np.repeat(offsets, 250)), ALPHA, SHARE).place


def test_a_run_that_leaves_all_numbers_is_no_feature_but_no_obstacle():
    """An unstable cart in free run: what it leaves over windows is noise all the same."""
    cart = SLEDGE.replace(equations={"v": "(F + 40*m*v)/m"})
    t, rng = np.arange(0, 60, 0.02), np.random.default_rng(0)
    X, y = np.c_[t, np.sin(t)], rng.normal(size=(t.size, 1))
    problem = build_problem(cart, read_records(cart, X, y), window_length=0.5)
    trial = HypothesisFitter(problem).base()
    assert not find_structure(problem, trial, ALPHA, SHARE).is_significant


# -- structure -------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    "effect", [effects.CoulombFriction("v", 0.4), effects.QuadraticDrag("v", 0.3)]
)
def test_an_effect_without_a_name_leaves_structure_in_what_it_depends_on(effect):
    structure = find_structure(*left_by(np.zeros(2000), rig=SLEDGE + effect), ALPHA, SHARE)
    assert structure.place == "v"
    assert structure.share > 0.5
    assert structure.memory == 0.0
    assert "v" in structure.depends_on


@pytest.mark.parametrize("name", ["F", IN_RECORD])
def test_structure_depends_on_what_makes_it(X, name):
    values = X.F**3 if name == "F" else 1.0 * (X.t > 3.0)
    signal = 4 * NOISE * ((values - values.mean()) / values.std()).to_numpy()
    structure = find_structure(*left_by(signal), ALPHA, SHARE)
    assert structure.place == "v"
    assert structure.depends_on[0] == name


@pytest.mark.slow
@pytest.mark.parametrize("memory", [0.1, 0.4])
@pytest.mark.parametrize("size", [1.0, 2.5])
def test_a_law_behind_a_lag_is_found_with_its_memory(memory, size):
    """The force passes a lag, and then acts as a sine of what it has become."""
    rig = PhysicsModel(
        {"v": "m/s", "L": "N"},
        {"v": f"(F - d*v - 1.5*sin({size}*L))/m", "L": f"(F - L)/{memory}"},
        {"m": 2.0, "d": 0.5},
        {"F": "N"},
        {"v": "v"},
    )
    structure = find_structure(*left_by(np.zeros(2000), rig=rig), ALPHA, SHARE)
    assert structure.place == "v"
    assert structure.share > 0.7
    assert memory / 2.5 < structure.memory < 2.5 * memory
    assert structure.depends_on[0] == "F"


@pytest.mark.slow
def test_a_second_store_of_heat_is_found_as_a_law_with_memory():
    air = PhysicsModel(
        {"T": "degC"}, {"T": "(P + U*(Ta - T))/C"}, {"C": 60.0, "U": 2.0}, {"P": "W", "Ta": "degC"}
    )
    wall = PhysicsModel(
        {"T": "degC", "W": "degC"},
        {"T": "(P + U*(Ta - T) + 4*(W - T))/C", "W": "(T - W)/100"},
        {"C": 60.0, "U": 2.0},
        {"P": "W", "Ta": "degC"},
        {"T": "T"},
    )
    rng, t, X, y = np.random.default_rng(0), np.arange(0.0, 3000.0, 5.0), [], []
    for record in range(4):
        heat = np.repeat(rng.choice([0.0, 50.0, 100.0], t.size // 40), 40)
        u = np.c_[heat, 15 + 5 * np.sin(t / 400 + record)]
        run = wall.simulate(t, u, [20.0, 20.0], substeps=4)
        X.append(pd.DataFrame({"trajectory": record, "t": t, "P": u[:, 0], "Ta": u[:, 1]}))
        y.append(run.y[:, 0] + 0.02 * rng.normal(size=t.size))
    X = pd.concat(X, ignore_index=True)
    problem = build_problem(air, read_records(air, X, pd.DataFrame({"T": np.concatenate(y)})))
    structure = find_structure(problem, HypothesisFitter(problem).base(), ALPHA, SHARE)
    assert structure.place == "T"
    assert structure.share > 0.5
    assert structure.memory > 0.0


def test_dynamics_without_a_name_leave_structure_though_windows_are_a_third_of_a_record():
    """Few samples have a past that is a window long."""
    problem = build_problem(SERVO, read_records(SERVO, *follow_sines()), window_length=1.67)
    structure = find_structure(problem, HypothesisFitter(problem).base(), ALPHA, SHARE)
    assert structure.is_significant


def test_less_than_the_smallest_share_is_not_worth_saying(X):
    signal = 4 * NOISE * X.F.to_numpy() ** 3 / np.std(X.F**3)
    assert find_structure(*left_by(signal), ALPHA, SHARE).is_significant
    assert not find_structure(*left_by(signal), ALPHA, 0.99).is_significant


@pytest.mark.parametrize("records", [1, 2, 3, 8, 20])
def test_groups_are_records_or_stretches_of_them_and_never_mixed_samples(records):
    record = np.repeat(np.arange(records), 48)
    group = groups_of(record)
    assert np.unique(group).size == STRETCHES
    inside = np.diff(record) == 0
    assert np.count_nonzero(np.diff(group)[inside]) == records * (-(-STRETCHES // records) - 1)
    np.testing.assert_array_equal(groups_of(2 * record + 1), group)  # some have no sample
