"""Stiffness of a joint from its motor's encoder alone: resonance and antiresonance in the loop.

The motor is hard to move at the antiresonance and easy to move at the resonance; the joint's
impedance (`joint_impedance`) is fitted over the bins that the reference excites (`impedance_fit`).
The sign of the load's friction comes from the motor's speed through the spring, in a second fit;
half of what that moves goes into the deviations. A rigid joint is fitted as well. Where the
flexible one is not clearly better, no resonance was seen, and the highest excited frequency says
how far that goes.
"""

from __future__ import annotations

from dataclasses import dataclass, field, fields

import numpy as np

from pivident.errors import IdentificationError
from pivident.flexibility.frequency_response import LocalSpectra, local_spectra
from pivident.flexibility.impedance_fit import fit_flexible, fit_rigid
from pivident.flexibility.joint_impedance import flexible_parts, load_speed, rigid_impedance
from pivident.flexibility.measured import Measured
from pivident.recording.recording import Recording

#: Fewest excited bins that a fit may rest on.
MIN_BINS = 40

#: Gain in twice the log-likelihood from which a resonance counts as seen.
CLEARLY_BETTER = 50.0

#: Share of itself to which the antiresonance has to be known (95 %).
KNOWN_TO = 0.25

#: Share of what the load's own sign of friction changes that is taken for a deviation.
FRICTION_DOUBT = 0.5


@dataclass(frozen=True, eq=False)
class Resonance:
    """What one encoder tells about a joint's flexibility."""

    recording: str  # name of the run
    joint: str  # name of the joint
    seen: bool  # whether there is a resonance in the excited band
    # lowest and highest frequency that the reference excites [Hz]; (0, 0): none
    excited: tuple[float, float]
    # Jm + Jl, or J of the rigid fit [kg m²]; None where nothing is excited
    total_inertia: Measured | None
    antiresonance: Measured | None  # √(k/Jl)/2π [Hz], or None
    resonance: Measured | None  # √(k (1/Jm + 1/Jl))/2π [Hz], or None
    # k; where no resonance was seen, only its lower end, and only if the load's inertia was given
    # [N m/rad]
    stiffness: Measured | None
    damping: Measured | None  # d [N m s/rad], or None
    motor_inertia: Measured | None  # Jm [kg m²], or None
    load_inertia: Measured | None  # Jl [kg m²], or None
    gain: float  # twice the log-likelihood of the flexible over that of the rigid joint
    misfit: float  # cost over the number of bins; about 1 where the model holds
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
    """Look for the resonance of one joint in its loop.

    Args:
        recording: has ``q_ref``; a link encoder is not used.
        joint: index of the joint.
        motor_inertia: Jm where it is known [kg m²]; None: it is estimated.
        load_inertia: Jl, for a lower end of the stiffness where no resonance is seen [kg m²].
        lowest: lowest frequency that is used [Hz].
        highest: highest frequency [Hz]; None: a fifth of the sampling rate.
        gamma: slope of the smoothed sign of friction [s/rad].

    Returns:
        Antiresonance, resonance and what follows from them, with deviations.

    Raises:
        IdentificationError: there is no reference.
    """
    name = recording.joint_names[joint]
    if recording.q_ref is None:
        raise IdentificationError(
            f"recording {recording.name!r} has no reference for joint {name!r}: in a loop, noise "
            "cannot be told from excitation without it; record q_ref"
        )
    high = 0.2 * recording.rate if highest is None else highest
    spectra = _loop_spectra(recording, joint, lowest, high, gamma, None)
    used = _excited(spectra)
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
        # The sign of friction is known only as well as the speeds: half of what it moved counts.
        moved = FRICTION_DOUBT * (flexible - first)
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
            else f"no resonance seen below {band[1]:.3g} Hz, the highest frequency that the "
            "reference excites"
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
    from pivident.signals.bandpass import butterworth, central_difference

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
    """The answer where a resonance was found; logarithms make the intervals of positive numbers."""

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
    """The answer where the reference excites next to nothing."""
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
        "few to see a resonance; add a multisine or noise up to the frequencies in question to the "
        "reference",
        response=np.empty((3, 0)),
    )


def _response(spectra: LocalSpectra, admittance: np.ndarray) -> np.ndarray:
    """Measured and fitted |speed/torque|, friction not taken off."""
    y, u = spectra.driven[:, 0], spectra.driven[:, 1]
    return np.vstack([spectra.frequency, np.abs(y / u), np.abs(admittance)])
