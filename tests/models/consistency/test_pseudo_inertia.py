"""Pseudo-inertia against sums over point masses, and the triangle inequality."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.models.consistency.pseudo_inertia import (
    BASIS,
    ball,
    from_triangle,
    inertial_parameters,
    least_body,
    link_body,
    pseudo_inertia,
    triangle,
)
from pivident.robot.inertia import from_center_of_mass


def cloud(points, masses):
    """Ten inertial parameters of point masses, from the definitions."""
    total = np.zeros(10)
    for p, m in zip(points, masses, strict=True):
        total += from_center_of_mass(m, p, np.zeros((3, 3)))
    return total


@settings(max_examples=40, deadline=None)
@given(st.integers(0, 2**32 - 1), st.integers(1, 8))
def test_it_is_the_second_moment_of_homogeneous_coordinates(seed, count):
    rng = np.random.default_rng(seed)
    points, masses = rng.normal(size=(count, 3)), rng.uniform(0.1, 2.0, count)
    homogeneous = np.c_[points, np.ones(count)]
    inertia = cloud(points, masses)
    expected = homogeneous.T @ (masses[:, None] * homogeneous)
    assert pseudo_inertia(inertia) == pytest.approx(expected, abs=1e-12)
    assert inertial_parameters(expected) == pytest.approx(inertia, abs=1e-12)
    assert np.tensordot(inertia, BASIS, axes=1) == pytest.approx(expected, abs=1e-12)


@settings(max_examples=60, deadline=None)
@given(
    st.tuples(*[st.floats(0.01, 1.0)] * 3),
    st.floats(0.1, 5.0),
    st.tuples(*[st.floats(-0.5, 0.5)] * 3),
)
def test_positive_definite_where_no_principal_moment_exceeds_the_others(moments, mass, center):
    a, b, c = sorted(moments)
    inertia = from_center_of_mass(mass, np.array(center), np.diag(moments))
    lowest = np.linalg.eigvalsh(pseudo_inertia(inertia))[0]
    if abs(a + b - c) > 1e-6:
        assert (lowest > 0.0) == (a + b > c)


def test_the_triangle_keeps_the_scalar_product():
    rng = np.random.default_rng(1)
    a, b = rng.normal(size=(2, 4, 4))
    a, b = a + a.T, b + b.T
    assert triangle(a) @ triangle(b) == pytest.approx(np.trace(a @ b))
    assert from_triangle(triangle(a)) == pytest.approx(a)
    # by columns: (0,0), (0,1), (1,1), (0,2) …
    assert triangle(a)[1] == pytest.approx(np.sqrt(2.0) * a[0, 1])
    assert triangle(a)[2] == pytest.approx(a[1, 1])


def test_a_ball_and_a_body():
    steel = inertial_parameters(ball(0.01))
    assert steel[9] == pytest.approx(7850.0 * np.pi / 6.0 * 1e-6)
    assert steel[0] == pytest.approx(0.1 * steel[9] * 0.01**2)  # 2/5 m r²
    inertia = from_center_of_mass(2.0, np.array([0.1, 0.0, -0.2]), np.diag([0.01, 0.02, 0.025]))
    body = link_body("arm", inertia)
    assert body.mass == 2.0
    assert body.center_of_mass == pytest.approx([0.1, 0.0, -0.2])
    assert body.principal_moments == pytest.approx([0.01, 0.02, 0.025])
    assert np.isnan(link_body("none", np.zeros(10)).center_of_mass).all()


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 2**32 - 1), st.floats(-3.0, 3.0), st.booleans())
def test_least_body_tells_second_moments_about_the_centre_of_mass_in_any_frame(seed, away, larger):
    """Σ about the centre, from the definition, decides; where the body lies does not."""
    rng = np.random.default_rng(seed)
    diameter = 0.02
    mass = 7850.0 * 4.0 / 3.0 * np.pi * 0.01**3
    own = mass * 0.01**2 / 5.0  # ∫ x² dm of the ball
    central = own * np.array([1.01 if larger else 0.99, 3.0, 9.0])
    turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
    second = turned @ np.diag(central) @ turned.T
    inertia = np.trace(second) * np.eye(3) - second
    center = away * rng.normal(size=3)
    matrix, lightest = least_body(diameter)
    assert lightest == pytest.approx(mass)
    difference = pseudo_inertia(from_center_of_mass(mass, center, inertia)) - matrix
    # a congruence that takes the centre back to the origin keeps the signs and the digits
    shift = np.eye(4)
    shift[:3, 3] = -center
    values = np.linalg.eigvalsh(shift @ difference @ shift.T)
    assert (values[0] > 0.0) == larger


def test_a_ball_is_exactly_the_least_body():
    matrix, mass = least_body(0.03)
    difference = ball(0.03) - matrix
    assert difference[3, 3] == pytest.approx(mass)
    np.testing.assert_allclose(difference[:3, :3], 0.0, atol=1e-18)
