"""Whether the logged speeds are those of the positions: the clock, a unit or a ratio.

A logged speed that is a times the derivative of its position by the stamps of the log,

    dq_j = a_j d(q_j)/dt,

has another clock than they have if all joints have the same a, and another unit or gear ratio if
one joint has it alone. No torque is asked, and none need show it: least squares puts up with a
wrong clock by wrong inertias and viscous frictions.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.data.logs.units import UNITS_OF
from pivident.estimation.problem import Problem
from pivident.foundation.text.numbers import format_significant
from pivident.foundation.text.repair import Edit, Multiplied, Repair, Retimed
from pivident.judgement.audit.speed import UNEXPLAINED, compare
from pivident.judgement.audit.standstill import STILL

#: Distance of a factor from one, relative, from which on something is wrong.
OFF = 0.05

#: Spread between joints within which they have one and the same factor, relative.
SAME = 0.03


@dataclass(frozen=True)
class SpeedEvidence:
    """What the logged speeds say.

    Attributes:
        repair: what would make them those of the positions.
        sentence: the evidence, with its numbers.
    """

    repair: Repair
    sentence: str


def speed_evidence(problem: Problem) -> tuple[SpeedEvidence, ...]:
    """What the logged speeds say against clock, units or ratios.

    Args:
        problem: its recordings may have measured speeds.

    Returns:
        Nothing where there are none, or where they are those of the positions.
    """
    names = problem.robot.joint_names
    measured = [_factors(r.q, r.dq, r.rate) for r in problem.recordings if r.dq is not None]
    if not measured:
        return ()
    factors = np.nanmedian(np.array(measured), axis=0)
    known = np.flatnonzero(np.isfinite(factors))
    off = [j for j in known if abs(factors[j] - 1.0) > OFF]
    if not off:
        return ()
    typical = float(np.median(factors[known]))
    alike = np.abs(factors[known] / typical - 1.0) < SAME
    if len(known) > 1 and alike.all():
        return (_common(typical, len(known)),)
    return tuple(_single(names[j], float(factors[j])) for j in off if len(known) > 1)


def _factors(q: np.ndarray, dq: np.ndarray, rate: float) -> np.ndarray:
    """Factor of each joint's logged speed, NaN where it stands or is another signal."""
    factors = np.full(q.shape[1], np.nan)
    for j in range(q.shape[1]):
        compared = compare(q[:, j], dq[:, j], rate) if np.ptp(q[:, j]) > STILL else None
        if compared is not None and compared[2] < UNEXPLAINED:
            factors[j] = compared[0]
    return factors


def _common(factor: float, joints: int) -> SpeedEvidence:
    """One factor of all joints: a unit of the speeds, or the clock."""
    units = UNITS_OF["dq"]
    named = next((u for u, worth in units.items() if abs(factor * worth - 1.0) < OFF), None)
    shown = format_significant(factor, 3)
    if named is not None and units[named] != 1.0:
        edit = Edit(("recording", "units", "dq"), named)
        return SpeedEvidence(Repair((edit,)), f"The logged speeds are in {named}.")
    faster = factor > 1.0
    times = format_significant(factor if faster else 1.0 / factor, 3)
    text = (
        f"The clock runs {times} times as {'slowly' if faster else 'fast'} as the logged speeds "
        f"say: on each of {joints} joints they are {shown} times the derivative of the positions."
    )
    return SpeedEvidence(Repair((Retimed(factor=float(f"{1.0 / factor:.4g}")),)), text)


def _single(joint: str, factor: float) -> SpeedEvidence:
    """A factor of one joint alone: the unit or the ratio of its position."""
    text = (
        f"The logged speed of {joint} is {format_significant(factor, 3)} times the derivative of "
        "its position, and those of other joints are not: its unit or its gear ratio is another."
    )
    edit = Multiplied(channel="q", factors=((joint, float(f"{factor:.4g}")),))
    return SpeedEvidence(Repair((edit,)), text)
