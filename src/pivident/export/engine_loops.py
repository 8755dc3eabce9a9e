"""Torques of a mechanism's independent joints from what an engine has read of its tree and loops.

The engine computes the torques of all joints as if nothing closed them, at the motion of all
joints that pivident finds, and has the slopes A of its own constraints. With A N = 0, the torques
of the independent joints are Nᵀ τ. Where the engine's constraints do not hold at that posture, the
torques are NaN.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.robot.description import Robot

#: Largest gap of a loop in the engine at a posture in which it is closed here [m, rad].
GAP = 1e-8

#: Relative size of a singular value of the engine's constraints that counts as zero.
RANK = 1e-8


def whole_motion(
    robot: Robot, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray
) -> tuple[np.ndarray, ...]:
    """Motion of all joints of the tree at states one by one, each shape (samples, tree joints)."""
    if robot.constraints is None:
        return q, dq, ddq
    chains = ClosedChains(robot)
    found = [
        chains.motion(*(x[:, None] for x in state))[:3] for state in zip(q, dq, ddq, strict=True)
    ]
    one, two, three = (np.array([motion[k][:, 0] for motion in found]) for k in range(3))
    return one, two, three


def independent_torque(robot: Robot, tau: np.ndarray, slope: np.ndarray) -> np.ndarray:
    """Nᵀ τ of all joints, (tree joints,), for constraints A, (equations, tree joints)."""
    own = list(robot.places)
    others = [i for i in range(robot.tree.size) if i not in robot.places]
    follow = -np.linalg.lstsq(slope[:, others], slope[:, own], rcond=RANK)[0]
    return np.asarray(tau[own] + follow.T @ tau[others])


def mujoco_slopes(
    mujoco: Any, loaded: Any, data: Any, at_v: list[int]
) -> tuple[np.ndarray, np.ndarray]:
    """Gaps and slopes of MuJoCo's equality constraints at the posture of its data.

    Args:
        mujoco: the library.
        loaded: a model with a dense Jacobian whose constraints are not disabled.
        data: its state.
        at_v: places of the tree's joints among its speeds.
    """
    mujoco.mj_fwdPosition(loaded, data)
    rows = data.efc_type[: data.nefc] == int(mujoco.mjtConstraint.mjCNSTR_EQUALITY)
    slopes = np.array(data.efc_J).reshape(-1, loaded.nv)[: data.nefc]
    return np.array(data.efc_pos[: data.nefc])[rows], slopes[rows][:, at_v]
