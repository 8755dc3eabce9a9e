import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.data.logs import timestamps
from pivident.data.logs.clock_alignment import ClockedChannel, resampled
from pivident.foundation.errors import (
    IrregularSampling,
    MissingSamples,
    RecordingError,
    RecordingTooShort,
)


@given(st.floats(0.5, 2e4), st.floats(-1e3, 1e3), st.integers(20, 2000))
def test_regular_stamps_give_their_rate(rate, start, samples):
    t = start + np.arange(samples) / rate
    assert timestamps.rate_of(t) == pytest.approx(rate, rel=2e-5)


def test_a_rate_within_the_clocks_accuracy_is_a_whole_number():
    assert timestamps.rate_of(np.arange(1000) / 1000.002) == 1000.0
    assert timestamps.rate_of(np.arange(1000) / 312.5) == pytest.approx(312.5)


def stamps():
    return np.arange(100) / 100.0


def test_jitter_is_refused_with_its_place():
    t = stamps()
    t[40:] += 0.004
    with pytest.raises(IrregularSampling, match="resample") as caught:
        timestamps.rate_of(t)
    assert (caught.value.kind, caught.value.sample) == ("jitter", 40)
    assert caught.value.interval == pytest.approx(0.014)
    assert caught.value.expected == pytest.approx(0.01)


def test_a_repeated_stamp_is_refused_with_its_place():
    t = stamps()
    t[40] = t[39]
    with pytest.raises(IrregularSampling) as caught:
        timestamps.rate_of(t)
    assert (caught.value.kind, caught.value.sample) == ("duplicate", 40)


def test_a_stamp_that_goes_backward_is_refused_even_when_resampling():
    t = stamps()
    t[40] = t[38]
    with pytest.raises(IrregularSampling) as caught:
        timestamps.uniform_grid(t)
    assert (caught.value.kind, caught.value.sample) == ("backward", 40)


def test_stamps_that_are_not_finite_are_refused():
    t = stamps()
    t[7] = np.nan
    with pytest.raises(RecordingError, match="sample 7"):
        timestamps.rate_of(t)


def test_too_few_stamps_are_refused():
    with pytest.raises(RecordingTooShort):
        timestamps.rate_of(stamps()[:3])


def test_a_given_rate_has_to_agree_with_the_stamps():
    timestamps.check_rate(100.4, stamps())
    with pytest.raises(RecordingError, match="unit of the time column"):
        timestamps.check_rate(100.0, stamps() * 1000.0)
    with pytest.raises(RecordingError):
        timestamps.check_rate(100.0, np.zeros(100))
    with pytest.raises(RecordingError, match="positive"):
        timestamps.check_rate(-100.0, stamps())


def test_a_uniform_grid_covers_the_stamps():
    jitter = np.random.default_rng(3).uniform(-2e-3, 2e-3, 100)
    grid, rate = timestamps.uniform_grid(stamps() + jitter, 100.0)
    assert rate == 100.0
    assert grid[0] == jitter[0]
    assert stamps()[-1] + jitter[-1] - 0.01 <= grid[-1] <= stamps()[-1] + jitter[-1]


def test_a_grid_of_no_rate_is_refused():
    with pytest.raises(RecordingError, match="positive"):
        timestamps.uniform_grid(stamps(), 0.0)


def test_channels_are_resampled_each_in_its_own_way():
    t = np.sort(np.random.default_rng(4).uniform(0.0, 2.0, 400))
    grid, _ = timestamps.uniform_grid(t, 150.0)
    smooth = timestamps.resample_smooth(t, np.column_stack([t**3, t]), grid)
    np.testing.assert_allclose(smooth, np.column_stack([grid**3, grid]), atol=1e-11)
    linear = timestamps.resample_linear(t, np.column_stack([2.0 * t, -t]), grid)
    np.testing.assert_allclose(linear, np.column_stack([2.0 * grid, -grid]), atol=1e-12)
    held = timestamps.resample_held(t, t[:, None], grid)[:, 0]
    assert np.all(held <= grid)
    assert np.all(np.isin(held, t))


def test_missing_samples_are_counted_and_the_largest_gap_is_named():
    t = np.delete(stamps(), [20, 40, 41, 42])
    with pytest.raises(MissingSamples, match=r"4 sample\(s\) are missing in 2 gaps") as caught:
        timestamps.rate_of(t)
    assert (caught.value.missing, caught.value.gaps, caught.value.sample) == (4, 2, 38)
    assert caught.value.interval == pytest.approx(0.04)
    assert "0.04 s after sample 38 (t = 0.390000 s)" in str(caught.value)
    with pytest.raises(MissingSamples, match=r"1 sample\(s\) are missing in one gap"):
        timestamps.rate_of(np.delete(stamps(), 20))


def test_intervals_are_told_in_microseconds():
    coarse = np.repeat(np.arange(50) / 1000.0, 4)
    with pytest.raises(IrregularSampling, match=r"by 0 µs instead of 246\.231 µs"):
        timestamps.rate_of(coarse)
    t = np.arange(100) / 4000.0
    t[40:] += 1e-4
    with pytest.raises(IrregularSampling, match="by 350 µs instead of 250 µs"):
        timestamps.rate_of(t)


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "ms"), (1e6, "us"), (1e9, "ns")])
def test_stamps_that_are_hardly_seconds_are_refused(scale, unit):
    timestamps.check_seconds(np.arange(100) / 100.0)
    with pytest.raises(RecordingError, match=f't = "{unit}"'):
        timestamps.check_seconds(np.arange(100) / 1000.0 * scale)


def test_the_mean_rate_is_that_of_the_recorded_time():
    alternating = np.cumsum(np.r_[0.0, np.tile([0.010, 0.012], 500)])
    assert timestamps.mean_rate(alternating) == pytest.approx(1000 / 11, rel=1e-9)
    rng = np.random.default_rng(3)
    jittery = np.cumsum(0.01 * (1.0 + np.clip(0.3 * rng.standard_normal(4000), -0.9, 2.0)))
    elapsed = (len(jittery) - 1) / (jittery[-1] - jittery[0])
    assert timestamps.mean_rate(jittery) == pytest.approx(elapsed, rel=1e-3)
    regular = np.delete(np.arange(4000) / 100.0, [700, 701, 2000])
    assert timestamps.mean_rate(regular) == 100.0  # lost samples leave the rate of a clock
    paused = np.r_[jittery, jittery[-1] + 30.0 + jittery]
    assert timestamps.mean_rate(paused) == pytest.approx(elapsed, rel=1e-3)


def test_torques_keep_their_amplitude_on_another_grid():
    """Straight lines would damp a sine at 5 Hz by 0.8 % on average, a spline by a hundredth."""
    rng = np.random.default_rng(4)
    t = np.cumsum(0.01 * (1.0 + 0.15 * rng.standard_normal(4000)))
    tau = ClockedChannel("tau", "t", t, np.sin(2 * np.pi * 5.0 * t)[:, None])
    grid = np.arange(t[10], t[-10], 0.01)
    wave = np.sin(2 * np.pi * 5.0 * grid)
    kept = resampled(tau, grid, 100.0)[:, 0] @ wave / (wave @ wave)
    assert kept == pytest.approx(1.0, abs=2e-4)
    linear = timestamps.resample_linear(t, tau.values, grid)[:, 0] @ wave / (wave @ wave)
    assert linear < 0.995


def test_samples_that_nearly_coincide_make_no_steep_spline():
    """Two messages of one instant, a microsecond apart, that differ by the encoder's noise."""
    t = np.arange(400) / 100.0
    t[201] = t[200] + 1e-6
    q = 1e-4 * np.random.default_rng(5).standard_normal((400, 1))
    assert np.abs(timestamps.resample_smooth(t, q, np.arange(1, 390) / 100.0)).max() < 1e-3


@pytest.mark.parametrize("samples", [2, 3, 5, timestamps.MIN_SAMPLES])
def test_of_a_few_samples_stamps_are_neither_better_nor_worse(samples):
    t = np.cumsum(np.r_[0.0, np.linspace(1.0, 2.0, samples - 1)])
    assert np.isnan(timestamps.stamp_error(np.sin(t)[:, None], t))
