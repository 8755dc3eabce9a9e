"""Arms on a force sensor, robots on a cable and on measured feet: records made by MuJoCo.

Everything that is measured besides the joints comes from MuJoCo: the wrench between the base and
the ground, the pose of a free base, the forces at tools, cables and feet. The masses are drawn,
physically possible, and known.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import mujoco
import numpy as np
from benchmarks.mujoco_mechanism import SUBSTEPS, friction_of, mujoco_spec, quaternion

from pivident.data.recording.measured_wrenches import with_wrenches
from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.robot.description import Link, Robot
from pivident.robot.measured_base import rotations_from_quaternions, with_wrench_sensors
from pivident.robot.wrench_sensor import WrenchSensor

#: Force at a sensor's origin in the world [N] from time [s], its position [m] and speed [m/s].
Force = Callable[[float, np.ndarray, np.ndarray], np.ndarray]


@dataclass(frozen=True)
class Push:
    """A sensor, and the force that it measures; None: what holds the base."""

    sensor: WrenchSensor
    force: Force | None = None


@dataclass(frozen=True)
class Accuracy:
    """Standard deviations of the measurements."""

    encoder: float = 2e-5  # [rad]
    torque: float = 0.0  # [N m]
    force: float = 0.5  # [N], moments a tenth [N m]
    position: float = 1e-4  # of a floating base [m]
    rotation: float = 1e-4  # likewise [rad]


def physical_body(rng: np.random.Generator, mass: float, size: float) -> np.ndarray:
    """Ten inertial parameters of a body that can exist: eight points of mass in a box."""
    share = rng.dirichlet(np.ones(8)) * mass
    points = rng.uniform(-0.5, 0.5, (8, 3)) * size
    total = np.zeros(10)
    for m, (x, y, z) in zip(share, points, strict=True):
        total += m * np.array(
            [y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y, x, y, z, 1.0]
        )
    return total


def with_drawn_masses(robot: Robot, masses: Sequence[float], size: float, seed: int) -> Robot:
    """A robot whose bodies are drawn; bodies that are none stay so."""
    rng = np.random.default_rng(seed)
    wanted = iter(masses)
    links = [
        Link(link.name, physical_body(rng, next(wanted), size)) if link.is_body else link
        for link in robot.links
    ]
    return replace(robot, links=tuple(links))


def truth_of(robot: Robot) -> dict[str, float]:
    """Base parameters of a description, by name."""
    base = base_parameters(robot)
    values = base.values(nominal_values(robot, base.standard))
    return dict(zip(base.names, values.tolist(), strict=True))


def mujoco_base_record(
    robot: Robot,
    q_ref: np.ndarray,
    rate: float,
    gains: tuple[np.ndarray, np.ndarray],
    pushes: Sequence[Push],
    seed: int,
    accuracy: Accuracy | None = None,
    height: float = 0.0,
) -> Recording:
    """A PD law with noisy encoders, u = kp e + kd (dq_ref - dq̂), held over each period.

    ``q_ref``: of the joints with motors, shape (samples, joints); ``height``: of a free base at the
    start [m].
    """
    std = accuracy or Accuracy()
    rng = np.random.default_rng(seed)
    driven = robot.on_fixed_base
    spec = mujoco_spec(robot, 1.0 / (rate * SUBSTEPS))
    held = add_sites(spec, robot, pushes)
    for name in driven.joint_names:  # friction that is late by half a step feels like inertia
        spec.joint(name).damping[0] = driven.friction_nominal.get(viscous_name(driven, name), 0.0)
    model = spec.compile()
    data = mujoco.MjData(model)
    names = driven.joint_names
    at = [model.joint(name).qposadr[0] for name in names]
    moving = [model.joint(name).dofadr[0] for name in names]
    sites = [model.site(push.sensor.name) for push in pushes]
    free = robot.base_motion == "measured"
    if free:
        data.qpos[2] = height
    data.qpos[at] = q_ref[0]
    law = friction_of(without_viscous(driven))
    samples, n = q_ref.shape
    noise = std.encoder * rng.normal(size=q_ref.shape)
    q, tau = np.zeros_like(q_ref), np.zeros_like(q_ref)
    pose = np.zeros((samples, 7))
    fine = {push.sensor.name: np.zeros((samples * SUBSTEPS, 6)) for push in pushes}
    kp, kd = gains
    before, dq_ref = q_ref[0] + noise[0], np.vstack([np.zeros(n), np.diff(q_ref, axis=0)]) * rate
    speed = np.zeros(6)
    for k in range(samples):
        heard = data.qpos[at] + noise[k]
        rate_of = (heard - before) * rate if k else np.zeros(n)
        before = heard
        u = kp * (q_ref[k] - heard) + kd * (dq_ref[k] - rate_of)
        q[k], tau[k] = heard, u
        if free:
            pose[k] = data.qpos[:7]
        for step in range(SUBSTEPS):
            mujoco.mj_kinematics(model, data)
            mujoco.mj_comPos(model, data)
            mujoco.mj_comVel(model, data)
            data.qfrc_applied[:] = 0.0
            data.qfrc_applied[moving] = u - law(data.qvel[moving])
            for push, site in zip(pushes, sites, strict=True):
                if push.force is None:
                    continue
                place = data.site(site.id)
                mujoco.mj_objectVelocity(model, data, mujoco.mjtObj.mjOBJ_SITE, site.id, speed, 0)
                force = push.force(k / rate + step * model.opt.timestep, place.xpos, speed[3:])
                body = model.site_bodyid[site.id]
                mujoco.mj_applyFT(
                    model, data, force, np.zeros(3), place.xpos, body, data.qfrc_applied
                )
                fine[push.sensor.name][k * SUBSTEPS + step, :3] = place.xmat.reshape(3, 3).T @ force
            if held is not None:
                mujoco.mj_forward(model, data)
                fine[held.sensor.name][k * SUBSTEPS + step] = data.sensordata
            mujoco.mj_step(model, data)
    wrench = {}
    for sensor in (push.sensor for push in pushes):
        # it averages over the period around its instant: between them a torque that is held makes a
        # ripple, which samples would turn into an offset that goes with the torque's slope
        around = np.pad(fine[sensor.name], ((SUBSTEPS // 2, SUBSTEPS), (0, 0)), mode="edge")
        means = around[: samples * SUBSTEPS].reshape(samples, SUBSTEPS, 6).mean(axis=1)
        sizes = std.force * np.array([1.0] * 3 + [0.1] * 3)
        wrench[sensor.name] = sensor.sign * means + sizes * rng.normal(size=means.shape)
    measured = None
    if free:
        position = pose[:, :3] + std.position * rng.normal(size=(samples, 3))
        rotation = rotations_from_quaternions(pose[:, [4, 5, 6, 3]])
        turn = std.rotation * rng.normal(size=(samples, 3))
        measured = position, rotation @ rotations_from_quaternions(_small_turns(turn))
    tau = tau + std.torque * rng.normal(size=tau.shape)
    recording = Recording(
        f"{robot.name} {seed}", names, q, tau, rate, q_ref=q_ref, dq_ref=dq_ref, control_rate=rate
    )
    robot = with_wrench_sensors(robot, [push.sensor for push in pushes])
    return with_wrenches(recording, robot, wrench, measured)


def viscous_name(robot: Robot, joint: str) -> str:
    """Name of its viscous friction."""
    return f"fv{robot.label(robot.joint_names.index(joint))}"


def without_viscous(robot: Robot) -> Robot:
    """The robot with what MuJoCo does not have: dry friction and offsets."""
    left = {k: v for k, v in robot.friction_nominal.items() if not k.startswith("fv")}
    return replace(robot, friction_nominal=left)


def _small_turns(turn: np.ndarray) -> np.ndarray:
    """Quaternions x y z w of small rotation vectors."""
    return np.column_stack([0.5 * turn, np.sqrt(1.0 - np.sum((0.5 * turn) ** 2, axis=1))])


def add_sites(spec: mujoco.MjSpec, robot: Robot, pushes: Sequence[Push]) -> Push | None:
    """A site for each sensor, and MuJoCo's own sensors under the base; the push that has them."""
    held = None
    for push in pushes:
        own = push.sensor
        base = own.link == "base"
        body = spec.body("base" if base else robot.joints[robot.link_index(own.link)].name)
        body.add_site(name=own.name, pos=own.frame.translation, quat=quaternion(own.frame.rotation))
        if push.force is None:
            held = push
            for kind in (mujoco.mjtSensor.mjSENS_FORCE, mujoco.mjtSensor.mjSENS_TORQUE):
                spec.add_sensor(type=kind, objtype=mujoco.mjtObj.mjOBJ_SITE, objname=own.name)
    return held
