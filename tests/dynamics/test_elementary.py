"""Sine, cosine and arctangent against extended precision."""

import numpy as np
import pytest

from pivident.dynamics.elementary import arctangent, sine_and_cosine

ROUNDING = np.finfo(float).eps


def both(x):
    return np.array([sine_and_cosine(value) for value in x]).T


@pytest.mark.parametrize("span", [1e-3, 1.0, 10.0, 1e4, 1e7])
def test_sine_and_cosine_to_rounding(span):
    x = np.random.default_rng(0).uniform(-span, span, 3000)
    exact = x.astype(np.longdouble)
    sine, cosine = both(x)
    assert abs(sine - np.sin(exact)).max() < ROUNDING
    assert abs(cosine - np.cos(exact)).max() < ROUNDING


def test_sine_and_cosine_at_the_joints_of_the_quadrants():
    x = np.arange(-40, 41) * np.pi / 4
    for nearby in (x, np.nextafter(x, np.inf), np.nextafter(x, -np.inf)):
        sine, cosine = both(nearby)
        exact = nearby.astype(np.longdouble)
        assert abs(sine - np.sin(exact)).max() < ROUNDING
        assert abs(cosine - np.cos(exact)).max() < ROUNDING
    assert sine_and_cosine(0.0) == (0.0, 1.0)


def test_what_is_no_angle_has_no_sine():
    for value in (np.nan, np.inf, -np.inf):
        assert np.isnan(sine_and_cosine(value)).all()


def test_arctangent_to_rounding():
    rng = np.random.default_rng(0)
    x = np.concatenate([rng.normal(size=2000) * 10.0**k for k in (-8, -2, -1, 0, 1, 2, 6)])
    x = np.concatenate([x, [0.0, 0.66, -0.66, 2.414213562373095, 1e300, -1e300, 1e-300]])
    exact = np.arctan(x.astype(np.longdouble))
    ours = np.array([arctangent(value) for value in x])
    assert (abs(ours - exact) <= 2 * ROUNDING * abs(exact)).all()


def test_arctangent_of_infinity_and_of_nothing():
    assert arctangent(np.inf) == np.pi / 2
    assert arctangent(-np.inf) == -np.pi / 2
    assert np.isnan(arctangent(np.nan))
