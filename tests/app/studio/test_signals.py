"""A window of a long signal shows its extremes at their places, and nothing where nothing is."""

import tracemalloc

import numpy as np
import pytest

from pivident.app.studio.signals import BLOCK, FEW, window, write_channel, write_times


def written(folder, t, values):
    write_times(folder, 0, t)
    write_channel(folder, 0, "q", values)


def drawn(folder, *arguments, **options):
    """Times and values of one line as arrays, NaN where there is nothing."""
    found = window(folder, 0, "q", *arguments, **options)
    return [
        (np.array(t), np.array([np.nan if y is None else y for y in values]))
        for t, values in zip(found["t"], found["y"], strict=True)
    ]


def test_short_signals_are_drawn_as_they_are(tmp_path):
    t, y = np.arange(50) / 10.0 + 1.7e9, np.random.default_rng(1).standard_normal((50, 2))
    y[7, 1] = np.nan
    written(tmp_path, t, y)
    for (times, values), expected in zip(drawn(tmp_path, [0, 1], None, None), y.T, strict=True):
        np.testing.assert_allclose(times, t, atol=1e-6)
        np.testing.assert_allclose(values, expected, rtol=1e-5, atol=1e-6)


@pytest.mark.parametrize("samples", [20 * FEW * 100, 20 * FEW * 100 + 177])
def test_extremes_of_every_stretch_are_kept(tmp_path, samples):
    """Compared with the smallest and largest value between the points that are drawn."""
    rng = np.random.default_rng(samples)
    t, y = np.arange(samples) / 1000.0, rng.standard_normal((samples, 1)).cumsum(axis=0)
    peaks = rng.integers(0, samples, 12)
    y[peaks, 0] += 1e4 * (1 + np.arange(12))
    written(tmp_path, t, y)
    for start, stop in ((None, None), (t[BLOCK + 3], t[-BLOCK - 5])):
        ((times, values),) = drawn(tmp_path, [0], start, stop, points=100)
        assert len(times) <= 100 and (np.diff(times) > 0).all()
        inside = (t >= (start or 0.0)) & (t <= (stop or t[-1]))
        largest = np.abs(y).max()  # six digits of it are drawn
        assert values.max() == pytest.approx(y[inside].max(), abs=1e-5 * largest)
        assert values.min() == pytest.approx(y[inside].min(), abs=1e-5 * largest)
        # each point is a sample of the signal
        k = np.rint(times * 1000.0).astype(int)
        np.testing.assert_allclose(values, y[k, 0], atol=1e-5 * largest)


def test_what_was_not_logged_is_nothing(tmp_path):
    samples = 400 * FEW * 10
    t, y = np.arange(samples) / 1000.0, np.ones((samples, 1))
    y[samples // 4 : samples // 2] = np.nan
    y[-5:, 0] = np.inf
    written(tmp_path, t, y)
    ((times, values),) = drawn(tmp_path, [0], None, None, points=400)
    middle = (times > t[samples // 4 + BLOCK]) & (times < t[samples // 2 - BLOCK])
    assert middle.sum() > 40 and np.isnan(values[middle]).all()
    assert (values[times < t[samples // 4 - BLOCK]] == 1.0).all()


def test_a_window_reads_only_what_it_shows(tmp_path):
    samples = 1_000_000
    written(tmp_path, np.arange(samples) / 1e3, np.random.default_rng(2).random((samples, 2)))
    tracemalloc.start()
    window(tmp_path, 0, "q", [0, 1], None, None)
    window(tmp_path, 0, "q", [0, 1], 10.0, 60.0)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 3e6  # the arrays have 16e6 bytes


def test_borders_of_a_window(tmp_path):
    t = np.arange(100) / 10.0
    written(tmp_path, t, t[:, None])
    ((times, _),) = drawn(tmp_path, [0], 2.05, 3.05)
    assert times[0] == 2.0 and times[-1] == 3.1  # one more, to which the line goes on
    ((times, _),) = drawn(tmp_path, [0], 50.0, 60.0)
    assert times.tolist() == [9.9]


def test_what_is_not_there(tmp_path):
    written(tmp_path, np.arange(3.0), np.ones((3, 1)))
    with pytest.raises(KeyError, match="no channel 'tau'"):
        window(tmp_path, 0, "tau", [0], None, None)
    with pytest.raises(KeyError, match="none of number 1"):
        window(tmp_path, 0, "q", [1], None, None)
    with pytest.raises(KeyError):
        window(tmp_path, 0, "../../../etc/passwd", [0], None, None)
