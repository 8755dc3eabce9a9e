import numpy as np
import pytest

from pivident.foundation.document.plot import kept_samples, stretches


@pytest.mark.parametrize("samples", [5001, 45_000])
def test_peaks_ends_and_size_are_kept(samples):
    y = np.sin(np.arange(samples) / 300.0)
    y[1234], y[-77] = 9.0, -8.0
    kept = kept_samples(y, 1000)
    assert kept.size <= 1000
    assert {0, 1234, samples - 77, samples - 1} <= set(kept.tolist())
    assert np.all(np.diff(kept) > 0)


def test_every_stretch_keeps_its_range():
    y = np.random.default_rng(2).standard_normal(20_000)
    kept = kept_samples(y, 402)
    for part in np.split(np.arange(y.size), 200):
        here = kept[(kept >= part[0]) & (kept <= part[-1])]
        assert y[here].min() == y[part].min()
        assert y[here].max() == y[part].max()


def test_short_signals_are_left_alone():
    np.testing.assert_array_equal(kept_samples(np.zeros(10), 300), np.arange(10))


def test_nan_is_never_an_extreme():
    y = np.linspace(0.0, 1.0, 5000)
    y[1000:3000] = np.nan
    assert not np.isnan(y[kept_samples(y, 100)]).all()
    assert 4999 in kept_samples(y, 100)


def test_stretches_of_a_mask():
    t = np.arange(1000) / 1000.0
    mask = np.zeros(1000, dtype=bool)
    mask[100:200] = mask[900:] = True
    assert stretches(mask, t) == [(0.1, 0.199), (0.9, 0.999)]
    assert stretches(np.zeros(1000, dtype=bool), t) == []
    assert stretches(np.ones(3, dtype=bool), t[:3]) == [(0.0, 0.002)]


def test_stretches_are_not_finer_than_a_drawing():
    mask = np.random.default_rng(1).random(100_000) < 0.5
    assert len(stretches(mask, np.arange(100_000.0))) <= 250
