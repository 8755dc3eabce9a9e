"""Laguerre responses against the closed form of known systems."""

import numpy as np
import pytest
from scipy.signal import cont2discrete, lfilter

from pivident.loop.instruments.reference_response import fit_response


def excitation(rate, seconds=40.0):
    t = np.arange(int(seconds * rate)) / rate
    rng = np.random.default_rng(3)
    phases = rng.uniform(0.0, 2.0 * np.pi, 6)
    frequencies = (0.2, 0.5, 0.9, 1.3, 1.9, 2.6)
    return sum(np.sin(2 * np.pi * f * t + p) for f, p in zip(frequencies, phases, strict=True))


def second_order(x, rate, hertz, damping=0.6):
    omega = 2.0 * np.pi * hertz
    b, a, _ = cont2discrete(([omega**2], [1.0, 2 * damping * omega, omega**2]), 1.0 / rate)
    return lfilter(b[0], a, x)


@pytest.mark.parametrize("rate", [100.0, 1000.0])
@pytest.mark.parametrize("hertz", [3.0, 8.0])
def test_the_response_of_a_second_order_loop_is_found(rate, hertz):
    x = excitation(rate)
    true = second_order(x, rate, hertz)
    noise = 1e-3 * np.random.default_rng(0).standard_normal(x.size)
    found = fit_response(x, true + noise, slice(200, -200))
    settled = slice(int(2.0 * rate), None)
    assert np.std(found.of(x)[settled] - true[settled]) < 4e-3 * np.std(true)
    assert found.explained > 0.9999


def test_a_constant_passes_with_the_gain_of_the_response():
    rate = 250.0
    x = excitation(rate)
    found = fit_response(x, second_order(x, rate, 5.0), slice(200, -200))
    still = found.of(np.full(2000, 3.0))
    np.testing.assert_allclose(still, still[0], rtol=1e-12)
    ramp = found.of(3.0 + x)
    np.testing.assert_allclose((ramp - found.of(x))[500:], still[0], atol=1e-9)


def test_an_unrelated_signal_explains_nothing():
    rng = np.random.default_rng(1)
    found = fit_response(excitation(100.0), rng.standard_normal(4000), slice(0, 4000))
    assert found.explained < 0.02


def test_a_signal_at_rest_makes_no_response():
    found = fit_response(np.zeros(2000), excitation(50.0), slice(0, 2000))
    assert found.explained == 0.0
    assert not found.of(np.full(2000, 1.0)).any()
