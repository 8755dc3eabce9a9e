import numpy as np
import pytest
from hypothesis import given, strategies as st
from scipy.io import loadmat
from scipy.signal import butter, filtfilt

from pivident.foundation.errors import RecordingError, RecordingTooShort
from pivident.signals.bandpass import bandpass, butterworth, central_difference, median_filter
from pivident.signals.decimation import parallel_decimation


def test_sections_agree_with_the_transfer_function():
    x = np.random.default_rng(0).standard_normal((500, 3))
    b, a = butter(4, 100, fs=1000)
    np.testing.assert_allclose(
        butterworth(x, 1000, 100), filtfilt(b, a, x, axis=0, padlen=12), atol=1e-10
    )


def test_filter_has_no_phase_and_half_the_amplitude_at_its_cutoff():
    t = np.arange(20_000) / 5000
    x = np.cos(2 * np.pi * 50 * t)
    inner = slice(2000, -2000)
    np.testing.assert_allclose(butterworth(x, 5000, 50)[inner], x[inner] / 2, atol=1e-6)


def test_derivatives_of_a_slow_motion():
    t = np.arange(5000) / 1000
    result = bandpass(np.sin(t), 1000, 50, median=3)
    inner = slice(200, -200)
    np.testing.assert_allclose(result.dq[inner], np.cos(t)[inner], atol=1e-5)
    np.testing.assert_allclose(result.ddq[inner], -np.sin(t)[inner], atol=2e-3)


def test_edge_is_a_period_of_the_cutoff_but_not_less_than_fifty():
    x = np.zeros(1000)
    assert bandpass(x, 1000, 100).edge == 50
    assert bandpass(x, 5000, 50).edge == 100


def test_central_differences_are_those_of_numpy():
    x = np.random.default_rng(0).standard_normal((20, 2))
    np.testing.assert_allclose(central_difference(x, 4.0)[1:-1], (x[2:] - x[:-2]) * 2)


@given(st.integers(1, 98), st.floats(-1e6, 1e6))
def test_a_single_outlier_is_removed(place, height):
    x = np.arange(100.0)[:, None] * [1.0, 2.0]
    spoilt = x.copy()
    spoilt[place] = height
    assert np.abs(median_filter(spoilt) - x).max() <= 2


def test_median_of_one_changes_nothing():
    x = np.random.default_rng(0).standard_normal(10)
    np.testing.assert_array_equal(median_filter(x, 1), x)


@pytest.mark.parametrize("length", [0, 2, -3])
def test_even_medians_are_refused(length):
    with pytest.raises(RecordingError, match="odd"):
        median_filter(np.zeros(10), length)


@pytest.mark.parametrize("cutoff", [0.0, 500.0, 600.0])
def test_cutoff_must_lie_below_half_the_rate(cutoff):
    with pytest.raises(RecordingError, match="cut-off"):
        butterworth(np.zeros(100), 1000, cutoff)


def test_a_cutoff_beyond_the_rate_asks_for_the_unit_of_time():
    with pytest.raises(RecordingError, match=r't = "ms"'):
        butterworth(np.zeros(100), 1, 50)


def test_too_short_a_record_is_refused():
    with pytest.raises(RecordingTooShort, match=r"has 12 sample.*at least 13"):
        butterworth(np.zeros(12), 1000, 100)


@pytest.mark.record
def test_published_parameters_of_the_emps_come_out(data_dir):
    data = loadmat(data_dir / "emps" / "DATA_EMPS.mat")
    force = float(data["gtau"].item()) * data["vir"].ravel()
    signals = bandpass(data["qm"].ravel(), 1000, 100)
    columns = np.column_stack(
        [signals.ddq, signals.dq, np.sign(signals.dq), np.ones(force.size), force]
    )
    rows = parallel_decimation(columns[49:], 10)
    found = np.linalg.lstsq(rows[:, :4], rows[:, 4])[0]
    np.testing.assert_allclose(found, [95.1089, 203.5034, 20.3935, -3.1648], atol=1e-4)


@pytest.mark.record
def test_equations_above_one_percent_of_rated_speed_on_the_tx40(data_dir):
    """2081 equations remain; they need the whole chain from median filter to decimation."""
    file = data_dir / "staubli_tx40" / "pos_read_data.csv.gz"
    motor = np.loadtxt(file, delimiter=",", skiprows=1)
    reduction = np.diag([32.0, 32, 45, -48, 45, 32])
    reduction[5, 4] = 32
    q = motor @ np.linalg.inv(reduction).T
    dq = bandpass(q, 5000, 100, median=3).dq
    slow = [0.05009095, 0.05009095, 0.07504916, 0.0715585, 0.05585054, 0.12217305]
    decimated = parallel_decimation(dq[20:44980], 100)
    assert decimated.shape == (450, 6)
    assert np.count_nonzero(np.abs(decimated) > slow) == 2081
