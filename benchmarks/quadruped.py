"""A quadruped whose base floats: on a cable, and on four feet that stand on springs.

Each leg has an abduction, a hip and a knee; positions of zero stretch the legs downwards. The
masses are drawn, and known.
"""

from __future__ import annotations

import numpy as np
from benchmarks.mujoco_base import Accuracy, Push, mujoco_base_record, with_drawn_masses

from pivident.data.recording.recording import Recording
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Joint, Link, Robot
from pivident.robot.frames import Pose, rotation_from_rpy, rotation_from_z_to
from pivident.robot.friction import DEFAULT_FRICTION
from pivident.robot.measured_base import with_floating_base
from pivident.robot.transmission import Transmission
from pivident.robot.wrench_sensor import WrenchSensor

RATE = 500.0

#: Corners of the trunk (forwards, to the left) and the legs there.
LEGS = {
    "front_left": (1.0, 1.0),
    "front_right": (1.0, -1.0),
    "rear_left": (-1.0, 1.0),
    "rear_right": (-1.0, -1.0),
}

#: Half the distance of the hips in x and y, offset of the thigh, lengths of thigh and shank [m].
HALF, OFFSET, LENGTH = np.array([0.25, 0.1]), 0.08, 0.25

#: Masses of the trunk and of the shoulder, thigh and shank of each leg [kg], size of bodies [m].
TRUNK, LEG, SIZE = 12.0, (1.0, 1.2, 0.4), 0.2

#: The bent posture of a leg [rad], and gains of the law on joints in the air.
POSTURE, KP, KD = np.array([0.0, 0.6, -1.2]), 150.0, 2.0

#: Rated speed [rad/s], which makes the sign of friction smooth: a step of the simulation is short
#: against it.
RATED = 15.0

#: Stiffness and damping of the ground at each foot [N/m, N s/m].
GROUND = 2e4, 150.0


def quadruped(seed: int = 3) -> Robot:
    """The robot with a floating base and drawn masses."""
    to_x, to_y = (rotation_from_z_to(axis) for axis in np.eye(3)[:2])
    joints: list[Joint] = []
    links: list[Link] = []
    for leg, corner in LEGS.items():
        first = len(joints)
        hip = np.array([*(HALF * corner), 0.0])
        aside = np.array([0.0, OFFSET * corner[1], 0.0])
        joints += [
            Joint(f"{leg}_abduction", "revolute", -1, to_x, hip, rated_speed=RATED),
            Joint(
                f"{leg}_hip", "revolute", first, to_x.T @ to_y, to_x.T @ aside, rated_speed=RATED
            ),
            Joint(
                f"{leg}_knee",
                "revolute",
                first + 1,
                np.eye(3),
                to_y.T @ [0.0, 0.0, -LENGTH],
                rated_speed=RATED,
            ),
        ]
        links += [Link(f"{leg}_{part}") for part in ("shoulder", "thigh", "shank")]
    friction = {f"fv[{joint.name}]": 0.3 for joint in joints}
    friction |= {f"fc[{joint.name}]": 0.5 for joint in joints}
    robot = Robot(
        "quadruped",
        tuple(joint.with_friction(DEFAULT_FRICTION) for joint in joints),
        tuple(links),
        np.array([0.0, 0.0, -9.81]),
        np.full(len(joints), 0.01),
        Transmission.direct(len(joints)),
        friction_nominal=friction,
    )
    return with_drawn_masses(with_floating_base(robot), [TRUNK, *LEG * len(LEGS)], SIZE, seed)


def hanging_record(
    robot: Robot, seed: int, seconds: float = 12.0, accuracy: Accuracy | None = None
) -> Recording:
    """The legs swing in the air, and the trunk hangs on a cable whose force is measured."""
    rng = np.random.default_rng(1)
    samples = round(seconds * RATE)
    reach = np.tile([0.35, 0.6, 0.6], len(LEGS))
    places = (
        np.tile(POSTURE, len(LEGS)) + rng.uniform(-1.0, 1.0, (round(2.2 * seconds), 12)) * reach
    )
    q_ref, _, _ = point_to_point(places, np.full(12, 5.0), RATE, samples)
    anchor = np.array([0.02, 0.01, 1.5])

    def cable(t: float, p: np.ndarray, v: np.ndarray) -> np.ndarray:
        way = anchor - p
        length = np.linalg.norm(way)
        along = way / length
        return along * max(0.0, 3000.0 * (length - 0.9) - 30.0 * (v @ along))

    at = WrenchSensor("cable", "base", Pose(np.eye(3), np.array([0.03, -0.02, 0.1])))
    gains = np.full(12, KP), np.full(12, KD)
    pushes = [Push(at, cable)]
    return mujoco_base_record(robot, q_ref, RATE, gains, pushes, seed, accuracy, height=0.45)


def standing_record(robot: Robot, seed: int, seconds: float = 12.0) -> Recording:
    """The trunk sways above four feet that do not leave the ground; each has a force sensor."""
    rng = np.random.default_rng(2)
    samples, count = round(seconds * RATE), round(2.0 * seconds)
    at_rest = np.tile(POSTURE, len(LEGS))
    feet = np.array([foot_of(leg, POSTURE) for leg in LEGS])
    height = -feet[0, 2]
    shift = rng.uniform(-1.0, 1.0, (count, 3)) * [0.05, 0.05, 0.05]
    turn = rng.uniform(-1.0, 1.0, (count, 3)) * [0.25, 0.2, 0.25]
    places = [at_rest]
    for position, angles in zip(shift, turn, strict=True):
        axes = rotation_from_rpy(*angles)
        wanted = (feet - position) @ axes  # of the feet in the frame of the trunk
        own = zip(LEGS, wanted, strict=True)
        places.append(np.concatenate([leg_positions(leg, foot) for leg, foot in own]))
    q_ref, _, _ = point_to_point(np.array(places), np.full(12, 2.0), RATE, samples)
    stiffness, damping = GROUND
    pushes = []
    for leg, foot in zip(LEGS, feet, strict=True):
        anchor = foot + np.array([0.0, 0.0, height])

        def ground(t: float, p: np.ndarray, v: np.ndarray, anchor=anchor) -> np.ndarray:
            return stiffness * (anchor - p) - damping * v

        down = rotation_from_z_to(np.eye(3)[1]).T @ [0.0, 0.0, -LENGTH]
        sensor = WrenchSensor(leg, f"{leg}_shank", Pose(np.eye(3), down))
        pushes.append(Push(sensor, ground))
    gains = np.full(12, 3.0 * KP), np.full(12, 2.0 * KD)
    return mujoco_base_record(robot, q_ref, RATE, gains, pushes, seed, Accuracy(), height)


def foot_of(leg: str, q: np.ndarray) -> np.ndarray:
    """The foot of a leg in the frame of the trunk [m]."""
    x, y = HALF * LEGS[leg]
    turned = rotation_from_rpy(q[0], 0.0, 0.0)
    bent = [np.sin(angle) * -LENGTH for angle in (q[1], q[1] + q[2])]
    down = [np.cos(angle) * -LENGTH for angle in (q[1], q[1] + q[2])]
    return np.array([x, y, 0.0]) + turned @ [sum(bent), OFFSET * LEGS[leg][1], sum(down)]


def leg_positions(leg: str, foot: np.ndarray) -> np.ndarray:
    """Positions of a leg whose foot is at a place in the frame of the trunk, by Newton [rad]."""
    q, step = POSTURE.copy(), 1e-6
    for _ in range(30):
        columns = [(foot_of(leg, q + step * e) - foot_of(leg, q - step * e)) for e in np.eye(3)]
        q = q + np.linalg.solve(np.array(columns).T / (2.0 * step), foot - foot_of(leg, q))
    return q
