"""Files of every kind are the same records, and every error has its place."""

from functools import partial

import numpy as np
import pandas as pd
import pytest
from scipy.io import savemat

from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.physics import PhysicsModel
from sklearn_pgnn.trajectories import read_file, read_files, read_records

CART = PhysicsModel(
    name="cart",
    states={"x": "m", "v": "m/s"},
    inputs={"F": "N"},
    outputs={"position": "x"},
    parameters={"m": 2.0},
    equations={"x": "v", "v": "F/m"},
    columns={"F": "force"},
)
RUN = pd.DataFrame(
    {
        "t": [0.0, 0.1, 0.2, 0.4, 0.5],
        "force": [1.0, 2.0, 3.0, 4.0, 5.0],
        "position": [0.5, 0.6, np.nan, 0.8, 0.9],
        "x": [0.5, np.nan, np.nan, np.nan, np.nan],
    }
)
X = pd.DataFrame(
    {"trajectory": "run", "t": RUN["t"], "F": RUN["force"], "x": RUN["x"]}, columns=None
)


def to_csv(path, table):
    table.to_csv(path, index=False)


def to_mat(path, table):
    savemat(path, {name: table[name].to_numpy() for name in table})


def to_mat_columns(path, table):
    """Write column vectors, as MATLAB has them, into a struct beside settings."""
    columns = {name: table[name].to_numpy()[:, None] for name in table}
    savemat(path, {"data": columns, "rig": "A", "gain": 2.0, "calibration": np.arange(7.0)})


def to_hdf5_mat(path, table, block=512, group="data"):
    """Write what MATLAB's ``save -v7.3`` writes: rows for columns, behind a block of text."""
    h5py = pytest.importorskip("h5py")
    with h5py.File(path, "w", userblock_size=block) as file:
        for name in table:
            file[f"{group}/{name}"] = table[name].to_numpy()[None, :]
        file["#refs#/a"] = np.zeros((3, 2))
        file["gain"] = np.array([[2.0]])


def to_tdms(path, table):
    nptdms = pytest.importorskip("nptdms")
    with nptdms.TdmsWriter(path) as writer:
        writer.write_segment(
            [nptdms.ChannelObject("rig", name, table[name].to_numpy()) for name in table]
        )


def to_parquet(path, table):
    pytest.importorskip("pyarrow")
    table.to_parquet(path)


def to_excel(path, table):
    pytest.importorskip("openpyxl")
    table.to_excel(path, index=False)


KINDS = {
    "csv": (to_csv, "csv"),
    "mat": (to_mat, "mat"),
    "mat with a struct of columns": (to_mat_columns, "mat"),
    "mat 7.3": (to_hdf5_mat, "mat"),
    "hdf5": (partial(to_hdf5_mat, block=0, group="run 1/channels"), "h5"),
    "tdms": (to_tdms, "tdms"),
    "parquet": (to_parquet, "parquet"),
    "excel": (to_excel, "xlsx"),
}
every_kind = pytest.mark.parametrize("kind", KINDS)


def write(folder, kind, table, stem="run"):
    save, ending = KINDS[kind]
    path = folder / f"{stem}.{ending}"
    save(path, table)
    return path


def refusal(path, model=CART, **options):
    """Return what is said behind the file's name."""
    with pytest.raises(RecordError) as caught:
        read_file(path, model, **options)
    message = str(caught.value)
    assert message.startswith(str(path))
    assert "\n" not in message
    return message.removeprefix(str(path))


@every_kind
def test_a_file_of_any_kind_is_the_same_record(tmp_path, kind):
    found, y = read_file(write(tmp_path, kind, RUN), CART)
    pd.testing.assert_frame_equal(found, X, check_dtype=False)
    pd.testing.assert_frame_equal(y, RUN[["position"]])
    (record,) = read_records(CART, found, y)
    assert record.t.tolist() == RUN["t"].tolist()


@every_kind
def test_a_file_may_hold_several_trajectories(tmp_path, kind):
    two = pd.concat([RUN.assign(trajectory=3.0), RUN.assign(trajectory=4.0)])
    found, _ = read_file(write(tmp_path, kind, two.reset_index(drop=True)), CART)
    assert found["trajectory"].tolist() == ["3"] * 5 + ["4"] * 5 or kind == "csv"
    assert found["t"].tolist() == RUN["t"].tolist() * 2


def test_files_of_several_kinds_are_read_together(tmp_path):
    paths = [write(tmp_path, "mat", RUN), write(tmp_path, "csv", RUN)]
    found, y = read_files([*paths, write(tmp_path, "csv", RUN, "other")], CART)
    assert found["trajectory"].unique().tolist() == ["run", "run-2", "other"]
    assert len(found) == len(y) == 15


@pytest.mark.parametrize("kind", ["parquet", "excel", "csv"])
def test_a_header_may_carry_a_unit(tmp_path, kind):
    named = RUN.rename(columns={"force": "force [N]", "t": "t (s)"})
    found, _ = read_file(write(tmp_path, kind, named), CART)
    assert found["F"].tolist() == RUN["force"].tolist()


# -- time ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("kind", ["parquet", "excel", "csv"])
def test_dates_are_a_time(tmp_path, kind):
    dates = pd.Timestamp("2026-01-31 23:59:59.9") + pd.to_timedelta(RUN["t"], unit="s")
    found, _ = read_file(write(tmp_path, kind, RUN.assign(t=dates)), CART)
    np.testing.assert_allclose(found["t"], RUN["t"], atol=1e-9)


def test_an_index_of_dates_in_a_parquet_file_is_a_time(tmp_path):
    dates = pd.Timestamp("2026-01-31", tz="Europe/Berlin") + pd.to_timedelta(RUN["t"], unit="s")
    table = RUN.drop(columns="t").set_index(pd.DatetimeIndex(dates))
    found, _ = read_file(write(tmp_path, "parquet", table), CART)
    np.testing.assert_allclose(found["t"], RUN["t"], atol=1e-9)


@pytest.mark.parametrize(
    "stamps",
    [
        ["2026-01-31 12:00:00", "2026-01-31 12:00:00.005", "2026-01-31 12:00:00.010"],
        ["2026-01-31T12:00:00Z", "2026-01-31T12:00:00.005Z", "2026-01-31T12:00:00.01Z"],
        ["2026-01-31T12:00:00+01:00", "2026-01-31T11:00:00.005+00:00", "2026-01-31T11:00:00.010Z"],
    ],
)
@pytest.mark.parametrize("separator", [",", ";"])
def test_a_csv_file_may_have_iso_time_stamps(tmp_path, stamps, separator):
    stamps = [
        *stamps,
        "2026-01-31T12:00:01.015+01:00" if "+" in stamps[0] else stamps[0][:11] + "12:00:01.015",
    ]
    table = RUN[1:].assign(t=stamps)
    table.to_csv(tmp_path / "run.csv", index=False, sep=separator)
    found, _ = read_file(tmp_path / "run.csv", CART)
    np.testing.assert_allclose(found["t"], [0.0, 0.005, 0.01, 1.015], atol=1e-12)


def test_trajectories_of_dates_begin_at_zero_each(tmp_path):
    dates = pd.date_range("2026-01-31", periods=10, freq="s").strftime("%Y-%m-%d %H:%M:%S")
    two = pd.concat([RUN, RUN]).assign(t=dates, trajectory=np.repeat([3, 4], 5))
    found, _ = read_file(write(tmp_path, "csv", two), CART)
    assert found["t"].tolist() == [0.0, 1.0, 2.0, 3.0, 4.0] * 2


def test_time_stamps_that_stand_still_or_are_none_have_their_line(tmp_path):
    stamps = [f"2026-01-31 12:00:0{k}" for k in (1, 3, 2, 4, 5)]
    message = refusal(write(tmp_path, "csv", RUN.assign(t=stamps)))
    assert message.startswith(
        ":4: column 't': expected time to increase, got 2026-01-31 12:00:02 after "
        "2026-01-31 12:00:03 in line 3: the rows are out of order. Remedy: sort"
    )
    stamps[2] = "half past"
    assert refusal(write(tmp_path, "csv", RUN.assign(t=stamps))) == (
        ":4: column 't': expected a time such as 2026-01-31 12:00:00.005, got 'half past'. "
        "Remedy: write all times that way, or as seconds."
    )


@every_kind
def test_a_file_without_a_time_takes_a_sample_time(tmp_path, kind):
    path = write(tmp_path, kind, RUN.drop(columns="t"))
    found, _ = read_file(path, CART, sample_time=0.25)
    assert found["t"].tolist() == [0.0, 0.25, 0.5, 0.75, 1.0]
    assert "sample_time=0.01 [s] (--sample-time)" in refusal(path)


def test_every_trajectory_of_a_sample_time_begins_at_zero(tmp_path):
    two = pd.concat([RUN, RUN]).drop(columns="t").assign(trajectory=np.repeat(["a", "b"], 5))
    path = write(tmp_path, "csv", two)
    found, _ = read_file(path, CART, sample_time=0.5)
    assert found["t"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0] * 2


def test_a_sample_time_overrides_a_time_and_says_so(tmp_path):
    path = write(tmp_path, "csv", RUN)
    with pytest.warns(RecordWarning, match=r"takes 2 s, by the column 't'.* 0.5 s. Remedy: leave"):
        found, _ = read_file(path, CART, sample_time=0.5)
    assert found["t"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    coarse = write(tmp_path, "csv", RUN.assign(t=["10:00:00"] * 3 + ["10:00:01"] * 2), "coarse")
    assert "the stamps are too coarse. Remedy: log finer stamps, or give" in refusal(coarse)
    found, _ = read_file(coarse, CART, sample_time=0.5)
    assert found["t"].tolist() == [0.0, 0.5, 1.0, 1.5, 2.0]
    backward = write(tmp_path, "csv", RUN.assign(t=[5.0, 4.0, 3.0, 2.0, 1.0]), "backward")
    assert "the rows run backward in time" in refusal(backward, sample_time=0.5)


@pytest.mark.parametrize("value", [0.0, -1.0, np.inf, np.nan, "0.1", True])
def test_a_sample_time_is_a_positive_number(tmp_path, value):
    with pytest.raises(ValueError, match=r"^sample_time: expected the sample interval in seconds"):
        read_file(write(tmp_path, "csv", RUN), CART, sample_time=value)


def test_the_remedy_for_a_missing_time_is_no_column_that_something_else_needs(tmp_path):
    path = write(tmp_path, "csv", RUN.drop(columns="t"))
    assert refusal(path) == (
        ":1: column 't': missing; the file has force, position, x. Remedy: add it to the file. "
        "Or, if it has no time, give the sample interval: sample_time=0.01 [s] (--sample-time)."
    )


# -- what is refused -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("kind", "place"),
    [("csv", ":4"), ("mat", ", row 3"), ("mat 7.3", ", row 3"), ("parquet", ", row 2"),
     ("excel", ", row 4")],
)  # fmt: skip
def test_an_error_has_its_row(tmp_path, kind, place):
    path = write(tmp_path, kind, RUN.assign(force=[1.0, 2.0, np.nan, 4.0, 5.0]))
    assert refusal(path).startswith(f"{place}: column 'force': expected a number, got nothing.")
    path = write(tmp_path, kind, RUN.assign(t=[0.0, 0.1, 0.05, 0.2, 0.3]))
    message = refusal(path)
    assert message.startswith(f"{place}: column 't': expected time to increase, got 0.05 after 0.1")
    path = write(tmp_path, kind, RUN[:3])
    assert "expected at least 4 samples in a record, got 3 in 'run'" in refusal(path)


@pytest.mark.parametrize("kind", ["parquet", "excel"])
def test_a_text_among_numbers_has_its_row(tmp_path, kind):
    texts = RUN.assign(force=["1", "2", "two", "4", "5"])
    row = {"parquet": 2, "excel": 4}[kind]
    assert refusal(write(tmp_path, kind, texts)) == (
        f", row {row}: column 'force': expected a number, got 'two'. Remedy: give a number in "
        f"every row, or cut the record there."
    )
    found, _ = read_file(write(tmp_path, kind, texts.replace("two", "3")), CART)
    assert found["F"].tolist() == RUN["force"].tolist()


@every_kind
def test_a_missing_column_has_a_remedy(tmp_path, kind):
    path = write(tmp_path, kind, RUN.rename(columns={"force": "force_act"}))
    message = refusal(path)
    names = {"csv": "CSV", "parquet": "Parquet file", "excel": "Excel file"}
    names |= {"hdf5": "HDF5 file", "tdms": "TDMS file"}
    name = names.get(kind, "MAT file")
    assert f"what the {name} calls it, as in columns: {{F: force_act}}." in message


@pytest.mark.parametrize("ending", ["mat", "parquet", "xlsx"])
def test_what_is_no_such_file_is_refused(tmp_path, ending):
    path = tmp_path / f"run.{ending}"
    with pytest.raises(RecordError, match=r"expected an? \w+ file, got: No such file"):
        read_file(path, CART)
    path.write_text("t,force,position\n0,1,2\n")
    assert refusal(path).startswith(": expected a")


def test_arrays_that_are_no_vectors_of_one_length_are_refused(tmp_path):
    path = tmp_path / "run.mat"
    values = {name: RUN[name].to_numpy() for name in RUN}
    savemat(path, values | {"force": np.zeros((5, 2))})
    assert refusal(path).startswith(
        ": variable 'force': expected a vector of 5 samples, got an array of shape (5, 2). Remedy: "
    )
    savemat(path, values | {"position": np.zeros(4)})
    assert "'position': expected a vector of 5 samples, got an array of shape (4,)" in refusal(path)
    savemat(path, {"note": "a table is an object"})
    assert "got none. Remedy: in MATLAB, s = table2struct(data, 'ToScalar', true)" in refusal(path)


def test_a_matrix_gives_its_columns_by_number(tmp_path):
    path = tmp_path / "run.mat"
    matrix = np.column_stack([RUN["t"], RUN["position"], RUN["force"]])
    called = {"t": "log_1", "F": "log_3", "position": "log_2"}
    model = CART.replace(columns=called)
    for saved in (matrix, matrix.T):
        savemat(path, {"log": saved, "gain": 2.0})
        X, y = read_file(path, model)
        assert X["F"].tolist() == RUN["force"].tolist()
        assert y["position"].equals(RUN["position"])
    assert "the file has log_1, log_2, log_3" in refusal(path)


def test_names_that_two_structs_share_are_told_apart(tmp_path):
    path = tmp_path / "run.mat"
    values = {name: RUN[name].to_numpy() for name in RUN}
    other = {"force": np.full(5, 7.0)}
    savemat(path, {"rig": values, "plan": other})
    found, _ = read_file(path, CART.replace(columns={"F": "plan.force"}))
    assert found["F"].tolist() == [7.0] * 5
    assert "the file has t, rig.force, position, x, plan.force" in refusal(path)


def test_the_waveform_of_a_channel_is_the_clock_of_its_file(tmp_path):
    nptdms = pytest.importorskip("nptdms")
    wave = {"wf_increment": 0.1, "wf_start_offset": 0.0, "wf_samples": 5}
    with nptdms.TdmsWriter(tmp_path / "run.tdms") as writer:
        for name in ("force", "position"):
            values = RUN[name].to_numpy()
            writer.write_segment([nptdms.ChannelObject("rig", name, values, properties=wave)])
    found, y = read_file(tmp_path / "run.tdms", CART)
    np.testing.assert_allclose(found["t"], 0.1 * np.arange(5), atol=1e-12)
    pd.testing.assert_frame_equal(y, RUN[["position"]])


def test_vectors_in_a_column_are_columns_of_their_own(tmp_path):
    pytest.importorskip("pyarrow")
    table = pd.DataFrame({"timestamp": RUN["t"], "episode_index": [3, 3, 3, 3, 3]})
    table["action"] = [np.array([force, 9.0]) for force in RUN["force"]]
    table["observation.state"] = [[0.0, position] for position in RUN["position"]]
    table.to_parquet(tmp_path / "run.parquet")
    columns = {"t": "timestamp", "F": "action/0", "position": "observation.state/1"}
    model = CART.replace(columns={**columns, "trajectory": "episode_index"})
    found, y = read_file(tmp_path / "run.parquet", model)
    assert found["trajectory"].tolist() == ["3"] * 5
    assert found["F"].tolist() == RUN["force"].tolist()
    pd.testing.assert_frame_equal(y, RUN[["position"]])
