"""Estimates answer as statsmodels does: the same names, the same numbers."""

import pickle
from dataclasses import replace

import numpy as np
import pandas as pd
import pytest
import statsmodels.api as sm

from pivident.foundation.document.estimated import ByName
from pivident.foundation.errors import UnknownName, UnusableValue
from pivident.linear.conversion import known_model
from pivident.linear.srivc import srivc
from tests.planar_results import planar_results
from tests.synthetic_identification import synthetic_identification


def fitted():
    """A regression by statsmodels, and an identification with its estimates."""
    result = synthetic_identification()
    rng = np.random.default_rng(4)
    x = rng.standard_normal((400, len(result.names)))
    y = x @ result.theta + rng.standard_normal(400)
    fit = sm.OLS(y, x).fit(use_t=False)
    return fit, replace(result, judged=None, theta=fit.params, robust_covariance=fit.cov_params())


def test_estimates_are_those_of_statsmodels():
    fit, result = fitted()
    for name in ("params", "bse", "tvalues", "pvalues"):
        own = getattr(result, name)
        assert list(own) == list(result.names)
        np.testing.assert_allclose(np.asarray(own), getattr(fit, name), rtol=1e-9, atol=1e-300)
    np.testing.assert_allclose(result.cov_params(), fit.cov_params(), rtol=1e-12)
    np.testing.assert_allclose(result.conf_int(0.9), fit.conf_int(alpha=0.1), rtol=1e-9)


def test_linear_hypotheses_are_those_of_statsmodels():
    fit, result = fitted()
    size = len(result.names)
    rows = np.zeros((2, size))
    rows[0, 0], rows[1, 1], rows[1, 2] = 1.0, 1.0, -2.0
    theirs = fit.t_test((rows, np.array([0.1, 0.0])))
    a, b, c = result.names[:3]
    for ours in (
        result.t_test(rows, [0.1, 0.0]),
        result.t_test([a, {b: 1.0, c: -2.0}], [0.1, 0.0]),
    ):
        np.testing.assert_allclose(ours.effect, theirs.effect, rtol=1e-9)
        np.testing.assert_allclose(ours.sd, np.ravel(theirs.sd), rtol=1e-9)
        np.testing.assert_allclose(ours.tvalue, np.ravel(theirs.tvalue), rtol=1e-9)
        np.testing.assert_allclose(ours.pvalue, np.ravel(theirs.pvalue), rtol=1e-7, atol=1e-300)
        np.testing.assert_allclose(ours.conf_int(0.9), theirs.conf_int(alpha=0.1), rtol=1e-9)
        assert ours.labels == (a, f"{b} - 2 {c}")
    assert f"{b} - 2 {c} = 0" in str(ours)


def test_names_and_shapes_that_do_not_fit_are_refused():
    result = synthetic_identification()
    name = result.names[0]
    with pytest.raises(UnknownName, match=f"no parameter '{name}x'; did you mean '{name}'"):
        result.t_test(f"{name}x")
    with pytest.raises(KeyError, match="did you mean"):
        result.params[f"{name}x"]
    with pytest.raises(UnusableValue, match=r"shape \(2,\); give coefficients of"):
        result.t_test([1.0, 2.0])
    with pytest.raises(UnusableValue, match="holds the true value"):
        result.t_test(name).conf_int(0.05)


def test_numbers_by_name_make_series_and_arrays():
    numbers = ByName({"fv1": 2.5, "fc1": 4.0})
    assert np.sqrt(np.asarray(numbers)).tolist() == [2.5**0.5, 2.0]
    series = pd.Series(numbers)
    assert series["fc1"] == 4.0 and list(series.index) == ["fv1", "fc1"]
    assert pickle.loads(pickle.dumps(numbers)) == numbers == {"fv1": 2.5, "fc1": 4.0}


def test_residuals_of_an_identification():
    for result in planar_results("ls", "piv"):
        used = np.isfinite(result.resid)
        assert int(used.sum()) == result.nobs == result.df_resid + len(result.names)
        fitted = np.concatenate([r.tau_model for r in result.recordings])
        np.testing.assert_array_equal(result.fittedvalues[used], fitted[used])
        assert np.isnan(result.fittedvalues[~used]).all()
        rms = np.sqrt(np.nanmean(result.resid**2, axis=0))
        np.testing.assert_allclose(rms, [fit.rms_error for fit in result.joints], rtol=1e-9)
        assert result.rsquared == pytest.approx(1.0 - result.relative_error**2)
    with pytest.raises(UnusableValue, match="no signals; it was loaded from a file"):
        replace(result, recordings=()).resid  # noqa: B018


def test_a_linear_model_answers_alike():
    rng = np.random.default_rng(1)
    u = np.sign(np.sin(0.02 * np.arange(3000)))
    truth = known_model([np.array([2.0])], [np.array([1.0, 0.8, 4.0])], 0.01, True)
    y = truth.simulate(u) + 0.01 * rng.standard_normal(3000)
    model = srivc(u, y, 0.01, 0, 2)
    assert list(model.params) == ["a1", "a2", "b0"]
    np.testing.assert_allclose(model.fittedvalues + model.resid, y, atol=1e-12)
    np.testing.assert_allclose(model.fittedvalues, model.simulate(u), atol=1e-9)
    assert model.resid.std() == pytest.approx(0.01, rel=0.05)
    assert (model.nobs, model.df_resid) == (3000, 2997)
    assert model.rsquared == pytest.approx(1.0 - model.resid.var() / y.var())
    assert (np.abs(np.asarray(model.params) - truth.theta) < 4.0 * np.asarray(model.bse)).all()
    assert model.t_test("a1", 0.8).pvalue[0] > 1e-4 > model.t_test("a1", 1.0).pvalue[0]
    assert truth.resid is None and truth.nobs == 0


def test_summaries_for_pages_and_papers():
    (result,) = planar_results("piv")
    u = np.sign(np.sin(0.02 * np.arange(500)))
    model = srivc(u, np.convolve(u, np.exp(-0.1 * np.arange(80)))[:500], 0.01, 0, 1)
    for made in (result, model):
        summary = made.summary()
        assert summary.as_text() == str(made) == repr(summary)
        assert summary.as_html() == made._repr_html_() == summary._repr_html_()
        text = summary.as_latex()
        assert text.count(r"\\") == 1 + len(made.names) and r"\toprule" in text
        assert all(f"\n{name.replace('_', chr(92) + '_')} & $" in text for name in made.names)
        again = pickle.loads(pickle.dumps(summary))
        assert again == summary and again.as_latex() == text
    assert r"$\mathrm{kg\,m^{2}}$" in result.summary().as_latex()
