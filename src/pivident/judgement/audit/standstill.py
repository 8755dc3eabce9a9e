"""Joints that do not move, of which nothing else can be said, and an arm that rests at the ends.

At rest dry friction holds a joint with any torque up to its own. What is before the motion and
behind it tells nothing, and friction that sticks there speaks against signs and delays.
"""

from __future__ import annotations

import numpy as np

from pivident.data.logs.log import Log
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import LeftOut, Repair, setting

STANDSTILL = FindingKind(Topic("motion"), "standstill", ("recording", "columns", "q"))

AT_ENDS = FindingKind(Topic("motion"), "rest at the ends", ("recording", "part"), reservation=True)

#: Travel below which a joint stands still [rad or m].
STILL = 5e-3

#: Travel within 0.1 s that is none, as share of a joint's fastest.
SLOW = 0.02

#: Share of a joint's path before its motion begins and after it has ended.
CREEP = 0.005

#: Rest at the ends that is told, as share of a log and at least [s].
MUCH_REST, LONG_REST = 0.1, 1.0


def still_joints(q: np.ndarray) -> list[int]:
    """Joints that move by no more than noise; positions q of shape (samples, joints) [rad or m]."""
    if not len(q):
        return []
    travel = np.quantile(q, 0.999, axis=0) - np.quantile(q, 0.001, axis=0)
    return np.flatnonzero((travel > 0) & (travel < STILL)).tolist()


def check_standstill(log: Log) -> list[Finding]:
    """An error that names every joint that stands still throughout."""
    q = log.channels["q"]
    q = q[np.isfinite(q).all(axis=1)]
    still = still_joints(q)
    if not still:
        return []
    names = ", ".join(log.joint_names[j] for j in still)
    step = (
        "Repeat the record with motion of this joint, or freeze it (URDF) and leave its columns "
        "out; its parameters cannot be identified. If it did move, check the unit of q."
    )
    if len(still) == q.shape[1]:
        names = "the whole arm" if len(still) > 1 else names
        step = (
            "Take a record in which the arm moves, name the part in which it does, or check the "
            "unit of q."
        )
    travel = 1e3 * np.ptp(q, axis=0)
    most = max(still, key=lambda j: travel[j])
    farthest = float(travel[most])
    unit = {"rad": "mrad", "m": "mm"}.get(log.position_unit(most), "mrad (or mm)")
    text = f"Standstill: {names} moves by {farthest:.3g} {unit} in the whole record."
    evidence = {"travel": Quantity(farthest, unit, bound=1e3 * STILL)}
    left_out = LeftOut(at=tuple((log.joint_names[j], 0.0) for j in still))
    repairs = [Repair((left_out,))] if len(still) < q.shape[1] else []
    return [STANDSTILL.finding("error", text, names, step, evidence, repairs=repairs)]


def motion_window(q: np.ndarray, seconds: np.ndarray) -> tuple[float, float, float]:
    """First and last time of motion, but for `CREEP` at both ends, and the share of rest between.

    Args:
        q: positions, shape (samples, joints) [rad or m].
        seconds: time of each sample, shape (samples,) [s].
    """
    step = max(1, round(0.1 * (len(q) - 1) / max(float(seconds[-1] - seconds[0]), 1e-9)))
    if step >= len(q):
        return float(seconds[0]), float(seconds[-1]), 0.0
    travel = np.abs(q[step:] - q[:-step])
    moving = travel > SLOW * np.quantile(travel, 0.995, axis=0) + 1e-12
    path = np.cumsum(np.where(moving, travel, 0.0), axis=0)
    if not path[-1].any():
        return float(seconds[0]), float(seconds[-1]), 1.0
    share = path[:, path[-1] > 0] / path[-1, path[-1] > 0]
    first = int(np.argmax((share > CREEP).any(axis=1)))
    last = int(np.argmax((share >= 1.0 - CREEP).all(axis=1)))
    still = 1.0 - float(moving[first : last + 1].any(axis=1).mean())
    return float(seconds[first]), float(seconds[last + step]), still


def check_rest_at_ends(q: np.ndarray, seconds: np.ndarray) -> list[Finding]:
    """A warning where an arm rests for long before its motion or behind it; shapes as above."""
    if len(q) < 2 or still_joints(q) == list(range(q.shape[1])):
        return []
    first, last, _ = motion_window(q, seconds)
    before, behind = first - float(seconds[0]), float(seconds[-1]) - last
    if before + behind < max(MUCH_REST * float(seconds[-1] - seconds[0]), LONG_REST):
        return []
    ends = [f"the first {before:.3g} s", f"the last {behind:.3g} s"]
    rests = " and ".join(text for text, t in zip(ends, (before, behind), strict=True) if t >= 0.05)
    part = [float(f"{first:.6g}"), float(f"{last:.6g}")]
    step = f"Keep to the motion: part = [{part[0]:g}, {part[1]:g}] under [recording]."
    evidence, repairs = {"rest": Quantity(before + behind, "s")}, [setting("part", value=part)]
    text = f"The arm rests for {rests}."
    return [AT_ENDS.finding("warning", text, "", step, evidence, repairs=repairs)]
