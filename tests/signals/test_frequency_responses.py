"""Frequency responses of the filters are what the filters do to a sine."""

import numpy as np
import pytest
from scipy.signal import freqz

from pivident.signals.bandpass import bandpass, bandpass_response
from pivident.signals.decimation import decimation_gain, parallel_decimation
from pivident.signals.prefilter import Prefilter

RATE = 1000.0
T = np.arange(20_000) / RATE
INNER = slice(5000, 15_000)


def amplitude(x, t, frequency):
    """Complex amplitude of a sine at a frequency, by least squares."""
    basis = np.stack([np.cos(2 * np.pi * frequency * t), -np.sin(2 * np.pi * frequency * t)], 1)
    real, imaginary = np.linalg.lstsq(basis, x, rcond=None)[0]
    return real + 1j * imaginary


@pytest.mark.parametrize("frequency", [3.0, 48.0, 50.0, 90.0, 170.0])
@pytest.mark.parametrize("order", [2, 4])
def test_a_sine_passes_the_band_pass_with_its_response(frequency, order):
    made = bandpass(np.cos(2 * np.pi * frequency * T), RATE, 50.0, order)
    for derivative, signal in enumerate((made.q, made.dq, made.ddq)):
        expected = bandpass_response(np.array([frequency]), RATE, 50.0, order, derivative)[0]
        seen = amplitude(signal[INNER], T[INNER], frequency)
        assert seen == pytest.approx(expected, rel=1e-6, abs=1e-9)


def test_the_band_pass_is_half_at_its_cut_off_and_without_phase():
    response = bandpass_response(np.array([50.0]), RATE, 50.0)
    assert response[0] == pytest.approx(0.5)
    assert bandpass_response(np.array([20.0]), RATE, 50.0, derivative=1)[0].real == 0.0
    assert bandpass_response(np.array([20.0]), RATE, 50.0, derivative=2)[0].real < 0.0


@pytest.mark.parametrize("frequency", [2.0, 15.0, 17.0, 19.5, 23.0])
@pytest.mark.parametrize("factor", [25, (5, 5), (25,)])
def test_a_sine_passes_the_decimation_with_its_gain(frequency, factor):
    kept = parallel_decimation(np.cos(2 * np.pi * frequency * T), factor, convention="scipy")
    t = T[::25]
    inner = slice(200, 600)
    seen = abs(amplitude(kept[inner], t[inner], frequency))  # aliases have the same samples
    expected = decimation_gain(np.array([frequency]), RATE, factor)[0]
    assert seen == pytest.approx(expected, rel=1e-4, abs=1e-7)


def test_no_decimation_has_no_gain():
    np.testing.assert_array_equal(decimation_gain(np.array([1.0, 400.0]), RATE, 1), 1.0)


def test_a_prefilter_has_the_response_of_its_polynomials():
    own = Prefilter((0.5, -0.2), (1.0, -0.9), (1.0, -1.2, 0.5), variance=4.0)
    frequency = np.geomspace(0.1, 499.0, 30)
    fir = freqz((1.0, -1.2, 0.5), 1.0, frequency, fs=RATE)[1]
    expected = 0.5 * fir * freqz((0.5, -0.2), (1.0, -0.9), frequency, fs=RATE)[1]
    np.testing.assert_allclose(own.response(frequency, RATE), expected, rtol=1e-12)
    impulse = np.zeros((1, 4000))
    impulse[0, 0] = 1.0
    spectrum = np.fft.rfft(own.stream(1).process(impulse)[0])[40]
    assert spectrum == pytest.approx(own.response(np.array([10.0]), RATE)[0], rel=1e-9)
