"""A key is the same for the same, in any process, and another for anything else."""

import subprocess
import sys
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import pandas as pd
import pytest
from sledge import SLEDGE, drive

import sklearn_pgnn
from sklearn_pgnn import effects
from sklearn_pgnn.exceptions import OptionError
from sklearn_pgnn.fleet.content_key import files_key, records_key, setting_key

pytestmark = pytest.mark.core


@pytest.mark.slow
def test_the_key_of_a_setting_is_the_same_in_another_process():
    code = (
        "from sledge import SLEDGE; from sklearn_pgnn import effects;"
        "from sklearn_pgnn.fleet.content_key import setting_key;"
        "print(setting_key(SLEDGE, {'catalogue': effects.CATALOGUE, 'alpha': 0.01}))"
    )
    folders = [Path(__file__).parents[1], Path(sklearn_pgnn.__file__).parents[1]]
    again = subprocess.run(
        [sys.executable, "-c", f"import sys; sys.path[:0] = {[*map(str, folders)]}; {code}"],
        stdout=subprocess.PIPE,
        text=True,
        check=True,
    )
    options = {"catalogue": effects.CATALOGUE, "alpha": 0.01}
    assert again.stdout.strip() == setting_key(SLEDGE, options)


@pytest.mark.parametrize(
    "other",
    [
        (SLEDGE.with_parameters(m=2.1), {}),
        (SLEDGE, {"alpha": 0.02}),
        (SLEDGE, {"catalogue": ()}),
        (SLEDGE, {"targets": ["v"]}),
        (SLEDGE, {"noise_std": [0.1]}),
    ],
)
def test_another_model_or_option_has_another_key(other):
    assert setting_key(*other) != setting_key(SLEDGE, {})


def test_how_a_machine_is_diagnosed_does_not_matter():
    assert setting_key(SLEDGE, {"n_jobs": 3}) == setting_key(SLEDGE, {})


def test_ids_and_effects_are_the_same_catalogue():
    by_id = setting_key(SLEDGE, {"catalogue": ["coulomb_friction"]})
    assert by_id == setting_key(SLEDGE, {"catalogue": (effects.CoulombFriction,)})


def test_an_effect_of_ones_own_is_told_by_what_it_does():
    def make(power):
        @dataclass(frozen=True)
        class Drag(effects.CoulombFriction):
            id = "drag"

            def typical(self, *args):
                return power

        return Drag

    def key(kind):
        return setting_key(SLEDGE, {"catalogue": (kind,)})

    @dataclass(frozen=True)
    class Drag(effects.CoulombFriction):
        id = "drag"
        phrase = "drag"

    assert key(make(2)) == key(make(2))
    assert key(make(2)) != key(Drag)
    assert key(make(2)) != key(make(3))


def test_properties_constants_and_defaults_of_an_effect_of_ones_own_count():
    def make(said, table, default):
        @dataclass(frozen=True)
        class Drag(effects.CoulombFriction):
            id = "drag"
            levels = table

            @property
            def hint(self):
                return said

            def typical(self, model, scales, share=default):
                return share

        return setting_key(SLEDGE, {"catalogue": (Drag,)})

    known = make("a", {"low": 1.0}, 2)
    assert make("a", {"low": 1.0}, 2) == known
    assert make("b", {"low": 1.0}, 2) != known
    assert make("a", {"low": 2.0}, 2) != known
    assert make("a", {"low": 1.0}, 3) != known


def test_an_option_that_cannot_be_told_is_refused():
    with pytest.raises(OptionError, match=r"random_state: expected numbers or texts.*a seed"):
        setting_key(SLEDGE, {"random_state": np.random.RandomState(0)})


def test_records_differ_by_every_sample_and_name():
    X, y = drive(samples=50)
    key = records_key(X, y)
    changed = X.copy()
    changed.loc[7, "F"] += 1e-9
    assert records_key(X.copy(), y.copy()) == key
    assert records_key(changed, y) != key
    assert records_key(X.rename(columns={"F": "G"}), y) != key
    assert records_key(X, y + 1e-9) != key
    assert records_key(X.iloc[::-1], y) != key


def test_dates_and_names_of_trajectories_are_content():
    t = pd.date_range("2026-01-01", periods=4, freq="s")
    X = pd.DataFrame({"t": t, "trajectory": list("aabb"), "F": 1.0})
    assert records_key(X, [0.0] * 4) != records_key(X.assign(trajectory=list("aaab")), [0.0] * 4)


def test_files_differ_by_name_content_and_clock(tmp_path):
    one, other = tmp_path / "one.csv", tmp_path / "other.csv"
    one.write_text("t,v\n0,1\n")
    other.write_text("t,v\n0,1\n")
    key = files_key([one], None)
    assert files_key([one], 0.1) != key
    assert files_key([other], None) != key
    one.write_text("t,v\n0,2\n")
    assert files_key([one], None) != key
