"""Torque ripple as lines over the position: their orders, results, printing, and removal.

A line is a torque a cos(nφ) + b sin(nφ) = A cos(nφ - ψ) of an angle φ. For most joints φ is the
joint's own position, and n [rad/rad, which is cycles per revolution; rad/m for a sliding joint] is
the argument of the friction term ``ripple(order)``. A motor that turns with several joints
(TX40: motor 6 with q5 + q6) has ripple over its own angle, in the rows of all these joints.

Angles over which a torque may ripple, and the revolutions to which an order may belong.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.robot.description import Robot
from pivident.signals.alignment import torque_shift
from pivident.studies.friction.order_spectrum import OrderSpectrum

#: 95 % of a normal variable lie within so many standard deviations.
TWO_SIDED = 1.96
#: Log-likelihood, in floors, by which a line in time must exceed a ripple to replace it. The two
#: are distinguishable if the ripple keeps twice as much beside the line in time.
DISTINGUISHABLE = 3.0
#: An order belongs to a revolution if the probability of a chance match is below this.
COINCIDENCE = 0.2
#: Multiples of a named order that are recognised.
NAMED_MULTIPLES = 4


@dataclass(frozen=True)
class NamedOrder:
    """An order that is expected, such as gear teeth or pole pairs.

    Attributes:
        name: in words, ``pole pairs``.
        count: cycles per revolution.
        of: revolution of the ``motor`` or of the ``joint``.
        joint: the joint's name; None: all joints.
    """

    name: str  # in words, ``pole pairs``
    count: float  # cycles per revolution
    of: Literal["motor", "joint"] = "motor"  # revolution of the ``motor`` or of the ``joint``
    joint: str | None = None  # the joint's name; None: all joints

    def __post_init__(self) -> None:
        if not (math.isfinite(self.count) and self.count > 0):
            raise ExperimentError(
                f"named order {self.name!r} has {self.count} cycles per revolution",
                advice="give a positive number",
            )
        if self.of not in ("motor", "joint"):
            raise ExperimentError(
                f"named order {self.name!r} is of the {self.of!r}",
                advice="choose 'motor' or 'joint'",
            )


@dataclass(frozen=True, eq=False)
class Angle:
    """The angle φ = c·q over which a torque may ripple."""

    name: str  # ``joint_1`` or ``motor of joint_6``
    coefficients: np.ndarray  # c, shape (joints,)
    # motor turns per unit of this angle, by the motor's name [rad/rad or rad/m]
    motors: tuple[tuple[str, float], ...]
    own: bool = True  # whether it is the joint's own position, as in the friction term


@dataclass(frozen=True)
class Relation:
    """The revolution to which an order belongs."""

    text: str  # in words, ``6 per revolution of the motor of joint_1``
    order: float  # the exact order n
    coincidence: float  # probability that a random order comes as close


def angles_of(robot: Robot, joint: int) -> tuple[Angle, ...]:
    """Angles over which a joint's torque may ripple: its position, and coupled motors acting on it.

    A motor that turns with this joint alone has an angle proportional to its position.
    """
    names = [j.name for j in robot.joints]
    reduction = robot.transmission.reduction
    own_motors, others = [], []
    for m in np.flatnonzero(reduction[:, joint]):
        row, motor = reduction[m], f"motor of {names[m]}"
        gear = float(abs(row[joint]))
        if np.count_nonzero(row) > 1:
            others.append(Angle(motor, row / row[joint], ((motor, gear),), own=False))
        else:
            own_motors.append((motor, gear))
    return (Angle(names[joint], np.eye(robot.size)[joint], tuple(own_motors)), *others)


def relate(
    order: float, std: float, angle: Angle, revolute: bool, named: Sequence[NamedOrder]
) -> Relation | None:
    """The revolution to which an order belongs; None if none is near, or too many are."""
    reach = max(2.0 * std, 1e-3 * order)
    found = []
    for wanted in named:
        for text, base in named_bases(wanted, angle, revolute):
            multiple = round(order / base)
            if 1 <= multiple <= NAMED_MULTIPLES and abs(order - multiple * base) <= reach:
                times = "" if multiple == 1 else f"{multiple} x "
                words = f"{times}{wanted.name}: {multiple * wanted.count:g} per {text}"
                found.append(Relation(words, multiple * base, min(2.0 * reach / base, 1.0)))
    turns = [(f"revolution of the {name}", gear) for name, gear in angle.motors if gear != 1.0]
    turns += [(f"revolution of {angle.name}", 1.0)] if revolute and angle.own else []
    for text, base in turns:
        multiple = round(order / base)
        if multiple >= 1 and abs(order - multiple * base) <= reach:
            words = f"{multiple} per {text}"
            found.append(Relation(words, multiple * base, min(2.0 * reach / base, 1.0)))
    likely = [relation for relation in found if relation.coincidence <= COINCIDENCE]
    return likely[0] if likely else None


def named_bases(wanted: NamedOrder, angle: Angle, revolute: bool) -> list[tuple[str, float]]:
    """Orders n of a named order over an angle, with the revolution in words."""
    if wanted.of == "motor":
        return [(f"revolution of the {name}", wanted.count * g) for name, g in angle.motors]
    if revolute and angle.own:
        return [(f"revolution of {angle.name}", wanted.count)]
    return []


@dataclass(frozen=True, eq=False)
class RippleLine:
    """One line of ripple."""

    joint: str  # name of the joint with this ripple in its torque
    index: int  # its number
    angle: Angle  # the ripple is periodic in this angle
    order: float  # n [rad/rad = cycles per revolution, or rad/m], as in ``ripple(order)``
    order_std: float  # its standard error
    # delay of the torque relative to the positions [s]: torque logged late, or the response of the
    # position loop to a ripple faster than the loop
    lag: float
    cosine: float  # a [N m or N]
    sine: float  # b [N m or N]
    covariance: np.ndarray  # of a and b, jointly with all other lines, order known, shape (2, 2)
    unit: str  # N m or N
    p_value: float  # probability of such a line without ripple, over all orders of this joint
    # its gain in log-likelihood, in floors, after subtracting the likeliest line of constant
    # frequency; zero if the speed hardly varies
    beside_time: float
    frequencies: tuple[float, float]  # 5th and 95th percentile of n|dφ/dt| over the rows [Hz]
    share: float  # of the residual's variance, 0 to 1
    relation: Relation | None  # the revolution it belongs to, or None
    # order of a stronger line within a few resolutions, or None: amplitude or phase of that ripple
    # change along the record, and this line compensates for it
    beside: float | None
    # relative change of amplitude per relative change of load; 0 constant, 1 proportional to the
    # load |Φθ|
    load_slope: float
    load_slope_std: float  # its standard error
    load_p: float  # probability if the amplitude did not depend on load
    forward: float  # amplitude at positive speed [unit]
    backward: float  # amplitude at negative speed [unit]
    direction_p: float  # probability if amplitude and phase did not depend on direction
    # share of the rows on which the ripple is faster than the passband of the position smoother;
    # there the amplitude lacks the torque that moves the joint itself
    smoothed: float

    @property
    def amplitude(self) -> float:
        """A = √(a² + b²) [unit]."""
        return math.hypot(self.cosine, self.sine)

    @property
    def amplitude_std(self) -> float:
        """Standard error of A [unit]."""
        slope = np.array([self.cosine, self.sine]) / max(self.amplitude, 1e-300)
        return float(np.sqrt(slope @ self.covariance @ slope))

    @property
    def interval(self) -> tuple[float, float]:
        """95 % interval of A [unit]."""
        reach = TWO_SIDED * self.amplitude_std
        return max(self.amplitude - reach, 0.0), self.amplitude + reach

    @property
    def phase(self) -> float:
        """ψ in A cos(nφ - ψ), order known [rad]."""
        return math.atan2(self.sine, self.cosine)

    @property
    def distinct_from_time(self) -> bool:
        """Whether the record distinguishes it from a line of constant frequency."""
        return self.beside_time > 2.0 * DISTINGUISHABLE

    @property
    def depends_on_load(self) -> bool:
        """Whether the amplitude changes with the load, at 1 %."""
        return self.load_p < 0.01

    @property
    def depends_on_direction(self) -> bool:
        """Whether amplitude or phase change with the direction, at 1 %."""
        return self.direction_p < 0.01

    def torque(self, q: np.ndarray) -> np.ndarray:
        """A cos(nφ - ψ) [N m or N] from positions of all joints, ``lag`` earlier."""
        phase = self.order * (q @ self.angle.coefficients)
        return self.cosine * np.cos(phase) + self.sine * np.sin(phase)

    def __str__(self) -> str:
        relation = self.relation.text if self.relation else "unrelated to known revolutions"
        if self.beside is not None:
            relation = f"beside {self.beside:.5g}, whose amplitude or phase changes"
        p = "p < 0.001" if self.p_value < 1e-3 else f"p = {self.p_value:.2g}"
        remarks = []
        if not self.distinct_from_time:
            remarks.append("not distinguishable from a constant frequency: speed varies too little")
        if self.depends_on_load:
            reach = TWO_SIDED * self.load_slope_std
            remarks.append(f"depends on load (slope {plus_minus(self.load_slope, reach)})")
        if self.depends_on_direction:
            remarks.append(
                f"forward {format_significant(self.forward)}, backward "
                f"{format_significant(self.backward)} "
                f"{self.unit}"
            )
        if self.lag:
            remarks.append(f"{1e3 * self.lag:.3g} ms behind the position")
        if self.smoothed > 0.5:
            remarks.append("mostly faster than the position smoother")
        text = (
            f"{self.joint}: order {plus_minus(self.order, TWO_SIDED * self.order_std)} of "
            f"{self.angle.name} ({relation}), "
            f"{plus_minus(self.amplitude, TWO_SIDED * self.amplitude_std)} {self.unit}, phase "
            f"{self.phase:.2f} rad, {100 * self.share:.2g} % of the residual's variance, {p}, "
            f"{self.frequencies[0]:.3g} to {self.frequencies[1]:.3g} Hz"
        )
        return "; ".join([text, *remarks])


@dataclass(frozen=True)
class TimeLine:
    """A line of constant frequency, which is not ripple."""

    frequency: float  # [Hz]
    amplitude: float  # largest of all recordings [N m or N]


@dataclass(frozen=True)
class NamedFinding:
    """Result for an order that was asked for."""

    order: NamedOrder
    value: float  # n [rad/rad or rad/m]
    amplitude: float  # at that order [N m or N]; NaN if it was not searched
    smallest_visible: float  # smallest detectable amplitude [N m or N]; NaN likewise
    p_value: float  # probability of this amplitude at this order, without ripple; NaN likewise
    unseen: str  # why it was not searched, else empty


@dataclass(frozen=True, eq=False)
class JointRipple:
    """Ripple of one joint."""

    name: str  # joint
    unit: str  # N m or N
    lines: tuple[RippleLine, ...]  # largest amplitude first
    time_lines: tuple[TimeLine, ...]  # lines of constant frequency
    angles: tuple[Angle, ...]  # angles searched
    spectra: tuple[OrderSpectrum, ...]  # of each angle, including the lines
    left: tuple[OrderSpectrum, ...]  # of each angle, without the lines; basis of the intervals
    named: tuple[NamedFinding, ...]  # orders asked for
    notes: tuple[str, ...]  # range and limits of the search, whole sentences

    @property
    def orders(self) -> tuple[float, ...]:
        """Orders over the joint's own position, for the friction term ``ripple(order)``.

        Lines beside a stronger one are excluded: they describe how the ripple changed along this
        record and do not predict other motion.
        """
        return tuple(line.order for line in self.lines if line.angle.own and line.beside is None)


@dataclass(frozen=True, eq=False)
class Ripple:
    """Ripple of all joints."""

    joints: tuple[JointRipple, ...]
    alpha: float  # largest false-alarm probability of a line, per joint

    @property
    def lines(self) -> tuple[RippleLine, ...]:
        """All lines, joint by joint."""
        return tuple(line for joint in self.joints for line in joint.lines)

    @property
    def main_lines(self) -> tuple[RippleLine, ...]:
        """The lines that predict other motion: those beside a stronger one are excluded."""
        return tuple(line for line in self.lines if line.beside is None)

    @property
    def orders(self) -> dict[str, tuple[float, ...]]:
        """For each joint with ripple over its own position, the orders of its friction terms."""
        return {joint.name: joint.orders for joint in self.joints if joint.orders}

    def __str__(self) -> str:
        out = []
        for joint in self.joints:
            out += [str(line) for line in joint.lines] or [f"{joint.name}: no ripple found"]
            out += [
                *(
                    f"{joint.name}: line at {line.frequency:.4g} Hz, "
                    f"{format_significant(line.amplitude)} "
                    f"{joint.unit}, constant in time, not ripple"
                    for line in joint.time_lines
                ),
                *(f"{joint.name}: {note}" for note in joint.notes),
            ]
        return "\n".join(out)


def ripple_torque(
    lines: Sequence[RippleLine], q: np.ndarray, rate: float, shift: float = 0.0
) -> np.ndarray:
    """Torque of some lines as a known signal, shape (samples, joints) [N m or N].

    The torque is sampled ``shift`` samples later than the positions.
    """
    torque, samples = np.zeros(np.shape(q)), np.arange(len(q))
    for line in lines:
        then = samples + shift - line.lag * rate
        moved = np.column_stack([np.interp(then, samples, column) for column in np.transpose(q)])
        torque[:, line.index] += line.torque(moved)
    return torque


def remove_ripple(recording: Recording, lines: Sequence[RippleLine]) -> Recording:
    """Subtract the ripple of some lines from the torque of a recording.

    The positions are interpolated at the instants of the torque samples. All other channels stay;
    the name of the recording lists what was removed.

    Args:
        recording: the recording.
        lines: found by ``find_ripple`` in this or another recording of the same machine.

    Returns:
        A new recording; the given one stays as it is.

    Raises:
        ExperimentError: a line belongs to a joint that the recording does not have.
    """
    for line in lines:
        own = recording.joint_names
        if line.index >= len(own) or own[line.index] != line.joint:
            raise ExperimentError(
                f"ripple of joint {line.joint!r} (number {line.index + 1}) cannot be removed from "
                f"recording {recording.name!r}, whose joints are {', '.join(own)}"
            )
    if not lines:
        return recording
    shift = torque_shift(
        recording.rate,
        recording.torque_timing,
        control_rate=recording.control_rate,
        delay=recording.delay,
    )
    removed = ", ".join(
        f"{joint} order {' '.join(f'{li.order:.5g}' for li in lines if li.joint == joint)}"
        for joint in dict.fromkeys(line.joint for line in lines)
    )
    return replace(
        recording,
        name=f"{recording.name} (ripple removed: {removed})",
        tau=recording.tau - ripple_torque(lines, recording.q, recording.rate, shift),
        saturation="allow",
    )
