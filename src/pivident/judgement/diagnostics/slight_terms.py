"""Terms that make hardly any torque, and what leaving them out does.

A friction or a rotor inertia that came out negative, or a parameter that may be zero, is of no
consequence where it makes less than a hundredth of any joint's torque. Least squares without all of
these is solved from the sums of a repair search, and its error on motion that was not fitted
compared with that of the whole model.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.signs import negative_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import ParameterRow, parameter_rows
from pivident.estimation.problem import Problem
from pivident.judgement.diagnostics.reading_rows import ReadingRows, mean_error
from pivident.judgement.diagnostics.repair_search import clearly_lower
from pivident.loop.motion.wanted_motion import FullMotion, MotionLimits

#: Share of any joint's torque below which a parameter makes no difference.
SLIGHT = 0.01

#: Samples of the record at which the columns are looked at.
SAMPLES = 400


@dataclass(frozen=True)
class LeftOut:
    """Least squares without the terms of no consequence.

    Attributes:
        names: parameters that were left out.
        before: geometric mean of the joints' errors on stretches that were not fitted [%].
        after: the same without them [%].
        is_needed: whether the error is clearly larger without them.
    """

    names: tuple[str, ...]
    before: float
    after: float
    is_needed: bool


def left_out(problem: Problem, result: Identification) -> LeftOut | None:
    """The trial, where something is negative beyond doubt or may be zero, and makes no torque."""
    rows = ReadingRows.of(problem)
    if rows is None:
        return None
    negative = negative_parameters(result.parameters, result.names, result.theta, result.std)
    doubtful = [p.name for p in negative if p.is_certain]
    doubtful += [r.name for r in parameter_rows(result) if r.includes_zero]
    slight = np.array(doubtful)[torque_shares(result, doubtful) < SLIGHT]
    names = tuple(name for name in rows.parameters if name in slight)
    if not names or len(names) == len(rows.parameters):
        return None
    given, other = rows.scores(), rows.without(names)
    return LeftOut(names, mean_error(given), mean_error(other), clearly_lower(given - other, 1))


def torque_shares(result: Identification, names: Sequence[str]) -> np.ndarray:
    """Largest share of a joint's torque that each parameter makes at the far end of its interval.

        max_j  (|θ_i| + 2σ_i) rms φ_ji / rms (Φθ)_j

    It is the larger one of the shares in the record and in motion within the robot's limits: a
    parameter of little torque here may have much there, and the other way round.

    Args:
        result: the estimate.
        names: parameters of it.

    Returns:
        Shares, shape (names,); NaN where the result has no record.
    """
    if not names or not result.recordings:
        return np.full(len(names), np.nan)
    robot, records = result.robot, result.recordings
    q, dq, ddq = (np.vstack([getattr(r, name) for r in records]) for name in ("q", "dq", "ddq"))
    full = FullMotion.within(robot, MotionLimits.of(robot, q, dq, ddq))
    some = np.unique(np.linspace(0, len(q) - 1, min(SAMPLES, len(q))).astype(int))
    places = [result.names.index(name) for name in names]
    reach = (np.abs(result.theta) + 2.0 * result.std)[places]
    shares = np.zeros(len(names))
    for motion in (full, FullMotion(robot, q[some], dq[some], ddq[some])):
        columns = motion.columns(result.parameters)
        torque = np.sqrt(np.mean((columns @ result.theta) ** 2, axis=0))
        own = np.sqrt(np.mean(columns[:, :, places] ** 2, axis=0)) * reach
        share = np.divide(own, torque[:, None], out=np.where(own > 0.0, np.inf, 0.0),
                          where=torque[:, None] > 0.0)  # fmt: skip
        shares = np.maximum(shares, share.max(axis=0))
    return shares


def zero_and_slight(
    result: Identification, rows: Sequence[ParameterRow]
) -> tuple[tuple[str, ...], tuple[str, ...]]:
    """Parameters that may be zero, and those among them that make hardly any torque in any case.

    The second are not in the first: no motion is needed to tell what makes no difference.

    Args:
        result: the estimate.
        rows: its parameters.
    """
    names = [r.name for r in rows if r.includes_zero]
    slight = (torque_shares(result, names) < SLIGHT).tolist()  # unknown shares are not slight
    return (
        tuple(name for name, small in zip(names, slight, strict=True) if not small),
        tuple(name for name, small in zip(names, slight, strict=True) if small),
    )
