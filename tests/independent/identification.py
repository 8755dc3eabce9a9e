"""IDIM-LS, IDIM-IV and IDIM-PIV as sections 3 and 4 of the paper print them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, cheby1, sosfiltfilt

from tests.independent.arm import NAMES, observed
from tests.independent.loop import Record, simulated
from tests.independent.noise import Noise, autoregression, controller, settled
from tests.independent.random_walk import derivatives
from tests.independent.reading import Reading

BUTTERWORTH = 50.0  # Hz
PARALLEL = 20.0  # Hz
INERTIAL = ("XX", "XY", "XZ", "YY", "YZ", "ZZ", "Ia")


@dataclass(frozen=True)
class Estimate:
    """Parameters in the order of `NAMES`, their standard errors, and how the iteration ended."""

    theta: np.ndarray
    errors: np.ndarray
    iterations: int
    changes: tuple[float, ...]
    end: str
    noise: tuple[Noise, ...] = ()

    @property
    def converged(self) -> bool:
        """Whether the iteration ended because no parameter changed any more."""
        return self.end == "converged"


def cad_start(parameters: dict[str, float]) -> np.ndarray:
    """CAD values for the inertias, zero for all others (step 1)."""
    return np.array([parameters[name] if name[:-1] in INERTIAL else 0.0 for name in NAMES])


def decimated(x: np.ndarray, factor: int) -> np.ndarray:
    """F_p and resampling along the last axis: Chebyshev filter of order 8 in both directions."""
    if factor == 1:
        return x
    return sosfiltfilt(cheby1(8, 0.05, 0.8 / factor, output="sos"), x)[..., ::factor]


def bandpass(record: Record) -> tuple[np.ndarray, ...]:
    """Position, velocity and acceleration: Butterworth in both directions, central differences."""
    q = sosfiltfilt(butter(4, BUTTERWORTH, fs=record.rate, output="sos"), record.q_m, axis=0)
    dq = np.gradient(q, 1 / record.rate, axis=0)
    return q, dq, np.gradient(dq, 1 / record.rate, axis=0)


def least_squares(record: Record, reading: Reading) -> Estimate:
    """IDIM-LS (19)."""
    factor = round(record.rate / 2 / PARALLEL)
    phi = decimated(observed(*bandpass(record)), factor)
    tau = decimated(record.tau.T, factor)
    theta, errors = weighted(phi, phi, tau, reading)
    return Estimate(theta, errors, 1, (), "converged")


def weighted(
    zeta: np.ndarray, phi: np.ndarray, tau: np.ndarray, reading: Reading
) -> tuple[np.ndarray, np.ndarray]:
    """IV estimate with one variance for all axes, or with weights by those of a first estimate."""
    weights = np.ones(len(tau))
    for _ in range(1 + reading.axis_weights):
        normal = np.einsum("jps,jqs,j->pq", zeta, phi, weights, optimize=True)
        theta = np.linalg.solve(normal, np.einsum("jps,js,j->p", zeta, tau, weights, optimize=True))
        squares = np.mean((tau - np.einsum("jps,p->js", phi, theta)) ** 2, axis=1)
        if reading.axis_weights:
            weights = 1 / squares
    scale = 1.0 if reading.axis_weights else squares.mean()
    spread = np.linalg.inv(np.einsum("jps,jqs,j->pq", zeta, zeta, weights, optimize=True))
    return theta, np.sqrt(scale * np.diag(spread))


def instrumental_variables(record: Record, reading: Reading, start: np.ndarray) -> Estimate:
    """IDIM-IV (section 3.3): instruments of the auxiliary model, F_p and resampling."""
    factor = round(record.rate / 2 / PARALLEL)
    phi, tau = decimated(observed(*bandpass(record)), factor), decimated(record.tau.T, factor)

    def step(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        zeta = decimated(observed(*simulated(record, theta)[:3]), factor)
        return weighted(zeta, phi, tau, reading)

    return iterated(step, start, reading)


def iterated(
    step: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], theta: np.ndarray, reading: Reading
) -> Estimate:
    """Steps until no parameter changes by more than a share of its standard error."""
    changes: list[float] = []
    errors = np.full(len(theta), np.nan)
    for k in range(1, reading.max_iterations + 1):
        try:
            following, errors = step(theta)
        except ArithmeticError as failure:
            return Estimate(theta, errors, k, tuple(changes), str(failure))
        changes.append(float(np.max(np.abs(following - theta) / errors)))
        theta = following
        if changes[-1] < reading.stop:
            return Estimate(theta, errors, k, tuple(changes), "converged")
    return Estimate(theta, errors, k, tuple(changes), f"no convergence in {k} iterations")


class Prefiltered:
    """One IDIM-PIV identification (section 4.3): what stays the same, and the present noise."""

    def __init__(self, record: Record, reading: Reading) -> None:
        self.record, self.reading = record, reading
        motion = (
            derivatives(record.q_m, record.rate, reading.second_pass)
            if reading.smoother == "irwsm"
            else bandpass(record)
        )
        self.phi = decimated(observed(*motion), reading.decimation)
        self.tau = decimated(record.tau.T, reading.decimation)
        rate = record.rate / reading.decimation
        self.step = 1 / rate
        margin = round(reading.margin * rate)
        self.used = slice(margin, self.tau.shape[1] - margin)
        self.joints = range(len(self.tau))
        self.noise = [Noise(np.ones(1), 1.0) for _ in self.joints]

    def inverse(self, j: int) -> tuple[np.ndarray, np.ndarray]:
        """C⁻¹ of a joint, or 1 where the noise is that of the torque: numerator, denominator."""
        if self.reading.noise_of == "torque":
            return np.ones(1), np.ones(1)
        record, reading = self.record, self.reading
        ki = 0.0 if reading.weak_integral else record.ki[j]
        numerator, denominator = controller(record.kp[j], record.kd[j], ki, self.step)
        floor = reading.ridge * record.kd[j] / self.step
        numerator = numerator + floor * np.pad(denominator, (0, len(numerator) - len(denominator)))
        return denominator, numerator

    def whitened(self, j: int, x: np.ndarray) -> np.ndarray:
        """H_τ⁻¹(z⁻¹) x for signals x of joint j; its sign is that of ε_τ."""
        first, second = self.inverse(j)
        x = settled(np.convolve(self.noise[j].a, first), second, x)
        if self.reading.cut:
            x = sosfiltfilt(butter(4, self.reading.cut, fs=1 / self.step, output="sos"), x)
        return x[..., self.used]

    def identify_noise(self, theta: np.ndarray) -> None:
        """AR models of the residuals (29), (30)."""
        residuals = self.tau - np.einsum("jps,p->js", self.phi, theta)
        found = []
        for j in self.joints:
            self.noise[j] = Noise(np.ones(1), 1.0)
            found.append(self.whitened(j, residuals[j]))
        for j in self.joints:
            y = found[j] if self.reading.joint_noise else np.concatenate(found)
            self.noise[j] = autoregression(y, self.reading.max_order)

    def __call__(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The next parameters (28), and their standard errors (31) by the noise that they leave."""
        zeta = decimated(observed(*simulated(self.record, theta)[:3]), self.reading.decimation)
        normal, right = np.zeros((len(theta), len(theta))), np.zeros(len(theta))
        for j in self.joints:
            scale = self.noise[j].variance ** (-2 * self.reading.exponent)
            held = np.flatnonzero(np.any(zeta[j], axis=1))
            instruments = scale * self.whitened(j, zeta[j, held])
            normal[np.ix_(held, held)] += instruments @ self.whitened(j, self.phi[j, held]).T
            right[held] += instruments @ self.whitened(j, self.tau[j])
        theta = np.linalg.solve(normal, right)
        self.identify_noise(theta)
        return theta, self.standard_errors(zeta)

    def standard_errors(self, zeta: np.ndarray) -> np.ndarray:
        """Square roots of the diagonal of (31)."""
        information = np.zeros((zeta.shape[1], zeta.shape[1]))
        for j in self.joints:
            held = np.flatnonzero(np.any(zeta[j], axis=1))
            white = self.whitened(j, zeta[j, held])
            information[np.ix_(held, held)] += white @ white.T / self.noise[j].variance
        if self.reading.covariance == "mean":
            information /= self.tau.shape[1]
        return np.sqrt(np.diag(np.linalg.inv(information)))


def prefiltered(record: Record, reading: Reading, start: np.ndarray) -> Estimate:
    """IDIM-PIV (28)."""
    method = Prefiltered(record, reading)
    found = iterated(method, start, reading)
    return Estimate(
        found.theta, found.errors, found.iterations, found.changes, found.end, tuple(method.noise)
    )
