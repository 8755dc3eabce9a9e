"""What every export gives back: the file's content, what the format cannot say, and the check."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field

import numpy as np

from pivident.robot.description import Robot

#: Largest deviation of a torque from the model's, relative to the largest torque of its joint,
#: that still counts as the same.
SAME = 1e-9

#: Largest values of a joint below this share of the robot's largest ones count as that share.
ROUNDING = 1e-6

#: Random states of a check, and their seed.
STATES, SEED = 200, 20180501

#: Speeds and accelerations of a check where the robot's are not known [rad/s, rad/s² or m].
USUAL_SPEED, USUAL_ACCELERATION, USUAL_RANGE = 2.0, 10.0, np.pi


@dataclass(frozen=True)
class ExportedText:
    """A model in some format.

    Attributes:
        content: content of the file.
        differences: what the format cannot say, whole sentences with sizes.
        further: contents of files that belong beside it, by name.
    """

    content: bytes
    differences: tuple[str, ...] = ()
    further: Mapping[str, bytes] = field(default_factory=dict)

    @property
    def text(self) -> str:
        """The content as text."""
        return self.content.decode("utf-8")


@dataclass(frozen=True)
class Verification:
    """An exported file loaded back and compared with the model.

    Attributes:
        program: what loaded it (``Pinocchio 3.4``, ``gcc -std=c99`` …).
        compared: what was compared, such as ``torques``.
        largest: largest difference [N m or N].
        relative: the same, each joint over its largest torque.
        states: number of random states.
        skipped: why nothing was compared; empty where something was.
    """

    program: str
    compared: str = "torques"
    largest: float = np.nan
    relative: float = np.nan
    states: int = 0
    skipped: str = ""

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


def random_states(
    robot: Robot, count: int = STATES, seed: int = SEED
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """States for a comparison: positions within the limits, speeds up to the rated ones.

    Args:
        robot: the robot.
        count: number of states.
        seed: of the generator.

    Returns:
        q [rad or m], dq [rad/s or m/s], ddq [rad/s² or m/s²], each (count, joints).
    """
    rng = np.random.default_rng(seed)
    wide = [(-USUAL_RANGE, USUAL_RANGE)] * robot.size
    limits = np.array([j.position_limits or w for j, w in zip(robot.joints, wide, strict=True)])
    limits = np.where(np.isfinite(limits), limits, wide)
    speed = np.where(np.isfinite(robot.rated_speeds), robot.rated_speeds, USUAL_SPEED)
    q = rng.uniform(limits[:, 0], limits[:, 1], (count, robot.size))
    dq = rng.uniform(-speed, speed, (count, robot.size))
    ddq = rng.uniform(-USUAL_ACCELERATION, USUAL_ACCELERATION, (count, robot.size))
    return q, dq, ddq


def compared(
    program: str,
    robot: Robot,
    ours: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
    theirs: Callable[[np.ndarray, np.ndarray, np.ndarray], np.ndarray],
) -> Verification:
    """Compare two functions that give torques at random states.

    Args:
        program: who computes the second one.
        robot: the robot.
        ours: the model's, of q dq ddq, each (states, joints).
        theirs: the loaded file's.
    """
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
    """Compare values at random states.

    Args:
        program: who computed the second ones.
        expected: the model's values, shape (states, joints, …).
        found: the loaded file's.
        what: what the values are.
        usual: what such values usually are; values much smaller than it count as zero.
    """
    difference = np.abs(found - expected)
    axes = (0, *range(2, expected.ndim))
    scale = np.abs(expected).max(axis=axes, initial=0.0)
    worst = difference.max(axis=axes, initial=0.0)
    # what is zero on a joint, gravity on a vertical axis for instance, is rounding on both sides
    least = max(ROUNDING * max(usual, float(scale.max(initial=0.0))), np.finfo(float).tiny)
    relative = worst / np.maximum(scale, least)
    return Verification(program, what, float(worst.max()), float(relative.max()), len(expected))
