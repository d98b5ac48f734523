"""What lies in a gap of a column is interpolated, and no equation is found from it."""

import warnings

import numpy as np
import pandas as pd
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from sklearn_pgnn import SINDYcRegressor
from sklearn_pgnn.exceptions import RecordError, RecordWarning

T = np.arange(0, 10, 0.02)
PERIOD = 2 * np.pi / 3


def machine(frequency, seed):
    """Return records of x' = v, v' = 2 u - v/2 - 9 x - 4 x^3, integrated by scipy."""
    rng, tables, states = np.random.default_rng(seed), [], []
    for name in range(3):
        phase = rng.uniform(0, 6, 2)

        def u(t, f=frequency * (1 + name / 3), phase=phase):
            return 4 * np.sin(f * t + phase[0]) + 2 * np.sin(2.7 * f * t + phase[1])

        def rate(t, x, u=u):
            return [x[1], 2 * u(t) - x[1] / 2 - 9 * x[0] - 4 * x[0] ** 3]

        run = solve_ivp(rate, (0, T[-1]), [0, 0], t_eval=T, rtol=1e-9, atol=1e-9)
        tables.append(pd.DataFrame({"trajectory": name, "t": T, "u": u(T)}))
        states.append(run.y.T)
    y = np.concatenate(states) + 1e-3 * rng.normal(size=(3 * T.size, 2))
    return pd.concat(tables, ignore_index=True), pd.DataFrame(y, columns=["x", "v"])


def equation(X, y, **options):
    fitted = SINDYcRegressor(hold="foh", **options).fit(X, y)
    rates = dict(zip(fitted.terms_, fitted.coefficients_[0], strict=True))
    return {term: value for term, value in rates.items() if value}


@settings(max_examples=8)
@given(
    column=st.sampled_from(["x", "v"]),
    gaps=st.lists(st.integers(20, 1400), min_size=1, max_size=3),
    samples=st.integers(20, 150),
    frequency=st.floats(0.6, 1.5),
)
def test_a_gap_in_one_column_bends_no_equation(column, gaps, samples, frequency):
    X, y = machine(frequency, seed=0)
    for begin in gaps:
        y.loc[begin : begin + samples, column] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", RecordWarning)
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=3e-3)


@pytest.mark.parametrize("column", ["x", "v"])
def test_a_gap_bends_no_map(column):
    X, y = machine(1.0, seed=5)
    expected = equation(X, y, discrete=True, degree=1)
    y.loc[X["t"].between(3, 5) & (X["trajectory"] > 0), column] = np.nan
    found = equation(X, y, discrete=True, degree=1)
    assert found == pytest.approx(expected, abs=1e-3)


@pytest.mark.parametrize("way", ["single samples", "every fifth", "in turns"])
def test_what_is_no_gap_is_used(way):
    X, y = machine(1.0, seed=1)
    place = np.arange(len(y))
    if way == "single samples":
        y.loc[np.random.default_rng(0).integers(0, len(y), 60), "v"] = np.nan
    elif way == "every fifth":
        y.loc[place % 5 != 0, "v"] = np.nan
    else:
        y.loc[place % 2 == 0, "v"] = y.loc[place % 2 == 1, "x"] = np.nan
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=5e-3)


def test_a_column_that_no_term_contains_costs_no_samples():
    X, y = machine(1.0, seed=2)
    y["heat"] = np.where(np.arange(len(y)) % 500 < 300, 20.0 + X["t"], np.nan)
    library = ["x", "v", "u", "x**3"]
    with warnings.catch_warnings():
        warnings.simplefilter("error", RecordWarning)
        assert equation(X, y, library=library) == pytest.approx({"v": 1.0}, abs=3e-3)


def test_where_much_is_lost_there_is_a_warning():
    X, y = machine(1.0, seed=3)
    y.loc[X["t"].between(2, 6), "v"] = np.nan
    with pytest.warns(
        RecordWarning, match=r"y: 4. % of the time lies in gaps of v, and no rate.*Rem"
    ):
        assert equation(X, y) == pytest.approx({"v": 1.0}, abs=5e-3)


def test_nothing_between_gaps_is_refused():
    X, y = machine(1.0, seed=4)
    y.loc[np.arange(len(y)) % 30 > 3, "v"] = np.nan
    with (
        pytest.warns(RecordWarning),
        pytest.raises(RecordError, match=r"none between the gaps of v\. "),
    ):
        SINDYcRegressor(span=0.2).fit(X, y)
