"""A SCARA with a slide, and logs of it."""

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.robot_regressor import regressor_of
from pivident.robot.urdf import parse_urdf

RATE = 500.0


def link(name, mass, x):
    return (
        f'<link name="{name}"><inertial><origin xyz="{x} 0 0"/><mass value="{mass}"/>'
        '<inertia ixx="0.02" iyy="0.03" izz="0.04" ixy="0" ixz="0" iyz="0"/></inertial></link>'
    )


def joint(name, kind, parent, child, axis, x):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/><child link="{child}"/>'
        f'<origin xyz="{x} 0 0"/><axis xyz="{axis}"/>'
        '<limit lower="-3" upper="3" velocity="5" effort="500"/></joint>'
    )


def urdf(slide):
    """Two joints about the vertical and a slide along some axis."""
    bodies = [link("a", 6.0, 0.2), link("b", 3.0, 0.15), link("c", 2.0, 0.0)]
    joints = [
        joint("turn", "revolute", "base", "a", "0 0 1", 0.0),
        joint("elbow", "revolute", "a", "b", "0 0 1", 0.4),
        joint("slide", "prismatic", "b", "c", slide, 0.3),
    ]
    return f'<robot name="scara"><link name="base"/>{"".join(bodies + joints)}</robot>'


def arm(slide):
    """The same, read."""
    return parse_urdf(urdf(slide))


def recording(robot, gain):
    """What drives of such gains log, with friction, an offset and rotors of their own."""
    t, rng = np.arange(10_000) / RATE, np.random.default_rng(2)
    phase = 2.0 * np.pi * rng.uniform(size=(3, 3))
    rates = np.array([1.1, 2.3, 3.7])
    angle = rates * t[:, None, None] + phase
    size = np.array([0.8, 0.7, 0.1])[:, None] / rates
    q, dq, ddq = (np.einsum("js,tjs->tj", size * rates**k, f(angle)) for k, f in enumerate(
        (np.sin, np.cos, lambda x: -np.sin(x))
    ))  # fmt: skip
    base = base_parameters(robot)
    rigid = regressor_of(robot, base.parameters).torque(
        q, dq, ddq, base.values(nominal_values(robot, base.standard))
    )
    tau = rigid + 0.3 * ddq + 2.0 * dq + 1.5 * np.tanh(100.0 * dq) + 0.4
    tau += 0.02 * rng.standard_normal(tau.shape)
    return Recording("run", robot.joint_names, q, tau / gain, RATE, torque_timing="sampled")
