"""Forward kinematics and potential energy, written a second time for the tests."""

import numpy as np

from pivident.robot.description import Robot


def homogeneous(rotation, translation):
    matrix = np.eye(4)
    matrix[:3, :3], matrix[:3, 3] = rotation, translation
    return matrix


def turn(axis, angle):
    """4x4 rotation about the x, y or z axis."""
    c, s = np.cos(angle), np.sin(angle)
    i, j = {"x": (1, 2), "y": (2, 0), "z": (0, 1)}[axis]
    matrix = np.eye(4)
    matrix[[i, i, j, j], [i, j, i, j]] = c, -s, s, c
    return matrix


def shift(axis, distance):
    """4x4 translation along the x, y or z axis."""
    matrix = np.eye(4)
    matrix["xyz".index(axis), 3] = distance
    return matrix


def link_poses(robot: Robot, q):
    """Pose of each link frame in the base frame, shape (joints, 4, 4)."""
    poses = []
    for joint, position in zip(robot.joints, q, strict=True):
        motion = turn("z", position) if joint.kind == "revolute" else shift("z", position)
        parent = poses[joint.parent] if joint.parent >= 0 else np.eye(4)
        poses.append(parent @ homogeneous(joint.rotation, joint.translation) @ motion)
    return np.array(poses).reshape(-1, 4, 4)


def potential_energy(robot: Robot, q):
    """U = -Σ gᵀ (m p + R h)."""
    return -sum(
        robot.gravity @ (link.inertia[9] * pose[:3, 3] + pose[:3, :3] @ link.inertia[6:9])
        for pose, link in zip(link_poses(robot, q), robot.links, strict=True)
    )


def gravity_torque(robot: Robot, q, step=1e-5):
    """∂U/∂q by central differences [N m or N]."""
    q = np.asarray(q, dtype=float)
    moves = step * np.eye(len(q))
    return np.array(
        [
            (potential_energy(robot, q + m) - potential_energy(robot, q - m)) / (2 * step)
            for m in moves
        ]
    )
