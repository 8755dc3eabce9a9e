"""What a design assumes where nothing is known, and what it says of that."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf
from pivident.studies.excitation.knowledge import NOISE_SHARE, knowledge
from pivident.studies.excitation.limits import joint_limits, wider_than_described

PLANAR = load_robot("planar_2r")


def deviations(known):
    return np.sqrt([f.variance for f in known.noise.filters])


def test_the_assumed_noise_is_that_of_the_drive_and_stated():
    """A gentler motion has the noise of the same drives."""
    limits = [joint_limits(PLANAR, torque_share=share) for share in (1.0, 0.3)]
    found = [knowledge(PLANAR, own) for own in limits]
    expected = NOISE_SHARE * np.array([j.torque_limit for j in PLANAR.joints])
    for known in found:
        np.testing.assert_allclose(deviations(known), expected)
        assert "shoulder 0.8 N m, elbow 0.4 N m" in known.noise_words


def test_a_limit_of_the_user_stands_in_for_one_of_the_description():
    joints = tuple(replace(joint, torque_limit=None) for joint in PLANAR.joints)
    robot = replace(PLANAR, joints=joints)
    limits = joint_limits(robot, {"shoulder": {"torque": 20.0}, "elbow": {"torque": 10.0}})
    np.testing.assert_allclose(deviations(knowledge(robot, limits)), [0.2, 0.1])


def test_without_limits_and_masses_standard_errors_are_ratios_only():
    robot = parse_urdf(
        '<robot name="bare"><link name="a"/><link name="b"/><joint name="turn" type="revolute">'
        '<parent link="a"/><child link="b"/><axis xyz="0 0 1"/>'
        '<limit lower="-1" upper="1" effort="0" velocity="2"/></joint></robot>'
    )
    known = knowledge(robot, joint_limits(robot))
    np.testing.assert_allclose(deviations(known), [NOISE_SHARE])
    assert "Neither a torque limit nor a mass is known of turn" in known.notes[0]


@pytest.mark.parametrize(
    ("given", "words"),
    [
        ({"position": (-10.0, 10.0)}, "The range of elbow is wider than that of the description"),
        ({"speed": 50.0}, "The limit of the speed of elbow is higher"),
        ({"torque": 900.0}, "The limit of the torque of elbow is higher"),
        ({"position": (-1.0, 1.0), "speed": 0.5, "torque": 5.0}, ""),
    ],
)
def test_limits_beyond_the_description_are_noted(given, words):
    notes = list(wider_than_described(PLANAR, joint_limits(PLANAR, {"elbow": given})))
    assert len(notes) == bool(words)
    assert not words or notes[0].startswith(words)
