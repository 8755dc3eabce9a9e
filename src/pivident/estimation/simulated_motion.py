"""Motions of the simulated loop, which make the instruments.

Speeds and accelerations that are compared with differences of measured positions have to be
differences themselves. They are then made from the positions where they are needed: a long record
keeps one array in place of three.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.signals.instants import differences_at_instants


@dataclass(frozen=True, eq=False)
class SimulatedMotion:
    """Noise-free motion of one recording, time **last**, on the samples of the record.

    Attributes:
        q: positions [rad or m], shape (joints, samples).
        rate: sampling rate [Hz].
        derivatives: dq and ddq right after each sample's torque, shape (2, joints, samples);
            None: from differences of q, as the smoother's. With a torque that is held over each
            period the acceleration has no value at an instant; this is its mean over the two
            periods that adjoin it.
        tau: torque held from each sample on [N m or N]; None where it was not kept.
        inner: columns with memory or load of this motion, shape (inner entries, samples); None
            where they were not made.
    """

    q: np.ndarray
    rate: float
    derivatives: np.ndarray | None = None
    tau: np.ndarray | None = None
    inner: np.ndarray | None = None

    @property
    def dq(self) -> np.ndarray:
        """Speeds of the whole record [rad/s or m/s], where they are differences made anew."""
        return self.stretch(slice(None))[1]

    @property
    def ddq(self) -> np.ndarray:
        """Accelerations of the whole record [rad/s² or m/s²], likewise."""
        return self.stretch(slice(None))[2]

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples; where they begin and end makes no difference."""
        if self.derivatives is not None:
            dq, ddq = self.derivatives[:, :, span]
            return self.q[:, span], dq, ddq
        first, last, _ = span.indices(self.q.shape[1])
        dq, ddq = np.empty((2, len(self.q), last - first))
        differences_at_instants(self.q, self.rate, first, dq, ddq)
        return self.q[:, first:last], dq, ddq


def central_differences(q: np.ndarray, rate: float) -> tuple[np.ndarray, np.ndarray]:
    """(q_{k+1} - q_{k-1}) rate/2 and (q_{k+1} - 2 q_k + q_{k-1}) rate², ends repeated.

    Args:
        q: positions, time first, shape (samples, …).
        rate: sampling rate [Hz].
    """
    dq, ddq = np.empty_like(q), np.empty_like(q)
    dq[1:-1] = 0.5 * rate * (q[2:] - q[:-2])
    ddq[1:-1] = rate**2 * ((q[2:] - q[1:-1]) - (q[1:-1] - q[:-2]))
    for x in (dq, ddq):
        x[0], x[-1] = x[1], x[-2]
    return dq, ddq
