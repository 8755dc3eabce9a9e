"""Algebraic differentiation against polynomials, Bessel functions, sums and Savitzky-Golay."""

import numpy as np
import pytest
from scipy.special import eval_jacobi, roots_jacobi

from pivident.foundation.errors import RecordingError
from pivident.signals.algebraic import (
    algebraic_derivative,
    algebraic_gain,
    algebraic_weights,
    half_gain_product,
    half_samples,
)

RATE, HALF = 100.0, 12


def middle(x):
    return x[HALF:-HALF]


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize(("degree", "exponent"), [(0, 2.0), (2, 2.0), (2, 4.0), (3, 3.5), (6, 5.0)])
def test_polynomials_are_differentiated_exactly(derivative, degree, exponent):
    """Up to degree N + n, and by symmetry one more where N is even."""
    t = np.arange(80) / RATE - 0.4
    order = degree + derivative + (degree % 2 == 0)
    polynomial = np.polynomial.Polynomial(np.random.default_rng(order).normal(size=order + 1))
    found = algebraic_derivative(polynomial(t), HALF, RATE, derivative, degree, exponent)
    truth = polynomial.deriv(derivative)(t) if derivative else polynomial(t)
    np.testing.assert_allclose(middle(found), middle(truth), rtol=0, atol=1e-9)


@pytest.mark.parametrize(("derivative", "degree"), [(1, 0), (1, 2), (2, 0), (2, 2), (2, 4)])
def test_with_its_exponent_at_the_derivative_it_is_savitzky_and_golay(derivative, degree):
    from scipy.signal import savgol_filter

    x = np.random.default_rng(3).normal(size=200)
    found = algebraic_derivative(x, HALF, RATE, derivative, degree, float(derivative))
    order = degree + derivative
    theirs = savgol_filter(x, 2 * HALF + 1, order, deriv=derivative, delta=1.0 / RATE)
    np.testing.assert_allclose(middle(found), middle(theirs), rtol=1e-9, atol=1e-7)


@pytest.mark.parametrize(("degree", "exponent"), [(0, 2.0), (2, 3.0), (2, 4.0), (4, 4.0)])
def test_weights_are_the_kernel_of_jacobi_polynomials(degree, exponent):
    """g = (1 - s²)^κ Σ P_i(0) P_i(s)/h_i, its norms by Gauss quadrature, with many samples."""
    half, n = 2000, 2 * 2000 + 1
    s = np.arange(-half, half + 1) / (half + 0.5)
    nodes, weights = roots_jacobi(20, exponent, exponent)
    kernel = np.zeros(n)
    for i in range(degree + 1):
        norm = float(weights @ eval_jacobi(i, exponent, exponent, nodes) ** 2)
        at_zero = eval_jacobi(i, exponent, exponent, 0.0)
        kernel += at_zero * eval_jacobi(i, exponent, exponent, s) / norm
    kernel *= (1.0 - s**2) ** exponent
    own = algebraic_weights(half, RATE, 0, degree, exponent) * (half + 0.5)
    np.testing.assert_allclose(own, kernel, atol=1e-4 * kernel.max())
    first = algebraic_weights(half, RATE, 1, degree, exponent) * (half + 0.5) ** 2 / RATE
    slope = -np.gradient(kernel, s)
    np.testing.assert_allclose(first[1:-1], slope[1:-1], atol=1e-3 * np.abs(first).max())


@pytest.mark.parametrize("derivative", [0, 1, 2])
@pytest.mark.parametrize(("degree", "exponent"), [(0, 3.0), (2, 2.0), (2, 4.0), (4, 6.0)])
def test_response_is_the_closed_form_times_the_ideal_derivative(derivative, degree, exponent):
    half, window = 400, 0.2
    rate = (2 * half + 1) / window
    frequency = np.linspace(1.0, 40.0, 25)
    c = algebraic_weights(half, rate, derivative, degree, exponent)
    at = np.arange(-half, half + 1) / rate
    response = np.exp(2j * np.pi * frequency[:, None] * at) @ c
    ideal = (2j * np.pi * frequency) ** derivative
    gain = algebraic_gain(frequency, window, degree, exponent)
    np.testing.assert_allclose(response / ideal, gain, atol=3e-5)


def test_half_gain_is_where_it_says():
    for degree, exponent in ((0, 2.0), (2, 4.0), (6, 10.0)):
        product = half_gain_product(degree, exponent)
        lower = algebraic_gain(np.linspace(0.0, 0.99 * product, 50), 1.0, degree, exponent)
        assert algebraic_gain(np.array([product]), 1.0, degree, exponent) == pytest.approx(0.5)
        assert (lower > 0.5).all() and lower[0] == pytest.approx(1.0)


def test_noise_gain_of_accelerations_is_that_of_legendre_polynomials():
    """At κ = 2 white noise of σ leaves σ² h (2/T)⁵ Σ_{i ≤ N+2} P_i''(0)² (2i+1)/2 in ddq."""
    half = 300
    window = (2 * half + 1) / RATE
    for degree in (0, 2, 4):
        total = 0.0
        for i in range(2, degree + 3):
            second = np.polynomial.legendre.Legendre.basis(i).deriv(2)(0.0)
            total += second**2 * (2 * i + 1) / 2
        predicted = (2.0 / window) ** 5 * total / RATE
        c = algebraic_weights(half, RATE, 2, degree, 2.0)
        assert np.sum(c**2) == pytest.approx(predicted, rel=0.01)


def test_noise_of_derivatives_is_as_predicted_by_the_weights():
    noise = np.random.default_rng(5).normal(size=200_000)
    for n in range(3):
        found = middle(algebraic_derivative(noise, HALF, RATE, n))
        assert found.std() == pytest.approx(
            np.sqrt(np.sum(algebraic_weights(HALF, RATE, n) ** 2)), rel=0.02
        )


def test_a_causal_window_lags_by_half_of_itself():
    """The window that ends at the last sample estimates what was true T/2 ago."""
    t = np.arange(200) / RATE
    x = np.sin(2 * np.pi * 0.3 * t)
    behind = np.convolve(x, algebraic_weights(HALF, RATE, 1)[::-1])[: len(x)]
    late = 2 * np.pi * 0.3 * np.cos(2 * np.pi * 0.3 * (t - HALF / RATE))
    np.testing.assert_allclose(behind[2 * HALF :], late[2 * HALF :], atol=2e-4)


def test_windows_that_hold_too_little_or_too_much_are_refused():
    with pytest.raises(RecordingError, match="does not determine a polynomial of degree 4"):
        algebraic_weights(1, RATE, 2)
    with pytest.raises(RecordingError, match="longer than the record of 20"):
        algebraic_derivative(np.zeros(20), HALF, RATE)
    assert half_samples(0.01, RATE) == 2 and half_samples(0.25, RATE) == 12
