"""Joints that do not move: nothing else can be said of them."""

from __future__ import annotations

import numpy as np

from pivident.logs.log import Log
from pivident.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.text.repair import LeftOut, Repair

STANDSTILL = FindingKind(Topic("motion"), "standstill", ("recording", "columns", "q"))

#: Travel below which a joint stands still [rad or m].
STILL = 5e-3


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
