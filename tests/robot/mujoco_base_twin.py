"""A robot with a measured base in MuJoCo: states, inverse dynamics and wrenches of its sensors."""

import mujoco
import numpy as np
from benchmarks.mujoco_base import add_sites
from benchmarks.mujoco_mechanism import mujoco_spec

from pivident.robot.frames import rotation_x, rotation_y, rotation_z


def base_rates(angles, rates):
    """Axes of roll, pitch and yaw in the world, their rates of change, and the axes of the base."""
    roll, pitch, yaw = angles
    first, second = rotation_x(roll), rotation_x(roll) @ rotation_y(pitch)
    axes = np.column_stack([np.eye(3)[0], first[:, 1], second[:, 2]])
    spin = axes[:, 0] * rates[0]
    change = [np.zeros(3), np.cross(spin, axes[:, 1])]
    change.append(np.cross(spin + axes[:, 1] * rates[1], axes[:, 2]))
    return axes, np.column_stack(change), second @ rotation_z(yaw)


class BaseTwin:
    """MuJoCo's model of a robot, with sites at its sensors and a force sensor under the base."""

    def __init__(self, robot, pushes=()):
        spec = mujoco_spec(robot, 1e-4)
        self.robot, self.held = robot, add_sites(spec, robot, pushes)
        self.model = spec.compile()
        self.data = mujoco.MjData(self.model)
        names = robot.joint_names[robot.base_joints :]
        self.places = [self.model.joint(name).qposadr[0] for name in names]
        self.rates = [self.model.joint(name).dofadr[0] for name in names]

    def inverse(self, q, dq, ddq):
        """Torques of all joints, those of a floating base along our coordinates, (joints,)."""
        first, data = self.robot.base_joints, self.data
        free = self.robot.base_motion == "measured"
        if free:
            axes, change, turned = base_rates(q[3:6], dq[3:6])
            data.qpos[:3], data.qvel[:3], data.qacc[:3] = q[:3], dq[:3], ddq[:3]
            mujoco.mju_mat2Quat(data.qpos[3:7], turned.ravel())
            data.qvel[3:6] = turned.T @ axes @ dq[3:6]
            data.qacc[3:6] = turned.T @ (axes @ ddq[3:6] + change @ dq[3:6])
        data.qpos[self.places], data.qvel[self.rates] = q[first:], dq[first:]
        data.qacc[self.rates] = ddq[first:]
        mujoco.mj_inverse(self.model, data)
        torques = np.zeros(self.robot.size)
        torques[first:] = data.qfrc_inverse[self.rates]
        if free:
            torques[:3] = data.qfrc_inverse[:3]
            torques[3:6] = axes.T @ turned @ data.qfrc_inverse[3:6]
        return torques

    def applied(self, q, sensor, wrench):
        """Joint torques of a force and a moment at a sensor, by MuJoCo's Jacobian, (joints,)."""
        self.inverse(q, np.zeros_like(q), np.zeros_like(q))
        site, data = self.model.site(sensor.name), self.data
        axes = data.site(site.id).xmat.reshape(3, 3)
        moving, turning = np.zeros((2, 3, self.model.nv))
        mujoco.mj_jacSite(self.model, data, moving, turning, site.id)
        total = moving.T @ axes @ wrench[:3] + turning.T @ axes @ wrench[3:]
        first = self.robot.base_joints
        torques = np.zeros(self.robot.size)
        torques[first:] = total[self.rates]
        if self.robot.base_motion == "measured":
            columns, _, turned = base_rates(q[3:6], np.zeros(3))
            torques[:3], torques[3:6] = total[:3], columns.T @ turned @ total[3:6]
        return torques
