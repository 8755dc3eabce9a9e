"""Bodies of links: principal form, their ellipsoids, moments about an axis, frames of the arm."""

import numpy as np
import pytest

from pivident.models.consistency.pseudo_inertia import (
    half_axes,
    link_body,
    moment_about_axis,
    outline,
    principal_axes,
)
from pivident.robot.closed_chains import link_frames
from pivident.robot.frames import Pose, rotation_about
from pivident.robot.gallery import load_robot


def of_points(points: np.ndarray, masses: np.ndarray) -> np.ndarray:
    """Ten inertial parameters of point masses, summed from the definition."""
    ten = np.zeros(10)
    for (x, y, z), m in zip(points, masses, strict=True):
        ten += m * np.array([y * y + z * z, -x * y, -x * z, x * x + z * z, -y * z, x * x + y * y,
                             x, y, z, 1.0])  # fmt: skip
    return ten


@pytest.fixture
def cloud():
    rng = np.random.default_rng(3)
    return rng.normal(size=(12, 3)) * [0.3, 0.1, 0.05] + [0.2, -0.1, 0.05], rng.uniform(0.1, 1, 12)


def test_moments_of_a_cloud_of_points_are_about_its_principal_axes(cloud):
    points, masses = cloud
    form = link_body("cloud", of_points(points, masses))
    axes = principal_axes(form)
    assert form.mass == pytest.approx(masses.sum())
    center = masses @ points / masses.sum()
    np.testing.assert_allclose(form.center_of_mass, center, atol=1e-12)
    for k in range(3):
        away = np.cross(points - center, axes[:, k])
        assert form.principal_moments[k] == pytest.approx(masses @ (away**2).sum(axis=1))


def test_moment_about_any_axis_is_the_sum_over_the_points(cloud):
    points, masses = cloud
    rng = np.random.default_rng(4)
    for _ in range(5):
        point, direction = rng.normal(size=(2, 3))
        direction /= np.linalg.norm(direction)
        expected = masses @ (np.cross(points - point, direction) ** 2).sum(axis=1)
        found = moment_about_axis(point, direction) @ of_points(points, masses)
        assert found == pytest.approx(expected)


def test_ellipsoid_of_a_ball_and_of_a_homogeneous_ellipsoid():
    mass, a, b, c = 2.0, 0.3, 0.2, 0.1
    moments = mass / 5.0 * np.array([b * b + c * c, a * a + c * c, a * a + b * b])
    ten = np.r_[moments[0], 0, 0, moments[1], 0, moments[2], 0, 0, 0, mass]
    form = link_body("egg", ten)
    np.testing.assert_allclose(half_axes(form), [a, b, c])
    turned = Pose(rotation_about(np.array([0.0, 0.0, 1.0]), 0.4), np.array([1.0, 2.0, 3.0]))
    seen = outline(form, turned, (0, 1)) - [1.0, 2.0]
    back = seen @ np.array([[np.cos(0.4), -np.sin(0.4)], [np.sin(0.4), np.cos(0.4)]])
    np.testing.assert_allclose((back[:, 0] / a) ** 2 + (back[:, 1] / b) ** 2, 1.0)
    np.testing.assert_allclose(seen[0], seen[-1], atol=1e-12)


def test_impossible_moments_and_no_mass_have_no_ellipsoid():
    flat = link_body("flat", np.r_[1.0, 0, 0, 0.1, 0, 0.1, 0, 0, 0, 1.0])
    assert np.isnan(half_axes(flat)).any()
    assert np.isnan(outline(flat, Pose.identity(), (0, 2))).all()
    assert np.isnan(outline(link_body("none", np.zeros(10)), Pose.identity(), (0, 2))).all()


def test_frames_of_the_planar_arm_are_its_elbow():
    robot = load_robot("planar_2r")
    upper, fore = link_frames(robot, np.array([0.3, -0.5]))
    length = np.linalg.norm(robot.joints[1].translation)
    reach = robot.joints[0].rotation @ [length * np.cos(0.3), length * np.sin(0.3), 0.0]
    np.testing.assert_allclose(fore.translation, reach + upper.translation, atol=1e-12)
