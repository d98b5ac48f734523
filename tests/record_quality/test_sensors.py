"""A sensor that is dead in some records is named with them; a machine at rest is not."""

import numpy as np
import pytest

from sklearn_pgnn import ModelDiagnosis, PhysicsModel
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.record_quality.sensors import find_dead_sensor, find_outliers
from sklearn_pgnn.record_quality.signals import Signal

CART = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - d*v - c*x)/m"},
    {"m": 2.0, "d": 0.5, "c": 3.0},
    {"F": "N"},
)
T = np.arange(0, 16, 0.05)


def records(dead=(), at_rest=(), value=0.1):
    """Return X and y of three records: v is dead in some, or the machine at rest, v counted."""
    rng = np.random.default_rng(0)
    tables, outputs = [], []
    for i in range(3):
        F = np.repeat(rng.uniform(-1, 1, 16), 20) * (i not in at_rest)
        y = CART.simulate(T, F).y + 1e-3 * rng.normal(size=(T.size, 2))
        y[:, 1] = value if i in dead else 0.0 if i in at_rest else y[:, 1]
        tables.append(np.column_stack([T, F]))
        outputs.append(y)
    return np.vstack(tables), np.vstack(outputs)


def found(X, y):
    diagnosis = ModelDiagnosis(CART, catalogue=()).fit(X, y)
    return [each for each in diagnosis.data_quality_ if each.kind == "dead sensor"]


def test_a_diagnosis_names_the_dead_sensor_and_its_records():
    (finding,) = found(*records(dead=(0, 2)))
    assert finding.where == "v"
    assert finding.value == 2.0
    assert finding.text == (
        "v has one value only throughout record 0 (0.1 m/s) and record 2 (0.1 m/s), where the "
        "model moves"
    )
    assert "look at the sensor and its cable" in finding.remedy
    assert "(NaN)" in finding.remedy


def test_a_machine_at_rest_has_no_dead_sensor():
    assert found(*records(at_rest=(1,))) == []


def test_a_sensor_that_is_dead_everywhere_is_refused_with_its_value():
    X, y = records(dead=(0, 1, 2))
    with pytest.raises(RecordError) as caught:
        ModelDiagnosis(CART).fit(X, y)
    assert str(caught.value) == (
        "output 'v': expected a signal that changes, got 0.1 m/s in every sample of every record. "
        "Remedy: look at the sensor and its cable; record the machine in motion, or leave the "
        "output out of the model."
    )


def test_dead_records_do_not_hide_the_noise_of_the_others():
    noisy = np.sin(0.1 * np.arange(300)) + 0.1 * np.random.default_rng(0).normal(size=300)
    pieces = [noisy, np.zeros(300), np.zeros(300)]
    signal = Signal("v", "m/s", pieces, [np.arange(300.0)] * 3, ["a", "b", "c"])
    assert signal.noise == pytest.approx(0.1, rel=0.2)
    assert find_outliers(signal, signal) is None
    unseen = Signal("v", "m/s", [noisy, np.full(300, np.nan)], [np.arange(300.0)] * 2, ["a", "b"])
    assert find_dead_sensor(unseen, unseen) is None
