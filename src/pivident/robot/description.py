"""What the machine is: joints, links, couplings, transmission and friction laws.

A robot is a tree of moving links. Link ``i`` is moved by joint ``i``; joint ``i`` hangs on link
``parent``, with -1 for the fixed base, and a parent always has a smaller index than its children.
The frame of link ``i`` sits on its joint and turns (or slides) with the link; its **z axis is the
joint's axis**. With ^pT_i the pose of that frame in the parent's link frame,

    revolute:   ^pR_i = rotation · Rz(q),   ^pp_i = translation
    prismatic:  ^pR_i = rotation,           ^pp_i = translation + rotation · (0, 0, q)

Inertial parameters are the ten of Khalil and Dombre in the link frame, in the order
``xx xy xz yy yz zz mx my mz m`` (inertia at the frame's origin, first moments, mass).
All quantities are SI, joint side.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any, Literal

import numpy as np

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.display import Printed
from pivident.foundation.text.identifiers import is_printable
from pivident.foundation.text.plain_values import Limits, Name
from pivident.robot.constraints import Constraints
from pivident.robot.friction import DEFAULT_FRICTION, FrictionLaw
from pivident.robot.joints import (
    INERTIAL,
    Contact,
    Coupling,
    Joint,
    JointKind,
    JointMotion,
    Link,
    check_joint,
)
from pivident.robot.naming import find_joint, nearest
from pivident.robot.pinocchio_model import model_joints
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import WrenchSensor

__all__ = [
    "INERTIAL",
    "MAX_JOINTS",
    "STANDARD_GRAVITY",
    "Coupling",
    "Joint",
    "JointKind",
    "JointMotion",
    "Link",
    "Robot",
    "TorqueSide",
    "UrdfFile",
    "check_robot",
]

#: Whose torques those of the joints are: of the motors, or of sensors behind the gears.
TorqueSide = Literal["motor", "link"]

STANDARD_GRAVITY = 9.81

#: Most joints of a robot that files may hold.
MAX_JOINTS = 1000


@dataclass(frozen=True)
class UrdfFile:
    """The URDF that a robot was read from, so that parameters can be written back into it."""

    path: str  # empty where the text did not come from a file
    #: Of the text, unpacked if it was compressed.
    sha256: Annotated[str, Limits(pattern="^[0-9a-f]{64}$")]
    #: Positions of frozen joints [rad or m], by name.
    frozen: Mapping[Name, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False)
class Robot(Printed):
    """A tree of links with everything that its dynamic model needs.

    Attributes:
        name: name of the robot.
        joints: joints, parents before children.
        links: ``links[i]`` is moved by ``joints[i]``.
        gravity: acceleration of gravity in the base frame [m/s²], shape (3,).
        rotor_inertia: nominal motor inertias on the joint side [kg m² or kg], shape (joints,);
            zeros where unknown.
        friction_nominal: nominal friction by parameter name (``fv1``: 7.9), may be empty.
        couplings: declared motor couplings.
        transmission: between motor and joint side.
        description: where it comes from, one line.
        urdf: the file it was read from, or None.
        torque_side: ``motor``: its joint torques are those of the motors, on the joint side;
            ``link``: of sensors behind the gears, see `with_link_torques`.
        passive_joints: joints that the loops of a closed mechanism move along, parents counted in
            the `tree` of all joints; empty for a tree.
        passive_links: what they carry.
        constraints: what closes the loops, see `pivident.robot.closed_robot`; None: a tree.
        sensors: force sensors, see `pivident.robot.with_wrench_sensors`.
        contacts: feet that stand, of a robot on a floating base.

    Example:
        >>> robot = pv.load_robot("planar_2r")
        >>> robot.joint_names, robot.friction_nominal["fv1"]
        (('shoulder', 'elbow'), 2.5)
        >>> level = robot.with_gravity([0.0, 0.0, -9.81])  # the arm lies on a table
        >>> len(pv.base_parameters(robot).names), len(pv.base_parameters(level).names)
        (13, 11)
    """

    name: str
    joints: tuple[Joint, ...]
    links: tuple[Link, ...]
    gravity: np.ndarray
    rotor_inertia: np.ndarray
    transmission: Transmission
    friction_nominal: dict[str, float] = field(default_factory=dict)
    couplings: tuple[Coupling, ...] = ()
    description: str = ""
    urdf: UrdfFile | None = None
    torque_side: TorqueSide = "motor"
    passive_joints: tuple[Joint, ...] = ()
    passive_links: tuple[Link, ...] = ()
    constraints: Constraints | None = None
    sensors: tuple[WrenchSensor, ...] = ()
    contacts: tuple[Contact, ...] = ()

    def __post_init__(self) -> None:
        check_robot(self)

    @classmethod
    def from_pinocchio(cls, model: Any, friction: FrictionLaw = DEFAULT_FRICTION) -> Robot:
        """The robot of a ``pinocchio.Model`` with a fixed base.

        Joints keep their order and names; each link frame is turned so that its z axis is the
        joint's axis. Limits, gravity, armature (or rotor inertia times the squared gear ratio),
        damping and dry friction are taken over where the model has them. Drives are unknown to
        the model; add them with `pivident.robot.with_drives`.

        Args:
            model: a ``pinocchio.Model`` of revolute and prismatic joints.
            friction: friction law of all joints; open slopes follow from the rated speeds.

        Returns:
            The robot.

        Raises:
            RobotDescriptionError: a free-flyer, spherical, planar or other joint that has not one
                degree of freedom about or along a fixed axis; names the joint and the next step.
        """
        found = tuple(model_joints(model))
        robot = cls(
            name=str(getattr(model, "name", "")) or "pinocchio model",
            joints=tuple(
                Joint(
                    name=j.name,
                    kind=j.kind,
                    parent=j.parent,
                    rotation=j.rotation,
                    translation=j.translation,
                    position_limits=j.position_limits,
                    rated_speed=j.speed_limit,
                    torque_limit=j.torque_limit,
                ).with_friction(friction)
                for j in found
            ),
            links=tuple(Link(j.link, j.inertia) for j in found),
            gravity=np.array(model.gravity.linear, dtype=float),
            rotor_inertia=np.array([j.rotor_inertia for j in found]),
            transmission=Transmission.direct(len(found)),
            description="pinocchio.Model",
        )
        nominal = {
            f"{term.stem}{robot.label(i)}": found[i].friction[term.stem]
            for i, joint in enumerate(robot.joints)
            for term in joint.friction.terms
            if found[i].friction.get(term.stem)
        }
        return replace(robot, friction_nominal=nominal)

    def __repr__(self) -> str:
        names = ", ".join(self.joint_names)
        return f"<Robot {self.name!r}: {self.size} joint{'s' * (self.size != 1)} ({names})>"

    @property
    def size(self) -> int:
        """Number of joints; of a closed mechanism, of those that are independent."""
        return len(self.joints)

    @cached_property
    def tree(self) -> Robot:
        """All joints and links with the loops cut; without loops the robot itself.

        Parameters count joints and links there, parents before children.
        """
        if self.constraints is None:
            return self
        places = self.constraints.places
        count = len(places) + len(self.passive_joints)
        passive = iter(zip(self.passive_joints, self.passive_links, strict=True))
        own = dict(zip(places, zip(self.joints, self.links, strict=True), strict=True))
        members = [own[i] if i in own else next(passive) for i in range(count)]
        rotor = np.zeros(count)
        rotor[list(places)] = self.rotor_inertia
        return replace(
            self,
            joints=tuple(joint for joint, _ in members),
            links=tuple(link for _, link in members),
            rotor_inertia=rotor,
            transmission=Transmission.direct(count),
            couplings=tuple(
                replace(c, motor=places[c.motor], joint=places[c.joint]) for c in self.couplings
            ),
            passive_joints=(),
            passive_links=(),
            constraints=None,
        )

    @property
    def places(self) -> tuple[int, ...]:
        """Index of each joint in the `tree`."""
        return tuple(range(self.size)) if self.constraints is None else self.constraints.places

    @property
    def with_motors(self) -> tuple[int, ...]:
        """Indices of the joints in the `tree` that have motors."""
        own = (i for i in self.places if self.tree.joints[i].motion == "driven")
        return (*own, *(self.constraints.driven if self.constraints else ()))

    @property
    def joint_names(self) -> tuple[str, ...]:
        """Names of the joints, in order."""
        return tuple(joint.name for joint in self.joints)

    @property
    def is_chain(self) -> bool:
        """Whether each link hangs on the one before it (a serial arm)."""
        return self.constraints is None and all(
            joint.parent == i - 1 for i, joint in enumerate(self.joints)
        )

    @property
    def rated_speeds(self) -> np.ndarray:
        """Rated speed of each joint [rad/s or m/s], NaN where it is not known."""
        return np.array([np.nan if j.rated_speed is None else j.rated_speed for j in self.joints])

    def label(self, index: int) -> str:
        """The joint of an index in a parameter's name: ``3`` on a chain, ``[elbow]`` on a tree.

        The joints of a closed mechanism are counted in its tree. Those of a measured base are not
        counted, and share the name of its link.
        """
        tree = self.tree
        if tree.joints[index].motion != "driven":
            return f"[{tree.links[tree.base_joints - 1].name}]"
        return (
            str(index + 1 - tree.base_joints) if tree.is_chain else f"[{tree.joints[index].name}]"
        )

    @cached_property
    def base_joints(self) -> int:
        """How many joints its measured base has: 6, which come first, or 0 without one."""
        return sum(joint.motion != "driven" for joint in self.joints)

    @property
    def base_motion(self) -> JointMotion:
        """``held`` or ``measured`` where the base is, otherwise ``driven``."""
        return self.joints[0].motion

    @cached_property
    def on_fixed_base(self) -> Robot:
        """The same robot without the joints and the link of a measured base.

        On planted feet it has no other independent joints, and is returned itself.
        """
        first = self.base_joints
        if not first or self.constraints is not None:
            return self
        return replace(
            self,
            joints=tuple(
                replace(joint, parent=max(joint.parent - first, -1))
                for joint in self.joints[first:]
            ),
            links=self.links[first:],
            rotor_inertia=self.rotor_inertia[first:],
            transmission=self.transmission.behind(first),
            couplings=tuple(
                replace(c, motor=c.motor - first, joint=c.joint - first) for c in self.couplings
            ),
        )

    def joint_index(self, reference: str) -> int:
        """Index of a joint by its name or number; those of a measured base are not counted.

        Args:
            reference: a name, or a number counted from 1, as text.

        Raises:
            RobotDescriptionError: there is no such joint; names the nearest ones.
        """
        first = self.base_joints
        return first + find_joint(self.joint_names[first:], reference)

    def link_index(self, name: str) -> int:
        """Index of a link by its own name, or that or the number of the joint that moves it.

        Numbers count the joints that have motors: those of a measured base are passed over.

        Args:
            name: a name, or the number of a joint counted from 1, as text.

        Raises:
            RobotDescriptionError: there is no such link; names the nearest ones.
        """
        links = [link.name for link in self.links]
        if name in links:
            return links.index(name)
        first = self.base_joints
        own = self.joint_names[first:]
        try:
            return first + find_joint(own, name)
        except RobotDescriptionError:
            known = dict.fromkeys([*links[max(first - 1, 0) :], *own])
            raise RobotDescriptionError(
                f"robot {self.name!r} has no link {name!r}", advice=nearest(name, known)
            ) from None

    def friction_text(self) -> str:
        """Friction law and γ of every joint; joints with the same law share one formula.

        Passive joints without friction are passed over.
        """
        sharing: dict[str, list[Joint]] = {}
        for joint in (*self.joints, *(j for j in self.passive_joints if j.friction.terms)):
            sharing.setdefault(str(joint.friction), []).append(joint)
        parts = []
        for law, joints in sharing.items():
            whose = f"{', '.join(j.name for j in joints)}: " if len(sharing) > 1 else ""
            slopes = [joint.slopes_text for joint in joints]
            if len(set(slopes)) == 1:
                slopes = slopes[:1]
            elif len({joint.kind for joint in joints}) == 1:  # the unit once is enough
                slopes = [text.rpartition(" ")[0] for text in slopes[:-1]] + slopes[-1:]
            gamma = f", γ = {', '.join(slopes)}" if any(slopes) else ""
            parts.append(f"{whose}{law}{gamma}")
        return "; ".join(parts)

    def ancestors(self, index: int) -> tuple[int, ...]:
        """Indices of the joints that move link ``index``, itself first, base last."""
        chain = []
        while index >= 0:
            chain.append(index)
            index = self.joints[index].parent
        return tuple(chain)

    def with_friction(self, law: FrictionLaw | Mapping[str, FrictionLaw]) -> Robot:
        """The same robot with one friction law on all joints, or with others on some.

        Args:
            law: of all joints but passive ones, or by the names of those that get another one.

        Raises:
            RobotDescriptionError: names an unknown joint.
        """
        if isinstance(law, FrictionLaw):
            return replace(self, joints=tuple(j.with_friction(law) for j in self.joints))
        joints, passive = list(self.joints), list(self.passive_joints)
        for name, own in law.items():
            group, names = joints, self.joint_names
            if name in (beside := [joint.name for joint in passive]):
                group, names = passive, tuple(beside)
            index = find_joint(names, name)
            group[index] = group[index].with_friction(own)
        return replace(self, joints=tuple(joints), passive_joints=tuple(passive))

    def with_link_torques(self, friction: FrictionLaw = DEFAULT_FRICTION) -> Robot:
        """The same links, whose torques are those of sensors between gear and link.

        With J the rotors on the joint side and f the friction of motors and gears,

            τ_motor = J ddq + f(dq) + τ_link,    τ_link = M ddq + c + g + f_bearing(dq) + off

        and the sensors measure τ_link. So rotor inertias, coupled motors and the laws of friction
        of the description, which are those of its drives, leave the model.

        Args:
            friction: law of all bearings behind the sensors, their offset included; by default
                viscous and Coulomb friction, which `pivident.studies.bearing_friction` leaves out
                where they are not significant, and an offset.

        Returns:
            A new robot; one with such torques is returned itself.
        """
        if self.torque_side == "link":
            return self
        bare = replace(
            self,
            torque_side="link",
            rotor_inertia=np.zeros(self.size),
            couplings=(),
            friction_nominal={},
        )
        return bare.with_friction(friction)

    def with_gravity(self, gravity: np.ndarray) -> Robot:
        """The same robot mounted differently: gravity in the base frame [m/s²]."""
        return replace(self, gravity=np.asarray(gravity, dtype=float))


def check_robot(robot: Robot) -> None:
    """Refuse a description that is not a tree with proper frames."""
    if robot.constraints is not None:
        robot.tree  # noqa: B018 — the tree checks itself, and holds all that there is
        return
    if not robot.joints:
        raise RobotDescriptionError(f"robot {robot.name!r} has no moving joint")
    if len(robot.links) != len(robot.joints) or np.shape(robot.rotor_inertia) != (robot.size,):
        raise RobotDescriptionError(
            f"robot {robot.name!r} has {robot.size} joints, {len(robot.links)} links and rotor "
            f"inertias of shape {np.shape(robot.rotor_inertia)}",
            advice="one of each per joint is needed",
        )
    if np.shape(robot.gravity) != (3,) or not np.isfinite(robot.gravity).all():
        raise RobotDescriptionError(
            f"robot {robot.name!r}: gravity {robot.gravity} must be three finite numbers in m/s²"
        )
    names = [joint.name for joint in robot.joints]
    for what, name in (
        ("robot", robot.name),
        *(("joint", name) for name in names),
        *(("link", link.name) for link in robot.links),
    ):
        if not is_printable(name):
            raise RobotDescriptionError(
                f"{what} {name!r}: its name holds control characters", advice="rename it"
            )
    repeated = {name for name in names if names.count(name) > 1}
    if repeated:
        raise RobotDescriptionError(f"joint names used twice: {', '.join(sorted(repeated))}")
    for i, joint in enumerate(robot.joints):
        check_joint(joint, i)
        if not np.isfinite(robot.links[i].inertia).all():
            raise RobotDescriptionError(f"link {robot.links[i].name!r}: inertia is not finite")
    base = [joint.motion for joint in robot.joints[: robot.base_joints]]
    if base and (len(base) != 6 or len(set(base)) != 1 or base[0] == "driven"):
        raise RobotDescriptionError(
            f"robot {robot.name!r}: joints without motors are the six of its base, which come first"
        )
    for c in robot.couplings:
        if not (0 <= c.motor < robot.size and 0 <= c.joint < robot.size) or c.motor == c.joint:
            raise RobotDescriptionError(
                f"coupling of motor {c.motor + 1} with joint {c.joint + 1}: two different joints "
                f"between 1 and {robot.size} are needed"
            )
