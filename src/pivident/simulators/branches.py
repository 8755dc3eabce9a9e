"""Branches of a robot: parts that hang on the base side by side and do not move one another.

The legs of a robot whose base is held are robots of their own. Tangents along a joint of one leg
are zero in all others, so that four legs of three joints cost less than one robot of twelve.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission
from pivident.simulation.closed_loop import LoopSignals
from pivident.simulation.controllers import PID, Cascade, Controller, PythonController


def branches(robot: Robot) -> list[tuple[int, ...]]:
    """Indices of the joints of each branch; joints that a coupled motor moves count as one."""
    root = [joint.parent for joint in robot.joints]
    for i, parent in enumerate(root):
        root[i] = i if parent < 0 else root[parent]
    for coupling in robot.couplings:
        kept, gone = root[coupling.motor], root[coupling.joint]
        root = [kept if r == gone else r for r in root]
    return [tuple(np.flatnonzero(np.array(root) == r).tolist()) for r in dict.fromkeys(root)]


def branch_of(robot: Robot, joints: Sequence[int]) -> Robot:
    """A branch as a robot of its own.

    ``joints``: all joints of one or several branches, in order. The names of parameters are those
    of the new robot.
    """
    if len(joints) == robot.size:
        return robot
    place = {old: new for new, old in enumerate(joints)} | {-1: -1}
    drives, own = robot.transmission, np.array(joints)
    part = replace(
        robot,
        joints=tuple(replace(robot.joints[i], parent=place[robot.joints[i].parent]) for i in own),
        links=tuple(robot.links[i] for i in own),
        rotor_inertia=robot.rotor_inertia[own],
        transmission=Transmission(
            drives.reduction[np.ix_(own, own)],
            drives.drive_gain[own],
            drives.position_offset[own],
            np.asarray(drives.gain_given)[own],
        ),
        couplings=tuple(
            replace(c, motor=place[c.motor], joint=place[c.joint])
            for c in robot.couplings
            if c.motor in place
        ),
        friction_nominal={},
        urdf=None,
    )
    nominal = {
        f"{term.stem}{part.label(k)}": robot.friction_nominal.get(f"{term.stem}{robot.label(i)}")
        for k, i in enumerate(joints)
        for term in part.joints[k].friction.terms
    }
    return replace(part, friction_nominal={k: v for k, v in nominal.items() if v is not None})


def can_be_divided(controller: Controller) -> bool:
    """Whether a law has gains joint by joint, and no model of the whole robot."""
    return isinstance(controller, (PID, Cascade)) and not isinstance(controller, PythonController)


def law_of(controller: Controller, joints: Sequence[int], size: int) -> Controller:
    """The law of some of the joints."""
    if len(joints) == size:
        return controller
    own = list(joints)
    changed = {
        name: np.broadcast_to(np.asarray(getattr(controller, name), float), size)[own]
        for name in ("kp", "kd", "ki", "kv")
        if getattr(controller, name, None) is not None
    }
    if isinstance(controller, Cascade):
        return Cascade(
            changed["kp"], changed["kv"], changed.get("ki"), controller.averaged,
            controller.speed_feed_forward,
        )  # fmt: skip
    assert isinstance(controller, PID)
    return PID(
        changed["kp"], changed["kd"], changed.get("ki"), controller.derivative_time,
        controller.speed_feed_forward,
    )  # fmt: skip


def signals_of(signals: LoopSignals, joints: Sequence[int]) -> LoopSignals:
    """What drives some of the joints."""
    own = list(joints)

    def columns(x: np.ndarray | None) -> np.ndarray | None:
        return None if x is None else np.ascontiguousarray(x[:, own])

    reference = columns(signals.q_ref)
    assert reference is not None
    return replace(
        signals,
        q_ref=reference,
        dq_ref=columns(signals.dq_ref),
        inputs=columns(signals.inputs),
        noise=columns(signals.noise),
        drive_gain=signals.drive_gain[own],
        limit=signals.limit[own],
        bound=signals.bound[own],
        speed_bound=signals.speed_bound[own],
        count=None if signals.count is None else np.asarray(signals.count)[own],
    )
