"""Both inertias, stiffness and damping of a joint from a record with both encoders.

    tau = Jm ddq_m + fv_m dq_m + fc_m s(dq_m) + o_m + k δ + d dδ
    0   = Jl ddq_l + fv_l dq_l + fc_l s(dq_l) + o_l + g_s sin q_l + g_c cos q_l - k δ - d dδ

with δ = q_m - q_l. Both lines are linear in the parameters and hold the same k and d. They are
averaged over the two sampling periods around each instant, as the logged torque is, and solved in
the frequency domain (`spectral_equations`), weighted by the spectra of their residuals.

Encoder noise is in every column, and the loop feeds it back into the torque, so that least squares
is biased. Instruments are the same columns from a simulated, noise-free joint that follows the
recorded reference under a control law of its own, fitted to the torque: instruments need to be
correlated with the motion, not exact. The simulation uses the parameters of the last step, until
they converge.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.signals.bandpass import butterworth, central_difference
from pivident.studies.flexibility.measured import Measured
from pivident.studies.flexibility.simulated_joint import MotorLoop, TwoMassJoint, loop_motion
from pivident.studies.flexibility.spectral_equations import (
    Spectra,
    residual_spectrum,
    solve,
    tapered_spectra,
)

MOTOR = ("motor_inertia", "motor_viscous", "motor_coulomb", "motor_offset")
LOAD = ("load_inertia", "load_viscous", "load_coulomb", "load_offset")
SPRING = ("stiffness", "damping")
GRAVITY = ("gravity_sin", "gravity_cos")

UNITS = {
    "inertia": "kg m²", "viscous": "N m s/rad", "coulomb": "N m", "offset": "N m",
    "sin": "N m", "cos": "N m", "stiffness": "N m/rad", "damping": "N m s/rad",
}  # fmt: skip

#: Maximum number of steps, and the change at which they end, in standard errors.
MAX_STEPS, SETTLED = 12, 0.05


class _Signals(NamedTuple):
    """Motion of one joint: positions, and speeds for the signs of friction."""

    q_motor: np.ndarray
    q_link: np.ndarray
    dq_motor: np.ndarray
    dq_link: np.ndarray


@dataclass(frozen=True, eq=False)
class TwoMassEstimate:
    """An identified flexible joint."""

    recording: str  # name of the run
    joint_name: str  # name of the joint
    names: tuple[str, ...]  # parameters, fields of `TwoMassJoint`
    theta: np.ndarray  # their values, in SI
    covariance: np.ndarray = field(repr=False)  # shape (parameters, parameters)
    joint: TwoMassJoint  # the parameters as a joint that can be simulated
    band: tuple[float, float]  # lowest and highest frequency used [Hz]
    steps: int  # number of steps
    converged: bool
    # whether instruments came from a simulated joint; else from the record itself
    instrumented: bool
    notes: tuple[str, ...]  # reservations, sentences

    @property
    def std(self) -> np.ndarray:
        """Standard errors, shape (parameters,)."""
        return np.sqrt(np.diag(self.covariance))

    def measured(self, name: str) -> Measured:
        """One parameter with its interval."""
        i = self.names.index(name)
        return Measured.around(self.theta[i], self.std[i], UNITS[name.rpartition("_")[2]], 1.96)

    @property
    def antiresonance(self) -> Measured:
        """√(k/Jl)/2π with its interval [Hz]."""
        i, j = self.names.index("stiffness"), self.names.index("load_inertia")
        gradient = np.zeros(len(self.theta))
        gradient[i], gradient[j] = 0.5 / self.theta[i], -0.5 / self.theta[j]
        relative = float(np.sqrt(gradient @ self.covariance @ gradient))
        value = self.joint.antiresonance
        return Measured.around(value, value * relative, "Hz", 1.96)


def identify_two_mass(
    recording: Recording,
    joint: int = 0,
    *,
    gravity: bool = False,
    gamma: float = 150.0,
    lowest: float = 0.0,
    highest: float | None = None,
) -> TwoMassEstimate:
    """Identify a flexible joint from both encoders, reference and torque.

    Args:
        recording: has ``q_link``; and ``q_ref``, without which noise biases the estimate.
        joint: index of the joint; other joints should stand still.
        gravity: whether the load has a weight, g_s sin q_l + g_c cos q_l.
        gamma: slope of the smoothed sign of friction [s/rad].
        lowest: lowest frequency used [Hz].
        highest: highest frequency [Hz]; None: a tenth of the sampling rate.

    Returns:
        The parameters of both sides and of the spring between them, with standard errors.

    Raises:
        IdentificationError: there is no link encoder, or the parameters are not identifiable.
    """
    recording.require_torque("two masses are identified")
    if recording.q_link is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no link encoder",
            advice="name its columns as q_link, or use find_resonance, which needs the motor's "
            "encoder only",
        )
    rate, name = recording.rate, recording.joint_names[joint]
    high = 0.1 * rate if highest is None else highest
    names = (*MOTOR, *SPRING, *LOAD, *(GRAVITY if gravity else ()))
    tau = recording.tau[:, joint]
    measured = _signals(recording.q[:, joint], recording.q_link[:, joint], rate, high)
    spectra = _spectra(measured, tau, rate, gamma, gravity, lowest, high)
    z, instrumented, steps, converged = spectra.phi, False, 0, False
    weights = _weights(spectra, np.zeros(len(names)), plain=True)
    theta, covariance = _solved(spectra, z, weights, name, recording.name)
    while steps < MAX_STEPS and not converged:
        steps += 1
        simulated = _simulated(recording, joint, names, theta, gamma)
        instrumented = simulated is not None
        if simulated is not None:
            signals = _signals(simulated[0], simulated[1], rate, None)
            z = _spectra(signals, tau, rate, gamma, gravity, lowest, high).phi
        weights = _weights(spectra, theta)
        before = theta
        theta, covariance = _solved(spectra, z, weights, name, recording.name)
        converged = bool(np.all(np.abs(theta - before) < SETTLED * np.sqrt(np.diag(covariance))))
    return TwoMassEstimate(
        recording=recording.name,
        joint_name=name,
        names=names,
        theta=theta,
        covariance=covariance,
        joint=_joint_of(names, theta, gamma),
        band=(lowest, high),
        steps=steps,
        converged=converged,
        instrumented=instrumented,
        notes=tuple(_notes(names, theta, covariance, converged, instrumented)),
    )


def _signals(
    q_motor: np.ndarray, q_link: np.ndarray, rate: float, cutoff: float | None
) -> _Signals:
    """Positions and speeds; measured speeds are low-passed for the sign of friction."""
    smooth = [q if cutoff is None else butterworth(q, rate, cutoff) for q in (q_motor, q_link)]
    return _Signals(q_motor, q_link, *(central_difference(q, rate) for q in smooth))


def _spectra(
    signals: _Signals,
    tau: np.ndarray,
    rate: float,
    gamma: float,
    gravity: bool,
    low: float,
    high: float,
) -> Spectra:
    """Spectra of both equations' columns."""
    motor = _inertia_and_friction(signals.q_motor, signals.dq_motor, rate, gamma)
    load = _inertia_and_friction(signals.q_link, signals.dq_link, rate, gamma)
    deflection = signals.q_motor - signals.q_link
    spring = [_averaged(deflection), _difference(deflection, rate)]
    weight = [np.sin(signals.q_link), np.cos(signals.q_link)] if gravity else []
    held = 0.5 * (tau + np.concatenate([tau[:1], tau[:-1]]))
    columns = np.column_stack([*motor, *load, *spring, *weight, held])[1:-1]
    found = tapered_spectra(columns, rate, low, high)
    m, n = len(MOTOR), len(MOTOR) + len(SPRING)
    phi = np.zeros((len(found), 2, 10 + len(weight)), dtype=complex)
    phi[:, 0, :m] = found[:, 0:4]
    phi[:, 1, n : n + 4] = found[:, 4:8]
    phi[:, 0, m:n], phi[:, 1, m:n] = found[:, 8:10], -found[:, 8:10]
    phi[:, 1, n + 4 :] = found[:, 10:-1]
    y = np.zeros((len(found), 2), dtype=complex)
    y[:, 0] = found[:, -1]
    frequency = np.fft.rfftfreq(len(columns), 1 / rate)
    return Spectra(frequency[(frequency >= low) & (frequency <= high)], phi, y)


def _inertia_and_friction(
    q: np.ndarray, dq: np.ndarray, rate: float, gamma: float
) -> Sequence[np.ndarray]:
    """Columns of inertia, viscous and Coulomb friction, offset."""
    second = np.zeros(len(q))
    second[1:-1] = (q[2:] - 2 * q[1:-1] + q[:-2]) * rate**2
    sign = _averaged(2 / np.pi * np.arctan(gamma * dq))
    return [second, _difference(q, rate), sign, np.ones(len(q))]


def _averaged(x: np.ndarray) -> np.ndarray:
    """Mean of x over the two periods around each instant, weighted like a second difference."""
    mean = x.copy()
    mean[1:-1] += (x[2:] - 2 * x[1:-1] + x[:-2]) / 12
    return mean


def _difference(x: np.ndarray, rate: float) -> np.ndarray:
    """Central difference, corrected to the same mean: it is one over dx up to h²/6, not h²/12."""
    first = np.gradient(x, 1 / rate)
    first[1:-1] -= (first[2:] - 2 * first[1:-1] + first[:-2]) / 12
    return first


def _weights(spectra: Spectra, theta: np.ndarray, plain: bool = False) -> np.ndarray:
    """Inverse spectral matrices of the residuals; ``plain``: one weight for all."""
    if plain:
        power = np.mean(np.abs(spectra.y[:, 0]) ** 2)
        weights = np.zeros((len(spectra.y), 2, 2))
        weights[:, 0, 0] = weights[:, 1, 1] = 1 / max(float(power), 1e-300)
        return weights
    e = spectra.y - np.einsum("fep,p->fe", spectra.phi, theta)
    return np.linalg.inv(residual_spectrum(e)).conj()


def _solved(
    spectra: Spectra, z: np.ndarray, weights: np.ndarray, joint: str, recording: str
) -> tuple[np.ndarray, np.ndarray]:
    """`solve`, with an error that names recording and joint of singular equations."""
    try:
        theta, covariance = solve(spectra, z, weights)
    except np.linalg.LinAlgError:
        theta, covariance = np.full(1, np.nan), np.zeros((1, 1))
    if not np.isfinite(theta).all():
        raise IdentificationError(
            f"the parameters of the flexible joint {joint!r} are not identifiable from recording "
            f"{recording!r}",
            advice="the joint has to move in both directions and deflect",
        )
    return theta, covariance


def _joint_of(names: Sequence[str], theta: np.ndarray, gamma: float) -> TwoMassJoint:
    return TwoMassJoint(**dict(zip(names, theta.tolist(), strict=True)), gamma=gamma)


def _simulated(
    recording: Recording, joint: int, names: Sequence[str], theta: np.ndarray, gamma: float
) -> np.ndarray | None:
    """Positions of the noise-free joint in its loop, or None if it cannot be simulated."""
    if recording.q_ref is None:
        return None
    made = _joint_of(names, theta, gamma)
    if min(made.motor_inertia, made.load_inertia, made.stiffness) <= 0:
        return None
    reference, q = recording.q_ref[:, joint], recording.q[:, joint]
    loop = _fitted_law(reference, q, recording.tau[:, joint], recording.rate)
    # Eight steps within a period of the resonance, and at least two within a sample.
    steps = int(np.clip(np.ceil(40 * made.resonance / recording.rate), 2, 20))
    try:
        return loop_motion(made, loop, reference, recording.rate, steps=steps)
    except IdentificationError:
        return None


def _fitted_law(reference: np.ndarray, q: np.ndarray, tau: np.ndarray, rate: float) -> MotorLoop:
    """PD law with feed-forward that comes closest to the torque, below a tenth of the rate."""
    dr = np.gradient(reference, 1 / rate)
    error = butterworth(reference - q, rate, 0.1 * rate)
    columns = np.column_stack(
        [error, np.gradient(error, 1 / rate), np.gradient(dr, 1 / rate), np.ones(len(q))]
    )
    kp, kd, forward, _ = np.linalg.lstsq(columns, butterworth(tau, rate, 0.1 * rate), rcond=None)[0]
    return MotorLoop(float(kp), float(kd), float(forward))


def _notes(
    names: Sequence[str],
    theta: np.ndarray,
    covariance: np.ndarray,
    converged: bool,
    instrumented: bool,
) -> Iterator[str]:
    std = np.sqrt(np.diag(covariance))
    if not instrumented:
        yield (
            "no instruments from a simulated joint (no reference, or the fitted loop is unstable): "
            "encoder noise biases the parameters, and the intervals do not include this bias"
        )
    if not converged:
        yield f"the parameters did not converge in {MAX_STEPS} steps"
    for name in ("motor_inertia", "load_inertia", "stiffness", "damping"):
        i = list(names).index(name)
        if theta[i] < 2 * std[i]:
            yield f"{name.replace('_', ' ')} is not significantly different from zero"
