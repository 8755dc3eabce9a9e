"""A reference for records that do not hold one.

Instruments must not know the noise of the record. A reference of few parameters, fitted to the
whole motion, hardly does: smoothed trapezoidal moves from point to point, where the motion is of
that kind. Where it is not, a smoothing spline stands for it (the random walk smoother of order
two is the cubic one, with the smoothness of maximum likelihood); it follows slow noise, and an
identification that uses it says so.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.control_law.point_to_point_fit import PointToPoint, fit_point_to_point
from pivident.signals.random_walk import smooth_channels

#: Largest deviation, rms relative to the range of a joint, at which moves are believed: what a loop
#: of moderate gains leaves between its reference and its motion.
BELIEVED = 5e-3

#: Samples per parameter that a reference must be fitted to.
MIN_SAMPLES = 50


@dataclass(frozen=True, eq=False)
class ReconstructedReference:
    """A reference and how far it can be trusted."""

    kind: str  # ``point_to_point`` or ``spline``
    q: np.ndarray  # positions, shape (samples, joints) [rad or m]; ``dq ddq`` likewise
    dq: np.ndarray  # speeds
    ddq: np.ndarray  # accelerations
    moves: PointToPoint | None  # the moves, where it is made of such
    rms: np.ndarray  # deviation of the signal that it was fitted to, shape (joints,) [rad or m]
    relative: np.ndarray  # that over the joint's range, shape (joints,)
    freedom: float  # parameters per sample: what share of the noise it can follow

    def to_values(self) -> dict[str, Any]:
        """Kind and fit as plain values, for the file of a result."""
        return {
            "kind": self.kind,
            "moves": None if self.moves is None else len(self.moves.moves),
            "rms": self.rms,
            "relative": self.relative,
            "freedom": self.freedom,
        }

    def __str__(self) -> str:
        worst = int(np.argmax(self.relative))
        what = (
            f"{len(self.moves.moves)} moves from point to point"
            if self.moves is not None
            else "a smoothing spline"
        )
        return (
            f"{what}; the motion deviates by at most {self.relative[worst]:.2g} of its range (rms, "
            f"joint {worst + 1}), and the reference can follow {100 * self.freedom:.2g} % of the "
            "noise"
        )


def reconstruct_reference(signal: np.ndarray, rate: float) -> ReconstructedReference:
    """The simplest reference that a motion allows.

    ``signal``: positions, or what a control law says its reference was, (samples, joints)
    [rad or m].
    """
    smoothed = smooth_channels(signal, rate)
    span = np.maximum(np.ptp(signal, axis=0), 1e-12)
    moves = fit_point_to_point(smoothed.q, smoothed.dq, rate)
    if moves is not None:
        q, dq, ddq = moves.reference(np.arange(len(signal)) / rate)
        rms = np.sqrt(np.mean((signal - q) ** 2, axis=0))
        size = 4 * len(moves.moves) / signal.shape[1] + len(moves.points)
        if (rms / span).max() < BELIEVED and len(signal) > MIN_SAMPLES * size:
            freedom = size / len(signal)
            return ReconstructedReference(
                "point_to_point", q, dq, ddq, moves, rms, rms / span, freedom
            )
    spline = smooth_channels(signal, rate, order=2)
    rms = np.sqrt(np.mean((signal - spline.q) ** 2, axis=0))
    # a low-pass of half-power frequency f50 keeps that share of white noise's samples
    freedom = float(min(1.0, np.max(2.0 * np.atleast_1d(spline.f50) / rate)))
    return ReconstructedReference(
        "spline", spline.q, spline.dq, spline.ddq, None, rms, rms / span, freedom
    )
