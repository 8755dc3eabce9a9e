"""Weighted means of blocks against their definition."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.estimation.output_error.thinning import WIDTH, Thinning, means_at, passed_power


def defined(x: np.ndarray, factor: int) -> np.ndarray:
    """The sums of the module's docstring, one after the other."""
    length = WIDTH * factor
    weights = 1.0 - np.cos(2.0 * np.pi * (np.arange(length) + 0.5) / length)
    weights /= weights.sum()
    starts = range(0, len(x) // factor * factor - length + 1, factor)
    return np.array([weights @ x[k : k + length] for k in starts])


@given(
    factor=st.integers(2, 9),
    blocks=st.lists(st.integers(1, 6), min_size=1, max_size=6),
    seed=st.integers(0, 100),
)
def test_blocks_give_the_means_of_the_whole(factor, blocks, seed):
    x = np.random.default_rng(seed).standard_normal((factor * sum(blocks), 3))
    thinning = Thinning(factor)
    edges = np.cumsum([0, *blocks]) * factor
    parts = [thinning.process(x[a:b]) for a, b in pairwise(edges)]
    made = np.concatenate(parts)
    expected = defined(x, factor)
    assert len(made) == thinning.rows(len(x)) == max(len(expected), 0)
    if len(expected):
        np.testing.assert_allclose(made, expected, atol=1e-14)


def test_a_factor_of_one_changes_nothing():
    x = np.random.default_rng(0).standard_normal((7, 2))
    assert Thinning(1).process(x) is x
    assert Thinning(1).rows(7) == 7


@pytest.mark.parametrize("share", [0.5, 0.75, 1.0, 1.5, 2.0])
def test_the_window_is_blind_at_multiples_of_half_the_new_nyquist_frequency(share):
    factor, samples = 20, 2000
    t = np.arange(samples)
    # in cycles per sample: the new rate is 1/20, its Nyquist frequency 1/40
    wave = np.sin(2.0 * np.pi * share / factor * t + 0.3)
    assert np.abs(means_at(wave, factor)).max() < 1e-12


def test_low_frequencies_pass():
    t = np.arange(4000)
    slow = np.sin(2.0 * np.pi * t / 2000.0)
    # the mean belongs to the middle of its window
    middle = t[: len(means_at(slow, 10)) * 10 : 10] + 19.5
    expected = np.sin(2.0 * np.pi * middle / 2000.0)
    np.testing.assert_allclose(means_at(slow, 10), expected, atol=1e-3)


@pytest.mark.parametrize("factor", [1, 2, 25])
def test_the_power_that_passes_is_that_of_the_weights(factor):
    frequency = np.linspace(0.0, 0.5, 41)
    weights = means_at(np.eye(4 * factor), factor)[0]
    turns = np.exp(-2j * np.pi * np.multiply.outer(frequency, np.arange(4 * factor)) / factor)
    np.testing.assert_allclose(
        passed_power(factor, frequency), np.abs(turns @ weights) ** 2, atol=1e-12
    )
