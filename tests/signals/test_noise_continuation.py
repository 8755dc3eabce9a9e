"""The noise level beyond the motion's band, continued into it."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.estimation.output_error.thinning import means_at, passed_power
from pivident.signals.noise_models import continued_into_band, fit_ar

RATE = 1000.0


@pytest.fixture(scope="module")
def covered():
    """White noise that slow model error, a hundred times as strong at rest, covers below 20 Hz."""
    rng = np.random.default_rng(2)
    slow = lfilter([0.02], [1.0, -0.98], 20.0 * rng.standard_normal(60000))
    return fit_ar(slow + rng.standard_normal(60000), 60)


def test_the_band_is_levelled_and_the_rest_is_left(covered):
    found = continued_into_band(covered, RATE, 50.0)
    inside = found.spectrum(np.linspace(0.0, 45.0, 20), RATE)
    outside = np.linspace(90.0, 480.0, 40)
    assert covered.spectrum(np.array([1.0]), RATE)[0] > 50 * inside.max()
    assert inside.max() < 2.0 * found.spectrum(np.array([60.0]), RATE)[0]
    ratio = found.spectrum(outside, RATE) / covered.spectrum(outside, RATE)
    assert np.abs(ratio - 1.0).max() < 0.25


def test_the_whitener_keeps_the_motions_frequencies(covered):
    found = continued_into_band(covered, RATE, 50.0)
    low = np.exp(-2j * np.pi * 2.0 / RATE)
    gain = [abs(np.polyval(m.coefficients[::-1], low)) for m in (covered, found)]
    assert gain[1] > 5 * gain[0]


def test_a_level_that_a_filter_lowers_beyond_the_band_is_that_inside_it():
    # means lower the level at the edge to less than half; the noise inside has it whole
    white = np.random.default_rng(3).standard_normal(60000)
    model = fit_ar(means_at(white[:, None], 5)[:, 0], 30)

    def passed(frequency):
        return passed_power(5, frequency / 200.0)

    inside = np.linspace(1.0, 40.0, 30)
    level = model.spectrum(inside, 200.0) / passed(inside)
    found = continued_into_band(model, 200.0, 45.0, passed).spectrum(inside, 200.0)
    assert (found / passed(inside)).mean() == pytest.approx(level.mean(), rel=0.1)
    lower = continued_into_band(model, 200.0, 45.0).spectrum(inside, 200.0)
    assert (lower / passed(inside)).mean() < 0.6 * level.mean()


def test_without_a_band_nothing_changes(covered):
    assert continued_into_band(covered, RATE, 0.0) is covered


def test_a_band_that_no_grid_resolves_is_left_as_it_is():
    """A clock in seconds that was taken for milliseconds makes half a megahertz of 500 Hz."""
    model = fit_ar(np.random.default_rng(2).standard_normal(4000), 5)
    assert continued_into_band(model, 500e3, 20.0) is model
