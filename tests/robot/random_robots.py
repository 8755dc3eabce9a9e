"""Random trees with every friction law, drives and couplings, for tests of files."""

import numpy as np

from pivident.robot.description import INERTIAL, Coupling, Joint, Link, Robot, UrdfFile
from pivident.robot.frames import rotation_from_rpy
from pivident.robot.friction import FrictionLaw
from pivident.robot.transmission import Transmission
from tests.dynamics.friction_laws import LAWS


def random_robot(seed: int, largest: int = 6, laws: tuple[str, ...] = tuple(LAWS)) -> Robot:
    """A random tree; each joint has a law of its own.

    Args:
        seed: of its generator.
        largest: most joints.
        laws: names of the laws to draw from.
    """
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, largest + 1))
    joints = []
    for i in range(n):
        limits = (float(rng.uniform(-3, 0)), float(rng.uniform(0.1, 3)))
        joint = Joint(
            name=f"joint <{i}> & 'ähm'" if rng.random() < 0.2 else f"joint{i}",
            kind="revolute" if rng.random() < 0.7 else "prismatic",
            parent=int(rng.integers(-1, i)) if i else -1,
            rotation=rotation_from_rpy(*rng.uniform(-3, 3, 3)),
            translation=rng.normal(size=3),
            position_limits=limits if rng.random() < 0.7 else None,
            rated_speed=float(rng.uniform(0.5, 6)) if rng.random() < 0.7 else None,
            torque_limit=float(rng.choice([10.0, np.inf])) if rng.random() < 0.7 else None,
        )
        law = FrictionLaw(LAWS[laws[int(rng.integers(len(laws)))]])
        joints.append(joint.with_friction(law) if rng.random() < 0.8 else joint)
    couplings = []
    if n > 1 and rng.random() < 0.5:
        flags = rng.random(3) < 0.7
        couplings = [Coupling(n - 1, n - 2, float(rng.normal()), *map(bool, flags))]
    reduction = np.diag(rng.uniform(1, 100, n)) + np.tril(rng.normal(size=(n, n)), -1)
    known = rng.random(n) < 0.5
    return Robot(
        name=f"random {seed}",
        joints=tuple(joints),
        links=tuple(Link(f"link{i}", rng.normal(size=len(INERTIAL))) for i in range(n)),
        gravity=rng.normal(size=3),
        rotor_inertia=rng.uniform(0, 1, n),
        transmission=Transmission(reduction, rng.normal(size=n), rng.normal(size=n), known),
        friction_nominal={"fv1": float(rng.normal())},
        couplings=tuple(couplings),
        description="made up",
        urdf=UrdfFile("/a/b.urdf", 32 * "0f", {"gripper": 0.1}) if rng.random() < 0.5 else None,
    )
