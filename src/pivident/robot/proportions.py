"""Joints that follow others in proportion, without loops of links.

Where only linear constraints R q = r close a mechanism, with the independent joints q_a and the
others q_d,

    q = N q_a + q_0,    N_d = -R_d⁺ R_a,    q_0d = R_d⁺ r

are the same at every posture.
"""

from __future__ import annotations

import numpy as np

from pivident.robot.description import Robot

#: Ratios below this share of the largest are rounding.
ROUNDING = 1e-12


def proportions(robot: Robot) -> tuple[np.ndarray, np.ndarray] | None:
    """N, shape (tree joints, joints), and q_0 [rad or m], shape (tree joints,).

    None where loops of links move joints.
    """
    constraints, count = robot.constraints, robot.tree.size
    if constraints is None:
        return np.eye(count), np.zeros(count)
    if constraints.closures:
        return None
    own = list(constraints.places)
    others = [i for i in range(count) if i not in own]
    rows = np.array([one.ratios for one in constraints.linear])
    offsets = np.array([one.offset for one in constraints.linear])
    scale = np.abs(rows).max(axis=1)
    rows, offsets = rows / scale[:, None], offsets / scale
    right = np.column_stack([-rows[:, own], offsets])
    solved = np.linalg.lstsq(rows[:, others], right, rcond=None)[0]
    solved[np.abs(solved) < ROUNDING * np.abs(solved).max(axis=0, initial=0.0)] = 0.0
    gain, rest = np.zeros((count, len(own))), np.zeros(count)
    gain[own] = np.eye(len(own))
    gain[others], rest[others] = solved[:, :-1], solved[:, -1]
    return gain, rest
