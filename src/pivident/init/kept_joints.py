"""Which joints are identified, and where the others stand."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.init.assumption import DraftError
from pivident.init.robot_file import RobotFile
from pivident.logs.recognition.joint_columns import JointMap
from pivident.logs.recognition.log_file import Run

#: Share of samples with one and the same value from which on a torque is no signal.
MOSTLY_ONE_VALUE = 0.7

#: Motion that is none, as share of the largest motion of a joint of its kind in the log; of a joint
#: alone of its kind as share of all others, that may be logged in a unit a thousand times smaller.
STILL, STILL_ALONE = 1e-3, 1e-6


@dataclass(frozen=True, eq=False)
class KeptJoints:
    """The joints of the experiment."""

    names: tuple[str, ...]  # those that are identified, parents first
    left_out: dict[str, str]  # why each of the others in the log is not, by name
    logged: tuple[str, ...]  # all joints with a column of positions


def kept_joints(
    run: Run, joints: JointMap, machine: RobotFile, wanted: Sequence[str]
) -> KeptJoints:
    """Choose the joints that move and whose torque, where there is one, is a signal."""
    q, tau = joints.channels["q"], joints.channels.get("tau")
    left_out: dict[str, str] = {}
    names = []
    kinds = {joint.name: joint.kind for joint in machine.robot().joints}
    for name in machine.joint_names:
        if name not in q.columns:
            continue
        position = q.values(run, [name])[:, 0]
        alike = [other for other in q.columns if kinds.get(other) == kinds.get(name)]
        still = STILL * _largest_range(run, joints, alike)
        if len(alike) == 1:
            still = STILL_ALONE * _largest_range(run, joints, list(q.columns))
        reason = _reason(run, joints, name, position, still)
        if wanted and name not in wanted:
            reason = "not requested"
        if reason:
            left_out[name] = reason
        else:
            names.append(name)
    missing = [name for name in wanted if name not in names]
    if missing:
        why = left_out.get(missing[0], "the log has no position of it")
        raise DraftError(f"joint {missing[0]!r} cannot be identified: {why}", advice="leave it out")
    if not machine.is_tree:
        names = [n for n in machine.joint_names if n in q.columns]
        names = [n for n in names if tau is None or n in tau.columns]
        if len(names) < len(machine.joint_names):
            lacking = next(n for n in machine.joint_names if n not in names)
            raise DraftError(
                f"the log has no position or no torque of joint {lacking!r}",
                advice=f"only a URDF can be cut down to some joints, {machine.name} cannot",
            )
        left_out = {}
    if not names:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        if tau is None:
            raise DraftError(
                f"no joint moves ({reasons or 'no joint is in the log'})",
                advice="log a motion of them",
            )
        raise DraftError(
            f"no joint both moves and has a torque signal ({reasons or 'no joint is in the log'})",
            advice="log a motion of the joints, check the files, or name the columns in an "
            "experiment file by hand",
        )
    return KeptJoints(tuple(names), left_out, tuple(q.columns))


def _reason(run: Run, joints: JointMap, name: str, position: np.ndarray, still: float) -> str:
    """Why a joint cannot be identified, or nothing; ``still``: motion that is none."""
    tau = joints.channels.get("tau")
    if tau is not None and name not in tau.columns:
        return "it has no torque column"
    finite = position[np.isfinite(position)]
    if not finite.size or np.ptp(finite) <= still or is_noise(finite):
        return "it does not move"
    if tau is None:
        return ""
    useful, why = is_informative(tau.values(run, [name])[:, 0])
    return "" if useful else f"its torque is {why}"


def _largest_range(run: Run, joints: JointMap, names: Sequence[str]) -> float:
    """The largest motion of some joints, in the unit of the log."""
    logged = joints.channels["q"].values(run, names)
    moved = [np.ptp(x[np.isfinite(x)]) for x in logged.T if np.isfinite(x).any()]
    return float(max(moved, default=0.0))


def is_noise(position: np.ndarray) -> bool:
    """Whether neighbouring samples are no more alike than distant ones; position (samples,).

    Σ(x_{k+1} - x_k)² / Σ(x_k - x̄)², von Neumann's ratio, is 2 for white noise, hardly above zero
    for a motion.
    """
    spread = float(np.sum((position - position.mean()) ** 2))
    return float(np.sum(np.diff(position) ** 2)) > spread


def is_informative(tau: np.ndarray) -> tuple[bool, str]:
    """Whether a torque column holds a signal, or why not; tau (samples,)."""
    finite = tau[np.isfinite(tau)]
    if not finite.size:
        return False, "no number in it"
    values, counts = np.unique(finite, return_counts=True)
    share = counts.max() / len(tau)
    if len(values) == 1:
        return False, f"always {values[0]:.4g}"
    if share > MOSTLY_ONE_VALUE:
        return False, f"exactly {values[counts.argmax()]:.4g} in {100 * share:.0f} % of the rows"
    return True, ""
