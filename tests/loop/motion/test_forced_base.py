"""Accelerations of a floating base from the forces on it, against a motion that is known."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.loop.instruments.interleaved_halves import interleaved_instruments
from pivident.loop.motion.motion import Kinematics
from pivident.loop.motion.simulated_detail import with_forced_detail
from pivident.robot.description import Link
from pivident.robot.gallery import load_robot
from pivident.robot.measured_base import with_floating_base
from pivident.signals.instants import differences_at_instants
from pivident.signals.random_walk import WalkSmoother
from pivident.signals.random_walk_model import nvr_from_f50

RATE, SAMPLES = 500.0, 2000

#: Band of the smoothers of the base [Hz], and where the jolts are that they take.
BAND, JOLTS = 5.0, 8.0

#: Samples at both ends that smoothers spoil.
ENDS = slice(200, -200)


@pytest.fixture(scope="module")
def robot():
    """A box that floats, with two links."""
    inertia = np.array([0.4, 0.01, 0.02, 0.5, -0.01, 0.6, 0.2, -0.1, 0.3, 8.0])
    return with_floating_base(load_robot("planar_2r"), Link("base", inertia))


def smoother(band):
    return WalkSmoother(nvr_from_f50(band, 3, RATE), 3)


def motion(robot):
    """Positions of all joints with their exact speeds and accelerations, (3, joints, samples)."""
    rng, t = np.random.default_rng(6), np.arange(SAMPLES) / RATE
    out = np.zeros((3, robot.size, SAMPLES))
    for frequency, size in ((0.7, 0.2), (1.3, 0.1), (JOLTS, 0.002)):
        w = 2.0 * np.pi * frequency
        for j, phase in enumerate(rng.uniform(0.0, 2.0 * np.pi, robot.size)):
            own = np.sin(w * t + phase), w * np.cos(w * t + phase), -(w**2) * np.sin(w * t + phase)
            out[:, j] += size * np.array(own)
    return out


def problem(robot, legs=100.0):
    """Regressor, parameters, the motion with its base smoothed, and its true accelerations."""
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    regressor = regressor_of(robot, parameters)
    q, dq, ddq = motion(robot)
    tau = regressor.torque(q.T, dq.T, ddq.T, theta).T
    smoothers = tuple(smoother(BAND if j < 6 else legs) for j in range(robot.size))
    smoothed = np.stack([s.smoothed(x) for s, x in zip(smoothers, q, strict=True)])
    speed, acceleration = np.empty((2, *q.shape))
    differences_at_instants(smoothed, RATE, 0, speed, acceleration)
    recording = Recording(
        "floating", robot.joint_names, q.T, tau.T, RATE, allow_constant=True, saturation="allow"
    )
    f50 = np.array([s.band(RATE) for s in smoothers])
    kin = Kinematics(
        recording, smoothed, speed, acceleration, tau, 200, SAMPLES - 200, f50, np.full(8, 1e-4),
        (), smoothers,
    )  # fmt: skip
    return regressor, theta, kin, ddq


def error(kin, ddq):
    """Error of the base's accelerations relative to them, by joint."""
    off = (kin.ddq - ddq)[:6, ENDS]
    return np.linalg.norm(off, axis=1) / np.linalg.norm(ddq[:6, ENDS], axis=1)


def test_forces_give_back_what_the_smoother_takes(robot):
    regressor, theta, kin, ddq = problem(robot)
    assert error(kin, ddq).min() > 0.2
    whole = with_forced_detail(regressor, kin, theta)
    assert error(whole, ddq).max() < 0.04
    np.testing.assert_array_equal(whole.ddq[6:], kin.ddq[6:])
    np.testing.assert_array_equal(whole.dq, kin.dq)


def test_beyond_the_band_of_the_legs_nothing_is_given_back(robot):
    """What a leg does there is not known, and would be taken for a motion of the base."""
    regressor, theta, kin, ddq = problem(robot, legs=JOLTS)
    changed = with_forced_detail(regressor, kin, theta)
    added, jolts = (changed.ddq - kin.ddq)[:6, ENDS], (ddq - kin.ddq)[:6, ENDS]
    assert np.linalg.norm(added) < 0.1 * np.linalg.norm(jolts)


def test_nothing_is_given_back_to_a_base_that_no_force_could_accelerate(robot):
    regressor, theta, kin, _ = problem(robot)
    assert with_forced_detail(regressor, kin, np.zeros_like(theta)) is kin
    unknown = replace(kin, smoothers=())
    assert with_forced_detail(regressor, unknown, theta) is unknown


def test_halves_know_what_has_smoothed_them(robot):
    """A smoother is linear: what it makes of the samples is what the half is."""
    _, _, kin, _ = problem(robot)
    (half,) = interleaved_instruments([kin]).regressors
    for j, own in enumerate(half.smoothers):
        again = own.smoothed(kin.recording.q[:, j])
        np.testing.assert_allclose(again[ENDS], half.q[j, ENDS], rtol=0, atol=1e-9)
        np.testing.assert_allclose(own.smoothed(np.arange(SAMPLES) ** 2), np.arange(SAMPLES) ** 2)
