"""A designed motion, with everything that is known of it before the robot moves, and as tables.

A motion as tables: samples at a rate, and the postures that one types into a teach pendant.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from math import inf, nan
from typing import Annotated, Any, Literal

import numpy as np

from pivident.foundation.document.table import Column, Table
from pivident.foundation.text import display
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Known, Limits, Name, Null, Sized, csv_table
from pivident.robot.description import Joint
from pivident.robot.robot_values import StoredRobot
from pivident.studies.collision.bodies import Body, Obstacle
from pivident.studies.excitation.motions import RISE_SHARE, StoredMotion

#: A number that is infinite where a file says null.
Unlimited = Annotated[float, Null(inf)]

#: Rate of the torques that a design keeps for its page [Hz].
PAGE_RATE = 50.0
#: Digits of a sample, and of a position in a list that is typed in by hand.
DIGITS, TYPED_DECIMALS = 12, 4


Limited = Literal["position", "speed", "acceleration", "jerk", "torque", "rms torque"]


@dataclass(frozen=True)
class LimitUse(Displayed):
    """How far a motion goes towards one limit of a joint, on the fine grid.

    Attributes:
        joint: name of the joint.
        quantity: ``position``, ``speed``, ``acceleration``, ``jerk``, ``torque`` or
            ``rms torque``.
        unit: of the values.
        low: least value allowed, -inf for none.
        high: largest value allowed, inf for none.
        least: least value of the motion; of a torque with two standard errors of the model.
        largest: largest value of the motion, likewise.
        t: instant at which it comes nearest to a limit [s]; NaN for an rms torque.
        source: where the limit comes from: ``description``, ``file`` or ``assumed``.
    """

    joint: Name
    quantity: Limited
    unit: Name
    low: Annotated[float, Null(-inf)]
    high: Unlimited
    least: float
    largest: float
    t: Known
    source: Name

    @property
    def share(self) -> float:
        """Share of the limit that is used, 0 to 1; more than 1 breaks it.

        Of positions it is counted from the middle of their range.
        """
        if self.quantity == "position":
            middle, half = 0.5 * (self.low + self.high), 0.5 * (self.high - self.low)
            return max(self.largest - middle, middle - self.least) / half
        return max(self.largest / self.high, self.least / self.low if self.low else 0.0)


@dataclass(frozen=True)
class ClearanceUse:
    """How near two bodies come to each other, or the tool to the side of its box.

    Attributes:
        name: such as ``forearm and table``.
        least: least clearance of the motion, on the fine grid [m].
        needed: clearance that is asked for [m].
        t: instant of the least clearance [s].
    """

    name: Name
    least: float
    needed: float
    t: float


@dataclass(frozen=True)
class PredictedError(Displayed):
    """What the motion will give for one parameter.

    Attributes:
        name: of the parameter, such as ``zz1r``.
        unit: of its value.
        value: present value, from an earlier result or the description; NaN where none is known.
        std: standard error that the record of this motion will give, infinite where the motion
            does not determine the parameter.
        before: standard error of the earlier records alone; infinite without them.
        size: size of the parameter that matters: that of its value, or the one from which on its
            torque is noticeable.
        alone: standard error that the record of this motion gives without the earlier ones; `std`
            where there are none.
        wanted: whether it was asked for by name.
        remark: why it remains undetermined, empty otherwise.
    """

    name: Name
    unit: Name
    value: Known
    std: Unlimited
    before: Unlimited
    wanted: bool = False
    remark: str = ""
    alone: Unlimited = inf
    size: Known = nan

    @property
    def relative(self) -> float:
        """σ/|θ|; infinite for a value of zero, NaN for an unknown one."""
        if np.isnan(self.value):
            return float("nan")
        return self.std / abs(self.value) if self.value else float("inf")

    @property
    def share(self) -> float:
        """Standard error over the size that matters: what the design made small."""
        return self.std / self.size


@dataclass(frozen=True, eq=False)
class Design(Displayed):
    """A motion that excites, and what its record is expected to determine.

    Attributes:
        robot: the robot.
        motion: the motion; `ExcitingMotion.sampled` gives it at any rate.
        criterion: what was made small: ``d``, ``a``, ``worst`` or ``cond``, and the names of the
            parameters where only some counted.
        cost: its value at the start of the search and at its end, in the words of ``cost_words``.
        cost_words: what the two numbers are, such as ``largest relative standard error``.
        condition: condition number of the observation matrix in SI units, as other programs print
            it, at the start of the search and at its end.
        predicted: standard errors, one entry for each base parameter, in order.
        correlation: of the estimates, shape (parameters, parameters).
        limits: use of each limit of each joint.
        clearances: use of the room between bodies, the nearest first.
        noise: what noise the standard errors rest on, one sentence.
        notes: reservations and assumptions, complete sentences.
        settings: what was asked for, as plain values.
        bodies: capsules of the robot in their links' frames, to draw it; see `Body`.
        obstacles: solid bodies around the robot, to draw them.
        seconds: time that the search took [s].
        torque: torques that the present model predicts along the motion, at the instants
            ``motion.times(PAGE_RATE)``, shape (samples, joints) [N m or N]; None where no model is
            known.
        torque_margin: two standard errors of these torques, same shape and unit, or None.
    """

    robot: StoredRobot
    motion: StoredMotion
    criterion: str
    cost: tuple[Unlimited, Unlimited]
    cost_words: str
    condition: tuple[Unlimited, Unlimited]
    predicted: Annotated[tuple[PredictedError, ...], Sized("parameters")]
    correlation: Annotated[np.ndarray, Sized("parameters", "parameters"), Null(nan)]
    limits: tuple[LimitUse, ...]
    clearances: tuple[ClearanceUse, ...]
    noise: str
    notes: tuple[str, ...] = ()
    settings: Mapping[str, Any] = field(default_factory=dict)
    bodies: tuple[Body, ...] = ()
    obstacles: tuple[Obstacle, ...] = ()
    seconds: Annotated[float, Limits(ge=0.0)] = 0.0
    torque: Annotated[np.ndarray | None, Sized(None, "joints")] = None
    torque_margin: Annotated[np.ndarray | None, Sized(None, "joints")] = None

    def __str__(self) -> str:
        return str(display.presentation.design_text(self))

    @property
    def undetermined(self) -> tuple[PredictedError, ...]:
        """Parameters that the record of this motion will not determine."""
        return tuple(p for p in self.predicted if p.remark)

    @property
    def reasons(self) -> dict[str, list[str]]:
        """Why parameters remain undetermined, with the names that share a reason."""
        found: dict[str, list[str]] = {}
        for p in self.undetermined:
            found.setdefault(p.remark, []).append(p.name)
        return found

    @property
    def binding(self) -> tuple[LimitUse | ClearanceUse, ...]:
        """Limits that the motion uses to 94 % or more, bodies within 15 mm of theirs."""
        limits = [use for use in self.limits if use.share >= 0.94]
        return (*limits, *(c for c in self.clearances if c.least <= c.needed + 0.015))


@dataclass(frozen=True, eq=False)
class PostureMove:
    """One line of the list of postures.

    Attributes:
        number: of the posture, from 1.
        q: joint positions, shape (joints,) [rad or m].
        duration: of the move to it [s]; NaN for the first posture.
        speed_share: largest share of its rated speed that a joint needs in that move, 0 to 1, as
            controllers count it; NaN for the first posture, and where no rated speed is known.
    """

    number: int
    q: np.ndarray
    duration: float
    speed_share: float


def samples_csv(design: Design, rate: float) -> str:
    """The motion at a rate as CSV: ``t [s]``, then q_, dq_ and ddq_ of every joint with units.

    Args:
        design: the design.
        rate: of the samples [Hz].
    """
    signals = np.column_stack([design.motion.times(rate), *design.motion.sampled(rate)]) + 0.0
    heads = (
        "t [s]",
        *(
            f"{stem}_{joint.name} [{joint.position_unit}{per}]"
            for stem, per in (("q", ""), ("dq", "/s"), ("ddq", "/s^2"))
            for joint in design.robot.joints
        ),
    )
    columns = [Column(x, file_format=f"%.{DIGITS}g") for x in signals.T]
    return Table("motion", dict(zip(heads, columns, strict=True))).to_csv()


def sample_arrays(design: Design, rate: float) -> dict[str, np.ndarray]:
    """The motion at a rate as arrays ``t``, ``q``, ``dq``, ``ddq`` and ``joint_names``.

    Args:
        design: the design.
        rate: of the samples [Hz].
    """
    q, dq, ddq = design.motion.sampled(rate)
    names = np.array(design.robot.joint_names, dtype=np.str_)
    return {"t": design.motion.times(rate), "q": q, "dq": dq, "ddq": ddq, "joint_names": names}


def posture_moves(design: Design) -> tuple[PostureMove, ...]:
    """The postures of a design in their order, both ends included; empty where it has none.

    A move of the duration T that accelerates for T_a and brakes for T_a has the largest speed
    way / (T - T_a).
    """
    postures = design.motion.postures
    if postures is None:
        return ()
    duration = design.motion.family.move_duration
    speeds = np.abs(np.diff(postures, axis=0)) / ((1.0 - RISE_SHARE) * duration)
    shares = speeds / design.robot.rated_speeds
    moves = [PostureMove(1, postures[0], np.nan, np.nan)]
    for k, q in enumerate(postures[1:]):
        share = float(shares[k].max())  # NaN where one of them is unknown
        moves.append(PostureMove(k + 2, q, duration, share))
    return tuple(moves)


def postures_csv(design: Design) -> str:
    """The list of postures as CSV, as one types it into a teach pendant.

    Every position stands in the unit of pendants (degrees or mm) and in SI.
    """
    joints = design.robot.joints
    heads = ["posture"]
    heads += [f"q_{joint.name} [{pendant_unit(joint)}]" for joint in joints]
    heads += [f"q_{joint.name} [{joint.position_unit}]" for joint in joints]
    heads += ["move duration [s]", "speed [% of rated speed]"]
    rows = []
    for move in posture_moves(design):
        typed = [f"{x:.{TYPED_DECIMALS}f}" for x in pendant_positions(design, move.q)]
        exact = [f"{x + 0.0:.{DIGITS}g}" for x in move.q]
        rest = [
            None if np.isnan(x) else f"{x:.{TYPED_DECIMALS}g}"
            for x in (move.duration, 100.0 * move.speed_share)
        ]
        rows.append([move.number, *typed, *exact, *rest])
    return csv_table(heads, rows)


def pendant_positions(design: Design, q: np.ndarray) -> np.ndarray:
    """Positions in degrees and mm.

    Args:
        design: the design.
        q: positions, shape (…, joints) [rad or m].
    """
    scale = [180.0 / np.pi if j.kind == "revolute" else 1e3 for j in design.robot.joints]
    return np.round(q * np.array(scale), TYPED_DECIMALS) + 0.0


def pendant_unit(joint: Joint) -> str:
    """Unit of a joint's position on a teach pendant: deg or mm."""
    return "deg" if joint.kind == "revolute" else "mm"
