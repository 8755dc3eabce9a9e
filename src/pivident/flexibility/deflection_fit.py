"""Linear fit of a joint's deflection: the terms of `compliance`, with their intervals.

Terms are torque (the compliance), speed (the link encoder's lag), sign of the speed (friction
before the spring), an offset, the lines of the transmission error and, where they are asked for,
damping, hysteresis and backlash. Torque and its derivative are instrumented with their part that
follows from the reference, so that noise of the torque cannot make the spring look stiff.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.flexibility.deflection_motion import TRANSITION, DeflectionMotion
from pivident.flexibility.measured import Measured
from pivident.flexibility.spectral_equations import (
    BLOCKS,
    STUDENT,
    jackknife_standard_error,
    solve_with_jackknife,
)
from pivident.flexibility.transmission_error import TransmissionLine, line_columns


@dataclass(frozen=True, eq=False)
class DeflectionFit:
    """A linear fit of the deflection, with its jackknife."""

    names: tuple[str, ...]  # of the terms; those of the transmission error come last
    columns: np.ndarray  # regressors, shape (samples, terms)
    theta: np.ndarray  # coefficients, shape (terms,)
    replicates: np.ndarray  # coefficients without each block, shape (blocks, terms)
    line_count: int  # number of columns of the transmission error
    by_lag: np.ndarray  # change of each coefficient by one standard error of the known lag

    @property
    def has_stiffness(self) -> bool:
        """Whether the compliance is significantly positive."""
        return self.value("torque") - STUDENT * self.std("torque") > 0

    def value(self, name: str) -> float:
        """Coefficient of a term."""
        return float(self.theta[self.names.index(name)])

    def std(self, name: str) -> float:
        """Its standard error, including that of the known lag."""
        i = self.names.index(name)
        return math.hypot(jackknife_standard_error(self.replicates[:, i]), self.by_lag[i])

    def ratio(self, name: str) -> float:
        """Coefficient over standard error."""
        return self.value(name) / max(self.std(name), 1e-300)

    def measured(
        self, name: str, unit: str, factor: float = 1.0, inverse: str | None = None
    ) -> Measured:
        """A term times ``factor`` with its interval; ``inverse``: unit of 1/coefficient."""
        value, std = self.value(name), self.std(name)
        if inverse is not None:
            return Measured.inverse(value, std, inverse, STUDENT)
        return Measured.around(factor * value, abs(factor) * std, unit, STUDENT)

    def of_lines(self) -> np.ndarray:
        """Part of the deflection that is transmission error, shape (samples,) [rad]."""
        n = self.line_count
        return self.columns[:, len(self.theta) - n :] @ self.theta[len(self.theta) - n :]

    def lines(self, orders: Sequence[float]) -> tuple[TransmissionLine, ...]:
        """Transmission error, largest amplitude first."""
        first = len(self.theta) - self.line_count
        found = []
        for i, order in enumerate(orders):
            pair = slice(first + 2 * i, first + 2 * i + 2)
            amplitude = float(np.hypot(*self.theta[pair]))
            along = self.replicates[:, pair] @ self.theta[pair] / max(amplitude, 1e-300)
            std = jackknife_standard_error(along)
            found.append(TransmissionLine(order, Measured.around(amplitude, std, "rad", STUDENT)))
        return tuple(sorted(found, key=lambda line: -line.amplitude.value))

    def over_compliance(self, name: str, unit: str) -> Measured:
        """-coefficient/compliance, with its own jackknife."""
        i, j = self.names.index(name), self.names.index("torque")
        if not self.has_stiffness:
            return Measured.unknown(unit)
        value = -self.theta[i] / self.theta[j]
        std = jackknife_standard_error(-self.replicates[:, i] / self.replicates[:, j])
        return Measured.around(value, std, unit, STUDENT)


def fit_deflection(
    motion: DeflectionMotion, orders: Sequence[float], optional: Sequence[str]
) -> DeflectionFit:
    """Least squares, or instrumental variables where there is a reference.

    ``optional``: which of damping, hysteresis and backlash are fitted too.
    """
    columns = {
        "torque": motion.torque,
        "speed": motion.speed,
        "sign": motion.sign,
        "offset": np.ones(len(motion.t)),
    }
    if "damping" in optional:
        columns["damping"] = motion.torque_rate
    if "hysteresis" in optional:
        columns["hysteresis"] = motion.direction
    if "backlash" in optional:
        spring = torque_through_spring(motion, fit_deflection(motion, orders, ()), motion.followed)
        columns["backlash"] = np.tanh(spring / (0.5 * TRANSITION * np.ptp(spring)))
    lines = line_columns(motion.angle, orders)
    phi = np.column_stack([*columns.values(), lines])
    z = phi.copy()
    if motion.instruments is not None:
        for name in ("torque", "damping"):
            if name in columns:
                i = list(columns).index(name)
                basis = motion.instruments
                z[:, i] = basis @ np.linalg.lstsq(basis, phi[:, i], rcond=None)[0]
    names = (*columns, *(f"line {i}" for i in range(lines.shape[1])))
    if motion.known_lag is None:
        theta, replicates = solve_with_jackknife(phi, z, motion.deflection)
        return DeflectionFit(names, phi, theta, replicates, lines.shape[1], np.zeros(len(theta)))
    return _with_known_lag(names, phi, z, motion, lines.shape[1])


def _with_known_lag(
    names: tuple[str, ...],
    phi: np.ndarray,
    z: np.ndarray,
    motion: DeflectionMotion,
    line_count: int,
) -> DeflectionFit:
    """The fit with a fixed lag; its standard error is propagated to the other terms."""
    assert motion.known_lag is not None
    lag, lag_std = motion.known_lag
    at = names.index("speed")
    others = [i for i in range(len(names)) if i != at]
    theta, by_lag = np.zeros(len(names)), np.zeros(len(names))
    replicates = np.full((BLOCKS, len(names)), lag)
    y = motion.deflection - lag * motion.speed
    theta[others], replicates[:, others] = solve_with_jackknife(phi[:, others], z[:, others], y)
    moved, _ = solve_with_jackknife(phi[:, others], z[:, others], y - lag_std * motion.speed)
    theta[at], by_lag[at] = lag, lag_std
    by_lag[others] = moved - theta[others]
    return DeflectionFit(names, phi, theta, replicates, line_count, by_lag)


def torque_through_spring(
    motion: DeflectionMotion, fit: DeflectionFit, torque: np.ndarray | None = None
) -> np.ndarray:
    """Torque after the friction before the spring, if the stiffness is known [N m]."""
    torque = motion.torque if torque is None else torque
    compliance = fit.value("torque")
    if not fit.has_stiffness:
        return torque
    return torque + fit.value("sign") / compliance * motion.sign
