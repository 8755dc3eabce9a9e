"""Stiffness of a joint from encoders on both sides of its gear, in slow motion.

The deflection, motor angle over gear ratio less link angle, is

    δ = q_m - q_l = T/k - (d/k²) dT + ϑ dq_m - (f/k) s(dq_m) - h z + (b/2) s(T) + ε(N q_m) + δ₀
    T = tau - Jm ddq_m

k stiffness, d damping, ϑ the delay of the link encoder, f Coulomb friction before the spring, 2h
width of the hysteresis loop with z the direction of change of the torque, b backlash, ε
transmission error (see `deflection_fit`), δ₀ the difference of the encoders' zeros. Viscous
friction before the spring is equivalent to ϑ, a delay of the torque to d. The link encoder is
shifted by a first estimate of ϑ, since the lag's second order, -ϑ²/2 ddq, would look like a stiffer
spring.

Torque and acceleration are low-passed with zero phase. If the reference was recorded, they are
instrumented with their part that follows from it, so that noise of the torque does not bias the
stiffness upwards. Standard errors come from leaving out blocks of the motion in turn (jackknife),
so they include model error. They are not valid if model error dominates the deflection, as for a
swinging load; then nothing is estimated.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import partial

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.studies.flexibility.deflection_fit import (
    DeflectionFit,
    DeflectionMotion,
    TransmissionLine,
    deflection_motion,
    find_orders,
    fit_deflection,
    largest_order,
    torque_through_spring,
)
from pivident.studies.flexibility.measured import Measured
from pivident.studies.flexibility.spectral_equations import STUDENT

#: Cut-off of torque and acceleration [Hz].
CUTOFF = 10.0

#: Samples by which an encoder may be late; more is viscous friction.
MAX_LAG = 20.0

#: An optional term is kept beyond this many standard errors.
CLEAR = 3.0

#: Share of the torque that must lie on each side of zero for backlash to show.
BOTH_SIDES = 0.1

#: Largest unexplained share of the deflection, by rms, for valid estimates.
MAX_UNEXPLAINED = 0.5


@dataclass(frozen=True, eq=False)
class Compliance:
    """Components of the deflection of one joint.

    If more than :data:`MAX_UNEXPLAINED` is unexplained, the estimates are withheld: those
    quantities have neither value nor ends, and a note gives the reason.
    """

    recording: str  # name of the run
    joint: str  # name of the joint
    stiffness: Measured  # k [N m/rad]
    motor_inertia: float  # Jm whose torque was subtracted [kg m²]
    stiffness_change: float  # change of k if Jm were a tenth larger [%]
    friction: Measured  # Coulomb friction before the spring [N m]
    # delay of the link encoder [s], including the viscous friction before the spring
    encoder_lag: Measured
    offset: Measured  # difference of the encoders' zeros [rad]
    hysteresis: Measured  # width of the loop of deflection over torque [rad]
    # gap without torque, or None if the torque does not change its sign [rad]
    backlash: Measured | None
    damping: Measured  # d, with the torque's delay in it [N m s/rad]
    lines: tuple[TransmissionLine, ...]  # transmission error
    transmitted: tuple[float, float]  # lowest and highest torque through the spring [N m]
    # lowest and highest deflection due to that torque [rad]
    deflection: tuple[float, float]
    recorded: tuple[float, float]  # lowest and highest recorded difference of the encoders [rad]
    residual: float  # rms of the residual [rad]
    unexplained: float  # the same over the deflection's standard deviation
    instrumented: bool  # whether instruments from the reference were used
    notes: tuple[str, ...]  # reservations, sentences
    # torque, deflection and model without lines, shape (3, samples), for the figure
    fitted: np.ndarray = field(repr=False)

    @property
    def explained(self) -> bool:
        """Whether the model explains enough of the deflection for its estimates to be valid."""
        return self.unexplained <= MAX_UNEXPLAINED


def identify_compliance(
    recording: Recording,
    joint: int = 0,
    *,
    motor_inertia: float = 0.0,
    reduction: float = 1.0,
    cutoff: float = CUTOFF,
    encoder_lag: tuple[float, float] | None = None,
    gamma: float | None = None,
) -> Compliance:
    """Stiffness, damping and losses of one joint, from both its encoders.

    Args:
        recording: has ``q_link``.
        joint: index of the joint.
        motor_inertia: Jm on the joint side [kg m²]; 0 leaves the motor's inertia in the torque.
        reduction: N, for orders of the transmission error per revolution of the motor.
        cutoff: of torque and acceleration [Hz].
        encoder_lag: delay of the link encoder and its standard error [s], if known; None: it is
            estimated.
        gamma: slope of the smoothed sign of friction [s/rad]; None: it changes within 2 % of the
            highest speed.

    Returns:
        Stiffness, damping and losses with intervals, and the unexplained part of the deflection.

    Raises:
        IdentificationError: there is no link encoder, or too little motion.
    """
    name = recording.joint_names[joint]
    prepared = partial(
        deflection_motion,
        recording,
        joint,
        reduction=reduction,
        cutoff=cutoff,
        known_lag=encoder_lag,
        gamma=gamma,
    )
    motion = prepared(motor_inertia)
    retimed = fit_deflection(motion, (), ()).value("speed")
    if abs(retimed) * recording.rate < MAX_LAG:
        motion = prepared(motor_inertia, retimed=retimed)
    orders = _orders(motion, recording, joint, reduction)
    plain = fit_deflection(motion, orders, ())
    backlash = _torque_changes_sides(torque_through_spring(motion, plain))
    optional = ["hysteresis", "damping"] + (["backlash"] if backlash else [])
    tried = {term: fit_deflection(motion, orders, (term,)) for term in optional}
    kept = tuple(term for term in optional if abs(tried[term].ratio(term)) > CLEAR)
    final = fit_deflection(motion, orders, kept) if kept else plain
    tried |= {term: final for term in kept}
    notes = tuple(_notes(recording, motion, final, kept, motor_inertia))
    k = final.measured("torque", "", inverse="N m/rad")
    compliance = final.value("torque")
    torque = torque_through_spring(motion, final)
    strained = torque * compliance
    left = motion.deflection - final.columns @ final.theta
    without_lines = motion.deflection - final.of_lines()
    slope = tried["damping"]
    damping = Measured.unknown("N m s/rad")
    if slope.has_stiffness:
        of_one = compliance**2
        value, std = -slope.value("damping") / of_one, slope.std("damping") / of_one
        damping = Measured.around(value, std, "N m s/rad", STUDENT)
    heavier = prepared(1.1 * motor_inertia, retimed=motion.retimed)
    other = fit_deflection(heavier, orders, kept).value("torque")
    found = Compliance(
        recording=recording.name,
        joint=name,
        stiffness=k,
        motor_inertia=motor_inertia,
        stiffness_change=100 * (compliance / other - 1) if final.has_stiffness else math.nan,
        friction=final.over_compliance("sign", "N m"),
        encoder_lag=_lag(final, motion),
        offset=final.measured("offset", "rad"),
        hysteresis=tried["hysteresis"].measured("hysteresis", "rad", -2.0),
        backlash=tried["backlash"].measured("backlash", "rad", 2.0) if backlash else None,
        damping=damping,
        lines=final.lines(orders),
        transmitted=(float(torque.min()), float(torque.max())),
        deflection=(float(strained.min()), float(strained.max())),
        recorded=motion.recorded,
        residual=float(np.sqrt(np.mean(left**2))),
        unexplained=float(np.std(left) / np.std(motion.deflection)),
        instrumented=motion.instruments is not None,
        notes=notes,
        fitted=np.vstack([torque, without_lines, without_lines - left]),
    )
    return found if found.explained else _withheld(found)


def _withheld(found: Compliance) -> Compliance:
    """The same without estimates, for a model that leaves most of the deflection unexplained."""
    note = (
        f"the model of slow motion leaves {100 * found.unexplained:.2g} % of the deflection "
        f"unexplained, more than {100 * MAX_UNEXPLAINED:.0f} %, so nothing is estimated from it: "
        "the load swings, or the deflection has another cause than the torque; record a slower "
        "motion that does not excite the resonance"
    )
    return replace(
        found,
        stiffness=Measured.unknown("N m/rad"),
        stiffness_change=math.nan,
        friction=Measured.unknown("N m"),
        encoder_lag=Measured.unknown("s"),
        offset=Measured.unknown("rad"),
        hysteresis=Measured.unknown("rad"),
        backlash=None if found.backlash is None else Measured.unknown("rad"),
        damping=Measured.unknown("N m s/rad"),
        lines=(),
        deflection=(math.nan, math.nan),
        notes=(note,),
    )


def identify_compliances(
    recording: Recording,
    motor_inertia: np.ndarray,
    reduction: np.ndarray,
    *,
    cutoff: float = CUTOFF,
) -> tuple[Compliance, ...]:
    """All joints of a record; a joint without a stiffness of its own takes the others' lag.

    The link encoders are read together, so joints share their lag up to the viscous friction before
    the spring, which the spread of the lags covers. Inertias are on the joint side [kg m²].
    """
    recording.require_torque("stiffness is identified")

    def one(joint: int, lag: tuple[float, float] | None) -> Compliance:
        return identify_compliance(
            recording,
            joint,
            motor_inertia=float(motor_inertia[joint]),
            reduction=float(reduction[joint]),
            cutoff=cutoff,
            encoder_lag=lag,
        )

    found = [one(joint, None) for joint in range(recording.joints)]
    known = [c.encoder_lag for c in found if math.isfinite(c.stiffness.high)]
    if len(known) >= 2:
        weights = 1 / np.square([(lag.high - lag.low) / (2 * STUDENT) for lag in known])
        mean = float(np.average([lag.value for lag in known], weights=weights))
        spread = float(np.std([lag.value for lag in known], ddof=1))
        common = (mean, math.hypot(spread, float(weights.sum() ** -0.5)))
        for joint, compliance in enumerate(found):
            if not math.isfinite(compliance.stiffness.high):
                found[joint] = one(joint, common)
    return tuple(found)


def _orders(
    motion: DeflectionMotion, recording: Recording, joint: int, reduction: float
) -> tuple[float, ...]:
    """Orders of the transmission error, from the residual of the other terms."""
    plain = fit_deflection(motion, (), ())
    highest = largest_order(reduction * recording.q[:, joint], recording.rate)
    return tuple(
        find_orders(motion.deflection - plain.columns @ plain.theta, motion.angle, highest)
    )


def _lag(fit: DeflectionFit, motion: DeflectionMotion) -> Measured:
    """Delay of the link encoder: the applied shift plus the remaining lag [s]."""
    return Measured.around(motion.retimed + fit.value("speed"), fit.std("speed"), "s", STUDENT)


def _torque_changes_sides(torque: np.ndarray) -> bool:
    """Whether the torque is on each side of zero long enough to show a gap."""
    share = float(np.mean(torque > 0))
    return min(share, 1 - share) > BOTH_SIDES


def _notes(
    recording: Recording,
    motion: DeflectionMotion,
    fit: DeflectionFit,
    kept: Sequence[str],
    motor_inertia: float,
) -> Iterator[str]:
    """Reservations about this estimate."""
    if motion.instruments is None:
        yield (
            "no reference was recorded: noise of the torque biases the stiffness upwards by its "
            f"share of the torque's variance below {CUTOFF:g} Hz"
        )
    if motor_inertia == 0.0:
        yield "the motor's inertia is unknown: its torque counts as transmitted"
    lag = (motion.retimed + fit.value("speed")) * float(np.abs(motion.speed).max())
    strain = fit.value("torque") * float(np.ptp(motion.torque))
    late = _lag(fit, motion)
    if late.clear and abs(lag) > 0.1 * abs(strain):
        yield (
            f"{1e3 * abs(lag):.2g} mrad of the recorded difference at the highest speed are due to "
            f"the delay between the encoders ({1e3 * late.value:.3g} ms), not deflection"
        )
    if motion.known_lag is not None:
        yield "the link encoder's lag is that of the other joints"
    if fit.value("torque") + STUDENT * fit.std("torque") <= 0:
        yield (
            "the deflection moves against the torque, which no spring does: torque, speed and "
            "direction change together in this motion, or the deflection has another cause"
        )
    elif fit.value("torque") - STUDENT * fit.std("torque") <= 0:
        yield (
            "the record does not bound the stiffness from above: the torque changes too little, or "
            "only together with friction or backlash"
        )
    if kept:
        yield f"clear terms: {', '.join(kept)}"
