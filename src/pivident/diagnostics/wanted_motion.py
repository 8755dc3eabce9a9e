"""Motions that would determine parameters of a result, in sentences."""

from __future__ import annotations

import numpy as np

from pivident.estimation.identification import Identification
from pivident.motion.wanted_motion import (
    SENTENCES,
    FullMotion,
    MotionLimits,
    motions_for,
)


def wanted_motions(identification: Identification, names: tuple[str, ...]) -> tuple[str, ...]:
    """Motions that would determine some parameters, one sentence for each kind of motion."""
    if not names or not identification.recordings:
        return ()
    robot, records = identification.robot, identification.recordings
    motion = (np.vstack([getattr(r, name) for r in records]) for name in ("q", "dq", "ddq"))
    limits = MotionLimits.of(robot, *motion)
    heads = [identification.parameters[identification.names.index(name)] for name in names]
    wanted = motions_for(heads, FullMotion.within(robot, limits), limits)
    groups: dict[int, tuple[list[str], set[str]]] = {}
    for name, motion_of_one in zip(names, wanted, strict=True):
        members, moved = groups.setdefault(motion_of_one.kind, ([], set()))
        members.append(name)
        moved.update(motion_of_one.joints)

    def in_order(joints: set[str]) -> str:
        return ", ".join(name for name in robot.joint_names if name in joints)

    return tuple(
        f"For {', '.join(members)}: {SENTENCES[kind].format(joints=in_order(moved))}."
        for kind, (members, moved) in sorted(groups.items())
    )
