"""Bags of joint states to begin with: ROS 1, MCAP and SQLite, plain and compressed."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

from fuzzing.table_inputs import log_table


def _joint_states(is_ros1: bool):
    """A typestore and messages of joint states, among them partial ones and other orders."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if is_ros1 else Stores.ROS2_HUMBLE)
    state = store.types["sensor_msgs/msg/JointState"]
    own = {"seq": 0} if is_ros1 else {}
    messages = []
    for k, row in enumerate(log_table(30)):
        stamp = store.types["builtin_interfaces/msg/Time"](1, 1_000_000 * k)
        header = store.types["std_msgs/msg/Header"](stamp=stamp, frame_id="b", **own)
        names, columns = (["q1", "q2"], [1, 2]) if k % 3 else (["q2"], [2])
        q, tau = row[columns], row[[5, 6]][: len(names)]
        messages.append((10**9 + 1_000_000 * k, state(header, names, q, q[:0], tau)))
    return store, messages


def _written_bag(kind: str) -> bytes:
    """A bag of one file: ``bag``, ``lz4.bag``, ``bz2.bag``, ``mcap``, ``zstd.mcap``, ``db3``."""
    from rosbags.rosbag1 import Writer as Ros1Writer
    from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
    from rosbags.rosbag2 import Writer as Ros2Writer

    is_ros1 = kind.endswith("bag")
    store, messages = _joint_states(is_ros1)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "log"
        if is_ros1:
            writer = Ros1Writer(path)
            if kind != "bag":
                writer.set_compression(Ros1Writer.CompressionFormat[kind[:3].upper()])
        else:
            plugin = StoragePlugin.SQLITE3 if kind == "db3" else StoragePlugin.MCAP
            writer = Ros2Writer(path, version=9, storage_plugin=plugin)
            if kind == "zstd.mcap":
                writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
        with writer:
            name = "sensor_msgs/msg/JointState"
            topic = writer.add_connection("/joint_states", name, typestore=store)
            serialize = store.serialize_ros1 if is_ros1 else store.serialize_cdr
            for received, message in messages:
                writer.write(topic, received, serialize(message, name))
        return (path if is_ros1 else next(path.glob(f"*.{kind[-4:].lstrip('.')}"))).read_bytes()


@cache
def bag_seeds() -> tuple[bytes, ...]:
    """ROS 1 bags, plain and compressed."""
    return tuple(_written_bag(kind) for kind in ("bag", "lz4.bag", "bz2.bag"))


@cache
def mcap_seeds() -> tuple[bytes, ...]:
    """MCAP files, plain and compressed."""
    return tuple(_written_bag(kind) for kind in ("mcap", "zstd.mcap"))


@cache
def db3_seeds() -> tuple[bytes, ...]:
    """A database of ROS 2."""
    return (_written_bag("db3"),)
