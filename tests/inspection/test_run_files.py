"""Records and simulations over one time, in files that other programs read back."""

import xml.etree.ElementTree as ET

import numpy as np
import pytest
from situations import situation

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.inspection import simulated_records
from sklearn_pgnn.inspection.run_files import write_runs
from sklearn_pgnn.trajectories import read_file


def test_records_follow_one_another_and_the_residual_is_of_the_last_model():
    table = simulated_records(situation("named"))
    assert (np.diff(table["time"]) > 0).all()
    for _, record in table.groupby("trajectory"):
        np.testing.assert_allclose(np.diff(record["time"]), np.diff(record["t"]))
    (output,) = situation("named").model.outputs
    left = table[f"{output}/measured"] - table[f"{output}/model extended"]
    np.testing.assert_allclose(table[f"{output}/residual"], left)
    given = table[f"{output}/measured"] - table[f"{output}/model as given"]
    assert np.std(left) < 0.5 * np.std(given)


@pytest.mark.parametrize("kind", ["csv", "parquet", "mcap"])
def test_the_file_reads_back_and_the_layout_shows_every_curve(kind, tmp_path):
    pytest.importorskip({"parquet": "pyarrow", "mcap": "rosbags"}.get(kind, "pandas"))
    table = simulated_records(situation("named"))
    write_runs(table, tmp_path, kind)
    shown = {curve.get("name") for curve in ET.parse(tmp_path / "runs.xml").iter("curve")}
    wanted = [name for name in table if "/" in name]
    if kind == "mcap":
        wanted = [f"/{name.replace(' ', '_')}/data" for name in wanted]
    assert shown == set(wanted)
    columns = {"t": "time", "y": wanted[0], "trajectory": "none"}
    model = PhysicsModel({"x": "m"}, {"x": "0"}, outputs={"y": "x"}, columns=columns)
    X, y = read_file(tmp_path / f"runs.{kind}", model)
    np.testing.assert_allclose(y["y"], table.filter(like="/measured").iloc[:, 0])
    np.testing.assert_allclose(np.diff(X["t"]), np.diff(table["time"]), atol=1e-8)
