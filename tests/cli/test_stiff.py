"""Stable stiff models simulate from `check` on, and `--substeps` is for every column."""

import json

import numpy as np
import pandas as pd
import pytest
from click.testing import CliRunner
from scipy.integrate import solve_ivp

from sklearn_pgnn.cli import main

pytestmark = pytest.mark.core

#: a catalyst C that is used and given back: two fast reactions, and a slow one
MODEL = """
name: catalysis
states: {C: mol/L, A: mol/L, CA: mol/L, P: mol/L}
outputs: {product: P}
parameters:
  k1: {value: %s, unit: L/mol/s, bounds: [10, 1.0e+7]}
  k2: {value: %s, unit: 1/s, bounds: [1, 1.0e+7]}
equations:
  C: -k1*C*A + k2*CA
  A: -k1*C*A
  CA: k1*C*A - k2*CA
  P: k2*CA
"""
TRUTH = {"k1": 2.0e5, "k2": 900.0}


def reaction(t, start):
    k1, k2 = TRUTH.values()

    def rates(_, x):
        first, second = k1 * x[0] * x[1], k2 * x[2]
        return [second - first, -first, first - second, second]

    return solve_ivp(rates, (0, t[-1]), start, "Radau", t, rtol=1e-9, atol=1e-13).y.T


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    path, rng = tmp_path_factory.mktemp("stiff"), np.random.default_rng(0)
    t = np.arange(0, 0.4, 0.005)
    for k, (c, a) in enumerate([(0.0005, 0.1), (0.001, 0.15), (0.0003, 0.06)]):
        x = reaction(t, [c, a, 0.0, 0.0])
        y = x[:, 3] + 2e-4 * rng.standard_normal(t.size)
        table = {"t": t, "product": y}
        starts = zip(["C", "A", "CA", "P"], [c, a, 0.0, 0.0], strict=True)
        table |= {name: np.where(t == 0, value, np.nan) for name, value in starts}
        pd.DataFrame(table).to_csv(path / f"r_{k}.csv", index=False)
    (path / "given.yaml").write_text(MODEL % (2.0e5, 900.0))
    (path / "start.yaml").write_text(MODEL % (6.0e5, 500.0))
    return path


def run(*words):
    result = CliRunner().invoke(main, [str(word) for word in words], catch_exceptions=False)
    assert result.exit_code == 0, result.output
    return result


def test_check_simulates_a_stiff_model(folder):
    records = sorted(folder.glob("r_*.csv"))
    found = json.loads(run("check", "--model", folder / "given.yaml", *records, "--json").stdout)
    assert found["outputs"][0]["fit"] > 98
    assert not [said for said in found["warnings"] if "sign" in said or "non-finite" in said]


def test_every_column_of_a_fit_is_in_the_steps_that_are_told(folder, tmp_path):
    records, fits = sorted(folder.glob("r_*.csv")), []
    for told in ((), ("--substeps", "64")):
        words = ("--output", tmp_path / "o.yaml", "--force", "--json", "--quiet", *told)
        said = run("fit", "--model", folder / "start.yaml", *records, *words).stdout
        fits.append(json.loads(said)["fit_percent"])
    as_given, fitted = ([fit[which]["product"] for fit in fits] for which in ("as given", "fitted"))
    assert as_given[0] == pytest.approx(as_given[1], abs=0.3)
    assert min(fitted) > 90 > max(as_given)


def test_no_sign_is_told_of_a_run_that_diverges(tmp_path):
    """An exploding model with an output far beyond any unit."""
    t = np.arange(0, 4, 0.02)
    pd.DataFrame({"t": t, "u": np.sin(t), "y": -np.sin(t)}).to_csv(tmp_path / "r.csv", index=False)
    (tmp_path / "m.yaml").write_text(
        "states: {y: V}\ninputs: {u: V}\nparameters: {a: 15.0}\nequations: {y: a*y + u}\n"
    )
    said = run("check", "--model", tmp_path / "m.yaml", tmp_path / "r.csv", "--json").stdout
    told = json.loads(said)["warnings"]
    assert not [each for each in told if "opposite sign" in each or "times what" in each]
