"""Robots for tests of symbolic models: a seven-axis arm, a SCARA, random chains and trees."""

import numpy as np

from pivident.robot.description import STANDARD_GRAVITY, Coupling, Joint, Link, Robot
from pivident.robot.transmission import Transmission


def rotation(axis, angle):
    """Rotation about z or x."""
    c, s = np.cos(angle), np.sin(angle)
    if axis == "z":
        return np.array([[c, -s, 0], [s, c, 0], [0, 0, 1.0]])
    return np.array([[1.0, 0, 0], [0, c, -s], [0, s, c]])


def robot_of(frames, name="robot", gravity=(0.0, 0.0, -STANDARD_GRAVITY), couplings=()):
    """A robot from (kind, parent, psi, alpha, phi, translation) for each joint, angles in rad."""
    joints = [
        Joint(
            f"joint_{i + 1}",
            kind,
            parent,
            rotation("z", psi) @ rotation("x", alpha) @ rotation("z", phi),
            np.array(translation, dtype=float),
        )
        for i, (kind, parent, psi, alpha, phi, translation) in enumerate(frames)
    ]
    n = len(joints)
    return Robot(
        name,
        tuple(joints),
        tuple(Link(f"link_{i + 1}") for i in range(n)),
        np.array(gravity, dtype=float),
        np.zeros(n),
        Transmission.direct(n),
        couplings=couplings,
    )


def modified_dh(rows, **kwargs):
    """A chain from (kind, alpha in quarter turns, d, theta in quarter turns, r)."""
    frames = []
    for i, (kind, quarters, d, theta, r) in enumerate(rows):
        alpha = quarters * np.pi / 2
        translation = [d, -r * np.sin(alpha), r * np.cos(alpha)]
        frames.append((kind, i - 1, 0.0, alpha, theta * np.pi / 2, translation))
    return robot_of(frames, **kwargs)


def seven_axes():
    """An arm with a spherical shoulder and wrist, axes in turn at right angles."""
    quarters = [0, -1, 1, 1, -1, -1, 1]
    lengths = [0.333, 0.0, 0.316, 0.0, 0.384, 0.0, 0.107]
    offsets = [0.0, 0.0, 0.0, 0.0825, -0.0825, 0.0, 0.088]
    rows = [("revolute", a, d, 0, r) for a, d, r in zip(quarters, offsets, lengths, strict=True)]
    return modified_dh(rows, name="seven axes")


def scara():
    """Three parallel vertical axes and a vertical slide, the last two pointing down."""
    return modified_dh(
        [
            ("revolute", 0, 0.0, 0, 0.4),
            ("revolute", 0, 0.325, 0, 0.0),
            ("prismatic", 2, 0.275, 0, 0.1),
            ("revolute", 0, 0.0, 1, 0.0),
        ],
        name="SCARA",
    )


def random_robot(seed, largest=7):
    """A random chain or tree: right angles, parallel axes and general poses, tilted gravity."""
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, largest + 1))
    tree = rng.random() < 0.4
    quarter = np.pi / 2

    def angle():
        kind = rng.random()
        if kind < 0.45:
            return 0.0
        return rng.integers(-2, 3) * quarter if kind < 0.85 else rng.uniform(-3, 3)

    def length():
        return 0.0 if rng.random() < 0.5 else rng.uniform(-0.5, 0.5)

    frames = [
        (
            "revolute" if rng.random() < 0.75 else "prismatic",
            int(rng.integers(-1, i)) if tree else i - 1,
            angle() if rng.random() < 0.4 else 0.0,
            angle(),
            angle(),
            [length(), length(), length()],
        )
        for i in range(n)
    ]
    gravity = rng.choice([[0, 0, -9.81], [0, -9.81, 0], [3.0, -2.0, -9.0], [0, 0, 0]])
    couplings = ()
    if n > 1 and rng.random() < 0.5:
        motor, joint = (int(k) for k in rng.choice(n, 2, replace=False))
        couplings = (Coupling(motor, joint, float(rng.uniform(-1.5, 1.5))),)
    return robot_of(frames, name="random", gravity=gravity, couplings=couplings)


def states(robot, count, seed=0):
    """Random ``q dq ddq``, each (count, joints)."""
    return np.random.default_rng(seed).uniform(-2.0, 2.0, (3, count, robot.size))
