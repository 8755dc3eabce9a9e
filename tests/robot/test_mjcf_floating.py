"""A free joint of an MJCF file is a floating base; its dynamics are MuJoCo's."""

import numpy as np
import pytest

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.frames import rotation_x, rotation_y, rotation_z
from pivident.robot.measured_base import base_positions
from pivident.robot.mjcf import read_mjcf

mujoco = pytest.importorskip("mujoco")

BODIES = """
<inertial pos="0.01 0 0.02" mass="5" diaginertia="0.05 0.06 0.07"/>
<body name="pack" pos="0 0 0.1"><inertial pos="0 0 0" mass="1" diaginertia="0.01 0.01 0.01"/></body>
<body name="thigh" pos="0.2 0.1 0"><joint name="hip" axis="1 0 0"/>
 <inertial pos="0 0 -0.1" mass="1" diaginertia="0.01 0.01 0.002"/>
 <body name="shank" pos="0 0 -0.2"><joint name="knee" axis="0 1 0"/>
  <inertial pos="0 0.01 -0.1" mass="0.5" diaginertia="0.005 0.005 0.001"/></body></body>
"""

FILE = f"""<mujoco model="dog"><compiler angle="radian"/><worldbody>
<body name="trunk" pos="0 0 1" quat="0.9 0.1 0 0.1"><freejoint name="root"/>{BODIES}</body>
</worldbody></mujoco>"""


@pytest.fixture
def path(tmp_path):
    made = tmp_path / "dog.xml"
    made.write_text(FILE, encoding="utf-8")
    return made


def test_a_free_joint_is_a_floating_base(path):
    robot = read_mjcf(path)
    assert robot.base_motion == "measured" and robot.joint_names[6:] == ("hip", "knee")
    trunk = robot.links[5]
    assert trunk.name == "trunk" and trunk.inertia[9] == pytest.approx(6.0)  # with its pack
    held = read_mjcf(path, frozen={"root": 0.0})
    assert held.base_joints == 0 and held.joint_names == ("hip", "knee")


@pytest.mark.parametrize("seed", range(4))
def test_inverse_dynamics_with_a_moving_base_are_mujocos(path, seed):
    robot, rng = read_mjcf(path), np.random.default_rng(seed)
    model = mujoco.MjModel.from_xml_path(str(path))
    data = mujoco.MjData(model)
    q, dq, ddq = rng.uniform(-0.6, 0.6, 8), rng.normal(size=8), rng.normal(size=8)
    turn = axes_and_rotation(q)[1]
    step = 1e-6
    later, earlier = (omega(q + s * dq + 0.5 * s * s * ddq, dq + s * ddq) for s in (step, -step))
    quaternion = np.zeros(4)
    mujoco.mju_mat2Quat(quaternion, turn.ravel())
    data.qpos[:] = np.concatenate([q[:3], quaternion, q[6:]])
    data.qvel[:] = np.concatenate([dq[:3], turn.T @ omega(q, dq), dq[6:]])
    data.qacc[:] = np.concatenate([ddq[:3], turn.T @ (later - earlier) / (2 * step), ddq[6:]])
    mujoco.mj_inverse(model, data)
    parameters = standard_parameters(robot)
    tau = Regressor.build(robot, parameters).torque(
        q[None], dq[None], ddq[None], nominal_values(robot, parameters)
    )[0]
    force, moment = data.qfrc_inverse[:3], turn @ data.qfrc_inverse[3:6]
    assert tau[:3] == pytest.approx(force, abs=1e-8)
    assert tau[3:6] == pytest.approx(axes_and_rotation(q)[0] @ moment, abs=1e-8)
    assert tau[6:] == pytest.approx(data.qfrc_inverse[6:], abs=1e-8)


def test_a_pose_is_the_positions_of_the_base():
    rng = np.random.default_rng(5)
    q = rng.uniform(-1.2, 1.2, (30, 6))
    rotation = np.array([axes_and_rotation(own)[1] for own in q])
    assert base_positions(q[:, :3], rotation) == pytest.approx(q, abs=1e-12)


def test_two_floating_bodies_are_refused(tmp_path):
    path = tmp_path / "two.xml"
    path.write_text(
        FILE.replace(
            "</worldbody>",
            '<body name="ball"><freejoint name="other"/><geom size="0.1"/></body></worldbody>',
        ),
        encoding="utf-8",
    )
    with pytest.raises(RobotDescriptionError, match=r"2 bodies float \('root', 'other'\)"):
        read_mjcf(path)
    assert read_mjcf(path, frozen={"other": 0.0}).base_joints == 6


def axes_and_rotation(q):
    """Axes of roll, pitch and yaw in the world, by rows, and the rotation of the base."""
    first, second = rotation_x(q[3]), rotation_x(q[3]) @ rotation_y(q[4])
    axes = np.array([[1.0, 0.0, 0.0], first[:, 1], second[:, 2]])
    return axes, second @ rotation_z(q[5])


def omega(q, dq):
    """Angular velocity of the base in the world."""
    return axes_and_rotation(q)[0].T @ dq[3:6]
