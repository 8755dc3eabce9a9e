"""Bags written by rosbags, of joint states as robots send them."""

from __future__ import annotations

from dataclasses import dataclass, field
from pathlib import Path

import numpy as np
from rosbags.rosbag1 import Writer as Ros1Writer
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin, Writer as Ros2Writer
from rosbags.typesys import Stores, get_types_from_msg, get_typestore

#: 2023-11-14 22:13:20 UTC, and the midnight before.
EPOCH = 1_700_000_000
MIDNIGHT = EPOCH - EPOCH % 86400

POINT = "trajectory_msgs/JointTrajectoryPoint"
OLDER = (
    f"std_msgs/Header header\nstring[] joint_names\n{POINT} desired\n{POINT} actual\n{POINT} error"
)
NEWER = (
    f"std_msgs/Header header\nstring[] joint_names\n{POINT} reference\n{POINT} feedback\n"
    f"{POINT} error\n{POINT} output\nstring[] multi_dof_joint_names\n"
    + "\n".join(
        f"trajectory_msgs/MultiDOFJointTrajectoryPoint multi_dof_{name}"
        for name in ("reference", "feedback", "error", "output")
    )
)
STATE = "control_msgs/msg/JointTrajectoryControllerState"


def typestore(kind: str, state: str = NEWER):
    store = get_typestore(Stores.ROS1_NOETIC if kind.endswith(".bag") else Stores.ROS2_HUMBLE)
    store.register(get_types_from_msg(state, STATE))
    return store


@dataclass
class Messages:
    """Messages of one topic: when received [s since EPOCH], and their content."""

    topic: str
    type: str
    content: list = field(default_factory=list)


def header(store, t, is_ros1, sequence=0):
    nanoseconds = EPOCH * 10**9 + round(t * 1e9) if t is not None else 0
    time = store.types["builtin_interfaces/msg/Time"](nanoseconds // 10**9, nanoseconds % 10**9)
    own = {"seq": sequence} if is_ros1 else {}
    return store.types["std_msgs/msg/Header"](stamp=time, frame_id="base", **own)


def joint_state(store, is_ros1, t, names, position, velocity=(), effort=()):
    return store.types["sensor_msgs/msg/JointState"](
        header=header(store, t, is_ros1),
        name=list(names),
        position=np.asarray(position, float),
        velocity=np.asarray(velocity, float),
        effort=np.asarray(effort, float),
    )


def joint_states(store, is_ros1, names, t, q, tau, topic="/joint_states", late=0.4e-3):
    """One message for each sample, received a little later than stamped."""
    made = Messages(topic, "sensor_msgs/msg/JointState")
    for k in range(len(t)):
        efforts = () if tau is None else tau[k]
        message = joint_state(store, is_ros1, t[k], names, q[k], np.zeros(len(names)), efforts)
        made.content.append((t[k] + late, message))
    return made


def write_bag(folder: Path, kind: str, store, topics: list[Messages]) -> Path:
    """Write a bag; kinds are ``bag``, ``lz4.bag``, ``bz2.bag``, ``sqlite3``, ``sqlite3+file`` …"""
    is_ros1 = kind.endswith("bag")
    path = folder / (f"log-{kind.replace('.', '-')}.bag" if is_ros1 else f"log-{kind}")
    if is_ros1:
        writer = Ros1Writer(path)
        if kind != ".bag":
            writer.set_compression(Ros1Writer.CompressionFormat[kind[:3].upper()])
    else:
        plugin, _, mode = kind.partition("+")
        writer = Ros2Writer(path, version=9, storage_plugin=StoragePlugin[plugin.upper()])
        if mode:
            writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    with writer:
        named = {
            topic: writer.add_connection(topic, kind_of, typestore=store)
            for topic, kind_of in {m.topic: m.type for m in topics}.items()
        }
        connections = [named[m.topic] for m in topics]
        every = [
            (received, k, message) for k, m in enumerate(topics) for received, message in m.content
        ]
        serialize = store.serialize_ros1 if is_ros1 else store.serialize_cdr
        for received, k, message in sorted(every, key=lambda one: one[0]):
            data = serialize(message, topics[k].type)
            writer.write(connections[k], EPOCH * 10**9 + round(received * 1e9), data)
    return path
