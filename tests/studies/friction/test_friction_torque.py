"""Friction torque: own friction of the estimate plus residual, whatever the law was."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.experiment import load_experiment
from pivident.studies.friction.friction_torque import friction_torques
from tests.friction_columns import friction_columns
from tests.planar_log import planar_truth, write_experiment


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return load_experiment(write_experiment(tmp_path_factory.mktemp("planar"))).problem()


def test_true_law_comes_back(problem):
    truth = planar_truth()
    for j, torque in enumerate(friction_torques(problem, identify(problem, "ls")), start=1):
        law = problem.robot.joints[j - 1].friction
        theta = [truth[f"{term.stem}{j}"] for term in law.terms]
        expected = friction_columns(law, torque.dq) @ theta
        error = (torque.tau - expected)[torque.moving]
        assert np.sqrt(np.mean(error**2)) < 0.08 * torque.level  # noise of the acceleration
        for sign in (-1.0, 1.0):
            own = torque.direction[torque.moving] == sign
            assert abs(error[own].mean()) < 0.01 * torque.level
        assert torque.torque_unit == "N m" and torque.rate == pytest.approx(1000.0)
        assert torque.moving.any() and not torque.moving.all()
        assert set(np.unique(torque.direction)) == {-1.0, 0.0, 1.0}
        assert 0.0 < torque.load_std < torque.level


def test_friction_that_the_law_lacks_is_in_it(problem):
    recording = problem.recordings[0]
    dq = np.gradient(recording.q[:, 1], 1.0 / recording.rate)
    extra = np.zeros_like(recording.tau)
    extra[:, 1] = 2.0 * np.exp(-((dq / 0.4) ** 2)) * np.tanh(dq / 0.01)
    more = replace(problem, recordings=(replace(recording, tau=recording.tau + extra),))
    plain = friction_torques(problem, identify(problem, "ls"))[1]
    stuck = friction_torques(more, identify(more, "ls"))[1]
    slow = stuck.moving & (np.abs(stuck.dq) < 0.2)
    change = (stuck.tau - plain.tau)[slow] * np.sign(stuck.dq[slow])
    assert np.mean(change) == pytest.approx(1.85, abs=0.25)


def test_recordings_stay_apart(problem):
    first = problem.recordings[0]
    twice = replace(problem, recordings=(first, replace(first, name="again")))
    torque = friction_torques(twice, identify(twice, "ls"))[0]
    assert np.unique(torque.record).tolist() == [0, 1]
    a, b = torque.pieces(torque.tau)
    np.testing.assert_allclose(a, b)
    assert np.isnan(a).any()


def test_standstill_is_a_share_of_the_rated_speed(problem):
    found = identify(problem, "ls")
    usual, wide = (friction_torques(problem, found, share)[0] for share in (None, 0.1))
    assert wide.standstill == pytest.approx(10 * usual.standstill)
    assert wide.moving.sum() < usual.moving.sum()
