"""IDIM-LS, IDIM-IV and IDIM-PIV as sections 3 and 4 of the paper print them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, cheby1, sosfiltfilt

from tests.independent.arm import COLUMNS, NAMES, VISCOUS, observed
from tests.independent.loop import Record, simulated
from tests.independent.noise import (
    Noise,
    autoregression,
    burg,
    controller,
    convolved,
    settled,
)
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
    phi, tau = parallel_filtered(record, reading, record.tau.T, bandpass(record))
    theta, errors = weighted(phi, phi, tau, reading)
    return Estimate(theta, errors, 1, (), "converged")


def parallel_filtered(
    record: Record, reading: Reading, tau: np.ndarray, motion: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, np.ndarray]:
    """φ of a motion and τ behind F_p, without the margins: the rows of IDIM-LS and IDIM-IV."""
    factor = round(record.rate / 2 / PARALLEL)
    rows = inside(reading, record.rate / factor, len(tau.T[::factor]))
    return decimated(observed(*motion), factor)[..., rows], decimated(tau, factor)[:, rows]


def inside(reading: Reading, rate: float, samples: int) -> slice:
    """Samples between the margins."""
    first, last = (round(seconds * rate) for seconds in reading.margins)
    return slice(first, samples - last)


def auxiliary(
    record: Record, reading: Reading, theta: np.ndarray, measured: tuple[np.ndarray, ...]
) -> tuple[np.ndarray, ...]:
    """Position, velocity and acceleration of the auxiliary model with the parameters theta."""
    if reading.dissipative:
        theta = np.where(COLUMNS[:, 0] >= VISCOUS, np.maximum(theta, 0.0), theta)
    start = np.stack([x[0] for x in measured[:2]]) if reading.begins == "measured" else None
    q, dq, ddq, _ = simulated(record, theta, start=start)
    if reading.accelerations == "instant":
        ddq = record.rate**2 * bent(q)
        ddq -= bent(ddq) / 12
    return q, dq, ddq


def bent(x: np.ndarray) -> np.ndarray:
    """Second differences of samples, zero at both ends."""
    return np.pad(np.diff(x, 2, axis=0), ((1, 1), (0, 0)))


def moving(record: Record, reading: Reading, dq: np.ndarray, factor: int) -> np.ndarray:
    """1 where a joint, and the motor that two joints turn, is faster than its share, else 0."""
    limit = reading.slowest * np.abs(record.dq_r).max(axis=0)
    fast = np.abs(dq) >= limit
    fast[:, 4:] &= (np.abs(dq[:, 4] + dq[:, 5]) >= limit[5])[:, None]
    rows = fast[::factor].T.astype(float)
    return rows[:, inside(reading, record.rate / factor, rows.shape[1])]


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
    measured = bandpass(record)
    phi, tau = parallel_filtered(record, reading, record.tau.T, measured)

    def step(theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        motion = auxiliary(record, reading, theta, measured)
        zeta, _ = parallel_filtered(record, reading, record.tau.T, motion)
        used = moving(record, reading, motion[1], round(record.rate / 2 / PARALLEL))
        return weighted(zeta * used[:, None], phi * used[:, None], tau * used, reading)

    return iterated(step, start, reading)


def iterated(
    step: Callable[[np.ndarray], tuple[np.ndarray, np.ndarray]], theta: np.ndarray, reading: Reading
) -> Estimate:
    """Steps until no parameter changes by more than a share of its standard error."""
    changes: list[float] = []
    errors = np.full(len(theta), np.nan)
    before, halvings = theta, 0
    for k in range(1, reading.max_iterations + 1):
        try:
            following, errors = step(theta)
        except ArithmeticError as failure:
            if halvings == reading.halvings:
                return Estimate(theta, errors, k, tuple(changes), str(failure))
            theta, halvings = 0.5 * (before + theta), halvings + 1
            continue
        changes.append(float(np.max(np.abs(following - theta) / errors)))
        before, theta, halvings = theta, following, 0
        if changes[-1] < reading.stop:
            return Estimate(theta, errors, k, tuple(changes), "converged")
    return Estimate(theta, errors, k, tuple(changes), f"no convergence in {k} iterations")


class Prefiltered:
    """One IDIM-PIV identification (section 4.3): what stays the same, and the present noise."""

    def __init__(self, record: Record, reading: Reading) -> None:
        self.record, self.reading = record, reading
        self.measured = (
            derivatives(record.q_m, record.rate, reading.second_pass, reading.slopes)
            if reading.smoother == "irwsm"
            else bandpass(record)
        )
        self.phi = decimated(observed(*self.measured), reading.decimation)
        self.tau = decimated(record.tau.T, reading.decimation)
        rate = record.rate / reading.decimation
        self.step = 1 / rate
        self.used = inside(reading, rate, self.tau.shape[1])
        self.iteration = 0
        self.joints = range(len(self.tau))
        self.noise = [Noise(np.ones(1), 1.0) for _ in self.joints]

    def inverse(self, j: int) -> tuple[np.ndarray, np.ndarray]:
        """C⁻¹ of a joint, or 1 where the noise is that of the torque: numerator, denominator."""
        if self.reading.noise_of == "torque":
            return np.ones(1), np.ones(1)
        record, reading = self.record, self.reading
        ki = 0.0 if reading.weak_integral else record.ki[j]
        numerator, denominator = controller(record.kp[j], record.kd[j], ki, record.lag, self.step)
        floor = reading.ridge * numerator[0] / denominator[0]
        numerator = numerator + floor * np.pad(denominator, (0, len(numerator) - len(denominator)))
        return denominator, numerator

    def whitened(self, j: int, x: np.ndarray) -> np.ndarray:
        """H_τ⁻¹(z⁻¹) x for signals x of joint j; its sign is that of ε_τ."""
        first, second = self.inverse(j)
        x = convolved(self.noise[j].a, settled(first, second, x))
        if self.reading.cut:
            x = sosfiltfilt(butter(4, self.reading.cut, fs=1 / self.step, output="sos"), x)
        return x[..., self.used]

    def forgotten(self, j: int) -> int:
        """Samples after which a prefilter has forgotten how it started, but for a share."""
        if not self.reading.forget:
            return 0
        first, second = self.inverse(j)
        poles = np.abs(np.roots(second))
        fade = np.log(self.reading.forget) / np.log(poles.max()) if len(poles) else 0.0
        return int(np.ceil(fade)) + len(first) + len(self.noise[j].a) - 1

    def white(self, theta: np.ndarray) -> list[np.ndarray]:
        """H_τ⁻¹ ε_τ of all joints."""
        residuals = self.tau - np.einsum("jps,p->js", self.phi, theta)
        return [self.whitened(j, residuals[j]) for j in self.joints]

    def identify_noise(self, theta: np.ndarray, used: np.ndarray) -> None:
        """AR models of the residuals (29), (30), or only λ where the models are kept."""
        reading, self.iteration = self.reading, self.iteration + 1
        if reading.noise_fits and self.iteration > reading.noise_fits:
            for j, white in enumerate(self.white(theta)):
                late = white[used[j] > 0] if reading.noise_moving else white[self.forgotten(j) :]
                self.noise[j] = Noise(self.noise[j].a, float(np.mean(late**2)))
            return
        kept = reading.keep_orders and self.iteration > 1
        orders = [len(noise.a) - 1 if kept else None for noise in self.noise]
        self.noise = [Noise(np.ones(1), 1.0) for _ in self.joints]
        found = [x[self.forgotten(j) :] for j, x in enumerate(self.white(theta))]
        for j in self.joints:
            y = found[j] if reading.joint_noise else np.concatenate(found)
            if reading.noise_moving:
                self.noise[j] = autoregression(y, reading.max_order, orders[j], used[j])
            else:
                fit = burg if reading.fit == "burg" else autoregression
                self.noise[j] = fit(y, reading.max_order, orders[j])

    def __call__(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """The next parameters (28), and their standard errors (31) by the noise that they leave."""
        reading, motion = self.reading, auxiliary(self.record, self.reading, theta, self.measured)
        zeta = decimated(observed(*motion), reading.decimation)
        used = moving(self.record, reading, motion[1], reading.decimation)
        for j in self.joints:
            used[j, : self.forgotten(j)] = 0.0
        normal, right = (
            np.zeros((len(used), len(theta), len(theta))),
            np.zeros((len(used), len(theta))),
        )
        for j in self.joints:
            held = np.flatnonzero(np.any(zeta[j], axis=1))
            instruments = used[j] * self.whitened(j, zeta[j, held])
            normal[j][np.ix_(held, held)] = instruments @ self.whitened(j, self.phi[j, held]).T
            right[j, held] = instruments @ self.whitened(j, self.tau[j])
        variance = np.array([noise.variance for noise in self.noise])
        for k in range(3):
            if reading.variance_of == "this" or k == 2:
                if reading.variance_of == "this":
                    variance = np.array(
                        [
                            np.mean(x[u > 0] ** 2)
                            for x, u in zip(self.white(theta), used, strict=True)
                        ]
                    )
                scale = variance ** (-2 * reading.exponent)
                theta = np.linalg.solve(np.tensordot(scale, normal, 1), scale @ right)
        self.identify_noise(theta, used)
        return theta, self.standard_errors(zeta, used)

    def standard_errors(self, zeta: np.ndarray, used: np.ndarray) -> np.ndarray:
        """Square roots of the diagonal of (31)."""
        information = np.zeros((zeta.shape[1], zeta.shape[1]))
        for j in self.joints:
            held = np.flatnonzero(np.any(zeta[j], axis=1))
            white = used[j] * self.whitened(j, zeta[j, held])
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
