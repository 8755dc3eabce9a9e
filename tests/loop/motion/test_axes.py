"""Which axis is time: the first in a recording and in predictions, the last in the equations."""

import numpy as np
import pytest

import pivident as pv
from pivident.estimation.kinematics import estimate_kinematics
from tests.planar_log import RATE, nominal_parameters, planar_motion, planar_record

SAMPLES = 2000


@pytest.fixture(scope="module")
def recording():
    rng = np.random.default_rng(5)
    reference = planar_motion(rng, RATE, SAMPLES)
    q, tau = planar_record(*nominal_parameters(), reference, RATE, rng)
    return pv.Recording("arm", ("shoulder", "elbow"), q, tau, RATE)


def test_time_is_first_in_a_recording_and_in_predictions(recording):
    problem = pv.Problem(pv.load_robot("planar_2r"), (recording,))
    result = pv.identify(problem, "ls")
    at_rest = np.zeros_like(recording.q)
    assert recording.q.shape == recording.tau.shape == (SAMPLES, 2)
    assert result.predict(recording.q, at_rest, at_rest).shape == (SAMPLES, 2)


@pytest.mark.parametrize("recipe", [pv.RandomWalk(), pv.Bandpass()])
def test_time_is_last_in_the_equations_and_each_joint_lies_in_one_piece(recording, recipe):
    motion = estimate_kinematics(recording, recipe)
    for signal in (motion.q, motion.dq, motion.ddq, motion.tau):
        assert signal.shape == (2, SAMPLES) and signal[0].flags.c_contiguous
    np.testing.assert_allclose(motion.q.T[500:-500], recording.q[500:-500], atol=1e-3)
