"""Covariance from the autocovariance of the residual, against closed forms and Monte Carlo."""

import numpy as np
import pytest
from scipy.linalg import toeplitz
from scipy.signal import lfilter

from pivident.estimation.covariance.stationary_noise import ScoreSpectra

SAMPLES = 6000
LAGS = 400


def motion(gaps):
    """Two slow columns, and which of their samples vote."""
    t = np.arange(SAMPLES)
    z = np.vstack([np.sin(0.004 * t), np.cos(0.011 * t) + 0.3])
    votes = ((t // 500) % 3 != 2).astype(float) if gaps else np.ones(SAMPLES)
    return z * votes, votes


def differentiated(rng):
    """Noise with next to nothing at low frequencies, as twice differentiated encoder noise."""
    white = rng.normal(size=SAMPLES + 500)
    return lfilter([1.0, -2.0, 1.0], np.convolve([1.0, -0.9], [1.0, -0.9]), white)[500:]


def correlated(rng):
    return lfilter([1.0], [1.0, -0.9], rng.normal(size=SAMPLES + 500))[500:]


def estimate(z, votes, noise, lags=LAGS, stretches=1):
    """Estimate of zero parameters by least squares, and its deviations."""
    gradient = z @ z.T
    inverse = np.linalg.inv(gradient)
    theta = inverse @ (z @ noise)
    residual = (noise - theta @ z) * votes
    length = SAMPLES // stretches
    spectra = ScoreSpectra(inverse, length, lags)
    for k in range(stretches):
        part = slice(k * length, (k + 1) * length)
        spectra.add(z[None, :, part], residual[None, part], votes[None, part])
    return theta, np.sqrt(np.diag(inverse @ spectra.variance_of_scores() @ inverse.T))


@pytest.mark.parametrize("gaps", [False, True])
@pytest.mark.parametrize(("make_noise", "lags"), [(differentiated, 1000), (correlated, 200)])
def test_deviations_are_those_of_repeated_records(make_noise, lags, gaps):
    z, votes = motion(gaps)
    rng = np.random.default_rng(3)
    found = [estimate(z, votes, make_noise(rng), lags) for _ in range(150)]
    theta, std = (np.array(x) for x in zip(*found, strict=True))
    ratio = std.mean(axis=0) / theta.std(axis=0)
    assert ratio == pytest.approx(1.0, abs=0.2)  # the taper smooths what falls as f⁴
    # each record knows its deviation well, as far as it has pairs at the longest lag
    assert (std.std(axis=0) < (0.35 if lags > 500 else 0.25) * std.mean(axis=0)).all()


def test_variance_of_scores_is_the_double_sum_over_the_autocovariance():
    z, votes = motion(gaps=True)
    z, votes = z[:, :1500], votes[:1500]
    coefficients = lfilter([1.0], [1.0, -0.8], np.eye(1, 200)[0])
    autocovariance = np.correlate(coefficients, coefficients, "full")[199:]
    exact = z @ toeplitz(np.pad(autocovariance, (0, 1300))) @ z.T
    rng = np.random.default_rng(4)
    spectra = ScoreSpectra(np.zeros((2, 2)), 1500, LAGS)
    for _ in range(300):
        noise = lfilter([1.0], [1.0, -0.8], rng.normal(size=1700))[200:]
        spectra.add(z[None], (noise * votes)[None], votes[None])
    assert spectra.variance_of_scores() / 300 == pytest.approx(
        exact, rel=0.03, abs=0.03 * exact.max()
    )


def test_white_residuals_give_the_formula():
    z, votes = motion(gaps=False)
    noise = 0.3 * np.random.default_rng(5).normal(size=SAMPLES)
    _, std = estimate(z, votes, noise, lags=50)
    plain = noise.std() * np.sqrt(np.diag(np.linalg.inv(z @ z.T)))
    assert std == pytest.approx(plain, rel=0.15)


def test_stretches_give_what_the_whole_record_gives():
    z, votes = motion(gaps=True)
    noise = correlated(np.random.default_rng(6))
    whole, apart = (estimate(z, votes, noise, lags=200, stretches=k)[1] for k in (1, 3))
    assert apart == pytest.approx(whole, rel=0.1)


def test_series_that_share_their_noise_are_counted_as_such():
    """Two series with one noise, the second delayed: the variance of the sum of both scores."""
    z, votes = motion(gaps=True)
    z, votes = z[:, :1500], votes[:1500]
    both = np.stack([z, 0.7 * np.roll(z, 3, axis=1) * votes])
    rng = np.random.default_rng(7)
    spectra = ScoreSpectra(np.zeros((2, 2)), 1500, LAGS, series=2)
    scores = []
    for _ in range(400):
        noise = lfilter([1.0], [1.0, -0.8], rng.normal(size=1703))[200:]
        pair = np.stack([noise[3:], -noise[:-3]])[:, :1500] * votes
        spectra.add(both, pair, np.stack([votes, votes]))
        scores.append(np.einsum("akt,at->k", both, pair))
    found = spectra.variance_of_scores() / 400
    exact = np.cov(np.array(scores).T)
    apart = ScoreSpectra(np.zeros((2, 2)), 1500, LAGS)
    for a in range(2):
        apart.add(both[a][None], pair[a][None], votes[None])
    assert found == pytest.approx(exact, rel=0.2, abs=0.2 * exact.max())
    assert (np.diag(found) < 0.35 * np.diag(apart.variance_of_scores())).all()
