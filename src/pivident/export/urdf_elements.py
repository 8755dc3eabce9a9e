"""Elements of a URDF as lines of text."""

from __future__ import annotations

import numpy as np

from pivident.export.xml_text import number, numbers
from pivident.models.link_bodies import written_body


def inertial_lines(name: str, inertia: np.ndarray) -> list[str]:
    """An ``<inertial>`` element about the centre of mass, in axes of the link; zeros: no mass."""
    mass, center, tensor = 0.0, np.zeros(3), np.zeros((3, 3))
    if inertia.any():
        body = written_body(name, inertia)
        mass, center, tensor = body.mass, body.center_of_mass, body.inertia
    keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    elements = tensor[np.triu_indices(3)]
    written = " ".join(f'{k}="{number(v)}"' for k, v in zip(keys, elements, strict=True))
    return [
        "<inertial>",
        f'  <origin xyz="{numbers(center)}" rpy="0 0 0"/>',
        f'  <mass value="{number(mass)}"/>',
        f"  <inertia {written}/>",
        "</inertial>",
    ]


def dynamics_line(damping: float, friction: float) -> str:
    """A ``<dynamics>`` element."""
    return f'<dynamics damping="{number(damping)}" friction="{number(friction)}"/>'
