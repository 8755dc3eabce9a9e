"""Robots and models to export: random consistent values, a UR-like URDF, random trees."""

import re
from dataclasses import replace

import numpy as np

from pivident.models.runnable_model import RunnableModel, runnable_model
from pivident.robot.description import Robot
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.robot.urdf import parse_urdf
from tests.robot.test_urdf_against_pinocchio import random_urdf

#: A six-axis arm in the manner of Universal Robots: axes along y and z, a fixed flange and tool,
#: a gripper with a slide, meshes that are not there, transmissions, comments, odd spacing.
UR = """<?xml version="1.0" ?>
<!-- like a UR5, made up -->
<robot name="ur &amp; co" xmlns:xacro="http://ros.org/wiki/xacro">
  <link name="base_link">
    <visual><geometry><mesh filename="package://ur/base.dae"/></geometry></visual>
    <inertial><mass value="4"/><origin xyz="0 0 0"/>
      <inertia ixx="0.1" ixy="0" ixz="0" iyy="0.1" iyz="0" izz="0.1"/></inertial>
  </link>
  <joint name="shoulder_pan" type="revolute">
    <parent link="base_link"/><child link="shoulder"/>
    <origin rpy="0 0 0" xyz="0 0 0.0892"/><axis xyz="0 0 1"/>
    <limit effort="150" lower="-6.2" upper="6.2" velocity="3.15"/>
    <dynamics damping="0.5"   friction='0.25' note="a > b, 'damping' stays"/>
  </joint>
  <link name="shoulder">
\t<inertial>
\t  <mass value="3.7"/>
\t  <inertia ixx="0.0149" ixy="0" ixz="0" iyy="0.0149" iyz="0" izz="0.0104"/>
\t</inertial>
    <collision><geometry><mesh filename="package://ur/shoulder.stl"/></geometry></collision>
  </link>
  <joint name="lift" type="revolute">
    <parent link="shoulder"/><child link="upper &quot;arm&quot;"/>
    <origin rpy="0 1.5707963267948966 0" xyz="0 0.135 0"/><axis xyz="0 1 0"/>
    <limit effort="150" lower="-3.1" upper="3.1" velocity="3.15"/>
  </joint>
  <link name="upper &quot;arm&quot;"><visual><geometry><box size="1 1 1"/></geometry></visual>
  </link>
  <joint name="elbow" type="continuous">
    <parent link="upper &quot;arm&quot;"/><child link="forearm"/>
    <origin xyz="0 -0.1197 0.425"/><axis xyz="0 0.6 -0.8"/><dynamics/>
  </joint>
  <link name="forearm"/>
  <joint name="flange" type="fixed">
    <parent link="forearm"/><child link="tool"/><origin xyz="0.1 0 0.2" rpy="0.3 0.2 0.1"/>
  </joint>
  <link name="tool">
    <inertial><origin xyz="0 0 0.05"/><mass value="0.4"/>
      <inertia ixx="0.001" ixy="0" ixz="0" iyy="0.001" iyz="0" izz="0.001"/></inertial>
  </link>
  <joint name="screwed" type="fixed"><parent link="tool"/><child link="cover"/></joint>
  <link name="cover"><collision><geometry><box size="1 1 1"/></geometry></collision></link>
  <joint name="finger_slide" type="prismatic">
    <parent link="tool"/><child link="finger"/><origin xyz="0 0 0.1"/><axis xyz="1 0 0"/>
    <limit effort="20" lower="0" upper="0.04" velocity="0.1"/>
    <dynamics damping="3" friction="1"/>
  </joint>
  <link name="finger">
    <inertial><origin xyz="0 0 0.02"/><mass value="0.1"/>
      <inertia ixx="1e-4" ixy="0" ixz="0" iyy="1e-4" iyz="0" izz="1e-4"/></inertial>
  </link>
  <transmission name="t1"><joint name="lift"><hardwareInterface>x</hardwareInterface></joint>
  </transmission>
  <gazebo reference="shoulder"><inertial>not one</inertial></gazebo>
</robot>
"""

ARM = ("shoulder_pan", "lift", "elbow")


def with_values(robot: Robot, seed: int = 1, mass: float = 1.0) -> RunnableModel:
    """A model with random bodies that exist, rotor inertias, and friction of every term."""
    rng = np.random.default_rng(seed)
    model = runnable_model(robot)
    values = np.zeros(len(model.parameters))
    bodies = [random_body(rng, mass) for _ in robot.tree.links]
    at = dict.fromkeys(range(robot.tree.size), 0)
    for k, p in enumerate(model.parameters):
        if p.is_inertial:
            values[k] = bodies[p.joint][at[p.joint]]
            at[p.joint] += 1
        else:
            values[k] = rng.uniform(0.1, 1.0)
            if not p.is_dissipative and rng.random() < 0.5:
                values[k] *= -1.0
    return replace(model, values=values)


def random_body(rng: np.random.Generator, mass: float) -> np.ndarray:
    """Ten inertial parameters of some points, which have a mass and a place."""
    points = rng.normal(scale=0.1, size=(8, 3)) + rng.normal(scale=0.2, size=3)
    each = mass * rng.uniform(0.1, 0.5, len(points))
    nothing = np.zeros((3, 3))
    return np.sum(
        [from_center_of_mass(m, x, nothing) for m, x in zip(each, points, strict=True)], axis=0
    )


def ur(frozen: dict[str, float] | None = None) -> Robot:
    """The arm of the URDF above, its finger frozen."""
    return parse_urdf(UR, joints=ARM, frozen=frozen or {})


def random_tree(rng: np.random.Generator, size: int) -> str:
    """A random URDF of all joint types whose bodies exist: S made tr(S) 1 - S."""

    def possible(found: re.Match[str]) -> str:
        keys = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
        values = [float(re.search(f'{key}="([^"]+)"', found[0])[1]) for key in keys]
        second = tensor(np.array(values))
        inertia = (np.trace(second) * np.eye(3) - second)[np.triu_indices(3)]
        written = [f'{k}="{v!r}"' for k, v in zip(keys, inertia.tolist(), strict=True)]
        return f"<inertia {' '.join(written)}/>"

    return re.sub(r"<inertia [^>]*/>", possible, random_urdf(rng, size))
