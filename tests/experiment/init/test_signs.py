"""Signs of the torques in a draft: joints of which nothing is known follow the others."""

import numpy as np
import pytest

from pivident import load_robot
from pivident.experiment.init.torque_unit import (
    Comparison,
    compare,
    reversed_signs,
    torque_unit,
    undecided_signs,
)
from pivident.robot.urdf import parse_urdf
from tests.other_arms import Setting, make_log

ROBOT = load_robot("staubli_tx40")


def compared(factors, reversed_=(), right=()) -> Comparison:
    every = np.full(6, np.nan)
    every[: len(factors)] = factors
    return Comparison(every, 0.01 * np.abs(every), tuple(reversed_), tuple(right))


@pytest.mark.parametrize(
    ("found", "wrong", "undecided"),
    [
        (compared([-1, -1, -1, -1], reversed_=(4,)), [0, 1, 2, 3, 4, 5], [5]),
        (compared([-1, 1, -1, -1], reversed_=(4,)), [0, 2, 3, 4], [5]),
        (compared([-1, -1], right=(2,), reversed_=(3,)), [0, 1, 3], [4, 5]),
        (compared([1, 1]), [], [2, 3, 4, 5]),
        (compared([]), [], [0, 1, 2, 3, 4, 5]),
    ],
)
def test_undecided_joints_follow_only_where_all_others_are_reversed(found, wrong, undecided):
    assert undecided_signs(found) == undecided
    assert reversed_signs(found) == wrong


def test_a_sign_that_nothing_decides_is_assumed():
    unit = torque_unit(ROBOT, compared([-1, -1, -1, -1, -1]), "N m", False, None)
    assert unit.value == [-1.0] * 6 and unit.sure == "assumed"
    assert "nothing tells that of joint_6, which is taken that of the others" in unit.seen
    mixed = torque_unit(ROBOT, compared([-1, 1, 1, 1, 1]), "N m", False, None)
    assert mixed.value == [-1.0, 1.0, 1.0, 1.0, 1.0, 1.0] and mixed.sure == "assumed"
    assert "joint_6, which is taken as logged" in mixed.seen
    known = torque_unit(ROBOT, compared([-1] * 6), "N m", False, None)
    assert known.sure == "likely" and "nothing tells" not in known.seen
    right = torque_unit(ROBOT, compared([1, 1]), "N m", False, None)
    assert right.value == "N m" and right.sure == "certain"


def test_the_gain_of_a_joint_that_nothing_decides_has_the_sign_of_the_others():
    unit = torque_unit(ROBOT, compared([-2, -2, -2, -2]), "A", True, None)
    assert [entry["gain"] < 0 for entry in unit.value] == [True] * 6
    assert "nothing tells that of joint_5, joint_6" in unit.seen


def test_a_joint_whose_torque_says_nothing_follows_on_a_log():
    """All torques of an arm of Pinocchio's have the other sign; that of one is lost in noise."""
    setting = Setting("regular", 200.0, 20.0, 0.0, 0.005, "none", 0.8)
    log = make_log(6, setting, joints=4)
    tau = -log.tau
    tau[:, 3] = np.random.default_rng(1).standard_normal(len(tau))
    found = compare(parse_urdf(log.arm.urdf), log.q, tau, log.t)
    assert undecided_signs(found) == [3]
    assert reversed_signs(found) == [0, 1, 2, 3]
