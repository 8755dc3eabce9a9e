"""Filters beside the robot: memory, errors, and what they refuse."""

import gc
import tracemalloc
from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.estimation.literature.filters import (
    KalmanFilter,
    RecursiveInstruments,
    RecursiveLeastSquares,
)
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.foundation.errors import ExperimentError, FilterDiverged, IdentificationError
from pivident.robot.friction import FrictionLaw, dahl, viscous
from pivident.robot.gallery import load_robot
from tests.estimation.literature.filters.scenes import RATE, planar_problem

METHODS = [ExtendedKalman(), UnscentedKalman(square_root=True), CentralDifferenceKalman()]


def made(problem, truth, method=None, **options):
    spread = 0.02 * np.abs(truth) + 1e-3
    known = {"rate": RATE, "encoder_std": 2e-6, "torque_std": 0.05, "method": method}
    return KalmanFilter(
        problem.robot,
        problem.regressor.parameters,
        options.pop("theta", truth),
        options.pop("covariance", np.diag(spread**2)),
        **(known | options),
    )


@pytest.fixture(scope="module")
def arm():
    return planar_problem(samples=1500)


def growth(update, count=10_000):
    """Memory that more updates hold, for each of them [bytes]: an object would be 50 or more."""
    for k in range(20):
        update(k)
    gc.collect()
    tracemalloc.start()
    update(20)
    first = tracemalloc.get_traced_memory()[0]
    for k in range(count):
        update(k % 100)
    gc.collect()
    held, _ = tracemalloc.get_traced_memory()
    tracemalloc.stop()
    return (held - first) / count


@pytest.mark.parametrize("method", METHODS, ids=lambda method: type(method).__name__)
def test_memory_does_not_grow(arm, method):
    problem, theta = arm
    recording = problem.recordings[0]
    kalman = made(problem, theta, method, encoder_std=1.0)
    update = lambda k: kalman.update(recording.q[k], recording.tau[max(k - 1, 0)])  # noqa: E731
    # what an update holds grows every time; what others in the process allocate meanwhile does not
    assert growth(update) < 10.0 or growth(update) < 10.0


def test_one_at_a_time_is_all_at_once(arm):
    problem, theta = arm
    recording = problem.recordings[0]
    one, all_ = made(problem, theta), made(problem, theta)
    for k in range(200):
        one.update(recording.q[k], recording.tau[max(k - 1, 0)])
    all_.start(recording.q[0])
    z, s = all_.run(recording.q[1:200], recording.tau[:199])
    np.testing.assert_array_equal(one.theta, all_.theta)
    np.testing.assert_array_equal(one.covariance, all_.covariance)
    np.testing.assert_array_equal(one.innovation, z[-1])
    assert one.q.shape == one.dq.shape == (2,) and (s > 0.0).all()


def test_a_filter_that_diverges_names_sample_and_innovation(arm):
    problem, theta = arm
    q = problem.recordings[0].q.copy()
    q[60, 1] += 0.1
    kalman = made(problem, theta)
    with pytest.raises(FilterDiverged, match=r"sample 60, joint 'elbow': the innovation") as caught:
        for k in range(100):
            kalman.update(q[k], problem.recordings[0].tau[max(k - 1, 0)])
    assert caught.value.sample == 60 and abs(caught.value.innovation) > 100.0


def test_a_mass_matrix_that_is_none_is_named(arm):
    problem, theta = arm
    kalman = made(problem, theta, theta=-theta)
    kalman.update(problem.recordings[0].q[0], np.zeros(2))
    with pytest.raises(FilterDiverged, match=r"sample 1, .*mass matrix .* not positive definite"):
        kalman.update(problem.recordings[0].q[1], np.zeros(2))


def test_bad_input_is_refused(arm):
    problem, theta = arm
    count = theta.size
    indefinite = np.eye(count)
    indefinite[0, 1] = indefinite[1, 0] = 2.0
    for covariance in (indefinite, np.zeros((count, count)), np.triu(np.ones((count, count)))):
        with pytest.raises(IdentificationError, match="not symmetric and positive definite"):
            made(problem, theta, covariance=covariance)
    with pytest.raises(IdentificationError, match="are needed"):
        made(problem, theta, covariance=np.eye(3))
    with pytest.raises(IdentificationError, match="not finite"):
        made(problem, theta, theta=np.full(count, np.nan))
    with pytest.raises(IdentificationError, match=r"encoder_std is 0.0; it has to be positive"):
        made(problem, theta, encoder_std=0.0)
    with pytest.raises(IdentificationError, match=r"torque_std has shape \(3,\)"):
        made(problem, theta, torque_std=np.ones(3))
    with pytest.raises(IdentificationError, match="call start"):
        made(problem, theta).run(np.zeros((1, 2)), np.zeros((1, 2)))


def test_friction_with_a_memory_is_refused():
    robot = load_robot("planar_2r")
    joint = replace(robot.joints[0], friction=FrictionLaw((viscous(), dahl(1e-3))))
    robot = replace(robot, joints=(joint, robot.joints[1]))
    with pytest.raises(ExperimentError, match="memory"):
        robot_equations(robot, base_parameters(robot).parameters)


def test_memory_of_recursions_does_not_grow(arm):
    problem, _ = arm
    recording, parameters = problem.recordings[0], problem.regressor.parameters
    least = RecursiveLeastSquares.of_robot(problem.robot, parameters, forgetting=0.999)
    instruments = RecursiveInstruments.of_robot(problem.robot, parameters)
    motion = np.zeros((3, 2))

    def update(k):
        motion[:] = recording.q[k]
        least.update_motion(*motion, recording.tau[k])
        instruments.update_motion(*motion, recording.tau[k], tuple(motion))

    assert growth(update) < 10.0
