"""Joints, the links that they move, and motors that turn with a second joint.

The z axis of a link's frame is its joint's axis, see `pivident.robot.description`.
"""

from __future__ import annotations

from dataclasses import dataclass, field, replace
from operator import attrgetter
from typing import Annotated, Literal

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import INFINITE_IN_WORDS, LATER, As, Limits, Name, Sized
from pivident.robot.frames import Matrix3, Vector3
from pivident.robot.friction import DEFAULT_FRICTION, FrictionLaw
from pivident.robot.friction_term import SLOPE_AT_RATED_SPEED, FrictionTerm

JointKind = Literal["revolute", "prismatic"]

#: How a joint comes to move: by a motor; not at all, and its torque is that of a force sensor; or
#: by what the outside does to it, and its motion is measured.
JointMotion = Literal["driven", "held", "measured"]

#: A friction law, which is stored as its terms.
StoredLaw = Annotated[FrictionLaw, As(tuple[FrictionTerm, ...], attrgetter("terms"), FrictionLaw)]

#: Order of a link's ten inertial parameters.
INERTIAL = ("xx", "xy", "xz", "yy", "yz", "zz", "mx", "my", "mz", "m")


@dataclass(frozen=True, eq=False)
class Joint(Displayed):
    """One degree of freedom.

    Attributes:
        name: unique name.
        kind: ``revolute`` (q in rad) or ``prismatic`` (q in m), about or along the z axis.
        parent: index of the link it hangs on, -1 for the base.
        rotation: orientation of the link frame in the parent's at q = 0, shape (3, 3).
        translation: origin of the link frame in the parent's at q = 0 [m], shape (3,).
        position_limits: lowest and highest position [rad or m], or None.
        rated_speed: rated (highest) speed [rad/s or m/s], or None where it is not known.
        torque_limit: highest torque or force [N m or N], or None.
        friction: friction law of the joint side.
        motion: ``driven``: by a motor; ``held``: it stands still at zero, and what holds it is
            measured; ``measured``: it moves without a motor, and how is measured. See
            `pivident.robot.with_held_base` and `pivident.robot.with_floating_base`.
    """

    name: Annotated[Name, Limits(min_length=1)]
    kind: JointKind
    parent: int
    rotation: Matrix3
    translation: Vector3
    position_limits: Annotated[tuple[float, float] | None, INFINITE_IN_WORDS] = None
    rated_speed: Annotated[float | None, INFINITE_IN_WORDS] = None
    torque_limit: Annotated[float | None, INFINITE_IN_WORDS] = None
    friction: StoredLaw = DEFAULT_FRICTION
    motion: Annotated[JointMotion, LATER] = "driven"

    @property
    def position_unit(self) -> str:
        """Rad or m."""
        return "rad" if self.kind == "revolute" else "m"

    @property
    def torque_unit(self) -> str:
        """N m or N."""
        return "N m" if self.kind == "revolute" else "N"

    @property
    def default_gamma(self) -> float:
        """Slope of the smoothed sign where the law leaves it open [s/rad or s/m]."""
        return SLOPE_AT_RATED_SPEED / (self.rated_speed or 5.0)

    @property
    def slopes_text(self) -> str:
        """The γ of its smoothed signs with their unit, empty where the law has none."""
        unit = "s/rad" if self.kind == "revolute" else "s/m"
        slopes = " and ".join(f"{gamma:.4g}" for gamma in self.friction.slopes)
        return f"{slopes} {unit}" if slopes else ""

    def with_friction(self, law: FrictionLaw) -> Joint:
        """The same joint with another friction law; open slopes get the joint's default."""
        return replace(self, friction=law.with_default_gamma(self.default_gamma))


@dataclass(frozen=True, eq=False)
class Link(Displayed):
    """A moving body (fixed children merged into it) in its joint's frame.

    Attributes:
        name: unique name.
        inertia: nominal ``xx xy xz yy yz zz mx my mz m``, shape (10,); zeros where unknown.
        is_body: False for a frame between the axes of a universal or ball joint: it has no mass,
            and no parameters.
    """

    name: Name
    inertia: Annotated[np.ndarray, Sized(10)] = field(default_factory=lambda: np.zeros(10))
    is_body: Annotated[bool, LATER] = True


@dataclass(frozen=True)
class Coupling:
    """A motor that turns with a second joint (the TX40's wrist).

    The rotor of joint ``motor`` turns with the speed dq_motor + ratio·dq_joint. What this adds to
    the model beyond the two joints' own columns is, on the row of ``joint`` and of ``motor``,

        iam: ratio·ddq_motor | ratio·ddq_joint        fvm: ratio·dq_motor | ratio·dq_joint
        fcm: ratio·s(v) | s(v)   with v = dq_motor + ratio·dq_joint

    Attributes:
        motor: index of the joint whose motor is coupled (6 on the TX40, counted from zero: 5).
        joint: index of the joint that moves that motor along.
        ratio: speed of the rotor per speed of ``joint``, referred to the side of ``motor``.
        inertia: whether the rotor inertia ``iam`` is a parameter.
        viscous: whether ``fvm`` is a parameter.
        coulomb: whether ``fcm`` is a parameter.
    """

    motor: int
    joint: int
    ratio: float = 1.0
    inertia: bool = True
    viscous: bool = True
    coulomb: bool = True


@dataclass(frozen=True, eq=False)
class Contact:
    """A point of a link that does not move in the world, and may not be pulled away from it.

    Attributes:
        link: the link, by its own name or that of its joint.
        point: the point in the frame of the link, shape (3,) [m].
    """

    link: Name
    point: Vector3 = field(default_factory=lambda: np.zeros(3))

    def __post_init__(self) -> None:
        if np.shape(self.point) != (3,) or not np.isfinite(self.point).all():
            raise RobotDescriptionError(
                f"contact of {self.link!r}: its point is {self.point}",
                advice="three finite numbers in m are needed",
            )


def check_joint(joint: Joint, index: int) -> None:
    """Refuse a joint without a proper frame, or with limits that mean nothing."""
    where = f"joint {joint.name!r}"
    if joint.kind not in ("revolute", "prismatic"):
        raise RobotDescriptionError(f"{where}: kind {joint.kind!r} is not supported")
    if not -1 <= joint.parent < index:
        raise RobotDescriptionError(f"{where}: parent {joint.parent} does not precede it")
    # Comparisons are written so that NaN fails them.
    if not np.abs(joint.rotation @ joint.rotation.T - np.eye(3)).max() <= 1e-9:
        raise RobotDescriptionError(f"{where}: its rotation matrix is not orthonormal")
    if not np.isfinite(joint.translation).all():
        raise RobotDescriptionError(f"{where}: translation {joint.translation} is not finite")
    for bound, value in (
        ("rated speed", joint.rated_speed),
        ("torque limit", joint.torque_limit),
    ):
        if value is not None and not value > 0:
            raise RobotDescriptionError(f"{where}: {bound} must be positive, not {value}")
    limits = joint.position_limits
    if limits is not None and not limits[0] < limits[1]:
        raise RobotDescriptionError(
            f"{where}: empty position range {limits}", advice="the lower limit comes first"
        )
