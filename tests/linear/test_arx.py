"""ARX against dense least squares, exact recursions, gaps and known poles."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st
from scipy.linalg import lstsq
from scipy.signal import lfilter

from pivident.foundation.errors import (
    DelayTooLong,
    IdentificationError,
    OrdersNotSupported,
    UnusableSignal,
)
from pivident.linear.arx import arx


def dense_least_squares(u, y, nb, na, delay):
    start = max(na, max(m + d for m, d in zip(nb, delay, strict=True)))
    rows = range(start, len(y))
    phi = [
        [-y[k - i] for i in range(1, na + 1)]
        + [u[k - d - j, c] for c, (m, d) in enumerate(zip(nb, delay, strict=True))
           for j in range(m + 1)]
        for k in rows
    ]  # fmt: skip
    return lstsq(np.array(phi), y[start:])[0]


@settings(max_examples=30, deadline=None)
@given(
    radius=st.lists(st.floats(-0.95, 0.95), min_size=1, max_size=4),
    nb=st.lists(st.integers(0, 3), min_size=1, max_size=2),
    delay=st.integers(0, 4),
    seed=st.integers(0, 10_000),
)
def test_equals_dense_least_squares_on_random_stable_systems(radius, nb, delay, seed):
    rng = np.random.default_rng(seed)
    u = rng.standard_normal((300, len(nb)))
    y = lfilter([1.0], np.poly(radius), u.sum(axis=1)) + 0.1 * rng.standard_normal(300)
    delays = [delay] * len(nb)
    found = arx(u, y, 0.1, nb, len(radius), delay=delays)
    expected = dense_least_squares(u, y, nb, len(radius), delays)
    assert np.allclose(found.theta, expected, rtol=1e-8, atol=1e-9)


def test_recovers_an_exact_recursion_that_is_badly_conditioned():
    """A discrete PID: its regression has a condition number of 1e7."""
    k = np.arange(20_000)
    e = np.sin(2e-4 * k) + 0.01 * np.sin(0.11 * k) + 1e-4 * np.sin(1.3 * k)
    a, b = np.poly([1.0, 0.799]), np.array([1.72e5, -3.43e5, 1.711e5])
    found = arx(e, lfilter(b, a, e), 2e-4, 2, 2)
    assert np.allclose(found.denominator, a, rtol=1e-10)
    assert np.allclose(found.numerator, b, rtol=1e-10)


def test_a_known_integrator_stays_one():
    rng = np.random.default_rng(3)
    u = rng.standard_normal(4000)
    y = lfilter([0.2], np.poly([1.0, 0.7]), u) + 0.05 * rng.standard_normal(4000)
    found = arx(u, y, 1.0, 0, 2, fixed_poles=(1.0,))
    assert np.abs(found.poles[0] - 1.0).min() < 1e-12
    assert found.theta.shape == (3,)
    assert np.linalg.matrix_rank(found.covariance) == 2


def test_masked_samples_have_no_vote():
    rng = np.random.default_rng(4)
    u = rng.standard_normal(1000)
    y = lfilter([1.0, 0.5], [1, -0.6], u)
    mask = np.zeros(1000, dtype=bool)
    mask[300:350] = mask[0] = mask[999] = True
    u_bad, y_bad = u.copy(), y.copy()
    u_bad[mask], y_bad[mask] = np.nan, np.nan
    found = arx(u_bad, y_bad, 1.0, 1, 1, mask=mask)
    assert np.allclose(found.theta, [-0.6, 1.0, 0.5], rtol=1e-10)


def test_the_record_may_begin_in_motion():
    rng = np.random.default_rng(5)
    u = rng.standard_normal(2000)
    y = lfilter([1.0], [1, -1.6, 0.7], u)
    found = arx(u[500:], y[500:], 1.0, 0, 2)
    assert np.allclose(found.theta, [-1.6, 0.7, 1.0], rtol=1e-10)


@pytest.mark.parametrize(
    ("changes", "error", "words"),
    [
        ({"u": np.ones(200)}, UnusableSignal, "u is 1 at every sample"),
        ({"y": np.full(200, np.nan)}, UnusableSignal, "NaN"),
        ({"y": np.arange(100.0)}, UnusableSignal, "samples"),
        ({"delay": 500}, DelayTooLong, "500"),
        ({"numerator_order": 80}, OrdersNotSupported, "samples"),
        ({"fixed_poles": (1.0, 0.5, 0.2)}, IdentificationError, "fixed poles"),
        ({"fixed_poles": (1j,)}, IdentificationError, "conjugate"),
        ({"mask": np.ones(200, dtype=bool)}, UnusableSignal, "mask"),
        ({"denominator_order": 6, "numerator_order": 6}, OrdersNotSupported, "rank"),
    ],
)
def test_what_cannot_be_estimated_is_said(changes, error, words):
    u = np.random.default_rng(0).standard_normal(200)
    given_ = {
        "u": u,
        "y": lfilter([1.0], [1, -0.5], u),
        "dt": 1.0,
        "numerator_order": 0,
        "denominator_order": 1,
    }
    with pytest.raises(error, match=words):
        arx(**(given_ | changes))
