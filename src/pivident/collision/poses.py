"""Poses of all links in the base frame, for many postures at once."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.robot.description import Robot


@dataclass(frozen=True, eq=False)
class LinkPoses:
    """Where the links are in each posture; index -1 of the links is the fixed base.

    Attributes:
        rotation: orientation of each link in the base frame, shape (links + 1, samples, 3, 3).
        origin: origin of each link in the base frame [m], shape (links + 1, samples, 3).
    """

    rotation: np.ndarray
    origin: np.ndarray

    @classmethod
    def of(cls, robot: Robot, q: np.ndarray) -> LinkPoses:
        """Forward kinematics, ⁰T_i = ⁰T_p · ^pT_i(q).

        Args:
            robot: the robot.
            q: joint positions [rad or m], shape (samples, joints).
        """
        samples = len(q)
        # the base comes last, so that the parent -1 of a joint finds it
        rotation = np.empty((robot.size + 1, samples, 3, 3))
        origin = np.empty((robot.size + 1, samples, 3))
        rotation[-1], origin[-1] = np.eye(3), 0.0
        for i, joint in enumerate(robot.joints):
            parent = rotation[joint.parent]
            mounted = parent @ joint.rotation
            origin[i] = origin[joint.parent] + parent @ joint.translation
            if joint.kind == "prismatic":
                rotation[i] = mounted
                origin[i] += mounted[..., 2] * q[:, i, None]
            else:
                c, s = np.cos(q[:, i, None]), np.sin(q[:, i, None])
                rotation[i, ..., 0] = mounted[..., 0] * c + mounted[..., 1] * s
                rotation[i, ..., 1] = mounted[..., 1] * c - mounted[..., 0] * s
                rotation[i, ..., 2] = mounted[..., 2]
        return cls(rotation, origin)

    def points(self, link: int, point: np.ndarray) -> np.ndarray:
        """A point of a link in the base frame [m], shape (samples, 3).

        Args:
            link: index of the link, -1 for the base.
            point: in the link's frame [m], shape (3,).
        """
        return self.origin[link] + self.rotation[link] @ point
