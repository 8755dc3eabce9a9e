"""A motion as tables: samples at a rate, and the postures that one types into a teach pendant."""

from __future__ import annotations

import io
from dataclasses import dataclass

import numpy as np

from pivident.excitation.design import Design
from pivident.excitation.motions import RISE_SHARE
from pivident.robot.description import Joint
from pivident.text.plain_values import csv_table

#: Digits of a sample, and of a position in a list that is typed in by hand.
DIGITS, TYPED_DECIMALS = 12, 4


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
    joints = design.robot.joints
    heads = ["t [s]"]
    for stem, per in (("q", ""), ("dq", "/s"), ("ddq", "/s^2")):
        heads += [f"{stem}_{joint.name} [{joint.position_unit}{per}]" for joint in joints]
    table = np.column_stack([design.motion.times(rate), *design.motion.sampled(rate)])
    stream = io.StringIO()
    np.savetxt(stream, table + 0.0, fmt=f"%.{DIGITS}g", delimiter=",")  # + 0.0: no -0
    return csv_table(heads, ()) + stream.getvalue()


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
