"""What a user asks of a design.

The table ``[excite]`` of a file as limits, clearances and a request.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, get_args

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters
from pivident.experiment.excite_keys import ExciteEntry
from pivident.experiment.explained import checked, errors_name, toml_content
from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import per_joint
from pivident.foundation.text.display import Displayed
from pivident.robot.description import Robot
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.mdh_keys import Entry
from pivident.robot.naming import find_joint, nearest
from pivident.studies.excitation.criteria import CriterionName
from pivident.studies.excitation.knowledge import Knowledge
from pivident.studies.excitation.limits import JointLimits, joint_limits
from pivident.studies.excitation.motions import MotionFamily, MotionKind
from pivident.studies.excitation.questions import Question, gain_question, load_question

#: Duration where none is given, and the shortest and longest that are designed [s].
USUAL_DURATION, MIN_DURATION, MAX_DURATION = 20.0, 2.0, 300.0

#: Harmonics of a Fourier motion, at least and at most, and moves between postures.
HARMONICS, MOVES = (3, 12), (5, 24)

#: Splines have as many functions as a Fourier motion, at most.
SPLINES = (7, 30)

#: One round does with the most functions if there is room for so many times as many.
ROOM_FOR_ONE = 1.25

#: Time of a move that every joint can make over half its range, over that at its largest speed.
UNHURRIED = 1.6


@dataclass(frozen=True)
class DesignRequest(Displayed):
    """What is asked of a motion.

    Attributes:
        duration: of the motion [s]; with a ``goal`` the longest that is tried.
        motion: ``fourier``, ``splines`` or ``postures``.
        criterion: ``d``, ``a``, ``worst`` or ``cond``; None: ``a``, with parameters or a goal
            ``worst``.
        parameters: names of those that count; empty for all.
        goal: standard error over the size that matters, which each of ``parameters`` must reach,
            0 to 1; None: as small as possible within ``duration``.
        seconds: time for the search [s].
        seed: of the random starts.
        start: posture at both ends, shape (joints,) [rad or m]; None: free.
    """

    duration: float = USUAL_DURATION
    motion: MotionKind = "splines"
    criterion: CriterionName | None = None
    parameters: tuple[str, ...] = ()
    goal: float | None = None
    seconds: float = 20.0
    seed: int = 0
    start: tuple[float, ...] | None = None

    def __post_init__(self) -> None:
        if not MIN_DURATION <= self.duration <= MAX_DURATION:
            raise ExperimentError(
                f"the duration is {self.duration:g} s",
                advice=f"motions of {MIN_DURATION:g} to {MAX_DURATION:g} s are designed",
            ).about("duration")
        for key, value, known in (
            ("motion", self.motion, get_args(MotionKind)),
            ("criterion", self.criterion or "a", get_args(CriterionName)),
        ):
            if value not in known:
                raise ExperimentError(
                    f"there is no {key} {value!r}", advice=nearest(str(value), known)
                ).about(key)
        if self.goal is not None and not (0.0 < self.goal < 1.0):
            raise ExperimentError(
                f"the goal is a standard error of {100 * self.goal:g} %",
                advice="give more than 0 % and less than 100 %, such as 2%",
            ).about("to")
        if self.seed < 0:
            raise ExperimentError(f"the seed is {self.seed}", advice="give zero or more").about(
                "seed"
            )
        if self.criterion == "cond" and self.parameters:
            raise ExperimentError(
                "the criterion cond is that of the whole observation matrix",
                advice="with chosen parameters take 'worst', 'a' or 'd'",
            ).about("criterion")
        if not (math.isfinite(self.seconds) and self.seconds > 0.0):
            raise ExperimentError(f"the search cannot take {self.seconds:g} s").about("seconds")

    @property
    def criterion_used(self) -> CriterionName:
        """The criterion, where none was named."""
        return self.criterion or ("worst" if self.parameters or self.goal is not None else "a")


def chosen_parameters(base: BaseParameters, names: Sequence[str]) -> np.ndarray | None:
    """Indices of base parameters by name; None for all.

    Args:
        base: the base parameters.
        names: with or without the trailing ``r``.

    Raises:
        ExperimentError: an unknown name, with the nearest ones; one that is part of another group.
    """
    if not names:
        return None
    found = []
    for name in names:
        try:
            found.append(base.index(name))
        except KeyError:
            raise _unknown(base, name).about("for") from None
    return np.array(sorted(set(found)))


def _unknown(base: BaseParameters, name: str) -> ExperimentError:
    """Why a name is none of a base parameter."""
    index = {p.name.lower(): i for i, p in enumerate(base.standard)}.get(name.lower())
    if index is None:
        return ExperimentError(
            f"the robot has no parameter {name!r}", advice=nearest(name, base.names)
        )
    if index in base.without_effect:
        return ExperimentError(f"{name} has no effect on any torque: no motion identifies it")
    column = list(base.dropped).index(index)
    heads = [base.names[k] for k in np.flatnonzero(base.regrouping[:, column])]
    return ExperimentError(
        f"{name} is identifiable only as a part of {', '.join(heads)}", advice="ask for that"
    )


def motion_family(kind: MotionKind, duration: float, limits: JointLimits) -> MotionFamily:
    """A family with as many functions as the joints can follow.

    A joint that swings between its largest speed and acceleration does so at a/(2π v). A duration
    that has room for more functions than a search can handle is run in several equal rounds.

    Args:
        kind: ``fourier``, ``splines`` or ``postures``.
        duration: of the motion [s].
        limits: of the joints.

    Raises:
        ExperimentError: no joint can move to anywhere in that time.
    """
    highest = float(np.median(limits.acceleration / limits.speed)) / (2.0 * np.pi)
    if kind == "fourier":
        rounds = _rounds(duration * highest, HARMONICS)
        swings = int(np.clip(round(duration / rounds * highest), *HARMONICS))
        return MotionFamily(kind, duration / rounds, 1 + 2 * swings, rounds)
    if kind == "splines":
        rounds = _rounds(2 * duration * highest, SPLINES)
        size = int(np.clip(round(2 * duration / rounds * highest), *SPLINES))
        return MotionFamily(kind, duration / rounds, size, rounds)
    way = UNHURRIED * float(np.median(limits.half / limits.speed))
    rise = float(np.median(limits.speed / limits.acceleration))
    moves = duration / (way + 2.0 * rise)
    rounds = _rounds(moves, MOVES)
    return MotionFamily(
        kind, duration / rounds, int(np.clip(round(moves / rounds), *MOVES)), rounds
    )


def _rounds(size: float, sizes: tuple[int, int]) -> int:
    """Rounds in which a motion that has room for so many functions is run."""
    return max(1, int(np.ceil(size / (ROOM_FOR_ONE * sizes[1]))))


class CellFile(Entry):
    """A file that holds the table alone."""

    excite: ExciteEntry = ExciteEntry.model_validate({})


def read_cell(path: str | Path) -> ExciteEntry:
    """The table ``[excite]`` of a file that holds nothing else: limits and room of a robot's cell.

    Args:
        path: the TOML file.

    Returns:
        The checked table.

    Raises:
        ExperimentError: it cannot be read, or has an unknown key or a bad value.
    """
    path = Path(path)
    with errors_name(path, ""):
        return checked(toml_content(path), CellFile).excite


def limits_of(robot: Robot, entry: ExciteEntry) -> JointLimits:
    """Limits of a robot's joints, those of the table in place of its description's.

    Args:
        robot: the robot.
        entry: the table.

    Raises:
        ExperimentError: an unknown joint, or limits that are unknown or contradict each other.
    """
    given: dict[str, dict[str, Any]] = {name: {} for name in robot.joint_names}
    for quantity in ("acceleration", "jerk"):
        value = getattr(entry, quantity)
        if value is not None:
            for name, number in zip(
                robot.joint_names, per_joint(quantity, value, robot.size), strict=True
            ):
                given[name][quantity] = number
    for reference, own in entry.joint.items():
        name = robot.joint_names[find_joint(robot.joint_names, reference)]
        for quantity in own.model_fields_set:
            value = getattr(own, quantity)
            given[name][quantity] = tuple(value) if isinstance(value, list) else value
    return joint_limits(robot, given, speed_share=entry.speed, torque_share=entry.torque)


def torque_noise_of(robot: Robot, entry: ExciteEntry) -> np.ndarray | None:
    """Standard deviation of the torque that the table expects, shape (joints,); None: not said.

    Args:
        robot: the robot.
        entry: the table.
    """
    if entry.torque_noise is None:
        return None
    return per_joint("torque_noise", entry.torque_noise, robot.size)


def question_of(entry: ExciteEntry) -> Callable[[Knowledge], Question] | None:
    """What is asked besides parameters of the robot: a load, or drive gains.

    Args:
        entry: the table.
    """
    if entry.about == "robot":
        return None
    assert entry.load is not None
    about_centre = np.zeros(6) if entry.load.inertia is None else np.array(entry.load.inertia)
    centre = np.array(entry.load.center_of_mass)
    load = from_center_of_mass(entry.load.mass, centre, tensor(about_centre))
    made = load_question if entry.about == "load" else gain_question

    def asked(known: Knowledge) -> Question:
        if entry.about == "gains" and not known.has_masses:
            raise ExperimentError(
                "drive gains can be asked for only where the masses of the robot are known: name a "
                "result, or a description with masses"
            ).about("about")
        return made(known.base, known.model_values, load)

    return asked
