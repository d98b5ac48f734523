"""Compiled functions that nobody holds any more leave the memory, and only those."""

import copy
import gc
import weakref
from functools import lru_cache

import numpy as np
import pytest

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.simulation import compiled, machine_code
from sklearn_pgnn.simulation.machine_code import CodeMemory

pytestmark = [
    pytest.mark.core,
    pytest.mark.skipif(compiled.PLAIN_CALLS, reason="numba keeps the code"),
]
T = np.arange(0, 2, 0.1)


def decay(rate):
    """Return a model with a function of its own for every rate."""
    return PhysicsModel({"x": ""}, {"x": f"u - {float(rate)!r}*x"}, inputs={"u": ""})


def run(model):
    return model.simulate(T, np.sin(T), [1.0]).y


@pytest.fixture
def few(monkeypatch):
    """Keep two functions in case they are used again, each in a memory of its own."""
    again = lru_cache(maxsize=2)(compiled._compile.__wrapped__)
    monkeypatch.setattr(compiled, "_compile", again)
    monkeypatch.setattr(machine_code, "FULL", 1)
    monkeypatch.setattr(machine_code._Begun, "memory", None)


def memories():
    gc.collect()
    return sum(isinstance(each, CodeMemory) for each in gc.get_objects())


def test_memory_does_not_grow_with_the_number_of_models(few):
    run(decay(1.0))
    before = memories()
    for rate in range(2, 22):
        run(decay(rate))
    assert memories() <= before + 2


def test_a_function_stays_as_long_as_it_is_held(few):
    model, expected = decay(30.0), run(decay(30.0))
    function, _ = compiled.compile_model(model)
    memory = weakref.ref(function.memory)
    for rate in range(31, 41):
        run(decay(rate))
    gc.collect()
    assert compiled.compile_model(model)[0].argument == function.argument  # it is found again
    assert np.array_equal(run(model), expected)
    for rate in range(31, 41):
        run(decay(rate))
    del function
    gc.collect()
    assert memory() is None
    assert np.array_equal(run(model), expected)  # compiled anew


def test_a_copy_of_a_function_is_in_the_same_memory(few):
    function = copy.deepcopy(compiled.compile_model(decay(50.0))[0])
    for rate in range(51, 61):
        run(decay(rate))
    assert function.memory is compiled.compile_model(decay(50.0))[0].memory
