"""What changed on a machine and what only seems so, what is usual in a fleet, and who is odd."""

import math

import numpy as np
import pytest

from sklearn_pgnn.fleet.changes import changes_between
from sklearn_pgnn.fleet.machine import Machine
from sklearn_pgnn.fleet.spread import first_ones, spread_of, standard_error

pytestmark = pytest.mark.core


def found(causes=(), m=2.0, error=0.05, verdict=None):
    named = [
        {"effect": effect, "target": "v", "parameters": {}, "gain_percent": 50.0,
         "probability": chance, "confused_with": [
             {"effect": other, "target": "v", "probability": 1 - chance} for other in rivals]}
        for effect, chance, rivals in causes
    ]  # fmt: skip
    mass = {"prior": 2.0, "value": m, "low": m - 1.96 * error, "high": m + 1.96 * error}
    return {
        "verdict": verdict or ("cause_named" if named else "model_adequate"),
        "causes": named,
        "gain": {},
        "free_run": {},
        "parameters": {"m": {**mass, "unit": "kg"}},
        "remaining": {"kind": "noise", "times_noise": {}},
        "data_quality": [],
    }


def changed(before, now, rate=0.01):
    earlier = {name: Machine(name, what) for name, what in before.items()}
    return changes_between(earlier, [Machine(name, what) for name, what in now.items()], rate)


def test_a_cause_comes_and_goes():
    friction = found([("coulomb_friction", 0.9, ("stribeck_friction",))])
    (came,) = changed({"a": found()}, {"a": friction})
    assert (came.kind, came.machine, came.sure) == ("cause", "a", pytest.approx(1.0))
    assert came.what == "Coulomb friction on v is newly named"
    (went,) = changed({"a": friction}, {"a": found()})
    assert (went.kind, went.what) == ("gone", "Coulomb friction on v is no longer named")


def test_another_name_for_what_may_be_the_same_is_no_change():
    one = found([("coulomb_friction", 0.6, ("stribeck_friction",))])
    other = found([("stribeck_friction", 0.6, ("coulomb_friction",))])
    assert changed({"a": one}, {"a": other}) == ()
    sure = found([("stribeck_friction", 1.0, ())])
    assert changed({"a": one}, {"a": sure}) == ()


def test_a_verdict_alone_is_told_last():
    now = {"a": found(verdict="unexplained"), "b": found([("coulomb_friction", 1.0, ())])}
    changes = changed({"a": found(), "b": found()}, now)
    assert [change.machine for change in changes] == ["b", "a"]
    assert math.isnan(changes[1].sure)


def test_a_parameter_that_differs_is_told_with_both_values():
    (change,) = changed({"a": found()}, {"a": found(m=2.6)})
    assert change.kind == "quantity"
    assert change.what == "m: 2.00 (1.90 to 2.10) kg before, 2.60 (2.50 to 2.70) kg now"
    assert change.sure > 0.999


def test_a_thousand_machines_that_did_not_change_are_not_told_to():
    rng = np.random.default_rng(0)
    names = [f"m{k}" for k in range(1000)]
    before, now = ({name: found(m=2.0 + 0.05 * rng.normal()) for name in names} for _ in range(2))
    assert changed(before, now) == ()
    now["m7"] = found(m=3.0)
    assert [change.machine for change in changed(before, now)] == ["m7"]


def test_new_and_failed_machines_have_not_changed():
    assert changed({}, {"a": found(m=9.0)}) == ()
    assert changed({"a": None}, {"a": found(m=9.0)}) == ()
    assert changed({"a": found()}, {"a": None}) == ()


def estimates(values, error):
    reach = 1.96 * error
    return {
        f"m{k}": {"value": v, "low": v - reach, "high": v + reach, "prior": 1.0, "unit": "kg"}
        for k, v in enumerate(values)
    }


def test_a_common_value_is_shared_and_nobody_is_odd():
    odd = shared = 0
    for seed in range(50):
        values = 2.0 + 0.1 * np.random.default_rng(seed).normal(size=40)
        found = spread_of("m", estimates(values, 0.1), 0.01)
        odd, shared = odd + bool(found.odd), shared + found.shared
    assert odd <= 5
    assert shared >= 45


def test_the_spread_between_machines_is_told_from_the_errors_of_the_estimates():
    rng = np.random.default_rng(0)
    values = 2.0 + 0.3 * rng.normal(size=2000) + 0.2 * rng.normal(size=2000)
    found = spread_of("m", estimates(values, 0.2), 0.01)
    assert found.spread == pytest.approx(0.3, rel=0.1)
    assert not found.shared


def test_many_odd_machines_do_not_hide_each_other():
    values = 2.0 + 0.01 * np.random.default_rng(0).normal(size=50)
    values[:10] += 1.0
    found = spread_of("m", estimates(values, 0.01), 0.01)
    assert set(found.odd) == {f"m{k}" for k in range(10)}


@pytest.mark.parametrize("n", [4, 5, 6, 9])
def test_one_of_few_machines_that_differs_by_half_is_odd(n):
    rng = np.random.default_rng(n)
    for size in 10.0 ** rng.uniform(-3, 3, 20):
        values = size * (1.0 + 0.003 * rng.normal(size=n))
        which = rng.integers(n)
        values[which] *= 1.54
        found = spread_of("K", estimates(values, 0.003 * size), 0.01)
        assert list(found.odd) == [f"m{which}"]
        assert found.shared  # by the others
        assert found.odd[f"m{which}"] < 0.01


@pytest.mark.parametrize("between", [0.0, 0.05])
def test_few_machines_that_are_alike_have_no_odd_one(between):
    rng, odd = np.random.default_rng(0), 0
    for n in rng.integers(2, 9, 300).tolist():
        values = 1.0 + between * rng.normal(size=n) + 0.01 * rng.normal(size=n)
        odd += bool(spread_of("m", estimates(values, 0.01), 0.01).odd)
    assert odd <= 8  # 3 are expected at most


def test_of_two_machines_none_is_odd_and_of_three_only_one_that_is_far_off():
    assert spread_of("m", estimates([1.0, 9.0], 0.01), 0.01).odd == {}
    assert spread_of("m", estimates([1.0, 1.0, 1.3], 0.01), 0.01).odd == {}
    assert list(spread_of("m", estimates([1.0, 1.0, 9.0], 0.01), 0.01).odd) == ["m2"]


def test_an_open_interval_is_neither_odd_nor_counted():
    found = estimates([1.0, 1.01, 0.99, 1.0, 1.02, 50.0], 0.01)
    found["m5"]["high"] = None
    assert standard_error(found["m5"]["low"], None) == np.inf
    spread = spread_of("m", found, 0.01)
    assert spread.odd == {}
    assert spread.usual == 1.0


def test_no_estimate_is_no_spread():
    assert spread_of("m", {}, 0.01) is None


def test_of_those_chosen_few_are_there_by_chance():
    rng, wrong = np.random.default_rng(0), []
    for _ in range(300):
        chances = np.concatenate([rng.uniform(size=200), np.full(20, 1e-6)])
        chosen = first_ones(chances, 0.1)
        wrong.append(chosen[:200].sum() / chosen.sum())
        assert chosen[200:].all()
    assert np.mean(wrong) < 0.11


def test_what_is_not_known_is_not_chosen():
    assert first_ones([np.nan, 1e-9], 0.05).tolist() == [False, True]
    assert first_ones([], 0.05).tolist() == []
