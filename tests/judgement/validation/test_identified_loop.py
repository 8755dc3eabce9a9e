"""Inertia and bandwidth of identified joints, with what is uncertain about them."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.forward import mass_matrix
from pivident.judgement.validation.identified_loop import (
    disagreement,
    identified_loop,
    inertia_ranges,
    too_slow_smoothers,
)
from pivident.loop.simulation.controllers import PD, PID, PythonController
from pivident.loop.simulation.joint_loop import JointLoop, joint_feedbacks
from tests.planar_results import LAW, planar_results
from tests.synthetic_identification import synthetic_identification


@pytest.fixture(scope="module")
def iv():
    return planar_results("iv")[0]


@pytest.fixture(scope="module")
def found(iv):
    return identified_loop(iv)


def in_loop(result, **changes):
    return identified_loop(replace(result, loop=replace(result.loop, **changes)))


def test_inertias_are_the_diagonal_of_the_mass_matrix(iv):
    postures = iv.recordings[0].q
    mass = mass_matrix(iv.robot, iv.parameters, iv.theta, postures)
    for j, own in enumerate(inertia_ranges(iv)):
        every = mass[:, j, j]
        assert own.mean == pytest.approx(every.mean(), rel=1e-2)
        for value, bound in ((own.lowest, every.min()), (own.highest, every.max())):
            assert value == pytest.approx(bound, rel=1e-2)
        assert own.lowest * (1 - 1e-9) <= own.mean <= own.highest * (1 + 1e-9)


def test_deviations_are_those_of_estimates_drawn_from_the_covariance(iv, found):
    rng = np.random.default_rng(1)
    draws = rng.multivariate_normal(iv.theta, iv.covariance, 150)
    inertia, bandwidth = np.zeros((2, 150, 2))
    feedbacks = joint_feedbacks(LAW, 1000.0, 2)
    names = list(iv.names)
    for k, theta in enumerate(draws):
        for j, own in enumerate(inertia_ranges(replace(iv, judged=None, theta=theta))):
            inertia[k, j] = own.mean
            viscous = theta[names.index(f"fv{j + 1}")]
            bandwidth[k, j] = JointLoop(own.mean, viscous, feedbacks[j]).bandwidth
    for j, joint in enumerate(found.joints):
        assert joint.inertia.std[1] == pytest.approx(inertia[:, j].std(), rel=0.2)
        assert joint.bandwidth_std == pytest.approx(bandwidth[:, j].std(), rel=0.2)
        assert joint.bandwidth == pytest.approx(bandwidth[:, j].mean(), rel=1e-3)


def test_range_over_the_postures_holds_the_bandwidth(found):
    shoulder, elbow = found.joints
    assert shoulder.slowest < shoulder.bandwidth < shoulder.fastest
    assert shoulder.fastest / shoulder.slowest > 1.05  # the elbow's posture changes its inertia
    assert elbow.fastest / elbow.slowest < 1.05
    assert found.fastest is elbow
    frequency = np.geomspace(1.0, 100.0, 20)
    for quantity in ("plant", "sensitivity", "complementary"):
        low, high = shoulder.band(quantity, frequency)
        own = np.abs(getattr(shoulder.loop, quantity)(frequency))
        assert (low <= own * (1 + 1e-6)).all() and (own <= high * (1 + 1e-6)).all()


def test_drive_gain_and_delay_are_part_of_the_loop(iv, found):
    gained = in_loop(iv, drive_gain=np.array([2.0, 1.0]), controller=PD([3000, 2500], [90, 60]))
    for a, b in zip(gained.joints, found.joints, strict=True):
        assert a.bandwidth == pytest.approx(b.bandwidth, rel=1e-9)
    record = iv.equations.records[0]
    recording = replace(record.kinematics.recording, drive_delay=1e-3)
    late = replace(record, kinematics=replace(record.kinematics, recording=recording))
    slower = identified_loop(replace(iv, equations=replace(iv.equations, records=(late,))))
    assert slower.delay == 1e-3
    assert slower.joints[1].loop.peak > 1.1 * found.joints[1].loop.peak


def test_least_squares_and_loaded_results_have_no_loop(iv):
    assert identified_loop(planar_results("ls")[0]) is None
    assert identified_loop(replace(iv, equations=None)) is None
    assert identified_loop(synthetic_identification()) is None


def test_what_cannot_be_drawn_says_why(iv):
    python = PythonController(lambda *x: x[1])
    none = in_loop(iv, controller=python)
    assert not none.joints and "Python function" in none.reason and none.fastest is None
    beside = in_loop(iv, controller=replace(python, linear=LAW))
    assert "the loop drawn is that of its linear law" in beside.notes[0]
    limited = in_loop(iv, limit=np.array([100.0, np.inf]))
    assert "below the limit" in limited.notes[0]
    assert "virtual" in in_loop(iv, reference="smoothed").notes[0]
    wild = in_loop(iv, controller=PID([6e7, 2500.0], [180.0, 60.0]))
    assert "not stable" in wild.joints[0].reason and np.isnan(wild.joints[0].bandwidth)
    assert not wild.joints[1].reason
    free = in_loop(iv, controller=PD([0.0, 2500.0], [0.0, 60.0]))
    assert "does not keep the joint on its reference" in free.joints[0].reason
    negative = identified_loop(replace(iv, judged=None, theta=-iv.theta))
    assert "not positive" in negative.joints[0].reason and negative.joints[0].loop is None


def test_a_rule_of_thumb_is_broken_clearly_or_not_at_all():
    assert disagreement(50.0, 50.0) == 0
    assert disagreement(50.0, 74.0) == 0
    assert disagreement(50.0, 76.0) == -1
    assert disagreement(50.0, 30.0) == 1
    assert disagreement(50.0, 79.0, spread=19.0) == 0


def test_smoothers_slower_than_the_loop_are_named(found):
    bandwidth = found.joints[1].bandwidth
    assert not too_slow_smoothers(found, [400.0, 400.0], 3)
    ((name, used, wanted),) = too_slow_smoothers(found, [400.0, 100.0], 3)
    assert (name, used) == (found.joints[1].name, 100.0)
    assert wanted == pytest.approx(bandwidth * 1000 ** (1 / 6))
