"""A stretch of a record beside the loop that simulates it."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np

from pivident.simulation.direction import ParametrisedLoop


@dataclass(frozen=True, eq=False)
class Stretch:
    """What was measured over some time, and the loop that is to give it.

    Attributes:
        name: name of the recording, for messages.
        loop: the loop at its control rate, with the initial state that the record suggests.
        q: measured positions, shape (samples, joints) [rad or m].
        tau: measured torques, likewise [N m or N]; None: none were.
        step: samples of the loop from one measured sample to the next.
        tau_late: how many samples of the loop a measured torque is later than the one that acts,
            a drive's delay not counted.
        moving: samples of the record at which each joint is compared, (samples, joints): at
            standstill dry friction follows no law. In an open loop positions are compared there.
        start_time: time of the first sample [s].
        start_std: how far initial positions and speeds may lie from those of ``loop``: standard
            deviations, shape (2 joints,); None: they are not sought.
        first: measured sample from which on is compared.
    """

    name: str
    loop: ParametrisedLoop
    q: np.ndarray
    tau: np.ndarray | None
    step: int
    tau_late: int
    moving: np.ndarray
    start_time: float
    start_std: np.ndarray | None
    first: int = 0

    @property
    def rate(self) -> float:
        """Rate of the measured samples [Hz]."""
        return float(self.loop.signals.rate) / self.step

    @property
    def samples(self) -> int:
        """Measured samples."""
        return len(self.q)

    def with_loop(self, loop: ParametrisedLoop) -> Stretch:
        """The same record beside another loop."""
        return replace(self, loop=loop)
