"""Two ways to Burg's reflection coefficients, each the other's oracle."""

import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.signal import lfilter

from pivident.signals import burg


def coloured(samples, seed, numerator=(1.0, -0.9), denominator=(1.0, -1.5, 0.8)):
    v = lfilter(numerator, denominator, np.random.default_rng(seed).standard_normal(samples))
    return v - v.mean()


@given(
    st.lists(st.integers(60, 3000), min_size=1, max_size=5), st.integers(1, 50), st.integers(0, 9)
)
def test_lattice_and_products_agree_over_stretches(lengths, order, seed):
    v, stops = coloured(sum(lengths), seed), np.cumsum(lengths)
    found, exact = burg.by_products(*burg.products(v, stops, order), order)
    assert exact
    np.testing.assert_allclose(found, burg.by_lattice(v, stops, order), atol=1e-12)


def test_products_are_those_of_each_stretch():
    v, stops, order = coloured(5000, 1), np.array([1200, 1300, 5000]), 21
    whole, head, tail = burg.products(v, stops, order)
    stretches = np.split(v, stops[:-1])
    for k in range(order + 1):
        pairs = [s[k:] * s[: s.size - k] for s in stretches]
        assert whole[k] == pytest.approx(sum(p.sum() for p in pairs), rel=1e-12)
        for t in range(k, order + 1):
            assert head[k, t] == pytest.approx(sum(p[: t - k + 1].sum() for p in pairs))
        for i in range(1, order + 2):
            assert tail[k, i] == pytest.approx(sum(p[-i:].sum() for p in pairs))


def deep_notch(samples=20_000):
    spectrum = np.fft.rfft(np.random.default_rng(3).standard_normal(samples))
    spectrum[len(spectrum) // 5 :] *= 1e-6
    return np.fft.irfft(spectrum)


def test_a_spectrum_with_a_deep_notch_is_left_to_the_lattice():
    v, stops = deep_notch(), np.array([20_000])
    _, exact = burg.by_products(*burg.products(v, stops, 100), 100)
    assert not exact
    expected = burg.by_lattice(v, stops, 100)
    np.testing.assert_array_equal(burg.reflection_coefficients(v, stops, 100), expected)


def test_what_can_be_predicted_exactly_is_left_to_the_lattice():
    v, stops = np.sin(0.3 * np.arange(4000)), np.array([4000])
    found = burg.reflection_coefficients(v, stops, 8)
    np.testing.assert_array_equal(found, burg.by_lattice(v, stops, 8))
    assert np.abs(found).max() <= 1.0


@pytest.mark.parametrize("lengths", [[4000, 20], [40] * 100])
def test_short_stretches_are_left_to_the_lattice(lengths):
    v, stops = coloured(sum(lengths), 5), np.cumsum(lengths)
    found = burg.reflection_coefficients(v, stops, 30)
    np.testing.assert_array_equal(found, burg.by_lattice(v, stops, 30))


def test_order_zero_has_no_coefficients():
    assert burg.reflection_coefficients(coloured(100, 0), np.array([100]), 0).size == 0
