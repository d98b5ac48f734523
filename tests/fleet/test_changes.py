"""What changed on a machine, and what only seems so."""

import math

import numpy as np
import pytest

from sklearn_pgnn.fleet.changes import changes_between
from sklearn_pgnn.fleet.machine import Machine

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
