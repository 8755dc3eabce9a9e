import math

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.data.recording.recording import Recording
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import ExperimentError, NonFiniteSamples, RecordingError
from pivident.signals.coloured_walk_likelihood import (
    NoiseColour,
    coloured_fit,
    estimate_coloured_nvr,
)
from pivident.signals.random_walk import smooth_channels, smooth_with_lines
from pivident.signals.random_walk_likelihood import diffuse_fit, estimate_nvr
from pivident.signals.spectral_lines import LineSearch, SpectralLine, find_lines, noise_colour
from tests.signals.motions import RATE, difference_matrix, point_to_point

WHITE = NoiseColour(np.ones(1), np.ones(1))
FLOOR = 2e-6


def resonance(radius, angle):
    return np.real(np.poly(radius * np.exp([1j * angle, -1j * angle])))


COLOURS = {
    "ar1": NoiseColour(np.array([1.0, -0.5]), np.ones(1)),
    "ar2": NoiseColour(resonance(0.98, 0.6), np.ones(1), 0.5),
    "line": NoiseColour(resonance(0.98, 0.6), resonance(0.8, 0.6), 1.3),
    "ar5": NoiseColour(np.poly([0.7, 0.5, -0.3, 0.2, 0.6]), np.array([1.0, 0.4])),
}


def toeplitz(row, rows):
    """Banded matrix with ``row`` along its diagonal, rows × (rows + len(row) - 1)."""
    matrix = np.zeros((rows, rows + len(row) - 1))
    for k in range(rows):
        matrix[k, k : k + len(row)] = row
    return matrix


def dense_fit(y, nvr, order, colour):
    """T of generalised least squares, diffuse in T and in the start of v; r̂, log L by matrices."""
    degree = len(colour.ar) - 1
    d = difference_matrix(y.size, order)
    a = toeplitz(colour.ar[::-1], y.size - degree)
    b = toeplitz(colour.ma[::-1], y.size - degree)
    covariance = colour.gain * b @ b.T
    whitened = a.T @ np.linalg.inv(covariance)
    level = np.linalg.solve(d.T @ d / nvr + whitened @ a, whitened @ a @ y)
    n = y.size - order - degree
    a, d = toeplitz(colour.ar[::-1], n), difference_matrix(n + order, order)
    omega = nvr * a @ a.T + d @ covariance @ d.T
    w = np.convolve(np.diff(y, order), colour.ar, "valid")
    variance = w @ np.linalg.solve(omega, w) / n
    log_det = np.linalg.slogdet(omega)[1]
    return level, variance, -0.5 * (n * (math.log(2 * math.pi * variance) + 1) + log_det)


def line_noise(samples, frequency, seed, std=3e-6, radius=0.998):
    """AR(2) noise of that deviation around a frequency [Hz]."""
    width = -math.log(radius) * RATE / (2 * math.pi)
    ar, variance = SpectralLine(frequency, width, std).autoregressive(RATE)
    white = np.random.default_rng(seed).standard_normal(samples + 5000)
    return lfilter([math.sqrt(variance)], ar, white)[5000:]


def encoder(frequency=None, seed=0, **options):
    """A motion, and what an encoder with a white floor and one line tells of it."""
    q, ddq = point_to_point()
    y = q + FLOOR * np.random.default_rng(seed).standard_normal(q.size)
    return (y if frequency is None else y + line_noise(q.size, frequency, seed, **options)), ddq


@pytest.mark.parametrize("colour", COLOURS.values(), ids=COLOURS)
@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_smoothing_and_likelihood_are_those_of_dense_matrices(order, colour):
    rng = np.random.default_rng(order)
    y = 1e-2 * np.cumsum(np.cumsum(rng.standard_normal(300)))
    y += lfilter(colour.ma, colour.ar, rng.standard_normal(300))
    for nvr in (1e-3, 1e-1):
        level, variance, log_likelihood = dense_fit(y, nvr, order, colour)
        fit = coloured_fit(y, nvr, order, colour)
        np.testing.assert_allclose(fit.level, level, atol=1e-6 * np.std(y))
        assert fit.noise_variance == pytest.approx(variance, rel=1e-7)
        assert fit.log_likelihood == pytest.approx(log_likelihood, abs=1e-5)


@pytest.mark.parametrize("order", [1, 2, 3, 4])
def test_white_noise_is_the_special_case(order):
    y, _ = encoder()
    y = y[:8000]
    expected, nvr = diffuse_fit(y, 1e-5, order), estimate_nvr(y, RATE, order).nvr
    fit = coloured_fit(y, 1e-5, order, WHITE)
    np.testing.assert_allclose(fit.level, expected.level, atol=1e-13)
    assert fit.log_likelihood == pytest.approx(expected.log_likelihood, abs=1e-3)
    assert estimate_coloured_nvr(y, RATE, order, WHITE).nvr == pytest.approx(nvr, rel=1e-2)


def test_statsmodels_agrees_once_its_stationary_start_is_forgotten():
    structural = pytest.importorskip("statsmodels.tsa.statespace.structural")
    rng = np.random.default_rng(5)
    ar, nvr, share = resonance(0.9, 0.7), 1e-4, 2.0
    y = np.cumsum(np.cumsum(math.sqrt(nvr) * rng.standard_normal(1000)))
    y += rng.standard_normal(1000) + lfilter([math.sqrt(share)], ar, rng.standard_normal(1000))
    numerator = np.convolve(ar, ar[::-1])
    numerator[2] += share
    roots = np.roots(numerator)
    ma = np.real(np.poly(roots[np.argsort(np.abs(roots))][:2]))
    colour = NoiseColour(ar, ma, numerator[2] / np.dot(ma, ma))
    model = structural.UnobservedComponents(y, "strend", autoregressive=2, use_exact_diffuse=True)
    model.ssm.tolerance = 0.0
    smoothed = model.smooth([1.0, nvr, share, *-ar[1:]]).level.smoothed
    fit = coloured_fit(y, nvr, 2, colour)
    assert np.abs(fit.level - smoothed)[:20].max() > 1e-4  # ours knows nothing of the start
    np.testing.assert_allclose(fit.level[400:], smoothed[400:], atol=1e-6)


def test_search_ends_on_the_maximum_of_the_likelihood():
    y, _ = encoder(200.0)
    y = y[:10000]
    colour = noise_colour(find_lines(y, RATE, 3), RATE)
    found = estimate_coloured_nvr(y, RATE, 3, colour)
    best = coloured_fit(y, found.nvr, 3, colour).log_likelihood
    assert not found.on_bound
    for factor in (0.9, 1.1):
        assert coloured_fit(y, factor * found.nvr, 3, colour).log_likelihood < best
    assert best > diffuse_fit(y, estimate_nvr(y, RATE, 3).nvr, 3).log_likelihood + 500


def test_bandwidth_stays_below_its_cap():
    y, _ = encoder(200.0)
    smoothed = smooth_with_lines(y[:, None], RATE, f50_max=30.0)
    assert smoothed.signal.f50[0] == pytest.approx(30.0, rel=1e-3)
    assert smoothed.signal.on_bound[0]
    assert np.isnan(smoothed.signal.log_nvr_std[0])


@pytest.mark.parametrize("frequency", [100.0, 200.0, 600.0, 1500.0])
def test_a_line_is_found_and_measured(frequency):
    for seed in range(3):
        y, _ = encoder(frequency, seed)
        (line,) = find_lines(y, RATE, 3).lines
        realised = np.std(line_noise(y.size, frequency, seed))
        assert line.frequency == pytest.approx(frequency, abs=1.0)
        assert line.width == pytest.approx(1.59, rel=0.5)  # 22 degrees of freedom in 6.9 s
        assert line.std == pytest.approx(realised, rel=0.15)


def test_wide_lines_and_mains_are_found_too():
    wide, _ = encoder(200.0, radius=0.99)
    (line,) = find_lines(wide, RATE, 3).lines
    assert line.width == pytest.approx(8.0, rel=0.4)
    y, _ = encoder()
    mains = y + 1e-6 * np.sin(2 * np.pi * 100.0 / RATE * np.arange(y.size))
    (line,) = find_lines(mains, RATE, 3).lines
    assert line.frequency == pytest.approx(100.0, abs=0.1)
    assert line.width < 0.5


def test_two_lines_are_told_apart_and_make_one_colour():
    y, _ = encoder(200.0)
    y += line_noise(y.size, 700.0, 9, std=5e-6)
    found = find_lines(y, RATE, 3)
    assert [round(line.frequency, -1) for line in found.lines] == [700.0, 200.0]
    assert math.sqrt(found.floor) == pytest.approx(FLOOR, rel=0.1)
    omega = np.linspace(0.01, 3.1, 400)
    expected = np.full(omega.size, found.floor)
    for line in found.lines:
        ar, variance = line.autoregressive(RATE)
        expected += variance / np.abs(np.polyval(ar[::-1], np.exp(-1j * omega))) ** 2
    colour = noise_colour(found, RATE)
    np.testing.assert_allclose(found.floor * colour.spectrum(omega), expected, rtol=1e-8)
    assert (np.abs(np.roots(colour.ma)) < 1).all()


def test_lorentz_curve_is_the_peak_of_its_autoregressive_model():
    line = SpectralLine(200.0, 1.6, 3e-6)
    ar, variance = line.autoregressive(RATE)
    frequency = np.linspace(190.0, 210.0, 41)
    z = np.exp(-2j * np.pi * frequency / RATE)
    exact = variance / np.abs(np.polyval(ar[::-1], z)) ** 2
    np.testing.assert_allclose(line.spectrum(frequency, RATE), exact, rtol=0.05)


def test_white_noise_has_no_line_and_is_smoothed_as_before():
    for seed in range(20):
        y, _ = encoder(seed=seed)
        assert find_lines(y, RATE, 3).lines == ()
    expected, smoothed = smooth_channels(y[:, None], RATE), smooth_with_lines(y[:, None], RATE)
    assert np.array_equal(smoothed.signal.ddq, expected.ddq)
    assert smoothed.lines == ((),)


def test_quantised_positions_have_no_line():
    y, _ = encoder()
    step = 2 * np.pi / 3600
    assert find_lines(step * np.round(y / step), RATE, 3).lines == ()


def test_periods_of_a_motion_are_no_lines():
    y, _ = encoder()
    pulses = np.zeros(y.size)
    pulses[:: int(RATE / 10)] = 1.0  # ten a second, so that the comb's teeth stand apart
    y += 2e-5 * lfilter([1.0], resonance(0.97, 0.06), pulses)
    assert find_lines(y, RATE, 3).lines == ()


@pytest.mark.parametrize("rate", [50.0, 100.0, 250.0, 1000.0])
def test_lines_of_slow_records_are_sought_where_there_is_room(rate):
    y, _ = encoder()
    y += 3e-6 * np.sin(0.24 * 2 * np.pi * np.arange(y.size))
    found = find_lines(y, rate, 3).lines
    assert [round(line.frequency / rate, 3) for line in found] == ([0.24] if rate > 200 else [])


def test_short_and_constant_records_have_no_line():
    y, _ = encoder(600.0)
    assert find_lines(y[:5000], RATE, 3) == LineSearch((), 0.0)
    assert find_lines(np.ones(20000), RATE, 3).lines == ()


def test_only_the_channel_with_a_line_is_treated():
    white, ddq = encoder()
    coloured, _ = encoder(200.0, seed=1)
    y = np.stack([white, coloured + 1.2], axis=1)
    plain, known = smooth_channels(y, RATE), smooth_with_lines(y, RATE)
    assert [len(lines) for lines in known.lines] == [0, 1]
    np.testing.assert_array_equal(known.signal.ddq[:, 0], plain.ddq[:, 0])
    inner = slice(300, -300)
    errors = [np.std(s.ddq[inner, 1] - ddq[inner]) for s in (plain, known.signal)]
    floor_only = np.std(plain.ddq[inner, 0] - ddq[inner])
    assert plain.f50[1] > 2 * plain.f50[0]  # taken for motion, the line opens the bandwidth
    assert known.signal.f50[1] == pytest.approx(plain.f50[0], rel=0.05)
    assert errors[1] < 0.1 * errors[0]
    assert errors[1] < 1.2 * floor_only
    assert known.signal.noise_std[1] == pytest.approx(FLOOR, rel=0.05)


def test_what_cannot_be_smoothed_is_refused():
    y, _ = encoder(200.0)
    with pytest.raises(RecordingError, match="orders are"):
        smooth_with_lines(y[:, None], RATE, order=5)
    y[7] = np.nan
    with pytest.raises(NonFiniteSamples):
        smooth_with_lines(y[:, None], RATE)


def test_recipe_decides_whether_lines_are_searched():
    y, _ = encoder(200.0)
    record = Recording("line", ("a",), y[:, None], y[:, None], RATE)
    searched = estimate_kinematics(record, RandomWalk())
    assert [round(line.frequency) for line in searched.lines[0]] == [200]
    white = estimate_kinematics(record, RandomWalk(measurement_noise="white"))
    assert white.lines == ()
    assert white.f50[0] > 2 * searched.f50[0]
    assert estimate_kinematics(record, RandomWalk(order=2, passes=2)).lines == ()
    with pytest.raises(ExperimentError, match="measurement_noise"):
        RandomWalk(measurement_noise="pink")
