"""Designs made by hand, for tests of what is written of them."""

from dataclasses import replace
from functools import cache

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.regressor import Regressor
from pivident.robot.gallery import load_robot
from pivident.studies.collision.bodies import Body, Obstacle
from pivident.studies.excitation.design import (
    PAGE_RATE,
    ClearanceUse,
    Design,
    LimitUse,
    PredictedError,
)
from pivident.studies.excitation.motions import ExcitingMotion, MotionFamily

#: Standard deviation of the torque noise that the standard errors rest on [N m].
NOISE = 1.0


#: A box around the robot.
TABLE = Obstacle(
    "table <b>", "box", np.eye(3), np.array([0.6, 0.0, -0.3]), np.array([0.6, 0.9, 0.08])
)


@cache
def made_design(name="planar_2r", kind="fourier", duration=6.0, size=None, seed=1):
    """A design whose standard errors are those of its regressor, all else by hand."""
    robot = load_robot(name)
    rng = np.random.default_rng(seed)
    family = MotionFamily(
        kind, duration, size or {"fourier": 9, "splines": 10, "postures": 7}[kind]
    )
    coefficients = 0.4 * rng.standard_normal((family.size, robot.size))
    if kind == "fourier":
        coefficients *= 2.0
    motion = ExcitingMotion(family, coefficients)
    base = base_parameters(robot)
    q, dq, ddq = motion.sampled(PAGE_RATE)
    phi = Regressor.build(robot, base.parameters).matrix(q, dq, ddq)
    phi = np.asarray(phi).reshape(-1, len(base))
    theta = rng.standard_normal(len(base))
    theta[-1] = np.nan
    lost = 2  # one that nothing determines
    kept = np.delete(np.arange(len(base)), lost)
    covariance = NOISE**2 * np.linalg.pinv(phi[:, kept].T @ phi[:, kept])
    std = np.full(len(base), np.inf)
    std[kept] = np.sqrt(np.diag(covariance))
    correlation = np.full((len(base), len(base)), np.nan)
    correlation[np.ix_(kept, kept)] = covariance / np.outer(std[kept], std[kept])
    predicted = tuple(
        PredictedError(
            name=one,
            unit=p.unit,
            value=float(value),
            std=float(s),
            before=float(10.0 * s) if k % 3 else np.inf,
            wanted=k in (1, 4),
            alone=1.1 * float(s),
            size=max(abs(np.nan_to_num(float(value))), 0.1),
            remark="" if np.isfinite(s) else "its column vanishes: joint 1 does not turn fast",
        )
        for k, (one, p, value, s) in enumerate(
            zip(base.names, base.parameters, theta, std, strict=True)
        )
    )
    torque = (phi @ np.nan_to_num(theta)).reshape(len(q), robot.size, order="C")
    return Design(
        robot=robot,
        motion=motion,
        criterion="worst",
        cost=(np.inf, 0.034),
        cost_words="largest relative standard error",
        condition=(1240.0, 87.3),
        predicted=predicted,
        correlation=correlation,
        limits=limits(robot, motion, torque),
        clearances=(
            ClearanceUse("forearm and table <b>", 0.0223, 0.02, 1.37),
            ClearanceUse("upper arm and table <b>", 0.131, 0.02, 2.5),
        ),
        noise="Noise of 1 N m on every joint, white, at 1000 Hz.",
        notes=("The torque limit of joint 2 is assumed; see `--limits`.",),
        settings={"robot": name, "duration": duration, "parameters": [base.names[1]], "own": None},
        bodies=bodies(robot),
        obstacles=(TABLE,),
        seconds=12.5,
        torque=torque,
        torque_margin=np.full_like(torque, 0.1 * np.abs(torque).max()),
    )


def limits(robot, motion, torque):
    """Limits somewhat above what the motion needs; the second joint has two open ends."""
    found = []
    q, dq, ddq = motion.sampled(500.0)
    t = motion.times(500.0)
    for j, joint in enumerate(robot.joints):
        for quantity, unit, signal, room in (
            ("position", joint.position_unit, q, 1.3),
            ("speed", f"{joint.position_unit}/s", dq, 1.02 + 0.2 * j),
            ("acceleration", f"{joint.position_unit}/s²", ddq, 1.2),
            ("torque", joint.torque_unit, torque, 1.5),
        ):
            own = signal[:, j]
            bound = room * np.abs(own).max()
            found.append(
                LimitUse(
                    joint=joint.name,
                    quantity=quantity,
                    unit=unit,
                    low=-np.inf if (quantity, j) == ("acceleration", 1) else -bound,
                    high=np.inf if (quantity, j) == ("torque", 1) else bound,
                    least=float(own.min()),
                    largest=float(own.max()),
                    t=float(t[np.abs(own).argmax()] if signal is not torque else 0.5),
                    source="description",
                )
            )
    return tuple(found)


def bodies(robot):
    """A capsule from every joint to those that it carries, and one at the end."""
    found = [Body("stand", -1, np.zeros(3), np.array([0.0, 0.0, -0.2]), 0.07)]
    for i, joint in enumerate(robot.joints):
        ends = [j.translation for j in robot.joints if j.parent == i]
        end = ends[0] if ends else np.array([0.3, 0.0, 0.0] if robot.size == 2 else [0, 0, 0.1])
        found.append(Body(f"body of {joint.name}", i, np.zeros(3), end, 0.05))
    return tuple(found)


def named(design, *names):
    """The same design with other names of its joints."""
    robot = design.robot
    renamed = dict(zip(robot.joint_names, names, strict=True))
    joints = tuple(replace(joint, name=renamed[joint.name]) for joint in robot.joints)
    return replace(
        design,
        robot=replace(robot, joints=joints),
        limits=tuple(replace(use, joint=renamed[use.joint]) for use in design.limits),
    )
