"""The parts of benchmarks/mujoco_sysid against MuJoCo itself and closed forms."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.direction import ParametrisedLoop

mujoco = pytest.importorskip("mujoco")

from benchmarks.mujoco_sysid.arm import STEP, mjcf, reference, wrong  # noqa: E402
from benchmarks.mujoco_sysid.judge import Judge, case  # noqa: E402
from benchmarks.mujoco_sysid.own import (  # noqa: E402
    PositionActuators,
    fitted,
    named,
    problem_of,
    robot_of,
)
from benchmarks.mujoco_sysid.peer import RESIDUALS, bodies_in, identified  # noqa: E402
from benchmarks.mujoco_sysid.record import ENCODER, TORQUE, measured, simulated  # noqa: E402
from benchmarks.mujoco_sysid.unidentifiable import cad, real, seven_axes  # noqa: E402

SECONDS = 4.0


@pytest.fixture(scope="module")
def viscous():
    return case(None)


@pytest.fixture(scope="module")
def true(viscous):
    return simulated(viscous.bodies, reference(1, SECONDS))


@pytest.fixture(scope="module")
def judge(viscous):
    return Judge.of(viscous, simulated(viscous.bodies, reference(2, SECONDS)))


def test_the_loop_is_that_of_mujocos_position_actuators(viscous, true):
    robot = robot_of(viscous.bodies, viscous.law)
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    chain = viscous.bodies.chain
    signals = LoopSignals(
        1.0 / STEP, true.u, None, None, None, np.ones(3), np.full(3, np.inf), np.full(3, 0.5),
        np.full(3, 50.0),
    )  # fmt: skip
    law = PositionActuators(chain.kp, chain.kv)
    loop = ParametrisedLoop(robot, base.parameters, theta, law, signals)
    start = true.start, np.zeros(3)
    made = simulate(loop.model, loop.controller, signals, robot.joint_names, start)
    assert np.abs(made.q - true.q).max() < 0.5 * ENCODER
    # the last period has no end in the record
    assert (np.abs(made.tau - true.mean_torque)[:-1].max(axis=0) < 0.2 * TORQUE).all()


def test_the_drives_log_the_mean_of_their_torque(viscous, true):
    # one period again in 200 steps, its torque the mean of the sensor's
    chain, k = viscous.bodies.chain, 700
    text = mjcf(viscous.bodies).replace(f'timestep="{STEP}"', f'timestep="{STEP / 200}"')
    model = mujoco.MjModel.from_xml_string(text)
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.ctrl[:] = true.q[k], true.dq[k], true.u[k]
    torques = []
    for _ in range(200):
        mujoco.mj_forward(model, data)
        torques.append(data.actuator_force.copy())
        mujoco.mj_step(model, data)
    mujoco.mj_forward(model, data)
    torques.append(data.actuator_force.copy())
    mean = np.trapezoid(torques, axis=0) / 200.0
    np.testing.assert_allclose(true.mean_torque[k], mean, atol=2e-3)
    first = chain.kp * (true.u[k] - true.q[k]) - chain.kv * true.dq[k]
    np.testing.assert_allclose(true.torque[k], first, atol=1e-9)


def test_a_file_and_its_bodies_are_the_same(viscous):
    model = mujoco.MjModel.from_xml_string(mjcf(viscous.bodies))
    found = bodies_in(model, viscous.bodies.chain)
    for name in ("mass", "centre", "inertia", "armature", "damping", "friction"):
        expected = getattr(viscous.bodies, name)
        np.testing.assert_allclose(getattr(found, name), expected, atol=1e-12)


def test_predictions_of_the_truth_have_no_error(viscous, judge):
    truth = judge.theta(viscous.bodies)
    assert judge.predicted(truth) == 0.0
    # all parameters 1 % more: 1 % more torque
    assert judge.predicted(1.01 * truth) == pytest.approx(0.01)
    heavier = replace(viscous.bodies, damping=1.1 * viscous.bodies.damping)
    changed = judge.theta(heavier) / truth
    np.testing.assert_allclose(changed[judge.groups()["damping"]], 1.1)
    np.testing.assert_allclose(changed[judge.groups()["inertial"]], 1.0)


def test_simulation_error_finds_the_arm_from_the_wrong_file(viscous, true, judge):
    fit = fitted(problem_of(measured(true, 3), wrong(viscous.bodies), viscous.law), named("ml"))
    z = (fit.result.theta - judge.theta(viscous.bodies)) / fit.result.std
    assert fit.result.converged
    assert np.mean(np.abs(z) < 2.0) > 0.8 and np.abs(z).max() < 5.0
    assert judge.predicted(fit.result.theta) < 2e-3
    assert judge.predicted(judge.theta(wrong(viscous.bodies))) > 0.1


def test_the_other_program_agrees(viscous, true, judge):
    for needed in ("absl", "colorama", "tabulate"):
        pytest.importorskip(needed, reason='needs pip install "mujoco[sysid]"')
    fit = identified(
        measured(true, 3), viscous.bodies, RESIDUALS["positions, torques"], weighted=True,
        friction=False, max_iterations=4,
    )  # fmt: skip
    off = judge.theta(fit.bodies) - judge.theta(viscous.bodies)
    half = fit.half_of(judge.theta)
    assert np.mean(np.abs(off) < half) > 0.8 and judge.predicted(judge.theta(fit.bodies)) < 2e-3
    assert fit.simulations > 33 * fit.passes


def test_the_unidentifiable_arm_is_as_far_from_its_file_as_the_issue_says():
    file, arm = cad(), real()
    assert arm.mass[6] / file.mass[6] == pytest.approx(4.24)
    away = np.linalg.norm(arm.centre - file.centre, axis=1)
    assert np.count_nonzero(away > 0.05) == 6
    # MuJoCo refuses bodies whose moments of inertia break the triangle inequality
    model = mujoco.MjModel.from_xml_string(mjcf(arm))
    np.testing.assert_allclose(bodies_in(model, seven_axes()).inertia, arm.inertia, atol=1e-12)
