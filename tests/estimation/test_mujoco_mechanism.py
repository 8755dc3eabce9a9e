"""Estimates on records of mechanisms that another simulator has made."""

import numpy as np
import pytest

pytest.importorskip("mujoco")

from benchmarks.closed_mechanisms import ENCODER, RATE, gains_of, reference
from benchmarks.mujoco_mechanism import mujoco_record, truth_of

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot


@pytest.mark.parametrize(
    ("name", "method"),
    [
        ("five_bar", "piv"),
        ("orthoglide", "piv"),
        ("five_bar", "cloe"),
        ("five_bar", "ml"),
        ("five_bar", "ekf"),
    ],
)
def test_methods_find_what_mujoco_was_given(name, method):
    robot = load_robot(name)
    q_ref = reference(robot, 5.0)
    gains = gains_of(robot, q_ref[0])
    made = mujoco_record(robot, q_ref, RATE, gains, np.full(robot.size, ENCODER / 4.0), 1)
    assert made.gap < 1e-7
    spread = 0.002 * np.array([joint.torque_limit for joint in robot.joints])
    tau = made.tau + spread * np.random.default_rng(2).normal(size=made.tau.shape)
    record = Recording(name, robot.joint_names, made.q, tau, RATE, q_ref=q_ref)
    problem = Problem(robot, (record,), Loop(PD(kp=gains[0], kd=gains[1])))
    base, truth = truth_of(robot)
    result = identify(problem, METHODS[method])
    off = (result.theta - truth) / result.std
    assert result.converged and np.abs(off).max() < 4.0
    assert np.mean(np.abs(off) < 2.0) > 0.7
    heavy = [k for k, p in enumerate(base.parameters) if p.stem == "fc"]
    np.testing.assert_allclose(result.theta[heavy], truth[heavy], rtol=0.1)
