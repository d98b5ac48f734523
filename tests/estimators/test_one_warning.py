"""Simulations that fail in one call are one warning, of the category that users know."""

import warnings

import pytest

from sklearn_pgnn.estimators.simulated_predictions import one_simulation_warning
from sklearn_pgnn.exceptions import SimulationWarning


def fail(times: int) -> None:
    for k in range(times):
        warnings.warn(f"simulation {k} failed.", SimulationWarning, stacklevel=1)


def test_the_warning_is_of_the_public_category_and_nested_ones_are_counted():
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with one_simulation_warning():
            for _ in range(2):
                with one_simulation_warning():
                    fail(2)
    assert [each.category for each in caught] == [SimulationWarning]
    assert str(caught[0].message).endswith(" failed. 3 more simulations failed in the same call.")


def test_what_was_warned_of_before_an_error_is_told():
    @one_simulation_warning()
    def predict():
        fail(2)
        raise ValueError("a consequence")

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always")
        with pytest.raises(ValueError, match="a consequence"):
            predict()
    assert [str(each.message) for each in caught] == [
        "simulation 0 failed. 1 more simulation failed in the same call."
    ]


def test_the_warning_names_the_line_of_the_caller():
    @one_simulation_warning()
    def predict():
        fail(1)

    with pytest.warns(SimulationWarning) as caught:
        predict()
    assert caught[0].filename == __file__
