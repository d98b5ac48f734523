"""Logs of channels, written by the libraries of their formats, come back as X and y."""

import numpy as np
import pytest
from asammdf import MDF, Signal
from click.testing import CliRunner
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.cli import main
from sklearn_pgnn.exceptions import RecordError, RecordWarning
from sklearn_pgnn.trajectories import read_file, read_files

# -- MDF files, written by asammdf -----------------------------------------------------------------

LAG = PhysicsModel(
    {"v": "m/s"}, {"v": "(F - d*v)/m"}, {"m": 2.0, "d": 0.5}, {"F": "N"},
    columns={"F": "force_cmd", "v": "speed"},
)  # fmt: skip
FAST, SLOW = np.arange(0.0, 2.0, 0.01), np.arange(0.005, 2.0, 0.02)


def write(path, *groups):
    """Write an MDF file with a clock for every group."""
    with MDF() as file:
        for clock, channels in groups:
            file.append(
                [Signal(values, clock, name=name, unit=unit) for name, unit, values in channels]
            )
        file.save(path, overwrite=True)
    return path


@pytest.fixture
def one_clock(tmp_path):
    channels = [("force_cmd", "kN", np.sin(FAST)), ("speed", "km/h", np.cos(FAST))]
    return write(tmp_path / "run.mf4", (FAST, [*channels, ("other", "", FAST)]))


def test_columns_and_units_are_those_of_the_model(one_clock):
    X, y = read_file(one_clock, LAG)
    assert np.allclose(X["t"], FAST)
    assert np.allclose(X["F"], 1000 * np.sin(FAST))
    assert np.allclose(y["v"], np.cos(FAST) / 3.6)
    assert X["trajectory"].unique().tolist() == ["run"]


def test_several_files_are_several_trajectories(one_clock):
    X, _ = read_files([one_clock, one_clock], LAG)
    assert X["trajectory"].unique().tolist() == ["run", "run-2"]


def test_clocks_of_their_own_are_kept_or_resampled(tmp_path):
    two = LAG.replace(outputs={"v": "v", "a": "(F - d*v)/m"})
    path = write(
        tmp_path / "run.mf4",
        (FAST, [("force_cmd", "N", np.sin(FAST)), ("speed", "m/s", np.cos(FAST))]),
        (SLOW, [("a", "m/s^2", SLOW)]),
    )
    with pytest.warns(RecordWarning, match="different time stamps"):
        X, y = read_file(path, two)
    seen = y["a"].notna()
    assert np.allclose(X["t"][seen], SLOW[FAST[-1] >= SLOW])
    assert np.allclose(y["v"][~seen], np.cos(X["t"][~seen]))
    assert len(y) == seen.sum() + y["v"].notna().sum()
    X, y = read_file(path, two, sample_time=0.02)
    assert np.allclose(np.diff(X["t"]), 0.02)
    assert not y[1:].isna().any(axis=None)


def test_a_channel_that_is_missing_is_told_with_its_likeness(tmp_path):
    path = write(
        tmp_path / "run.mf4", (FAST, [("force_cmd", "N", FAST), ("velocity", "m/s", FAST)])
    )
    with pytest.raises(
        RecordError, match=r"'speed': missing; .*velocity.*columns: \{v: velocity\}"
    ):
        read_file(path, LAG)


def test_a_channel_that_stands_twice_has_its_group_in_its_name(tmp_path):
    channels = [("force_cmd", "N", FAST), ("speed", "m/s", FAST)]
    path = write(tmp_path / "run.mf4", (FAST, channels), (FAST, [("speed", "m/s", 2 * FAST)]))
    with pytest.raises(RecordError, match=r"0\.speed \[m/s\], 1\.speed \[m/s\]"):
        read_file(path, LAG)
    _, y = read_file(path, LAG.replace(columns={"F": "force_cmd", "v": "1.speed"}))
    assert np.allclose(y["v"], 2 * FAST)


def test_samples_that_are_marked_as_invalid_are_none(tmp_path):
    path, wrong = tmp_path / "run.mf4", np.zeros(FAST.size, dtype=bool)
    wrong[50:60] = True
    broken = np.where(wrong, 99.0, FAST)
    with MDF(version="4.10") as file:
        force = Signal(FAST, FAST, name="force_cmd")
        file.append([force, Signal(broken, FAST, name="speed", invalidation_bits=wrong)])
        file.save(path)
    _, y = read_file(path, LAG)
    assert len(y) == FAST.size - 10
    assert y["v"].max() < 2.0


def test_a_unit_may_be_told_where_the_file_has_none(tmp_path):
    path = write(tmp_path / "run.mf4", (FAST, [("force_cmd", "N", FAST), ("speed", "", FAST)]))
    told = LAG.replace(columns={"F": "force_cmd", "v": "speed [km/h]"})
    assert np.allclose(read_file(path, told)[1]["v"], FAST / 3.6)


def test_what_is_no_mdf_file_is_refused(tmp_path):
    path = tmp_path / "run.mf4"
    path.write_text("t,v\n0,1\n")
    with pytest.raises(RecordError, match=r"run\.mf4: expected an MDF file"):
        read_file(path, LAG)
    with pytest.raises(RecordError, match="No such file"):
        read_file(tmp_path / "none.mf4", LAG)


def test_the_command_line_reads_it(one_clock):
    LAG.to_yaml(one_clock.parent / "lag.yaml")
    given = ["--model", str(one_clock.parent / "lag.yaml"), str(one_clock)]
    said = CliRunner().invoke(main, ["check", *given])
    assert said.exit_code == 0, said.output
    assert "Not used: other." in said.stdout
    assert "kN" in said.stdout


# -- bags of ROS 1 and ROS 2, written by rosbags ---------------------------------------------------

ARM = PhysicsModel(
    {"phi": "rad"}, {"phi": "(u - phi)/T"}, {"T": 0.5}, {"u": "N m"},
    columns={"u": "/torque/data", "phi": "/joints/position/1"},
)  # fmt: skip
START = 1_700_000_000_000_000_000
TIMES = START + 10_000_000 * np.arange(100)


def write_bag(writer, store, serialize):
    """Write a torque as a plain number, and joints with a header that was stamped 3 ms before."""
    types = store.types
    Float, Joints = types["std_msgs/msg/Float64"], types["sensor_msgs/msg/JointState"]
    Header, Time = types["std_msgs/msg/Header"], types["builtin_interfaces/msg/Time"]
    extra = {"seq": 0} if "seq" in Header.__dataclass_fields__ else {}
    with writer:
        torque = writer.add_connection("/torque", Float.__msgtype__, typestore=store)
        joints = writer.add_connection("/joints", Joints.__msgtype__, typestore=store)
        for k, now in enumerate(TIMES):
            stamp = int(now) - 3_000_000
            header = Header(
                stamp=Time(sec=stamp // 10**9, nanosec=stamp % 10**9), frame_id="arm", **extra
            )
            message = Joints(
                header=header,
                name=["a", "b"],
                position=np.array([0.0, 0.01 * k]),
                velocity=np.zeros(2),
                effort=np.zeros(0),
            )
            writer.write(torque, int(now), serialize(Float(data=float(k)), Float.__msgtype__))
            writer.write(joints, int(now), serialize(message, Joints.__msgtype__))


@pytest.fixture(params=["ros1", "sqlite", "mcap"])
def bag(request, tmp_path):
    if request.param == "ros1":
        store = get_typestore(Stores.ROS1_NOETIC)
        path = tmp_path / "run.bag"
        write_bag(Writer1(path), store, store.serialize_ros1)
        return path
    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.SQLITE3 if request.param == "sqlite" else StoragePlugin.MCAP
    path = tmp_path / "run"
    write_bag(Writer2(path, version=9, storage_plugin=plugin), store, store.serialize_cdr)
    return path


def test_topics_are_columns_with_their_own_clocks(bag):
    X, y = read_file(bag, ARM)
    assert X["trajectory"].unique().tolist() == ["run"]
    assert np.allclose(np.diff(X["t"]), 0.01, atol=1e-9)
    # a joint's time is that of its stamp, 3 ms before the torque is the next one
    k = np.round(100 * (X["t"] + 0.003)).astype(int)
    assert np.allclose(y["phi"], 0.01 * k)
    assert np.allclose(X["u"][:-1], (0.3 * (k - 1) + 0.7 * k)[:-1])


def test_a_sample_time_resamples(bag):
    X, y = read_file(bag, ARM, sample_time=0.02)
    assert np.allclose(np.diff(X["t"]), 0.02)
    assert np.allclose(y["phi"], X["t"] + 0.003)


def test_a_single_file_of_ros_2_is_a_record(bag):
    for file in bag.glob("*.[md][cb]*"):
        X, y = read_file(file, ARM)
        assert np.allclose(y["phi"], 0.01 * np.round(100 * (X["t"] + 0.003)))


def test_a_topic_that_is_missing_is_told(bag):
    with pytest.raises(RecordError, match=r"/torque/data.*/joints/position/0"):
        read_file(bag, ARM.replace(columns={"u": "/force/data"}))


def test_what_is_no_bag_is_refused(tmp_path):
    path = tmp_path / "run.bag"
    path.write_text("nothing")
    with pytest.raises(RecordError, match=r"run\.bag: expected a ROS bag"):
        read_file(path, ARM)
