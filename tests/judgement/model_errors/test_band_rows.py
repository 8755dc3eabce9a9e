import numpy as np
import pytest
from scipy.signal import butter, fftconvolve, sosfiltfilt

from pivident.judgement.model_errors.cause_rows import BandRows

RATE, BAND = 500.0, 20.0
SPAN = slice(300, 5500)


def signals(rate=RATE, seconds=12.0):
    """Sums of sines below 45 Hz, and one that rises, sampled at a rate."""
    t = np.arange(int(seconds * rate)) / rate
    found = [
        np.sin(2 * np.pi * f * t + f) + 0.3 * np.cos(11 * np.pi * f * t) for f in (0.7, 4.1, 8)
    ]
    return np.array([*found, 1.0 + t])


def weight():
    half = 250
    taps = np.exp(-np.abs(np.arange(-half, half + 1)) / 20.0) * np.cos(
        0.2 * np.arange(-half, half + 1)
    )
    return taps * np.hanning(2 * half + 1)


@pytest.mark.parametrize("taps", [None, weight()])
def test_rows_are_those_of_the_filters_one_after_the_other(taps):
    x = signals()
    rows = BandRows.of(x.shape[1], RATE, BAND, 4, SPAN)
    expected = sosfiltfilt(butter(4, BAND, fs=RATE, output="sos"), x, axis=1)
    if taps is not None:
        expected = np.array([fftconvolve(y, taps, mode="same") for y in expected])
    assert rows.at[0] == 300 and np.all(np.diff(rows.at) == 4) and rows.at[-1] < 5500
    found = rows.passed(x, rows.gain(taps))
    inner = slice(60, -60)
    # rows are free of what would be aliased; the filters' rest above half their rate is that small
    np.testing.assert_allclose(
        found[:, inner], expected[:, rows.at][:, inner], atol=2e-3 * np.abs(expected).max()
    )


def test_signals_at_a_fraction_of_the_rate_have_the_same_rows():
    slow = signals()[:3]
    rows = BandRows.of(slow.shape[1], RATE, BAND, 4, SPAN)
    gain = rows.gain(None)
    whole, half = rows.passed(slow, gain), rows.passed(slow[:, ::2], gain, 2)
    np.testing.assert_allclose(half[:, 100:-100], whole[:, 100:-100], atol=1e-6)


def test_no_signals_and_no_rows():
    rows = BandRows.of(1000, RATE, BAND, 4, slice(600, 400))
    assert rows.at.size == 0
    assert rows.passed([], rows.gain(None)).shape == (0, 0)
    assert rows.passed(np.zeros((2, 1000)), rows.gain(weight())).shape == (2, 0)
