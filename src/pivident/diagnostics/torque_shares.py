"""How much torque parameters of a result can make at most."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import shown_std
from pivident.motion.wanted_motion import FullMotion, MotionLimits

#: Samples of the record at which the columns are looked at.
SAMPLES = 400


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
    reach = (np.abs(result.theta) + 2.0 * shown_std(result))[places]
    shares = np.zeros(len(names))
    for motion in (full, FullMotion(robot, q[some], dq[some], ddq[some])):
        columns = motion.columns(result.parameters)
        torque = np.sqrt(np.mean((columns @ result.theta) ** 2, axis=0))
        own = np.sqrt(np.mean(columns[:, :, places] ** 2, axis=0)) * reach
        share = np.divide(own, torque[:, None], out=np.where(own > 0.0, np.inf, 0.0),
                          where=torque[:, None] > 0.0)  # fmt: skip
        shares = np.maximum(shares, share.max(axis=0))
    return shares
