"""The motion that columns are made from: measured, simulated, or any other."""

from __future__ import annotations

from typing import Protocol

import numpy as np


class Motion(Protocol):
    """Positions, speeds and accelerations, each (joints, samples)."""

    @property
    def q(self) -> np.ndarray:
        """Positions [rad or m]."""

    @property
    def dq(self) -> np.ndarray:
        """Speeds [rad/s or m/s]."""

    @property
    def ddq(self) -> np.ndarray:
        """Accelerations [rad/s² or m/s²]."""

    @property
    def inner(self) -> np.ndarray | None:
        """Columns with memory or load, (inner entries, samples), where there are any."""

    def stretch(self, span: slice) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """q, dq and ddq on some samples."""
