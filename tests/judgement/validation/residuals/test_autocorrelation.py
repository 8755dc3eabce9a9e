import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import chi2
from statsmodels.stats.diagnostic import acorr_ljungbox
from statsmodels.stats.stattools import durbin_watson as statsmodels_durbin_watson
from statsmodels.tsa.stattools import acf

from pivident.judgement.validation.residuals.autocorrelation import (
    JointResidual,
    autocorrelation,
    durbin_watson,
    ljung_box,
    upper_tail,
    variance_factor,
)
from pivident.signals.noise_models import fit_ar, lagged_sums, whiten


def ar1(n, a=0.3, seed=0):
    return lfilter([1.0], [1.0, -a], np.random.default_rng(seed).standard_normal(n))


def test_autocorrelations_are_those_of_statsmodels():
    x = ar1(700)
    found = autocorrelation(JointResidual("a", (x,), rate=500.0), 60)
    assert np.allclose(found.rho, acf(x, nlags=60, adjusted=True)[1:], atol=1e-12)
    assert np.allclose(found.band, 2.0 / np.sqrt(700 - np.arange(1, 61)))


@pytest.mark.parametrize("order", [0, 3, 12])
def test_ljung_box_is_that_of_statsmodels(order):
    x = ar1(600, 0.05)
    found = ljung_box(JointResidual("a", (x,), order))
    table = acorr_ljungbox(x, lags=[order + 40], model_df=order)
    assert found.degrees_of_freedom == 40
    assert found.statistic == pytest.approx(table["lb_stat"].iloc[0], rel=1e-10)
    assert found.p_value == pytest.approx(table["lb_pvalue"].iloc[0], rel=1e-10)


def test_durbin_watson_is_that_of_statsmodels():
    x = ar1(500) + 0.2
    found = durbin_watson(JointResidual("a", (x,)))
    assert found.statistic == pytest.approx(statsmodels_durbin_watson(x), rel=1e-10)
    assert found.significant and found.matters
    assert np.isnan(durbin_watson(JointResidual("a", (x,), order=2)).p_value)


def test_a_gap_hides_no_correlation_and_makes_none():
    x = ar1(20_000, 0.5)
    x[::7] = np.nan
    found = autocorrelation(JointResidual("a", (x,)), 5)
    assert found.rho[:3] == pytest.approx([0.5, 0.25, 0.125], abs=0.03)
    white = np.random.default_rng(5).standard_normal(20_000)
    white[(np.arange(20_000) // 30) % 2 == 0] = np.nan
    assert ljung_box(JointResidual("a", (white,))).p_value > 0.01


def test_a_large_record_is_significant_without_practical_size():
    x = np.random.default_rng(2).standard_normal(200_001)
    small = ljung_box(JointResidual("a", (x[1:] + 0.03 * x[:-1],)))
    assert small.significant and not small.matters
    assert "significant, but of no practical size" in str(small)
    assert small.predictable == pytest.approx(0.03**2, rel=0.4)
    large = ljung_box(JointResidual("a", (x[1:] + 0.1 * x[:-1],), rate=1000.0))
    assert large.matters and large.largest_lag == 1e-3
    assert "at a lag of 1 ms" in str(large)


def test_the_distribution_after_aic_is_that_of_simulated_sums():
    squares = np.random.default_rng(0).standard_normal((200_000, 40)) ** 2
    sums = squares.cumsum(axis=1)
    kept = sums[(sums <= 2.0 * np.arange(1, 41)).all(axis=1), -1]
    assert kept.size / 200_000 == pytest.approx(0.712, abs=0.005)  # Shibata 1976
    for q in (25.0, 40.0, 53.0, 60.0):
        assert upper_tail(q, 40, 2.0) == pytest.approx(np.mean(kept > q), abs=4e-3)
    assert upper_tail(100.0, 40, 2.0) == 0.0
    assert upper_tail(50.0, 40, 30.0) == pytest.approx(chi2.sf(50.0, 40), abs=2e-3)


def test_factors_of_variance_are_one_for_white_residuals():
    white = lagged_sums([np.random.default_rng(3).standard_normal(5000)], 100)
    assert [variance_factor(white, m) for m in (2, 3, 4)] == [1.0, 1.0, 1.0]
    coloured = lagged_sums([ar1(100_000, 0.8)], 100)
    assert variance_factor(coloured, 2) == pytest.approx(1 + 2 * 0.64 / 0.36, rel=0.05)


def rejected(make, robust=False, runs=300):
    tests = [ljung_box(make(np.random.default_rng((3, k)))) for k in range(runs)]
    return np.mean([(t.robust_p_value if robust else t.p_value) < 0.05 for t in tests])


def whitened(rng, order=None):
    v = lfilter([1.0], [1.0, -1.2, 0.5], rng.standard_normal(1700))[200:]
    model = fit_ar(v, 40, order=order)
    x = whiten(model, v - model.mean)
    x[: model.order] = np.nan
    return JointResidual("a", (x,), model.order, penalty=2.0 if order is None else None)


def masked(rng):
    x = rng.standard_normal(600)
    x[(np.arange(600) // 50) % 4 == 3] = np.nan
    return JointResidual("a", (x,))


def changing(rng):
    return JointResidual(
        "a", (rng.standard_normal(800) * (0.3 + np.abs(np.sin(np.arange(800) / 50))),)
    )


# 300 records at 5 %: 99.7 % of the shares of a right test lie between 1.2 and 8.8 %
@pytest.mark.parametrize("make", [masked, whitened, lambda rng: whitened(rng, 2)])
def test_ljung_box_has_its_size(make):
    assert 0.012 < rejected(make) < 0.088


def test_the_robust_test_has_its_size_where_the_variance_changes():
    assert rejected(changing) > 0.12
    assert 0.012 < rejected(changing, robust=True) < 0.088


def test_ljung_box_sees_an_order_too_low():
    assert rejected(lambda rng: whitened(rng, 1), runs=50) > 0.9
