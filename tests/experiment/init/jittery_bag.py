"""A bag as a robot leaves it: jittery joint states in any order, a controller's state beside."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
from scipy.interpolate import CubicSpline

from pivident.robot.gallery import load_robot
from tests.bags import STATE, Messages, header, joint_state, typestore, write_bag
from tests.planar_log import planar_log

#: Rates of the joint states and of the controller's state [Hz].
STATES, CONTROLLER = 500.0, 100.0


def jittery_bag(
    folder: Path,
    rate: float = CONTROLLER,
    lead: float = 0.0,
    gap: Sequence[float] | None = None,
    stamped: bool = True,
    torques: float = STATES,
) -> Path:
    """Write the bag.

    Args:
        folder: where.
        rate: of the controller's state [Hz].
        lead: how far the controller's clock is ahead of that of the joint states [s].
        gap: times between which the controller says nothing [s].
        stamped: whether the controller's messages carry stamps.
        torques: rate of the torques; another one than `STATES` puts them into a topic of their
            own [Hz].
    """
    rng = np.random.default_rng(4)
    log = planar_log()
    t, q, q_ref, tau = log[:, 0], *(log[:, k : k + 2] for k in (1, 3, 5))
    q, q_ref = np.deg2rad(q), np.deg2rad(q_ref)
    seen = np.arange(0.01, t[-1] - 0.01, 1.0 / STATES)
    seen += rng.uniform(-0.4e-3, 0.4e-3, len(seen))
    asked = np.arange(0.013, t[-1] - 0.01, 1.0 / rate)
    if gap is not None:
        asked = asked[(asked < gap[0]) | (asked > gap[1])]
    store, names = typestore("mcap"), np.array(load_robot("planar_2r").joint_names)
    measured, torque = CubicSpline(t, q)(seen), CubicSpline(t, tau)(seen)
    states = Messages("/joint_states", "sensor_msgs/msg/JointState")
    for k, now in enumerate(seen):
        o = rng.permutation(2)
        effort = torque[k, o] if torques == STATES else ()
        message = joint_state(store, False, now, names[o], measured[k, o], (), effort)
        states.content.append((now + 0.4e-3, message))
    controller = Messages("/arm_controller/controller_state", STATE)
    wanted = CubicSpline(t, q_ref)(asked)
    for k, now in enumerate(asked):
        state = _state(store, now + lead if stamped else None, names[::-1], wanted[k, ::-1].copy())
        controller.content.append((now + 0.4e-3, state))
    drives = Messages("/drives", states.type)
    if torques != STATES:
        for now in np.arange(0.02, t[-1] - 0.02, 1.0 / torques):
            effort = np.array([np.interp(now, t, column) for column in tau.T])
            drives.content.append((now, joint_state(store, False, now, names, (), (), effort)))
    topics = [states, controller, drives] if drives.content else [states, controller]
    return write_bag(folder, "mcap", store, topics)


def _state(store, t: float | None, names: np.ndarray, reference: np.ndarray):
    """One state of a controller that tells its reference alone."""
    kinds = store.types

    def point(values=()):
        duration = kinds["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
        none = np.empty(0)
        return kinds["trajectory_msgs/msg/JointTrajectoryPoint"](
            positions=np.array(values, float), velocities=none, accelerations=none, effort=none,
            time_from_start=duration,
        )  # fmt: skip

    duration = kinds["builtin_interfaces/msg/Duration"](sec=0, nanosec=0)
    nowhere = kinds["trajectory_msgs/msg/MultiDOFJointTrajectoryPoint"](
        transforms=[], velocities=[], accelerations=[], time_from_start=duration
    )
    parts = ("reference", "feedback", "error", "output")
    return kinds[STATE](
        header=header(store, t, False),
        joint_names=list(names),
        **{part: point(reference if part == "reference" else ()) for part in parts},
        multi_dof_joint_names=[],
        **{f"multi_dof_{part}": nowhere for part in parts},
    )
