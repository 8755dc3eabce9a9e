"""Identification of a record in amperes, volts or counts: every motor in its own unit.

Without gains the row of motor m determines Φ_m θ/κ_m = c_m: each of its parameters divided by the
motor's gain. Rows are independent of each other, and no scale has to be assumed; but a mass has one
value in the row of the shoulder and another in that of the elbow. Their ratio is the ratio of the
gains.

One row alone separates fewer parameters than all rows together. A column that depends on the
columns before it is left out, and its parameter is grouped with theirs.

Which gains, ratios of gains and scales are known follows from there. Rows of several motors share
inertial parameters: a mass on the forearm acts on shoulder and elbow. In the units of their logs
each row determines such a parameter in its own unit, and its value in one row over that in another
is the ratio of two gains. A known payload, a trusted gain or a trusted parameter is given in N m,
and is an additional node, *ground*.

Motors (and ground) are nodes of a graph; two are connected where the ratio of their gains is known
to within a given fraction at 2σ. Within a connected component all ratios are known. Each component
without ground has exactly one scale that the record does not determine.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.estimation.covariance.sandwich import sandwich
from pivident.estimation.drives.drive_equations import DriveRecord, drive_sums
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.text.display import Displayed

#: Smallest relative remainder of an independent column.
SEPARATE = 1e-3


@dataclass(frozen=True, eq=False)
class MotorInLogUnits(Displayed):
    """Parameters of one motor's row, each divided by the motor's gain.

    Attributes:
        joint: name of the joint.
        names: base parameters that the row separates.
        units: unit of each, such as ``kg m²/(N m/A)``.
        values: θ/κ, shape (parameters,).
        std: standard errors by the sandwich, likewise.
        left_out: parameters that this row alone does not separate from those above.
        relative_error: ‖c - Φθ/κ‖/‖c‖.
    """

    joint: str
    names: tuple[str, ...]  # base parameters that the row separates
    units: tuple[str, ...]  # of each, such as ``kg m²/(N m/A)``
    values: np.ndarray  # θ/κ, (parameters,)
    std: np.ndarray  # standard errors by the sandwich, (parameters,)
    left_out: tuple[str, ...]  # parameters that this row alone does not separate
    relative_error: float  # ‖c - Φθ/κ‖/‖c‖


def identify_in_log_units(
    problem: Problem,
    unit: str | Sequence[str] = "unit of the log",
    signals: RandomWalk | None = None,
) -> tuple[MotorInLogUnits, ...]:
    """Least squares of every motor's row on its own, in the unit of its command.

    Args:
        problem: robot, recordings with commands as ``tau``, parameters.
        unit: unit of the command, the same for all joints or one for each.
        signals: the smoother; default: random walk with the command aligned.

    Returns:
        One answer for each motor.
    """
    for recording in problem.recordings:
        recording.require_torque("motors are identified in the unit of their log")
    units = (unit,) * problem.robot.size if isinstance(unit, str) else tuple(unit)
    records = [
        DriveRecord(estimate_kinematics(r, signals or RandomWalk()), problem.speed_limits(r))
        for r in problem.recordings
    ]
    (sums,) = drive_sums(problem.robot, problem.regressor, records)
    answers = []
    for joint, own, command in zip(problem.robot.joints, sums, units, strict=True):
        unit_of_gain = f"({'N m' if joint.kind == 'revolute' else 'N'}/{command})"
        kept = independent_columns(own.ff)
        row = restricted(own, kept)
        values, std = solved_row(row)
        chosen = own.columns[kept]
        left = row.tt - 2.0 * values @ row.ft + values @ row.ff @ values
        answers.append(
            MotorInLogUnits(
                joint.name,
                tuple(problem.names[c] for c in chosen),
                tuple(f"{problem.regressor.parameters[c].unit}/{unit_of_gain}" for c in chosen),
                values,
                std,
                tuple(problem.names[c] for c in own.columns if c not in chosen),
                float(np.sqrt(max(left, 0.0) / max(row.tt, 1e-300))),
            )
        )
    return tuple(answers)


def independent_columns(gram: np.ndarray, separate: float = SEPARATE) -> np.ndarray:
    """Indices of columns that are independent of those before them, from ΦᵀΦ."""
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    left = gram / np.outer(scale, scale)
    kept = []
    for k in range(len(left)):
        if left[k, k] > separate**2:
            kept.append(k)
            left = left - np.outer(left[:, k], left[k]) / left[k, k]
    return np.array(kept, dtype=int)


def restricted(sums: JointSums, kept: np.ndarray) -> JointSums:
    """The sums of some of a row's columns, renumbered."""
    grid = np.ix_(kept, kept)
    return JointSums(
        sums.name, np.arange(kept.size), sums.zf[grid], sums.zz[grid], sums.ff[grid],
        sums.zt[kept], sums.ft[kept], sums.window_zf[:, kept[:, None], kept],
        sums.window_zt[:, kept], sums.tt, sums.rows,
    )  # fmt: skip


def solved_row(sums: JointSums) -> tuple[np.ndarray, np.ndarray]:
    """Solution of one row's normal equations, and its standard errors by the sandwich."""
    scale = np.sqrt(np.maximum(np.diag(sums.ff), 1e-300))
    values = np.linalg.solve(sums.zf / np.outer(scale, scale), sums.zt / scale) / scale
    return values, np.sqrt(np.diag(sandwich([sums], values, np.ones(1))))


#: Largest relative half width of the 2σ interval of a known ratio.
KNOWN_WITHIN = 0.25


@dataclass(frozen=True, eq=False)
class GainGroup:
    """Motors whose gains are known relative to each other.

    Ratios of a group without anchor are relative to ``reference``, the motor against which the
    others are known best.
    """

    motors: tuple[int, ...]  # indices, ascending
    anchored: bool  # whether the gains themselves are known, not only their ratios
    reference: int


def gain_groups(log_covariance: np.ndarray, known_within: float = KNOWN_WITHIN) -> list[GainGroup]:
    """Connected components of the graph of known ratios, the anchored one first."""
    n = len(log_covariance)
    own = np.diag(log_covariance)
    spread = np.full((n + 1, n + 1), np.inf)
    spread[:n, :n] = own[:, None] + own[None, :] - 2.0 * log_covariance
    spread[n, :n] = spread[:n, n] = own
    known = 2.0 * np.sqrt(np.maximum(spread, 0.0)) <= known_within
    groups, left = [], set(range(n))
    for first in (n, *range(n)):
        if first not in left and first != n:
            continue
        reached, front = {first}, [first]
        while front:
            node = front.pop()
            new = {int(k) for k in np.flatnonzero(known[node])} - reached
            reached |= new
            front.extend(new)
        motors = tuple(sorted(reached - {n}))
        left -= reached
        if motors:
            reference = motors[int(np.argmin(spread[np.ix_(motors, motors)].sum(axis=1)))]
            groups.append(GainGroup(motors, n in reached, reference))
    return groups


def ratio(
    kappa: np.ndarray, log_covariance: np.ndarray, motor: int, reference: int
) -> tuple[float, float]:
    """κ_motor/κ_reference and its standard error."""
    value = float(kappa[motor] / kappa[reference])
    pair: Sequence[int] = (motor, reference)
    block = log_covariance[np.ix_(pair, pair)]
    variance = block[0, 0] + block[1, 1] - 2.0 * block[0, 1] if motor != reference else 0.0
    return value, abs(value) * float(np.sqrt(max(variance, 0.0)))
