"""A record may lack one of several outputs, in files as in tables."""

import numpy as np
import pandas as pd
import pytest

from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_csv, read_files, read_records

pytestmark = pytest.mark.core

MODEL = PhysicsModel(
    {"x": "m", "v": "m/s"},
    {"x": "v", "v": "(F - v)/m"},
    {"m": 2.0},
    {"F": "N"},
    outputs={"place": "x", "speed": "v"},
)
RUN = pd.DataFrame({"t": np.arange(6.0), "F": 1.0, "place": np.arange(6.0), "speed": 1.0})


@pytest.mark.parametrize("lacks", [["place"], ["speed"]])
@pytest.mark.parametrize("empty", [True, False], ids=["empty", "absent"])
def test_one_file_of_several_may_lack_an_output(tmp_path, lacks, empty):
    without = RUN.assign(**dict.fromkeys(lacks, np.nan)) if empty else RUN.drop(columns=lacks)
    for order in (0, 1):
        tables = [RUN, without][:: 1 - 2 * order]
        paths = [tmp_path / f"run_{k}.csv" for k in range(2)]
        for path, table in zip(paths, tables, strict=True):
            table.to_csv(path, index=False)
        X, y = read_files(paths, MODEL)
        assert list(y) == ["place", "speed"]
        expected = pd.concat([table.reindex(columns=list(y)) for table in tables])
        np.testing.assert_array_equal(y, expected)
        assert len(read_records(MODEL, X, y)) == 2


@pytest.mark.parametrize(
    ("tables", "said"),
    [
        ([RUN.drop(columns="speed")] * 2, r"run_0.csv:1: column 'speed': missing; .* Remedy: add"),
        ([RUN.assign(speed=np.nan)] * 2, r"run_0.csv:2: column 'speed': expected a measured value"),
        ([RUN, RUN.drop(columns=["place", "speed"])], r"run_1.csv:1: column 'place': missing"),
    ],
)
def test_every_output_needs_a_file_and_every_file_an_output(tmp_path, tables, said):
    paths = [tmp_path / f"run_{k}.csv" for k in range(2)]
    for path, table in zip(paths, tables, strict=True):
        table.to_csv(path, index=False)
    with pytest.raises(RecordError, match=said):
        read_files(paths, MODEL)


def test_of_a_single_file_every_output_is_needed(tmp_path):
    RUN.assign(speed=np.nan).to_csv(tmp_path / "run.csv", index=False)
    with pytest.raises(RecordError, match="Remedy: take the output out of the model, or give with"):
        read_csv(tmp_path / "run.csv", MODEL)
