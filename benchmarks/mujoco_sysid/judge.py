"""Both programs' estimates as base parameters, beside the truth."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.robot.friction import FrictionLaw, coulomb, viscous

from .arm import STEP, TRUE, Bodies, without_friction
from .own import robot_of
from .record import Record

#: Slope of the smoothed sign of dry friction [s/rad]: it is nearly sharp.
GAMMA = 400.0


@dataclass(frozen=True)
class Case:
    """One arm with its friction."""

    bodies: Bodies
    law: FrictionLaw  # pivident's
    friction_time: float  # of MuJoCo's constraint [s]

    @property
    def has_friction(self) -> bool:
        """Whether there is dry friction."""
        return bool(self.bodies.friction.any())


def case(friction_time: float | None) -> Case:
    """The arm without dry friction (None), or with dry friction of a time constant [s]."""
    if friction_time is None:
        return Case(without_friction(TRUE), FrictionLaw((viscous(),)), 0.02)
    return Case(TRUE, FrictionLaw((viscous(), coulomb("tanh", GAMMA))), friction_time)


@dataclass(frozen=True, eq=False)
class Judge:
    """Truth and the motion that predictions are made for."""

    case: Case
    motion: tuple[np.ndarray, np.ndarray, np.ndarray]  # q, dq, ddq of shape (samples, joints)

    @classmethod
    def of(cls, own: Case, other: Record) -> Judge:
        """``other``: another motion, without noise."""
        ddq = np.gradient(other.dq, STEP, axis=0)
        return cls(own, (other.q, other.dq, ddq))

    def theta(self, bodies: Bodies) -> np.ndarray:
        """Base parameters of an arm, shape (base,)."""
        robot = robot_of(bodies, self.case.law)
        base = base_parameters(robot)
        return base.values(nominal_values(robot, base.standard))

    @property
    def names(self) -> tuple[str, ...]:
        """Their names."""
        return base_parameters(robot_of(self.case.bodies, self.case.law)).names

    def predicted(self, theta: np.ndarray) -> float:
        """‖Φ (θ̂ - θ)‖/‖Φ θ‖ on the other motion."""
        robot = robot_of(self.case.bodies, self.case.law)
        regressor = Regressor.build(robot, base_parameters(robot).parameters)
        phi = regressor.matrix(*self.motion)
        truth = self.theta(self.case.bodies)
        return float(np.linalg.norm(phi @ (theta - truth)) / np.linalg.norm(phi @ truth))

    def groups(self) -> dict[str, np.ndarray]:
        """Indices of inertial, damping and friction parameters, and of the armature on its own."""
        names = np.array(self.names)
        chosen = {
            "armature": [n.startswith("ia") for n in names],
            "damping": [n.startswith("fv") for n in names],
            "friction": [n.startswith("fc") for n in names],
        }
        rest = ~np.any(list(chosen.values()), axis=0)
        return {"inertial": np.flatnonzero(rest)} | {
            key: np.flatnonzero(own) for key, own in chosen.items() if np.any(own)
        }
