import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.robot.frames import (
    Pose,
    rotation_about,
    rotation_from_rpy,
    rotation_from_z_to,
    rotation_x,
    rotation_y,
    rotation_z,
)

angles = st.floats(-7.0, 7.0)
Z = np.array([0.0, 0.0, 1.0])


@st.composite
def unit_vectors(draw):
    vector = np.array([draw(st.floats(-1, 1)) for _ in range(3)])
    length = np.linalg.norm(vector)
    return vector / length if length > 1e-6 else Z


@given(unit_vectors())
def test_the_frame_rule_is_a_rotation_that_takes_z_to_the_axis(axis):
    rotation = rotation_from_z_to(axis)
    np.testing.assert_allclose(rotation @ Z, axis, atol=1e-12)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1.0)


@given(unit_vectors())
def test_the_frame_rule_turns_no_further_than_needed(axis):
    angle = np.arccos(np.clip((np.trace(rotation_from_z_to(axis)) - 1) / 2, -1, 1))
    assert angle == pytest.approx(np.arccos(np.clip(axis[2], -1, 1)), abs=1e-6)


def test_the_frame_rule_leaves_a_z_axis_alone_and_makes_a_half_turn_about_x_of_its_opposite():
    np.testing.assert_array_equal(rotation_from_z_to(Z), np.eye(3))
    np.testing.assert_array_equal(rotation_from_z_to(-Z), np.diag([1.0, -1.0, -1.0]))


@pytest.mark.parametrize("tilt", [1e-3, 1e-6, 1e-9, 1e-11])
def test_the_frame_rule_keeps_its_digits_close_to_minus_z(tilt):
    axis = np.array([tilt * 0.6, tilt * 0.8, -np.sqrt(1 - tilt**2)])
    rotation = rotation_from_z_to(axis)
    np.testing.assert_allclose(rotation @ Z, axis, atol=1e-15)
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-14)


@given(angles)
def test_rotations_about_the_coordinate_axes_are_special_cases_of_rodrigues(angle):
    for axis, rotation in zip(np.eye(3), (rotation_x, rotation_y, rotation_z), strict=True):
        np.testing.assert_allclose(rotation(angle), rotation_about(axis, angle), atol=1e-12)


def test_roll_pitch_yaw_turns_about_fixed_axes_in_that_order():
    expected = rotation_z(0.3) @ rotation_y(0.2) @ rotation_x(0.1)
    np.testing.assert_allclose(rotation_from_rpy(0.1, 0.2, 0.3), expected)


@given(angles, angles)
def test_composed_poses_map_points_like_one_after_the_other(first_angle, second_angle):
    first = Pose(rotation_x(first_angle), np.array([1.0, 2.0, 3.0]))
    second = Pose(rotation_z(second_angle), np.array([-0.5, 0.1, 0.7]))
    point = np.array([0.2, -0.4, 0.9])
    inner = second.rotation @ point + second.translation
    both = first @ second
    np.testing.assert_allclose(
        both.rotation @ point + both.translation,
        first.rotation @ inner + first.translation,
        atol=1e-12,
    )
