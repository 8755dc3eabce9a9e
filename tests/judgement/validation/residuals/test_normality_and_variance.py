import numpy as np
import pytest
from scipy.signal import lfilter
from scipy.stats import normaltest
from statsmodels.stats.diagnostic import het_breuschpagan, het_white
from statsmodels.stats.stattools import jarque_bera
from statsmodels.tools import add_constant

from pivident.judgement.validation.residuals.cross_correlation import variance_test
from pivident.judgement.validation.residuals.residual_tests import normality
from pivident.signals.noise_models import lagged_sums

DRIVERS = np.abs(np.sin(np.linspace(0.0, 9.0, 500)[:, None] * [1.0, 1.7, 0.6]))
NAMES = ("speed", "acceleration", "torque")


def test_normality_is_that_of_scipy_and_moments_those_of_statsmodels():
    x = np.random.default_rng(0).standard_t(6, 400)
    found = normality(x, lagged_sums([x], 100))
    expected = normaltest(x)
    assert found.statistic == pytest.approx(expected.statistic, rel=1e-10)
    assert found.p_value == pytest.approx(expected.pvalue, rel=1e-10)
    _, _, skewness, kurtosis = jarque_bera(x)
    assert found.skewness == pytest.approx(skewness, rel=1e-10)
    assert found.excess_kurtosis == pytest.approx(kurtosis - 3.0, rel=1e-10)


def test_variance_tests_are_those_of_statsmodels():
    x = np.random.default_rng(1).standard_normal(500) * (0.7 + DRIVERS[:, 0])
    found = variance_test(x, DRIVERS, NAMES)
    statistic, p, _, _ = het_breuschpagan(x, add_constant(DRIVERS))
    assert found.statistic == pytest.approx(statistic, rel=1e-10)
    assert found.p_value == pytest.approx(p, rel=1e-10)
    white = variance_test(x, DRIVERS, NAMES, products=True)
    statistic, p, _, _ = het_white(x, add_constant(DRIVERS))
    assert white.degrees_of_freedom == 9
    assert white.statistic == pytest.approx(statistic, rel=1e-10)
    assert white.p_value == pytest.approx(p, rel=1e-10)


def test_a_driver_that_repeats_another_takes_no_degree_of_freedom():
    x = np.random.default_rng(2).standard_normal(500)
    twice = np.column_stack([DRIVERS[:, 0], 2.0 * DRIVERS[:, 0]])
    assert variance_test(x, twice, NAMES[:2]).degrees_of_freedom == 1


def test_sentences_tell_significance_from_practical_size():
    rng = np.random.default_rng(3)
    drivers = rng.uniform(size=(200_000, 1))
    x = rng.standard_normal(200_000)
    small = variance_test(x * (1.0 + 0.1 * drivers[:, 0]), drivers, ["speed"])
    assert small.significant and not small.matters and small.ratio == pytest.approx(1.16, abs=0.03)
    assert "significant, but of no practical size" in str(small)
    large = variance_test(x * (0.5 + drivers[:, 0]), drivers, ["speed"])
    assert large.matters and "where the speed is in its upper quarter" in str(large)
    tails = normality(rng.standard_t(40, 200_000))
    assert tails.significant and not tails.matters
    assert normality(rng.standard_t(5, 20_000)).matters


def rejected(p_value, make, runs=300):
    values = [p_value(make(np.random.default_rng((4, k)))) for k in range(runs)]
    return np.mean(np.array(values) < 0.05)


def white(rng):
    return rng.standard_normal(500)


def correlated(rng):
    return lfilter([1.0], [1.0, -0.9], rng.standard_normal(2700))[200:]


def p_normal(x):
    return normality(x, lagged_sums([x], 100)).p_value


def p_variance(x):
    slow = np.abs(np.sin(np.linspace(0.0, 9.0, x.size)[:, None] * [1.0, 1.7]))
    return variance_test(x, slow, NAMES[:2], lagged_sums([x], 100)).p_value


# 300 records at 5 %: 99.7 % of the shares of a right test lie between 1.2 and 8.8 %
@pytest.mark.parametrize("p_value", [p_normal, p_variance])
@pytest.mark.parametrize("make", [white, correlated])
def test_sizes_hold_for_white_and_for_correlated_residuals(p_value, make):
    assert 0.012 < rejected(p_value, make) < 0.088


def test_power():
    assert rejected(p_normal, lambda rng: rng.standard_t(4, 500), 100) > 0.9
    wide = 0.3 + np.abs(np.sin(np.linspace(0.0, 9.0, 500)))
    assert rejected(p_variance, lambda rng: wide * rng.standard_normal(500), 100) > 0.9
