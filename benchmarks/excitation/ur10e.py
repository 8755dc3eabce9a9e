"""A URDF of the UR10e, made of what its maker publishes: DH table, masses, centres of mass.

Universal Robots, *DH parameters for calculations of kinematics and dynamics*; speeds and torques
are those of the data sheet. The maker publishes no shapes and no inertias: the collision bodies are
cylinders along the links and joints, and each link has the inertia of its own cylinder.
"""

from __future__ import annotations

from pathlib import Path

import numpy as np

#: d, a [m] and alpha [rad] of each joint, in the order of Denavit and Hartenberg.
TABLE = (
    (0.1807, 0.0, np.pi / 2),
    (0.0, -0.6127, 0.0),
    (0.0, -0.57155, 0.0),
    (0.17415, 0.0, np.pi / 2),
    (0.11985, 0.0, -np.pi / 2),
    (0.11655, 0.0, 0.0),
)

#: Mass [kg] and centre of mass [m] of each link, in the DH frame at its far end.
BODIES = (
    (7.369, (0.021, 0.0, 0.027)),
    (13.051, (0.38, 0.0, 0.158)),
    (3.989, (0.24, 0.0, 0.068)),
    (2.1, (0.0, 0.007, 0.018)),
    (1.98, (0.0, 0.007, 0.018)),
    (0.615, (0.0, 0.0, -0.026)),
)

SPEEDS = np.deg2rad([120, 120, 180, 180, 180, 180])
TORQUES = (330, 330, 150, 56, 56, 56)

NAMES = ("shoulder_pan", "shoulder_lift", "elbow", "wrist_1", "wrist_2", "wrist_3")

#: Cylinders of each link in its DH frame: both ends [m] and radius [m].
CYLINDERS: tuple[tuple[tuple, tuple, float], ...] = (
    ((0.0, -0.09, 0.0), (0.0, 0.09, 0.0), 0.09),
    ((0.0, 0.0, 0.175), (0.6127, 0.0, 0.175), 0.075),
    ((0.0, 0.0, 0.05), (0.57155, 0.0, 0.05), 0.06),
    ((0.0, -0.06, 0.0), (0.0, 0.06, 0.0), 0.05),
    ((0.0, -0.06, 0.0), (0.0, 0.06, 0.0), 0.05),
    ((0.0, 0.0, -0.05), (0.0, 0.0, 0.0), 0.045),
)


def write_urdf(path: Path) -> Path:
    """Write the URDF; a joint turns about the z axis of the DH frame before it."""
    lines = [
        '<robot name="ur10e">',
        '<link name="base"><collision><origin xyz="0 0 0.05"/>'
        '<geometry><cylinder radius="0.09" length="0.1"/></geometry></collision></link>',
    ]
    parent, before = "base", (0.0, 0.0, 0.0)
    for k, name in enumerate(NAMES):
        d, a, alpha = TABLE[k]
        rotation, offset = _turned(alpha), np.array([a, 0.0, d])
        mass, centre = BODIES[k]
        first, second, radius = CYLINDERS[k]
        ends = [rotation @ np.array(end) + offset for end in (first, second)]
        centre = rotation @ np.array(centre) + offset
        way = ends[1] - ends[0]
        length, place = float(np.linalg.norm(way)), 0.5 * (ends[0] + ends[1])
        along = way / length
        about, across = mass * radius**2 / 2, mass * (3 * radius**2 + length**2) / 12
        inertia = across * np.eye(3) + (about - across) * np.outer(along, along)
        rpy = (0.0, float(np.arccos(along[2])), float(np.arctan2(along[1], along[0])))
        reach = np.deg2rad(180 if name == "elbow" else 360)
        lines += [
            f'<joint name="{name}_joint" type="revolute"><parent link="{parent}"/>'
            f'<child link="{name}_link"/>'
            f'<origin xyz="{_text(before[:3])}" rpy="{_text(before[3:] or (0, 0, 0))}"/>'
            f'<axis xyz="0 0 1"/><limit lower="{-reach}" upper="{reach}" '
            f'velocity="{SPEEDS[k]}" effort="{TORQUES[k]}"/></joint>',
            f'<link name="{name}_link"><inertial><origin xyz="{_text(centre)}"/>'
            f'<mass value="{mass}"/><inertia ixx="{inertia[0, 0]}" ixy="{inertia[0, 1]}" '
            f'ixz="{inertia[0, 2]}" iyy="{inertia[1, 1]}" iyz="{inertia[1, 2]}" '
            f'izz="{inertia[2, 2]}"/></inertial><collision>'
            f'<origin xyz="{_text(place)}" rpy="{_text(rpy)}"/>'
            f'<geometry><cylinder radius="{radius}" length="{length}"/></geometry>'
            f"</collision></link>",
        ]
        parent, before = f"{name}_link", (*offset, alpha, 0.0, 0.0)
    path.write_text("\n".join([*lines, "</robot>\n"]), encoding="utf-8")
    return path


def _turned(alpha: float) -> np.ndarray:
    """Rotation about x."""
    c, s = np.cos(alpha), np.sin(alpha)
    return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])


def _text(numbers) -> str:
    return " ".join(repr(float(x)) for x in numbers)
