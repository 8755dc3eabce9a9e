"""Friction that changes while a log runs: with a temperature that was logged, or with time.

Grease thins as a gear warms up. With w, the temperature or the time less its mean over its range,
each joint's equation gets two more columns,

    τ = Φ θ + w (β_v dq + β_c sign dq).

Whether they are worth it decides motion that was not fitted: one stretch of time after the other is
left out, and predicted from all others, with and without them.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.foundation.text.numbers import percent
from pivident.foundation.text.sentences import listed
from pivident.judgement.audit.blocked_fit import BLOCKS, blocked_fit
from pivident.judgement.audit.inverse_model import InverseModel

#: Share of the squared error of unseen motion that must go away.
WORTHWHILE = 0.1
#: Share of the stretches in which it must do so: of 20 by chance in one case of 170.
MOSTLY = 0.8
#: Least change of friction over the record, as a share of it.
MIN_CHANGE = 0.03


@dataclass(frozen=True)
class FrictionDrift:
    """Change of one joint's friction over a record.

    Attributes:
        joint: name of the joint.
        change: of friction at its usual speed from the lowest to the highest w, as a share of it.
        gain: share of the squared error of unseen motion that goes away.
    """

    joint: str
    change: float
    gain: float

    def __str__(self) -> str:
        way = "rises" if self.change > 0 else "falls"
        unseen = percent(100 * self.gain)
        return f"friction of {self.joint} {way} by {100 * abs(self.change):.0f} % ({unseen} less " \
            "squared error of unseen motion)"  # fmt: skip


def friction_drifts(model: InverseModel, course: np.ndarray) -> tuple[FrictionDrift, ...]:
    """Joints whose friction clearly follows a slow signal.

    Args:
        model: rows of a log.
        course: temperature or time at the samples of the log, shape (samples,) or (samples,
            joints).

    Returns:
        One entry for each joint whose unseen motion it explains better.
    """
    signals = np.reshape(course, (len(course), -1))
    samples = np.arange(len(signals), dtype=float)
    found = []
    for j in range(model.robot.size):
        values = np.interp(model.first + model.at, samples, signals[:, j % signals.shape[1]])
        if model.usable(j) and np.ptp(values[model.moving[:, j]]) > 0.0:
            drift = _drift(model, j, values)
            if drift is not None:
                found.append(drift)
    return tuple(found)


def drift_text(drifts: Sequence[FrictionDrift]) -> str:
    """All of them as a part of a sentence."""
    return listed([str(drift) for drift in drifts])


def _drift(model: InverseModel, j: int, values: np.ndarray) -> FrictionDrift | None:
    """The change of one joint's friction, where unseen motion confirms it."""
    rows = model.moving[:, j]
    own, dq, block = values[rows], model.dq[rows, j], model.block[rows]
    tau = model.tau()[rows, j]
    w = (own - own.mean()) / np.ptp(own)
    usual = float(np.median(np.abs(dq)))
    friction = np.column_stack([dq / usual, np.sign(dq)])
    steady = model.bases[j] * np.sqrt(len(tau))
    moving = np.column_stack([steady, w[:, None] * friction])
    before, behind = (_unseen_errors(columns, tau, block) for columns in (steady, moving))
    gain = 1.0 - float(behind.sum() / before.sum())
    better = float(np.mean(behind < before))
    if len(before) < BLOCKS // 2 or gain < WORTHWHILE or better < MOSTLY:
        return None
    level = blocked_fit(friction, _rest(model, j, tau), block).estimate.sum()
    change = blocked_fit(moving, tau, block).estimate[-2:].sum()
    if not abs(change) > MIN_CHANGE * abs(level):
        return None
    return FrictionDrift(model.robot.joint_names[j], float(change / abs(level)), gain)


def _rest(model: InverseModel, j: int, tau: np.ndarray) -> np.ndarray:
    """Torque of a joint less that of gravity and inertia after the description."""
    rows = model.moving[:, j]
    return np.asarray(tau - model.gravity[rows, j] - model.inertial[rows, j])


def _unseen_errors(columns: np.ndarray, y: np.ndarray, block: np.ndarray) -> np.ndarray:
    """Squared error of each stretch, predicted by a fit on all others, shape (stretches,)."""
    fit = blocked_fit(columns, y, block)
    parts = np.unique(block)
    return np.array(
        [
            float(np.sum((y[block == b] - columns[block == b] @ without) ** 2))
            for b, without in zip(parts, fit.replicates, strict=True)
        ]
    )
