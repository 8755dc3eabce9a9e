import math

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.signals.random_walk import irwsm
from pivident.signals.random_walk_likelihood import spectral_factor
from pivident.signals.random_walk_model import (
    derivative_noise,
    difference_coefficients,
    f50_from_nvr,
    gain,
    log_nvr_std,
    nvr_from_f50,
    required_f50,
)
from tests.signals.motions import RATE, omega

ORDERS = st.integers(1, 4)
EXPONENTS = st.floats(-14, 4)


@pytest.mark.parametrize(
    ("nvr", "f0", "k1", "k2"),
    [
        (1e-10, 1.00448, 0.00446216, 9.97768e-06),
        (1e-8, 1.01424, 0.0140427, 9.92954e-05),
        (1e-5, 1.08279, 0.0764567, 0.00303899),
        (1e-2, 1.56683, 0.361769, 0.0798893),
        (1.0, 4.33064, 0.769087, 0.480534),
        (1e3, 1005.98, 0.999006, 0.997022),
    ],
)
def test_steady_kalman_gains_of_the_integrated_random_walk(nvr, f0, k1, k2):
    theta, found, _ = spectral_factor(nvr, 2)
    assert found == pytest.approx(f0, rel=1e-5)
    assert 1 - theta[2] == pytest.approx(k1, rel=2e-5)
    assert theta[1] + 1 + theta[2] == pytest.approx(k2, rel=2e-5)


@given(ORDERS, EXPONENTS)
def test_spectral_factor_has_the_spectrum_of_the_model(order, exponent):
    nvr = 10**exponent
    theta, f0, _ = spectral_factor(nvr, order)
    theta = theta[: order + 1]
    assert f0 * theta[order] * (-1) ** order == pytest.approx(1, rel=1e-9)
    w = np.linspace(0.1, math.pi, 50)
    spectrum = f0 * np.abs(np.polyval(theta[::-1], np.exp(-1j * w))) ** 2
    np.testing.assert_allclose(spectrum, nvr + (2 * np.sin(w / 2)) ** (2 * order), rtol=1e-7)


@given(ORDERS, st.floats(1e-3, 0.49))
def test_f50_and_nvr_are_inverse_and_the_gain_there_is_one_half(order, fraction):
    f50 = fraction * RATE
    nvr = nvr_from_f50(f50, order, RATE)
    assert f50_from_nvr(nvr, order, RATE) == pytest.approx(f50, rel=1e-9)
    assert gain(2 * np.pi * f50 / RATE, nvr, order) == pytest.approx(0.5)


def test_f50_of_a_smoother_that_passes_everything_is_infinite():
    assert f50_from_nvr(1e4, 2, RATE) == math.inf


def test_bandwidths_at_5_khz():
    assert nvr_from_f50(50, 2, RATE) == pytest.approx(1.56e-5, rel=2e-3)
    assert nvr_from_f50(50, 3, RATE) == pytest.approx(6.2e-8, rel=1e-2)
    assert nvr_from_f50(10, 3, RATE) == pytest.approx(3.9e-12, rel=2e-2)


def test_required_bandwidth_loses_what_it_promises():
    assert required_f50(1, 2) == pytest.approx(5.6, abs=0.05)
    assert required_f50(1, 3) == pytest.approx(3.2, abs=0.05)
    nvr = nvr_from_f50(required_f50(5, 3, 1e-3), 3, RATE)
    assert 1 - gain(2 * np.pi * 5 / RATE, nvr, 3) == pytest.approx(1e-3, rel=1e-2)


def test_acceleration_noise_of_the_integrated_random_walk():
    _, ddq = derivative_noise(10**-4.992, 2, RATE, 5.03e-4)
    assert ddq == pytest.approx(2.838, rel=1e-3)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_noise_of_the_derivatives_is_what_white_noise_leaves(order):
    nvr = nvr_from_f50(200, order, RATE)
    noise = np.random.default_rng(0).standard_normal(200_000)
    result = irwsm(noise, RATE, order, nvr=nvr)
    dq, ddq = derivative_noise(nvr, order, RATE, 1.0)
    inner = slice(result.edge, -result.edge)
    assert np.std(result.dq[inner]) == pytest.approx(dq, rel=0.03)
    assert np.std(result.ddq[inner]) == pytest.approx(ddq, rel=0.03)


@pytest.mark.parametrize("order", [1, 2, 3])
def test_standard_error_of_the_nvr_agrees_with_the_exact_information(order):
    samples, nvr = 1200, 1e-3
    inverse = np.linalg.inv(omega(samples, order, nvr))
    n = samples - order
    trace = np.trace(inverse)
    information = nvr**2 / 2 * np.sum(inverse**2) - (nvr * trace) ** 2 / (2 * n)
    assert log_nvr_std(nvr, order, samples) == pytest.approx(information**-0.5, rel=0.03)


def test_difference_coefficients_are_those_of_numpy():
    for order in (1, 2, 3, 4):
        np.testing.assert_array_equal(
            difference_coefficients(order), np.diff(np.eye(order + 1), order, axis=0)[0]
        )
