import numpy as np

from pivident.loop.motion.motion import SpeedLimits
from pivident.robot.description import Coupling

DQ = np.array([[0.5, 0.05, 0.5, -0.5], [0.0, 1.0, -0.5, 0.5]])


def test_a_joint_is_left_out_while_it_stands_still():
    limits = SpeedLimits(np.array([0.1, 0.0]))
    np.testing.assert_array_equal(limits.moving(DQ), [[1, 0, 1, 1], [1, 1, 1, 1]])


def test_both_joints_of_a_coupled_motor_are_left_out_while_it_stands_still():
    limits = SpeedLimits(np.array([0.1, 0.0]), (Coupling(0, 1, 1.0),))
    np.testing.assert_array_equal(limits.moving(DQ), [[1, 0, 0, 0], [1, 1, 0, 0]])


def test_a_coupling_without_dry_friction_leaves_nothing_out():
    limits = SpeedLimits(np.array([0.1, 0.0]), (Coupling(0, 1, 1.0, coulomb=False),))
    np.testing.assert_array_equal(limits.moving(DQ), [[1, 0, 1, 1], [1, 1, 1, 1]])
