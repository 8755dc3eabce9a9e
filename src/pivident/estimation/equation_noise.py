"""The information of a row of each joint's equation: its noise by frequency, and the rows left out.

An estimate weighs the rows of joint j with its prefilter L_j, which holds their standard deviation.
The design of the next motion expects the same noise: what it will know of the parameters is

    I = Σ_j Σ_t (L_j Φ_j)ᵀ (L_j Φ_j)
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from pivident.estimation.problem import Problem
from pivident.estimation.solved_equations import Equations
from pivident.signals.prefilter import Prefilter


@dataclass(frozen=True, eq=False)
class EquationNoise:
    """Noise of the equations that an estimate solved.

    Attributes:
        filters: prefilter of each joint with its variance: what it leaves of the residual is white
            and has the variance one.
        rate: rows per second [Hz].
        standstill: speed below which rows were left out, zero where none were, shape (joints,)
            [rad/s or m/s].
    """

    filters: tuple[Prefilter, ...]
    rate: float
    standstill: np.ndarray

    @classmethod
    def of(cls, problem: Problem, equations: Equations, rate: float) -> EquationNoise:
        """Noise of the equations of a problem, with so many rows per second [Hz]."""
        standstill = np.zeros(problem.robot.size)
        slow, left_out = np.zeros((2, problem.robot.size))
        for recording, record in zip(problem.recordings, equations.records, strict=True):
            limits = problem.speed_limits(recording)
            rows = np.clip(record.sample_numbers.astype(int), 0, record.kinematics.dq.shape[1] - 1)
            resting = ~limits.moving(record.kinematics.dq[:, rows])
            slow += resting.sum(axis=1)
            left_out += (resting & ~record.used).sum(axis=1)
            standstill = np.maximum(standstill, limits.joints)
        variance = equations.variance
        filters = equations.filters if equations.full_rate else [Prefilter()] * problem.robot.size
        return cls(
            tuple(
                replace(f, variance=float(f.variance * v))
                for f, v in zip(filters, variance, strict=True)
            ),
            rate,
            np.where(left_out > 0.5 * slow, standstill, 0.0),
        )

    def to_values(self) -> dict[str, Any]:
        """Plain values for a file."""
        filters = [
            {
                "numerator": np.asarray(f.numerator, dtype=float).tolist(),
                "denominator": np.asarray(f.denominator, dtype=float).tolist(),
                "fir": np.asarray(f.fir, dtype=float).tolist(),
                "variance": f.variance,
            }
            for f in self.filters
        ]
        return {"rate": self.rate, "standstill": self.standstill.tolist(), "filters": filters}

    @classmethod
    def from_values(cls, values: Mapping[str, Any], joints: int) -> EquationNoise:
        """The noise of :meth:`to_values`.

        Raises:
            ValueError: it is none of that many joints.
        """
        try:
            filters = tuple(_filter_of(entry) for entry in values["filters"])
            rate, standstill = float(values["rate"]), np.array(values["standstill"], dtype=float)
        except (KeyError, TypeError, ValueError) as error:
            raise ValueError(
                f"equation_noise: a key is missing or not a number ({error})"
            ) from error
        if len(filters) != joints or standstill.shape != (joints,):
            raise ValueError(f"equation_noise: one filter for each of {joints} joints is needed")
        if not (np.isfinite(rate) and rate > 0 and np.isfinite(standstill).all()):
            raise ValueError(
                "equation_noise: rate and standstill must be finite, the rate positive"
            )
        return cls(filters, rate, standstill)


def _filter_of(values: Mapping[str, Any]) -> Prefilter:
    """A filter from its plain values."""
    parts: dict[str, Sequence[float]] = {}
    for key in ("numerator", "denominator", "fir"):
        coefficients = np.array(values[key], dtype=float)
        if coefficients.ndim != 1 or not coefficients.size or not np.isfinite(coefficients).all():
            raise ValueError(f"{key!r} is not a list of finite numbers")
        parts[key] = tuple(coefficients.tolist())
    variance = float(values["variance"])
    if not (np.isfinite(variance) and variance > 0.0):
        raise ValueError("'variance' is not positive")
    return Prefilter(**parts, variance=variance)
