from dataclasses import replace
from statistics import NormalDist

import numpy as np
import pytest
import statsmodels.api as sm

from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.simulation_result import SimulationResult
from pivident.studies.tables.identifications import identification_parameters
from tests.synthetic_identification import synthetic_identification


def fitted():
    """An ordinary least squares fit of statsmodels, and an identification with its estimate."""
    rng = np.random.default_rng(3)
    result = synthetic_identification()
    x = rng.normal(size=(400, len(result.names)))
    y = x @ rng.normal(size=len(result.names)) + 0.3 * rng.normal(size=400)
    fit = sm.OLS(y, x).fit(use_t=False)
    return fit, replace(result, judged=None, theta=fit.params, robust_covariance=fit.cov_params())


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
    with pytest.raises(ValueError, match="level must be between"):
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


def test_an_interval_has_one_side_where_a_bound_holds_the_estimate():
    result = synthetic_identification()
    first, second = result.names[:2]
    nothing = np.full(len(result.joints), np.nan)
    simulation = SimulationResult(
        "torques", "closed", nothing, nothing, at_bound=(first, second), bound_sides=("low", "high")
    )
    bounded = replace(result, simulation=simulation)
    both, one = result.conf_int(), bounded.conf_int()
    np.testing.assert_array_equal(one[:2, 0], [result.theta[0], both[1, 0]])
    np.testing.assert_array_equal(one[:2, 1], [both[0, 1], result.theta[1]])
    np.testing.assert_array_equal(one[2:], both[2:])
    row = parameter_rows(bounded)[0]
    assert row.interval()[0] == row.value < row.interval()[1]
    assert row.value_and_spread[1].startswith("+")
    table = identification_parameters(bounded)
    assert table.columns["low"][0] == table.columns["value"][0] < table.columns["high"][0]
