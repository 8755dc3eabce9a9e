"""Control laws that add the torque of gravity of their own model of the robot.

    u = [law](q_ref, q) + g(x),     x the measured position q, or the reference q_ref

    g_j(x) = -z_j · Σ_i (m_ji (o_i - o_j) + R_i s_ji) × g,     prismatic: -z_j · Σ_i m_ji g

with z_j the axis of joint j, o_i and R_i origin and orientation of link i, g the acceleration of
gravity, and m_ji, s_ji mass and first moments of link i as the law of joint j knows them. Each
joint has masses of its own, since its gravity model is identified in the unit of its own output.
On the reference g is known before the run; on the measured position it is a part of the feedback
and is evaluated in the compiled loop.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.kernels import link_poses, place_link, tree_of
from pivident.dynamics.parameters import Parameter, nominal_values, standard_parameters
from pivident.foundation.compiled import allocating, inlined, inner
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed, Printed
from pivident.loop.simulation.controllers import Controller, PythonController, SampledLaw
from pivident.robot.description import Robot
from pivident.robot.refusals import without_loops

#: Parameters that gravity acts on, in the order of the last axis of ``GravityModel.masses``.
MASS_STEMS = ("mx", "my", "mz", "m")

#: Numbers of a link's place in the base frame: its orientation row by row, and its origin.
PLACE = 12


@inlined
def _with_link(carried, link, joint, lx, ly, lz, mass):
    """Moment Σ m (o - o_joint) + R s and mass that a joint carries, with one more link."""
    sx, sy, sz, m = carried[0], carried[1], carried[2], carried[3]
    lx += m * (link[9] - joint[9])
    ly += m * (link[10] - joint[10])
    lz += m * (link[11] - joint[11])
    lx += link[0] * sx + link[1] * sy + link[2] * sz
    ly += link[3] * sx + link[4] * sy + link[5] * sz
    lz += link[6] * sx + link[7] * sy + link[8] * sz
    return lx, ly, lz, mass + m


@inner
def gravity_torques(
    parent, prismatic, rotation, translation, gravity, masses, q, pose, place, out
):  # fmt: skip
    """Torque of gravity of each joint in one posture.

    ``gravity``: acceleration of gravity in the base frame [m/s²]; ``masses``: first moments and
    mass of every link for every joint, shape (joints, joints, 4); ``pose``: scratch, shape
    (joints, 12); ``place``: scratch, shape (joints, PLACE); ``out``: receives the torques, shape
    (joints,).
    """
    link_poses(prismatic, rotation, translation, q, pose)
    n = q.size
    for i in range(n):
        place_link(parent[i], pose, i, place)
    for j in range(n):
        lx, ly, lz, mass = 0.0, 0.0, 0.0, 0.0
        for i in range(j, n):
            lx, ly, lz, mass = _with_link(masses[j, i], place[i], place[j], lx, ly, lz, mass)
        fx, fy, fz = mass * gravity[0], mass * gravity[1], mass * gravity[2]
        if not prismatic[j]:
            fx = ly * gravity[2] - lz * gravity[1]
            fy = lz * gravity[0] - lx * gravity[2]
            fz = lx * gravity[1] - ly * gravity[0]
        out[j] = -(place[j, 2] * fx + place[j, 5] * fy + place[j, 8] * fz)


@inner
def gravity_slopes(parent, prismatic, gravity, masses, place, out):
    """∂g_j/∂q_k of ``gravity_torques``, from the ``place`` that it leaves, shape (joints, joints).

    With L_jk = Σ m_ji (o_i - o_k) + R_i s_ji over the links beyond joint k, which turns them, g_j
    changes by -z_j · ((z_k × L_jk) × g) where k is beyond j. Where it is before j, or j itself,
    only the direction of gravity changes for what j carries: by z_j · (L_jj × (z_k × g)). A
    prismatic k shifts the mass Σ m_ji by z_k.
    """
    n = parent.size
    for j in range(n):
        for k in range(n):
            out[j, k] = 0.0
    for j in range(n):
        for k in range(n):
            outer, inner_joint = max(j, k), min(j, k)
            p = outer
            while p > inner_joint:
                p = parent[p]
            if p != inner_joint:
                continue
            lx, ly, lz, mass = 0.0, 0.0, 0.0, 0.0
            for i in range(outer, n):
                p = i
                while p > outer:
                    p = parent[p]
                if p != outer:
                    continue
                lx, ly, lz, mass = _with_link(
                    masses[j, i], place[i], place[outer], lx, ly, lz, mass
                )
            zx, zy, zz = place[k, 2], place[k, 5], place[k, 8]
            gx, gy, gz = gravity[0], gravity[1], gravity[2]
            if k > j:
                if prismatic[j]:
                    continue  # the force of a weight is the same everywhere
                if prismatic[k]:
                    lx, ly, lz = mass * zx, mass * zy, mass * zz
                else:
                    lx, ly, lz = zy * lz - zz * ly, zz * lx - zx * lz, zx * ly - zy * lx
                sign = -1.0
            else:
                if prismatic[k]:
                    continue  # all that joint j carries is shifted as one
                gx, gy, gz = zy * gz - zz * gy, zz * gx - zx * gz, zx * gy - zy * gx
                sign = 1.0
            fx, fy, fz = ly * gz - lz * gy, lz * gx - lx * gz, lx * gy - ly * gx
            if prismatic[j]:
                fx, fy, fz = mass * gx, mass * gy, mass * gz
            out[j, k] = sign * (place[j, 2] * fx + place[j, 5] * fy + place[j, 8] * fz)


@allocating
def _along(parent, prismatic, rotation, translation, gravity, masses, q, out):
    """``gravity_torques`` of many postures, shape (samples, joints)."""
    n = q.shape[1]
    pose, place = np.empty((n, 12)), np.empty((n, PLACE))
    for k in range(q.shape[0]):
        gravity_torques(
            parent, prismatic, rotation, translation, gravity, masses, q[k], pose, place, out[k]
        )


#: What there is for a robot with closed loops.
AT_REFERENCE = 'use feed_forward = "gravity", which takes the reference, if the controller does'


@dataclass(frozen=True, eq=False)
class GravityModel(Displayed):
    """What the laws of a robot's joints take for the weight of its links.

    Attributes:
        robot: its geometry and gravity.
        masses: mx, my, mz and m of link i as the law of joint j knows them, shape
            (joints j, links i, 4) [u per N m times kg m or kg]; zero for links that joint j does
            not carry.
    """

    robot: Robot
    masses: np.ndarray

    def __post_init__(self) -> None:
        without_loops(self.robot, "gravity at the measured position in the control law")

    @classmethod
    def of(
        cls,
        robot: Robot,
        parameters: Sequence[Parameter],
        theta: np.ndarray,
        drive_gain: np.ndarray | float = 1.0,
    ) -> GravityModel:
        """The same parameters for all joints.

        Args:
            robot: the robot.
            parameters: standard parameters or heads of base groups; those without weight are
                passed over.
            theta: their values, shape (parameters,).
            drive_gain: joint torque per controller output, shape (joints,) or a scalar.

        Returns:
            The gravity model, in the unit of the controller's output.

        Raises:
            RobotDescriptionError: a robot with closed loops.
        """
        without_loops(robot, "gravity at the measured position in the control law", AT_REFERENCE)
        n = robot.size
        masses = np.zeros((n, n, len(MASS_STEMS)))
        gain = np.broadcast_to(np.asarray(drive_gain, float), (n,))
        for p, value in zip(parameters, theta, strict=True):
            if p.stem not in MASS_STEMS:
                continue
            carrier = p.joint
            while carrier >= 0:
                masses[carrier, p.joint, MASS_STEMS.index(p.stem)] = value / gain[carrier]
                carrier = robot.joints[carrier].parent
        return cls(robot, masses)

    @classmethod
    def nominal(cls, robot: Robot, drive_gain: np.ndarray | float = 1.0) -> GravityModel:
        """The masses of the robot's description.

        Args:
            robot: the robot.
            drive_gain: joint torque per controller output, shape (joints,) or a scalar.

        Returns:
            The gravity model, in the unit of the controller's output.
        """
        standard = standard_parameters(robot)
        return cls.of(robot, standard, nominal_values(robot, standard), drive_gain)

    def torque(self, q: np.ndarray) -> np.ndarray:
        """What the laws add in given postures.

        Args:
            q: positions [rad or m], shape (samples, joints).

        Returns:
            Torques of gravity in the unit of the controller's output, shape (samples, joints).
        """
        out = np.empty(q.shape)
        _along(*tree_of(self.robot), self.masses, np.ascontiguousarray(q, dtype=float), out)
        return out


@dataclass(frozen=True, eq=False)
class GravityCompensated(Printed):
    """A control law with gravity added: at the measured position, at the reference, or both.

    Attributes:
        feedback: the law without gravity.
        measured: gravity model evaluated at the measured position; None: there is none.
        reference: gravity model evaluated at the reference; None: there is none.
    """

    feedback: Controller
    measured: GravityModel | None = None
    reference: GravityModel | None = None

    def check(self, joints: int) -> None:
        """Refuse Python functions, and a law or gravity model of another number of joints.

        Args:
            joints: of the robot.

        Raises:
            ExperimentError: says what was given and what to give.
        """
        if isinstance(self.feedback, PythonController):
            raise ExperimentError(
                "gravity cannot be added to a control law that is a Python function: let the "
                "function add it, it is given the measured position"
            )
        self.feedback.check(joints)
        for model in (self.measured, self.reference):
            if model is not None and model.robot.size != joints:
                raise ExperimentError(
                    f"the gravity model of the control law is that of {model.robot.size} joints, "
                    f"but the robot has {joints}"
                )

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """Discretise at ``rate`` [Hz] for the reference ``q_ref``, ``dq_ref``: a `SampledLaw`."""
        law = self.feedback.law(rate, q_ref, dq_ref)
        if self.reference is not None:
            law = law._replace(reference=law.reference + self.reference.torque(q_ref))
        return law if self.measured is None else law._replace(masses=self.measured.masses)
