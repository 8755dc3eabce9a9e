"""Stiffness of a joint from its motor's encoder alone: resonance and antiresonance in the loop.

The impedance of a joint (`impedance_fit`) has a maximum at the antiresonance and a minimum at the
resonance; it is fitted over the bins that the reference excites (`impedance_fit`). The sign of the
load's friction comes from the motor's speed through the spring, in a second fit; half of the change
is added to the standard errors. A rigid joint is fitted as well. If the flexible one is not clearly
better, there is no resonance up to the highest excited frequency.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import IdentificationError
from pivident.signals.bandpass import butterworth, central_difference
from pivident.studies.flexibility.frequency_response import LocalSpectra, local_spectra
from pivident.studies.flexibility.impedance_fit import (
    fit_flexible,
    fit_rigid,
    flexible_parts,
    load_speed,
    rigid_impedance,
)
from pivident.studies.flexibility.measured import Measured

#: Smallest number of excited bins for a fit.
MIN_BINS = 40

#: Smallest gain in twice the log-likelihood for a resonance.
CLEARLY_BETTER = 50.0

#: Largest relative half width of the antiresonance's 95 % interval.
KNOWN_TO = 0.25

#: Share of the change by the load's own sign of friction that is added to the standard error.
FRICTION_SHARE = 0.5


@dataclass(frozen=True, eq=False)
class Resonance:
    """A joint's flexibility from the motor encoder alone."""

    recording: str  # name of the run
    joint: str  # name of the joint
    seen: bool  # whether there is a resonance in the excited band
    # lowest and highest frequency that the reference excites [Hz]; (0, 0): none
    excited: tuple[float, float]
    # Jm + Jl, or J of the rigid fit [kg m²]; None where nothing is excited
    total_inertia: Measured | None
    antiresonance: Measured | None  # √(k/Jl)/2π [Hz], or None
    resonance: Measured | None  # √(k (1/Jm + 1/Jl))/2π [Hz], or None
    # k [N m/rad]; without a resonance only its lower end, and only for a given load inertia
    stiffness: Measured | None
    damping: Measured | None  # d [N m s/rad], or None
    motor_inertia: Measured | None  # Jm [kg m²], or None
    load_inertia: Measured | None  # Jl [kg m²], or None
    gain: float  # twice the log-likelihood of the flexible over that of the rigid joint
    misfit: float  # cost over the number of bins; about 1 if the model holds
    conclusion: str  # in one sentence
    # frequency [Hz], |Y/U| measured and fitted [rad/s per N m], shape (3, bins)
    response: np.ndarray = field(repr=False)


def find_resonance(
    recording: Recording,
    joint: int = 0,
    *,
    motor_inertia: float | None = None,
    load_inertia: float | None = None,
    lowest: float = 2.0,
    highest: float | None = None,
    gamma: float = 150.0,
) -> Resonance:
    """Search for the resonance of one joint in its loop.

    Args:
        recording: has ``q_ref``; a link encoder is not used.
        joint: index of the joint.
        motor_inertia: Jm if known [kg m²]; None: it is estimated.
        load_inertia: Jl, for a lower end of the stiffness if there is no resonance [kg m²].
        lowest: lowest frequency used [Hz].
        highest: highest frequency [Hz]; None: a fifth of the sampling rate.
        gamma: slope of the smoothed sign of friction [s/rad].

    Returns:
        Antiresonance, resonance and the parameters that follow from them, with intervals.

    Raises:
        IdentificationError: there is no reference.
    """
    recording.require_torque("a resonance is found")
    name = recording.joint_names[joint]
    if recording.q_ref is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no reference for joint {name!r}: in a closed loop, "
            "noise cannot be distinguished from excitation without it",
            advice="record q_ref",
        )
    high = 0.2 * recording.rate if highest is None else highest
    used = _excited(_loop_spectra(recording, joint, lowest, high, gamma, None))
    if len(used.frequency) < MIN_BINS:
        return _nothing_excited(recording, name, used)
    rigid, rigid_cost, rigid_covariance = fit_rigid(used)
    flexible, cost, covariance = fit_flexible(used, rigid, motor_inertia)
    band = (float(used.frequency[0]), float(used.frequency[-1]))
    gain = 2 * (rigid_cost - cost)
    if _is_seen(flexible, covariance, gain, band):
        used = _excited(_loop_spectra(recording, joint, lowest, high, gamma, flexible))
        first = flexible
        flexible, cost, covariance = fit_flexible(used, rigid, motor_inertia, first)
        # The sign of friction is as uncertain as the speeds: half of its effect is added.
        moved = FRICTION_SHARE * (flexible - first)
        covariance = covariance + np.outer(moved, moved)
        return _seen(recording, name, used, flexible, covariance, gain, cost)
    inertia = Measured.around(rigid[0], float(np.sqrt(rigid_covariance[0, 0])), "kg m²", 1.96)
    flexible_looking = gain > CLEARLY_BETTER
    bound = None
    if load_inertia is not None and not flexible_looking:
        least = (2 * np.pi * band[1]) ** 2 * load_inertia
        bound = Measured(np.inf, float(least), np.inf, "N m/rad")
    return Resonance(
        recording.name,
        name,
        seen=False,
        excited=band,
        total_inertia=inertia,
        antiresonance=None,
        resonance=None,
        stiffness=bound,
        damping=None,
        motor_inertia=None,
        load_inertia=None,
        gain=gain,
        misfit=rigid_cost / len(used.frequency),
        conclusion=(
            f"the joint is not rigid below {band[1]:.3g} Hz, the highest frequency that the "
            "reference excites, but its antiresonance cannot be located; excite more frequencies"
            if flexible_looking
            else f"no resonance below {band[1]:.3g} Hz, the highest frequency that the reference "
            "excites"
        ),
        response=_response(used, 1 / rigid_impedance(used.frequency, rigid)),
    )


def _loop_spectra(
    recording: Recording,
    joint: int,
    low: float,
    high: float,
    gamma: float,
    known: np.ndarray | None,
) -> LocalSpectra:
    """Spectra of speed, torque and sign of the speed, as values at the instants."""
    assert recording.q_ref is not None
    rate, h = recording.rate, recording.dt
    q, tau = recording.q[:, joint], recording.tau[:, joint]
    speed = central_difference(q, rate)
    smooth = central_difference(butterworth(q, rate, 0.2 * rate), rate)
    speeds = [smooth] if known is None else [smooth, load_speed(smooth, rate, known)]
    sign = 2 / np.pi * np.arctan(gamma * np.column_stack(speeds))
    reference = central_difference(recording.q_ref[:, joint], rate)
    found = local_spectra(np.column_stack([speed, tau]), reference, sign, rate, low, high)
    omega = 2 * np.pi * found.frequency
    factor = np.ones((len(omega), 2), dtype=complex)
    factor[:, 0] = omega * h / np.sin(omega * h)
    if recording.torque_timing == "held" and recording.control_rate <= 1.01 * rate:
        factor[:, 1] = np.sinc(found.frequency * h) * np.exp(-0.5j * omega * h)
    return LocalSpectra(
        found.frequency,
        factor * found.x,
        found.disturbance,
        factor * found.driven,
        factor[:, :, None] * found.noise * factor[:, None, :].conj(),
        found.excited,
    )


def _excited(spectra: LocalSpectra) -> LocalSpectra:
    """The excited bins up to the highest frequency around which most are."""
    kept = spectra.excited & (spectra.frequency <= spectra.excited_up_to)
    return LocalSpectra(*(getattr(spectra, part.name)[kept] for part in fields(spectra)))


def _is_seen(
    theta: np.ndarray, covariance: np.ndarray, gain: float, band: tuple[float, float]
) -> bool:
    """Whether the flexible fit is clearly better, and its antiresonance lies in the band."""
    f = float(np.exp(theta[2]) / (2 * np.pi))
    known = 1.96 * float(np.sqrt(covariance[2, 2])) < KNOWN_TO
    return gain > CLEARLY_BETTER and band[0] < f < band[1] and known


def _seen(
    recording: Recording,
    name: str,
    spectra: LocalSpectra,
    theta: np.ndarray,
    covariance: np.ndarray,
    gain: float,
    cost: float,
) -> Resonance:
    """The result with a resonance; intervals of positive numbers through their logarithms."""

    def positive(log: float, gradient: np.ndarray, unit: str) -> Measured:
        std = float(np.sqrt(gradient @ covariance[:4, :4] @ gradient))
        value, low, high = np.exp([log, log - 1.96 * std, log + 1.96 * std]).tolist()
        return Measured(value, low, high, unit)

    motor, load, omega, zeta = theta[:4]
    unit = np.eye(4)
    share = float(np.exp(motor) / (np.exp(motor) + np.exp(load)))
    ratio = 0.5 * (1 - share) * (unit[1] - unit[0])
    anti = positive(omega - np.log(2 * np.pi), unit[2], "Hz")
    stiffness = positive(2 * omega + load, 2 * unit[2] + unit[1], "N m/rad")
    resonance = omega - 0.5 * np.log(share) - np.log(2 * np.pi)
    total = np.log(np.exp(motor) + np.exp(load))
    return Resonance(
        recording.name,
        name,
        seen=True,
        excited=(float(spectra.frequency[0]), float(spectra.frequency[-1])),
        total_inertia=positive(total, share * unit[0] + (1 - share) * unit[1], "kg m²"),
        antiresonance=anti,
        resonance=positive(resonance, unit[2] + ratio, "Hz"),
        stiffness=stiffness,
        damping=positive(np.log(2) + zeta + omega + load, unit[3] + unit[2] + unit[1], "N m s/rad"),
        motor_inertia=positive(motor, unit[0], "kg m²"),
        load_inertia=positive(load, unit[1], "kg m²"),
        gain=gain,
        misfit=cost / len(spectra.frequency),
        conclusion=f"antiresonance at {anti} and stiffness {stiffness}",
        response=_response(spectra, flexible_parts(spectra.frequency, theta)[0]),
    )


def _nothing_excited(recording: Recording, name: str, used: LocalSpectra) -> Resonance:
    """The result if the reference excites too few frequencies."""
    top = float(used.frequency[-1]) if len(used.frequency) else 0.0
    band = (float(used.frequency[0]), top) if len(used.frequency) else (0.0, 0.0)
    return Resonance(
        recording.name,
        name,
        seen=False,
        excited=band,
        total_inertia=None,
        antiresonance=None,
        resonance=None,
        stiffness=None,
        damping=None,
        motor_inertia=None,
        load_inertia=None,
        gain=0.0,
        misfit=float("nan"),
        conclusion=f"the reference excites {len(used.frequency)} frequencies above the motion, too "
        "few to detect a resonance; add a multisine or noise up to the frequencies of interest to "
        "the reference",
        response=np.empty((3, 0)),
    )


def _response(spectra: LocalSpectra, admittance: np.ndarray) -> np.ndarray:
    """Measured and fitted |speed/torque|, including friction."""
    y, u = spectra.driven[:, 0], spectra.driven[:, 1]
    return np.vstack([spectra.frequency, np.abs(y / u), np.abs(admittance)])
