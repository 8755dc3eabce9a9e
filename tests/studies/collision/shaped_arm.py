"""A small arm with every kind of collision shape, as URDF text with a mesh beside it."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

#: Corners of a crooked block [mm], those of its floor before those of its roof.
CORNERS = np.array(
    [[0, 0, 0], [100, 0, 10], [105, 90, 0], [0, 95, 0],
     [0, 10, 300], [100, 0, 290], [110, 90, 300], [10, 90, 295]], dtype=float,
)  # fmt: skip

FACES = (
    (0, 2, 1), (0, 3, 2), (4, 5, 6), (4, 6, 7), (0, 1, 5), (0, 5, 4),
    (1, 2, 6), (1, 6, 5), (2, 3, 7), (2, 7, 6), (3, 0, 4), (3, 4, 7),
)  # fmt: skip

ARM = """<robot name="arm">
  <link name="world"/>
  <link name="stand"><collision><origin xyz="0 0 0.1"/>
    <geometry><cylinder radius="0.1" length="0.2"/></geometry></collision></link>
  <link name="upper"><collision><origin xyz="0.1 0.02 0.2" rpy="0.1 0.4 -0.2"/>
    <geometry><box size="0.1 0.14 0.5"/></geometry></collision></link>
  <link name="lower"><collision><origin xyz="0 -0.03 0.1" rpy="0.3 0 0"/>
    <geometry><mesh filename="{mesh}" scale="0.001 -0.001 0.0012"/></geometry></collision></link>
  <link name="slide"><collision><origin rpy="0 0.7 0"/>
    <geometry><capsule radius="0.04" length="0.2"/></geometry></collision></link>
  <link name="hand"><collision><origin xyz="0 0 0.1"/>
    <geometry><sphere radius="0.06"/></geometry></collision></link>
  <joint name="mount" type="fixed"><parent link="world"/><child link="stand"/>
    <origin xyz="0.1 0 0.05" rpy="0 0 0.3"/></joint>
  <joint name="shoulder" type="revolute"><parent link="stand"/><child link="upper"/>
    <origin xyz="0 0 0.3" rpy="0.2 0 0"/><axis xyz="0 1 0"/>
    <limit lower="-2" upper="2" velocity="1" effort="1"/></joint>
  <joint name="elbow" type="revolute"><parent link="upper"/><child link="lower"/>
    <origin xyz="0.1 0 0.45" rpy="0 0.3 0.5"/><axis xyz="1 -1 0.5"/>
    <limit lower="-2.5" upper="2.5" velocity="1" effort="1"/></joint>
  <joint name="quill" type="prismatic"><parent link="lower"/><child link="slide"/>
    <origin xyz="0 0 0.4"/><axis xyz="0 0 -1"/>
    <limit lower="-0.2" upper="0.1" velocity="1" effort="1"/></joint>
  <joint name="wrist" type="revolute"><parent link="slide"/><child link="hand"/>
    <origin xyz="0 0 0.15"/><axis xyz="1 0 0"/>
    <limit lower="-1" upper="1" velocity="1" effort="1"/></joint>
</robot>"""


def stl_text(corners: np.ndarray = CORNERS, faces: Sequence[Sequence[int]] = FACES) -> str:
    lines = ["solid block"]
    for face in faces:
        lines += ["facet normal 0 0 0", "outer loop"]
        lines += [f"vertex {x} {y} {z}" for x, y, z in corners[list(face)]]
        lines += ["endloop", "endfacet"]
    return "\n".join([*lines, "endsolid block", ""])


def write_arm(folder: Path, mesh: str = "package://arm_parts/meshes/lower.stl") -> Path:
    """The URDF in a package of the folder; its mesh is where a package:// path leads."""
    package = folder / "arm_parts"
    (package / "meshes").mkdir(parents=True, exist_ok=True)
    (package / "urdf").mkdir(exist_ok=True)
    (package / "meshes" / "lower.stl").write_text(stl_text())
    path = package / "urdf" / "arm.urdf"
    path.write_text(ARM.format(mesh=mesh))
    return path
