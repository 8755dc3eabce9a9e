"""Results of exports: content of the file, differences of the format, and the check."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.robot_regressor import closing_states
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops

#: Largest difference of a torque from the model's, relative to the largest torque of its joint,
#: that counts as equal.
SAME = 1e-9

#: Largest values of a joint below this fraction of the robot's count as that fraction.
ROUNDING = 1e-6

#: Random states of a check, and their seed.
STATES, SEED = 200, 20180501

#: Speeds and accelerations of a check where the robot's are not known [rad/s, rad/s² or m].
USUAL_SPEED, USUAL_ACCELERATION, USUAL_RANGE = 2.0, 10.0, np.pi


@dataclass(frozen=True)
class ExportedText:
    """A model in some format."""

    content: bytes  # of the file
    differences: tuple[str, ...] = ()  # what the format cannot represent, complete sentences
    #: Contents of accompanying files, by name.
    further: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The content as text."""
        return self.content.decode("utf-8")


@dataclass(frozen=True)
class Verification:
    """An exported file loaded back and compared with the model."""

    program: str  # that loaded it (``Pinocchio 3.4``, ``gcc -std=c99`` …)
    compared: str = "torques"
    largest: float = np.nan  # difference [N m or N]
    relative: float = np.nan  # the same, each joint over its largest torque
    states: int = 0  # number of random states
    skipped: str = ""  # why nothing was compared; empty where something was

    @property
    def agrees(self) -> bool:
        """Whether the torques are the same to rounding."""
        return not self.skipped and bool(self.relative <= SAME)

    def __str__(self) -> str:
        if self.skipped:
            return f"Not loaded back: {self.skipped}"
        return (
            f"{self.compared} of {self.states} random states by {self.program}: largest difference "
            f"{self.largest:.2g} N m (or N), {self.relative:.2g} of the joint's largest"
        )


def refuse_loops(robot: Robot, title: str) -> None:
    """Refuse to write a robot with closed loops into a file of a format."""
    step = "export it as MJCF, or as JSON, which read_model reads back"
    without_loops(robot, f"a file of {title}", step)


def random_states(robot: Robot, count: int = STATES, seed: int = SEED) -> tuple[np.ndarray, ...]:
    """Positions within limits, speeds up to rated, accelerations, each (count, joints)."""
    rng = np.random.default_rng(seed)
    wide = [(-USUAL_RANGE, USUAL_RANGE)] * robot.size
    limits = np.array([j.position_limits or w for j, w in zip(robot.joints, wide, strict=True)])
    limits = np.where(np.isfinite(limits), limits, wide)
    speed = np.where(np.isfinite(robot.rated_speeds), robot.rated_speeds, USUAL_SPEED)
    q = rng.uniform(limits[:, 0], limits[:, 1], (count, robot.size))
    dq = rng.uniform(-speed, speed, (count, robot.size))
    ddq = rng.uniform(-USUAL_ACCELERATION, USUAL_ACCELERATION, (count, robot.size))
    return closing_states(robot, q, dq, ddq)


def compared(
    program: str,
    robot: Robot,
    ours: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    theirs: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
) -> Verification:
    """Compare two functions of q dq ddq for torques at random states."""
    states = random_states(robot)
    return compared_values(program, ours(*states), theirs(*states))


def compared_values(
    program: str,
    expected: np.ndarray,
    found: np.ndarray,
    *,
    what: str = "torques",
    usual: float = 0.0,
) -> Verification:
    """Compare values (states, joints, …); those much smaller than ``usual`` count as zero."""
    difference = np.abs(found - expected)
    axes = (0, *range(2, expected.ndim))
    scale = np.abs(expected).max(axis=axes, initial=0.0)
    worst = difference.max(axis=axes, initial=0.0)
    # zeros of a joint, gravity on a vertical axis for instance, are rounding on both sides
    least = max(ROUNDING * max(usual, float(scale.max(initial=0.0))), np.finfo(float).tiny)
    relative = worst / np.maximum(scale, least)
    return Verification(program, what, float(worst.max()), float(relative.max()), len(expected))
