from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
import statsmodels.api as sm

from tests.synthetic_identification import synthetic_identification


def fitted():
    """An ordinary least squares fit of statsmodels, and an identification with its estimate."""
    rng = np.random.default_rng(3)
    result = synthetic_identification()
    x = rng.normal(size=(400, len(result.names)))
    y = x @ rng.normal(size=len(result.names)) + 0.3 * rng.normal(size=400)
    fit = sm.OLS(y, x).fit(use_t=False)
    return fit, replace(result, theta=fit.params, covariance=fit.cov_params())


@pytest.mark.parametrize("level", [0.5, 0.95, 0.999])
def test_intervals_are_those_of_statsmodels(level):
    fit, result = fitted()
    expected = fit.conf_int(alpha=1.0 - level)
    np.testing.assert_allclose(result.conf_int(level), expected, rtol=1e-12, atol=1e-14)


def test_intervals_are_normal_quantiles_about_the_estimates():
    result = synthetic_identification()
    lower, upper = result.conf_int().T
    z = NormalDist().inv_cdf(0.975)
    np.testing.assert_allclose(upper - result.theta, z * result.std, rtol=1e-9)
    np.testing.assert_allclose(result.theta - lower, z * result.std, rtol=1e-9)
    assert (result.conf_int(0.9)[:, 0] > lower).all()


@pytest.mark.parametrize("level", [0.0, 1.0, 95, -0.1, float("nan")])
def test_a_level_is_a_probability(level):
    with pytest.raises(ValueError, match="level must be between 0 and 1"):
        synthetic_identification().conf_int(level)


def test_estimates_by_name():
    result = synthetic_identification()
    assert list(result.params) == list(result.names)
    for name, value in result.params.items():
        assert value == result.value(name) and type(value) is float


def test_texts_and_files_come_from_above(tmp_path):
    result = synthetic_identification()
    assert str(result) == result.summary()
    assert repr(result).startswith(f"<Identification: {len(result.names)} parameters by IDIM")
    result.save(tmp_path)
    assert {f.name for f in tmp_path.iterdir()} == {"identification.json", "parameters.csv"}
