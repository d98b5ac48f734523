"""Bags of ROS 1 and ROS 2, written by rosbags, come back as X and y."""

import numpy as np
import pytest
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2 import Writer as Writer2
from rosbags.typesys import Stores, get_typestore

from sklearn_pgnn import PhysicsModel
from sklearn_pgnn.exceptions import RecordError
from sklearn_pgnn.trajectories import read_file

ARM = PhysicsModel(
    {"phi": "rad"}, {"phi": "(u - phi)/T"}, {"T": 0.5}, {"u": "N m"},
    columns={"u": "/torque/data", "phi": "/joints/position/1"},
)  # fmt: skip
START = 1_700_000_000_000_000_000
TIMES = START + 10_000_000 * np.arange(100)


def write(writer, store, serialize):
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
        write(Writer1(path), store, store.serialize_ros1)
        return path
    store = get_typestore(Stores.ROS2_HUMBLE)
    plugin = StoragePlugin.SQLITE3 if request.param == "sqlite" else StoragePlugin.MCAP
    path = tmp_path / "run"
    write(Writer2(path, version=9, storage_plugin=plugin), store, store.serialize_cdr)
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
