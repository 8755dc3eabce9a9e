"""The robot that a log is held against: which joints are identified, and where the others stand.

The robot that a log is held against: its joints before it is known which of them matter.

What a person says of the machine that was logged: how it was mounted, and what hung on it. Words of
a command line become keys of the table ``[robot]``:

    "flange 2.75 kg"                    {link = "flange", mass = 2.75}
    "wrist_3 800 g at 0, 0, 0.05"       … center_of_mass = [0.0, 0.0, 0.05], in m
    "-y", "none" or "0, 0, -9.81"       gravity
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.data.logs.recognition.log_file import JointMap, Run
from pivident.experiment.file_keys import RobotEntry
from pivident.experiment.init.assumption import Assumption, DraftError
from pivident.experiment.robot_table import robot_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.mdh_keys import GRAVITY_BY_NAME
from pivident.robot.mjcf import movable_joints
from pivident.robot.naming import MJCF_FILES, URDF_FILES, errors_name, nearest
from pivident.robot.urdf_xml import MOVING, UrdfJoint, file_content, parse_model

_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_BODY = re.compile(
    rf"(?P<link>\S.*?)\s+(?P<mass>{_NUMBER})\s*(?P<unit>kg|g)?(?:\s+at\s+(?P<at>.+))?"
)
_UNITS = {None: 1.0, "kg": 1.0, "g": 1e-3}


@dataclass(frozen=True)
class GivenRobot:
    """What somebody said of the machine.

    Attributes:
        gravity: a direction by its name, three numbers [m/s²], or None.
        bodies: bodies on its links, as an experiment file says them.
    """

    gravity: Any = None
    bodies: tuple[dict[str, Any], ...] = ()

    @classmethod
    def of(cls, gravity: str | None, bodies: Sequence[str]) -> GivenRobot:
        """From the words of a command line; see the head of this module."""
        return cls(
            None if gravity is None else given_gravity(gravity), tuple(map(given_body, bodies))
        )

    @property
    def keys(self) -> dict[str, Any]:
        """Keys of the table ``[robot]`` with their values."""
        keys: dict[str, Any] = {}
        if self.bodies:
            keys["bodies"] = [dict(body) for body in self.bodies]
        if self.gravity is not None:
            keys["gravity"] = self.gravity
        return keys

    def lines(self, no_gravity: str) -> list[Assumption]:
        """Their lines of a draft; ``no_gravity``: how the log shows none, or empty."""
        seen = dict.fromkeys(self.keys, "as given")
        correct = {
            "bodies": "center_of_mass [m] and inertia (xx xy xz yy yz zz about it, kg m²) may be "
            "added, in the frame of the link."
        }
        if no_gravity and "gravity" in seen:
            seen["gravity"] += f", although the log says otherwise: {no_gravity}"
            correct["gravity"] = 'Write "none" where the torques hold none.'
        return [
            Assumption("robot", key, value, "certain", seen[key], correct.get(key, ""))
            for key, value in self.keys.items()
        ]


#: Of a machine of which nobody said anything.
NOTHING_GIVEN = GivenRobot()


def given_body(text: str) -> dict[str, Any]:
    """A body on a link, from ``flange 2.75 kg at 0, 0, 0.05``."""
    found = _BODY.fullmatch(text.strip())
    if found is None or not math.isfinite(float(found["mass"])):
        raise DraftError(
            f"--body {text!r} says no link and mass",
            advice='write both, such as --body "flange 2.75 kg" or "flange 2.75 kg at 0,0,0.05" '
            "with the centre of mass in m",
        )
    body: dict[str, Any] = {
        "link": found["link"], "mass": float(found["mass"]) * _UNITS[found["unit"]]
    }  # fmt: skip
    if found["at"]:
        body["center_of_mass"] = _three_numbers("--body", text, found["at"])
    return body


def given_gravity(text: str) -> Any:
    """A direction by its name, or three numbers in m/s²."""
    if text in GRAVITY_BY_NAME:
        return text
    if "," not in text:
        raise DraftError(
            f"--gravity {text!r} is no direction",
            advice=f"{nearest(text, GRAVITY_BY_NAME)}; or write three numbers in m/s², such as "
            "--gravity=0,0,-9.81",
        )
    return _three_numbers("--gravity", text, text)


def _three_numbers(option: str, whole: str, text: str) -> list[float]:
    """Three numbers between commas or blanks."""
    words = text.replace(",", " ").split()
    if len(words) != 3 or not all(map(_is_number, words)):
        raise DraftError(
            f"{option} {whole!r} does not say three numbers", advice="write them with commas"
        )
    return [float(word) for word in words]


#: Share of samples with one and the same value from which on a torque is no signal.
MOSTLY_ONE_VALUE = 0.7
#: Motion that is none, as share of the largest motion of a joint of its kind in the log; of a joint
#: alone of its kind as share of all others, that may be logged in a unit a thousand times smaller.
STILL, STILL_ALONE = 1e-3, 1e-6


@dataclass(frozen=True, eq=False)
class KeptJoints:
    """The joints of the experiment."""

    names: tuple[str, ...]  # those that are identified, parents first
    left_out: dict[str, str]  # why each of the others in the log is not, by name
    logged: tuple[str, ...]  # all joints with a column of positions


@dataclass(frozen=True, eq=False)
class RobotFile:
    """A robot's file, or a robot of the gallery."""

    name: str  # path or name in the gallery
    is_tree: bool  # a URDF or MJCF: joints that do not move are left out
    joint_names: tuple[str, ...]  # joints that can be identified, parents first
    fixed: tuple[str, ...] = ()  # joints that move but have no column (they mimic, float, follow …)
    found: bool = False  # whether nobody named it
    is_open: bool = True  # whether joints can be chosen and frozen, as without closed loops
    given: GivenRobot = NOTHING_GIVEN  # how it was mounted, as somebody said

    def robot(
        self, joints: Sequence[str] | None = None, frozen: Mapping[str, float] | None = None
    ) -> Robot:
        """The robot with some of its joints; frozen [rad or m]."""
        keys: dict[str, Any] = {"model": self.name, **self.given.keys}
        if self.is_open:
            keys |= {"joints": list(joints or self.joint_names), "frozen": dict(frozen or {})}
        return robot_of(RobotEntry.model_validate(keys), Path())


def robot_file(
    name: str | None, logs: Sequence[Path], given: GivenRobot = NOTHING_GIVEN
) -> RobotFile:
    """The robot by its name, or the only robot file beside the logs."""
    found = name is None
    name = name or _beside(logs)
    if name.endswith(MJCF_FILES):
        movable_names, others = movable_joints(name)
        return RobotFile(name, True, movable_names, others, found, given=given)
    if not name.endswith(URDF_FILES):
        robot = load_robot(name)
        is_open = robot.constraints is None and not robot.base_joints
        return RobotFile(name, False, robot.joint_names, found=found, is_open=is_open, given=given)
    with errors_name(name):
        model = parse_model(file_content(Path(name)))
        movable = [joint for joint in model.joints if joint.type != "fixed"]
        usable = [joint for joint in movable if _can_be_kept(joint)]
        if not usable:
            raise RobotDescriptionError("no joint of it can move", advice="is it the right file?")
    carrier = {joint.child: joint for joint in model.joints}
    order = sorted(usable, key=lambda joint: _depth(joint, carrier))
    names = tuple(joint.name for joint in order)
    return RobotFile(
        name, True, names, tuple(j.name for j in movable if j.name not in names), found,
        given=given,
    )  # fmt: skip


def _can_be_kept(joint: UrdfJoint) -> bool:
    """Whether a joint is one independent degree of freedom with room to move."""
    room = joint.limits is None or joint.limits[0] < joint.limits[1]
    return joint.type in MOVING and joint.mimics is None and room


def _depth(joint: UrdfJoint, carrier: Mapping[str, UrdfJoint]) -> int:
    """Number of joints between a joint and the root; a ring ends the count."""
    depth = 0
    while joint.parent in carrier and depth <= len(carrier):
        joint, depth = carrier[joint.parent], depth + 1
    return depth


def _beside(logs: Sequence[Path]) -> str:
    """The only URDF in the folder of the logs."""
    folder = logs[0].absolute().parent
    found = sorted(p for p in folder.iterdir() if p.name.endswith(URDF_FILES) and p.is_file())
    if len(found) == 1:
        return str(logs[0].parent / found[0].name)
    several = ", ".join(p.name for p in found)
    what = f"several URDF files lie beside it ({several})" if found else "no URDF lies beside it"
    raise DraftError(
        f"the robot of {logs[0].name} is not named, and {what}",
        advice=f"name one with --robot FILE, or one of the gallery: {', '.join(gallery_names())}",
    )


def kept_joints(
    run: Run, joints: JointMap, machine: RobotFile, wanted: Sequence[str]
) -> KeptJoints:
    """Choose the joints that move and whose torque, where there is one, is a signal."""
    q, tau = joints.channels["q"], joints.channels.get("tau")
    left_out: dict[str, str] = {}
    names = []
    kinds = {joint.name: joint.kind for joint in machine.robot().joints}
    for name in machine.joint_names:
        if name not in q.columns:
            continue
        position = q.values(run, [name])[:, 0]
        alike = [other for other in q.columns if kinds.get(other) == kinds.get(name)]
        still = STILL * _largest_range(run, joints, alike)
        if len(alike) == 1:
            still = STILL_ALONE * _largest_range(run, joints, list(q.columns))
        reason = _reason(run, joints, name, position, still)
        if wanted and name not in wanted:
            reason = "not requested"
        if reason:
            left_out[name] = reason
        else:
            names.append(name)
    missing = [name for name in wanted if name not in names]
    if missing:
        why = left_out.get(missing[0], "the log has no position of it")
        raise DraftError(f"joint {missing[0]!r} cannot be identified: {why}", advice="leave it out")
    if not machine.is_tree and not wanted:
        whole = [n for n in machine.joint_names if n in q.columns]
        whole = [n for n in whole if tau is None or n in tau.columns]
        if len(whole) == len(machine.joint_names):
            return KeptJoints(machine.joint_names, {}, machine.joint_names)
    if not machine.is_open and len(names) < len(machine.joint_names):
        lacking = next(n for n in machine.joint_names if n not in names)
        raise DraftError(
            f"the log has no position or no torque of joint {lacking!r}",
            advice=f"{machine.name} has closed loops or a base that moves, and cannot be cut down "
            "to some joints",
        )
    if not names:
        reasons = "; ".join(f"{name}: {reason}" for name, reason in left_out.items())
        if tau is None:
            raise DraftError(
                f"no joint moves ({reasons or 'no joint is in the log'})",
                advice="log a motion of them",
            )
        raise DraftError(
            f"no joint both moves and has a torque signal ({reasons or 'no joint is in the log'})",
            advice="log a motion of the joints, check the files, or name the columns in an "
            "experiment file by hand",
        )
    logged = [*q.columns] if machine.is_tree else [n for n in machine.joint_names if n in q.columns]
    return KeptJoints(tuple(names), left_out, tuple(logged))


def _reason(run: Run, joints: JointMap, name: str, position: np.ndarray, still: float) -> str:
    """Why a joint cannot be identified, or nothing; ``still``: motion that is none."""
    tau = joints.channels.get("tau")
    if tau is not None and name not in tau.columns:
        return "it has no torque column"
    finite = position[np.isfinite(position)]
    if not finite.size or np.ptp(finite) <= still or is_noise(finite):
        return "it does not move"
    if tau is None:
        return ""
    useful, why = is_informative(tau.values(run, [name])[:, 0])
    return "" if useful else f"its torque is {why}"


def _largest_range(run: Run, joints: JointMap, names: Sequence[str]) -> float:
    """The largest motion of some joints, in the unit of the log."""
    logged = joints.channels["q"].values(run, names)
    moved = [np.ptp(x[np.isfinite(x)]) for x in logged.T if np.isfinite(x).any()]
    return float(max(moved, default=0.0))


def is_noise(position: np.ndarray) -> bool:
    """Whether neighbouring samples are no more alike than distant ones; position (samples,).

    Σ(x_{k+1} - x_k)² / Σ(x_k - x̄)², von Neumann's ratio, is 2 for white noise, hardly above zero
    for a motion.
    """
    spread = float(np.sum((position - position.mean()) ** 2))
    return float(np.sum(np.diff(position) ** 2)) > spread


def is_informative(tau: np.ndarray) -> tuple[bool, str]:
    """Whether a torque column holds a signal, or why not; tau (samples,)."""
    finite = tau[np.isfinite(tau)]
    if not finite.size:
        return False, "no number in it"
    values, counts = np.unique(finite, return_counts=True)
    share = counts.max() / len(tau)
    if len(values) == 1:
        return False, f"always {values[0]:.4g}"
    if share > MOSTLY_ONE_VALUE:
        return False, f"exactly {values[counts.argmax()]:.4g} in {100 * share:.0f} % of the rows"
    return True, ""


def _is_number(word: str) -> bool:
    return re.fullmatch(_NUMBER, word) is not None and math.isfinite(float(word))
