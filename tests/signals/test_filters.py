"""Filters against those of SciPy, whose conventions they have."""

import numpy as np
import pytest
import scipy.fft
import scipy.signal

from pivident.signals.filters import (
    butterworth_sections,
    chebyshev_sections,
    convolution,
    fast_length,
    forwards_and_backwards,
    recursion,
    run_sections,
    sections_response,
    steady_state,
)

SECTIONS = scipy.signal.butter(4, 33.0, fs=1000.0, output="sos")
STEPS = np.random.default_rng(3).standard_normal((700, 3)).cumsum(axis=0)


@pytest.mark.parametrize(("order", "cutoff", "rate"), [(2, 0.5, 125), (4, 33.3, 1e3), (8, 7, 333)])
def test_a_butterworth_low_pass_of_even_order_is_that_of_scipy(order, cutoff, rate):
    wanted = scipy.signal.butter(order, cutoff, fs=rate, output="sos")
    np.testing.assert_allclose(butterworth_sections(order, cutoff, rate), wanted, rtol=1e-14)


@pytest.mark.parametrize("order", [1, 3, 5, 7])
def test_an_odd_one_has_the_same_response(order):
    omega = np.linspace(0.0, 3.1, 40)
    sections = scipy.signal.butter(order, 10.0, fs=100.0, output="sos")
    _, wanted = scipy.signal.freqz_sos(sections, worN=omega)
    response = sections_response(butterworth_sections(order, 10.0, 100.0), omega)
    np.testing.assert_allclose(response, wanted, rtol=1e-11, atol=1e-14)


@pytest.mark.parametrize("stage", [2, 5, 10, 13])
def test_a_chebyshev_low_pass_is_that_of_scipy(stage):
    wanted = scipy.signal.cheby1(8, 0.05, 0.8 / stage, output="sos")
    np.testing.assert_allclose(chebyshev_sections(8, 0.05, 0.8 / stage), wanted, rtol=1e-14)


def test_sections_run_forwards():
    wanted = scipy.signal.sosfilt(SECTIONS, STEPS, axis=0)
    np.testing.assert_allclose(run_sections(SECTIONS, STEPS), wanted, rtol=1e-13)


@pytest.mark.parametrize("extension", [0, 12, 300])
@pytest.mark.parametrize("x", [STEPS, STEPS[:, 0]])
def test_sections_run_forwards_and_backwards(extension, x):
    given = x.copy()
    made = forwards_and_backwards(SECTIONS, x, extension)
    wanted = scipy.signal.sosfiltfilt(SECTIONS, x, axis=0, padlen=extension)
    np.testing.assert_allclose(made, wanted, rtol=1e-12)
    assert np.array_equal(x, given)


def test_a_record_can_be_held_beyond_its_ends():
    made = forwards_and_backwards(SECTIONS, STEPS[:, 1], 100, held=True)
    wanted = scipy.signal.sosfiltfilt(SECTIONS, STEPS[:, 1], padtype="constant", padlen=100)
    np.testing.assert_allclose(made, wanted, rtol=1e-12)


@pytest.mark.parametrize(("b", "a"), [([0.3], [2, -0.5]), ([1, 2, 1], [4, -3, 1]), ([2, 1], [1])])
def test_a_recursion_from_rest_and_from_a_steady_state(b, a):
    b, a, x = np.array(b, float), np.array(a, float), STEPS[:, 2]
    np.testing.assert_allclose(recursion(b, a, x), scipy.signal.lfilter(b, a, x), rtol=1e-13)
    state = scipy.signal.lfilter_zi(b, a)
    np.testing.assert_allclose(steady_state(b, a), state, rtol=1e-13)
    wanted, _ = scipy.signal.lfilter(b, a, x, zi=state * x[0])
    np.testing.assert_allclose(recursion(b, a, x, state * x[0]), wanted, rtol=1e-13)


def test_a_gain_alone_is_a_recursion():
    gain = recursion(np.array([3.0]), np.array([2.0]), STEPS[:, 0])
    np.testing.assert_allclose(gain, 1.5 * STEPS[:, 0])


@pytest.mark.parametrize("least", [*range(1, 200), 3441, 34_500, 90_001])
def test_fast_lengths_are_those_of_scipy(least):
    assert fast_length(least) == scipy.fft.next_fast_len(least, real=True)


def test_the_fast_length_of_nothing_is_one():
    assert fast_length(0) == 1


def test_convolution_is_the_full_one():
    made = convolution(STEPS[:, 0], STEPS[:80, 1])
    np.testing.assert_allclose(made, np.convolve(STEPS[:, 0], STEPS[:80, 1]), atol=1e-9)
