import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Coupling
from pivident.robot.drives import with_drives
from pivident.robot.gallery import load_robot
from pivident.robot.modified_dh import parse_modified_dh

ARM = load_robot("planar_2r")


def test_drives_are_given_in_order_or_by_name():
    in_order = with_drives(ARM, rotor_inertia=[0.5, 0.7], reduction=[30, -40])
    by_name = with_drives(ARM, rotor_inertia={"elbow": 0.7}, reduction={"elbow": -40})
    np.testing.assert_array_equal(in_order.rotor_inertia, [0.5, 0.7])
    np.testing.assert_array_equal(by_name.rotor_inertia, [ARM.rotor_inertia[0], 0.7])
    np.testing.assert_array_equal(in_order.transmission.reduction, np.diag([30.0, -40.0]))
    np.testing.assert_array_equal(by_name.transmission.reduction, np.diag([1.0, -40.0]))


def test_what_is_not_given_stays_as_it_is():
    changed = with_drives(ARM, drive_gain=[2.0, 3.0])
    np.testing.assert_array_equal(changed.rotor_inertia, ARM.rotor_inertia)
    np.testing.assert_array_equal(changed.transmission.drive_gain, [2.0, 3.0])
    assert changed.couplings == ARM.couplings


def test_a_coupling_between_names_takes_its_ratio_from_the_reduction():
    reduction = [[10.0, 0.0], [-20.0, 40.0]]
    robot = with_drives(ARM, reduction=reduction, couplings=[("elbow", "shoulder")])
    assert robot.couplings == (Coupling(motor=1, joint=0, ratio=-0.5),)


def test_a_coupling_that_the_reduction_does_not_know_has_ratio_one():
    robot = with_drives(ARM, couplings=[("elbow", "shoulder")])
    assert robot.couplings[0].ratio == 1.0


def test_a_coupling_object_is_taken_as_it_is():
    coupling = Coupling(1, 0, 0.25, inertia=False)
    assert with_drives(ARM, couplings=[coupling]).couplings == (coupling,)


@pytest.mark.parametrize(
    ("drives", "message"),
    [
        ({"rotor_inertia": {"elbwo": 1.0}}, "no joint 'elbwo'; did you mean 'elbow'"),
        ({"rotor_inertia": [1.0]}, "shape \\(1,\\) for 2 moving joints"),
        ({"rotor_inertia": [1.0, -2.0]}, "joint 'elbow' is -2; it cannot be negative"),
        ({"drive_gain": [np.nan, 1.0]}, "drive_gain of joint 'shoulder' is not finite"),
        ({"position_offset": ["a", "b"]}, "position_offset = .* is not an array of numbers"),
        ({"drive_gain": {"elbow": "big"}}, "drive_gain = 'big' is not an array of numbers"),
        ({"reduction": [1.0, 0.0]}, "reduction of joint 'elbow' is 0"),
        ({"reduction": [[1.0, 0.0]]}, "shape \\(1, 2\\); with 2 moving joints \\(2, 2\\)"),
        ({"reduction": [[1.0], [0.0, 1.0]]}, "is not an array of numbers"),
        ({"reduction": [[1.0, 1.0], [1.0, 1.0]]}, "singular"),
        ({"couplings": [("elbow", "knee")]}, "there is no joint 'knee'"),
        ({"couplings": [("elbow", "elbow")]}, "two different joints"),
    ],
)
def test_drives_that_do_not_fit_the_robot_are_refused(drives, message):
    with pytest.raises(RobotDescriptionError, match=message):
        with_drives(ARM, **drives)


def test_it_is_known_which_drive_gains_somebody_gave():
    arm = parse_modified_dh('name = "two"\n[[joints]]\nname = "a"\n[[joints]]\nname = "b"\n')
    assert not arm.transmission.gain_given.any()
    one, both = with_drives(arm, drive_gain={"b": 1.0}), with_drives(arm, drive_gain=[1.0, 1.0])
    assert one.transmission.gain_given.tolist() == [False, True]
    assert both.transmission.gain_given.all()
    assert with_drives(both, reduction=[9, 9]).transmission.gain_given.all()
