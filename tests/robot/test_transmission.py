import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.transmission import Transmission


def coupled():
    reduction = np.array([[32.0, 0, 0], [0, -48, 0], [0, 32, 32]])
    return Transmission(reduction, np.array([1.0, 2.0, 3.0]), np.array([0.1, 0.2, 0.3]))


@given(st.integers(0, 2**32 - 1))
def test_motor_and_joint_side_are_each_others_inverse(seed):
    rng = np.random.default_rng(seed)
    q, tau = rng.normal(size=(2, 20, 3))
    transmission = coupled()
    np.testing.assert_allclose(
        transmission.joint_positions(transmission.motor_positions(q)), q, atol=1e-12
    )
    np.testing.assert_allclose(
        transmission.joint_torques(transmission.motor_torques(tau)), tau, atol=1e-12
    )


@given(st.integers(0, 2**32 - 1))
def test_power_is_the_same_on_both_sides(seed):
    rng = np.random.default_rng(seed)
    dq, tau_motor = rng.normal(size=(2, 20, 3))
    transmission = coupled()
    dq_motor = dq @ transmission.reduction.T
    tau = transmission.joint_torques(tau_motor)
    np.testing.assert_allclose((tau * dq).sum(1), (tau_motor * dq_motor).sum(1), atol=1e-10)


def test_a_direct_drive_changes_nothing():
    q = np.random.default_rng(1).normal(size=(5, 2))
    direct = Transmission.direct(2)
    np.testing.assert_array_equal(direct.joint_positions(q), q)
    np.testing.assert_array_equal(direct.joint_torques(q), q)


def test_a_singular_reduction_is_refused():
    with pytest.raises(RobotDescriptionError, match="singular"):
        Transmission(np.ones((2, 2)), np.ones(2), np.zeros(2))
    with pytest.raises(RobotDescriptionError, match="singular"):
        Transmission(np.diag([1.0, 0.0]), np.ones(2), np.zeros(2))


def test_small_and_large_ratios_side_by_side_are_not_singular():
    Transmission(np.diag([6283.0, 1.0, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3]), np.ones(7), np.zeros(7))


@pytest.mark.parametrize("key", ["reduction", "drive_gain", "position_offset"])
def test_values_that_are_not_finite_are_refused(key):
    values = {"reduction": np.eye(2), "drive_gain": np.ones(2), "position_offset": np.zeros(2)}
    values[key].flat[0] = np.nan
    with pytest.raises(RobotDescriptionError, match=f"{key} holds NaN"):
        Transmission(**values)


def test_sizes_that_do_not_fit_are_refused():
    with pytest.raises(RobotDescriptionError, match="do not belong to the same joints"):
        Transmission(np.eye(3), np.ones(2), np.zeros(2))
