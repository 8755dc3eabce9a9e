"""A quadruped that sways on feet that stand, by MuJoCo: contact forces that nobody measures.

The feet are held by stiff equality constraints (`connect`), the trunk is free, and the legs follow
the angles that a wandering trunk asks of them. `python -m benchmarks.mujoco_stance --runs 20` says
how often the intervals of each method contain the truth, and how large they are.
"""

from __future__ import annotations

import argparse
from dataclasses import replace

import mujoco
import numpy as np
from benchmarks.mujoco_base import Accuracy, viscous_name, without_viscous
from benchmarks.mujoco_mechanism import friction_of, mujoco_spec

from pivident.data.recording.measured_wrenches import with_wrenches
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.loop.motion.planted_feet import on_planted_feet
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.closed_chains import closed_robot
from pivident.robot.constraints import Closure
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.gallery import load_robot
from pivident.robot.joints import Contact
from pivident.robot.measured_base import BASE_JOINTS, link_places, rotations_from_quaternions

RATE = 500.0

#: Hip and knee of all legs where the trunk stands in the middle [rad].
POSTURE = np.tile([0.0, 0.75, -1.5], 4)

#: How far the trunk wanders [m, rad], and how fast [m/s, rad/s].
REACH = np.array([0.04, 0.03, 0.025, 0.12, 0.08, 0.18])
SPEED = np.array([0.4, 0.4, 0.4, 2.0, 2.0, 2.0])

#: Proportional and derivative gains of the legs [N m/rad, N m s/rad].
GAINS = 400.0, 8.0


def standing_quadruped() -> Robot:
    """The quadruped of the gallery with feet that stand."""
    robot = load_robot("quadruped")
    shanks = [name for name in robot.joint_names if name.endswith("knee")]
    feet = tuple(Contact(name, np.array([0.25, 0.0, 0.0])) for name in shanks)
    return replace(robot, contacts=feet)


def stance_record(
    robot: Robot,
    samples: int,
    seed: int,
    accuracy: Accuracy,
    substeps: int = 20,
    motion: int = 2,
) -> Recording:
    """A record of all joints with the pose of the trunk.

    Noise by ``seed``, the motion by ``motion``.
    """
    start, places = _stance(robot)
    q_ref = _reference(robot, start, places, samples, motion)
    spec = mujoco_spec(robot, 1.0 / (RATE * substeps))
    _hold_feet(spec, robot, places, 1.0 / (RATE * substeps))
    driven = robot.on_fixed_base
    for name in driven.joint_names:
        spec.joint(name).damping[0] = driven.friction_nominal.get(viscous_name(driven, name), 0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    at = [model.joint(name).qposadr[0] for name in driven.joint_names]
    moving = [model.joint(name).dofadr[0] for name in driven.joint_names]
    data.qpos[:3], data.qpos[at] = start[:3], q_ref[0]
    law, rng = friction_of(without_viscous(driven)), np.random.default_rng(seed)
    noise = accuracy.encoder * rng.normal(size=q_ref.shape)
    q, tau, pose = np.zeros_like(q_ref), np.zeros_like(q_ref), np.zeros((samples, 7))
    dq_ref = np.vstack([np.zeros(q_ref.shape[1]), np.diff(q_ref, axis=0)]) * RATE
    before = q_ref[0]
    for k in range(samples):
        heard = data.qpos[at] + noise[k]
        speed = (heard - before) * RATE if k else np.zeros(len(heard))
        before = heard
        u = GAINS[0] * (q_ref[k] - heard) + GAINS[1] * (dq_ref[k] - speed)
        q[k], tau[k], pose[k] = heard, u, data.qpos[:7]
        for _ in range(substeps):
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[moving] = u - law(data.qvel[moving])
            mujoco.mj_step(model, data)
    position = pose[:, :3] + accuracy.position * rng.normal(size=(samples, 3))
    turn = accuracy.rotation * rng.normal(size=(samples, 3))
    small = np.column_stack([0.5 * turn, np.ones(samples)])
    rotation = rotations_from_quaternions(pose[:, [4, 5, 6, 3]]) @ rotations_from_quaternions(small)
    legs = Recording(
        f"stance {seed}", driven.joint_names, q, tau, RATE, q_ref=q_ref, control_rate=RATE
    )
    return with_wrenches(legs, robot, {}, (position, rotation))


def truth_of_stance(problem: Problem, robot: Robot) -> np.ndarray:
    """Base parameters of a problem on planted feet, from the description of the robot."""
    base = problem.base
    nominal = nominal_values(problem.robot, base.standard)
    for k, p in enumerate(base.standard):
        if p.stem == "ia":
            nominal[k] = robot.rotor_inertia[p.joint]
    return base.values(nominal)


def _stance(robot: Robot) -> tuple[np.ndarray, list[np.ndarray]]:
    """Positions of all joints with the feet on the ground, and the places of the feet."""
    start = np.concatenate([np.zeros(6), POSTURE])
    start[2] = -min(place[2] for place in _places(robot, start))
    return start, _places(robot, start)


def _places(robot: Robot, q: np.ndarray) -> list[np.ndarray]:
    """Feet in the world."""
    found = []
    for contact in robot.contacts:
        rotation, origin = link_places(robot, robot.link_index(contact.link), q[None])
        found.append(origin[0] + rotation[0] @ contact.point)
    return found


def _reference(
    robot: Robot, start: np.ndarray, places: list[np.ndarray], samples: int, motion: int
) -> np.ndarray:
    """Angles of the legs while the trunk wanders, shape (samples, legs' joints)."""
    closures = [
        Closure(
            c.link, (robot.link_index(c.link), -1), (Pose(np.eye(3), c.point), Pose(np.eye(3), p))
        )
        for c, p in zip(robot.contacts, places, strict=True)
    ]
    closed = closed_robot(replace(robot, contacts=()), BASE_JOINTS, closures, posture=start)
    rng = np.random.default_rng(motion)
    stops = start[:6] + np.vstack([np.zeros(6), rng.uniform(-1.0, 1.0, (60, 6)) * REACH])
    trunk = point_to_point(stops, SPEED, RATE, samples)[0].T
    return ClosedChains(closed).motion(trunk, 0.0 * trunk, 0.0 * trunk).q[6:].T


def _hold_feet(spec: mujoco.MjSpec, robot: Robot, places: list[np.ndarray], step: float) -> None:
    """Equality constraints between the feet and the ground."""
    for contact, place in zip(robot.contacts, places, strict=True):
        body = spec.body(robot.joints[robot.link_index(contact.link)].name)
        names = f"{contact.link}:foot", f"{contact.link}:ground"
        body.add_site(name=names[0], pos=contact.point)
        spec.worldbody.add_site(name=names[1], pos=place)
        equality = spec.add_equality(
            name=contact.link, objtype=mujoco.mjtObj.mjOBJ_SITE, name1=names[0], name2=names[1]
        )
        equality.type = mujoco.mjtEq.mjEQ_CONNECT
        equality.solref = [-1.0 / (2.0 * step) ** 2, -1.0 / step]
        equality.solimp = [0.9999, 0.9999, 0.001, 0.5, 2.0]


def main() -> None:
    """Coverage of each method over some runs."""
    arguments = argparse.ArgumentParser(description=__doc__)
    arguments.add_argument("--runs", type=int, default=20)
    arguments.add_argument("--seconds", type=float, default=16.0)
    chosen = arguments.parse_args()
    robot = standing_quadruped()
    accuracy = Accuracy(2e-5, 0.0, 0.0, 5e-5, 5e-5)
    hits: dict[str, list[float]] = {}
    for seed in range(chosen.runs):
        record = stance_record(robot, int(chosen.seconds * RATE), seed, accuracy)
        closed, recordings = on_planted_feet(robot, [record.part(200, record.samples)])
        problem = Problem(closed, recordings)
        truth = truth_of_stance(problem, robot)
        for name in ("ls", "iv-full-rate", "piv"):
            found = identify(problem, METHODS[name])
            inside = np.abs(found.theta - truth) < 1.96 * found.std
            hits.setdefault(name, []).append(100.0 * float(inside.mean()))
        print(seed, {name: round(own[-1], 1) for name, own in hits.items()}, flush=True)
    count = len(base_parameters(closed).names)
    for name, own in hits.items():
        error = np.std(own, ddof=1) / np.sqrt(len(own)) if len(own) > 1 else np.nan
        print(f"{name}: {np.mean(own):.1f} ± {error:.1f} % of {count} parameters, {len(own)} runs")


if __name__ == "__main__":
    main()
