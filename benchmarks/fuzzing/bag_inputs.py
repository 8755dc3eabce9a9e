"""Bags of joint states to begin with: ROS 1, MCAP and SQLite, plain and compressed."""

from __future__ import annotations

import tempfile
from functools import cache
from pathlib import Path

import numpy as np

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
        if k % 5 == 0:  # another publisher, whose joints stand still
            other = state(header, ["q2", "q1"], np.zeros(2), q[:0], q[:0])
            messages.append((10**9 + 1_000_000 * k + 1, other))
    return store, messages


def _motors(store, is_ros1: bool):
    """Messages of a robot's own type, which has arrays of other types, and names in them."""
    from rosbags.typesys import get_types_from_msg

    time = "time" if is_ros1 else "builtin_interfaces/Time"
    motor = "float32 q\nstring[] names\nfloat64[] values\nint16[2] temperature"
    low = f"{time} stamp\nstring[] joint_names\nown_msgs/Motor[2] motor\nown_msgs/Motor[] more"
    store.register(get_types_from_msg(motor, "own_msgs/msg/Motor"))
    store.register(get_types_from_msg(low, "own_msgs/msg/Low"))
    motor, low = store.types["own_msgs/msg/Motor"], store.types["own_msgs/msg/Low"]
    stamp = store.types["builtin_interfaces/msg/Time"](1, 2)
    for k in range(20):
        one = motor(0.1 * k, ["position", "effort"], np.ones(2), np.int16([20, 30]))
        sent = low(stamp, ["a", "b"], [one, one], [one] * (k % 3))
        yield 10**9 + 1_000_000 * k, sent


def _written_bag(kind: str) -> bytes:
    """A bag of one file: ``bag``, ``lz4.bag``, ``bz2.bag``, ``mcap``, ``zstd.mcap``, ``db3``."""
    from rosbags.rosbag1 import Writer as Ros1Writer
    from rosbags.rosbag2 import (
        CompressionFormat,
        CompressionMode,
        StoragePlugin,
        Writer as Ros2Writer,
    )

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
            own = "own_msgs/msg/Low"
            motors = list(_motors(store, is_ros1))
            low = writer.add_connection("/lowstate", own, typestore=store)
            for received, message in motors:
                writer.write(low, received, serialize(message, own))
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
