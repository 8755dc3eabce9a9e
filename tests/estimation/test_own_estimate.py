"""Estimators of one's own are methods, and their results are judged as their own."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

from pivident.estimation.identification import Identification
from pivident.estimation.identify import build_regression, identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.methods import method_named
from pivident.estimation.own_estimate import OwnMethod
from pivident.estimation.signal_recipes import RandomWalk
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.errors import IdentificationError, UnusableValue
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.report.builder import write_report
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.studies.comparison.compare import compare
from tests.estimation.test_known_parameters import problem as problem
from tests.planar_arm import nominal_parameters

FULL = LeastSquares(signals=RandomWalk())


def least_squares(phi, tau):
    return np.linalg.lstsq(phi, tau, rcond=None)[0]


def shrunk(phi, tau):
    return 0.9 * least_squares(phi, tau)


def test_least_squares_as_a_function_is_least_squares(problem):
    found, expected = identify(problem, least_squares), identify(problem, FULL)
    assert found.method == "least_squares"
    assert np.allclose(found.theta, expected.theta, rtol=1e-9)
    assert found.relative_error == pytest.approx(expected.relative_error, rel=1e-9)
    assert [j.rms_error for j in found.joints] == pytest.approx(
        [j.rms_error for j in expected.joints], rel=1e-9
    )
    assert np.allclose(found.formula_covariance, expected.formula_covariance, rtol=1e-7, atol=0.0)
    assert np.allclose(found.robust_std, np.sqrt(np.diag(_windows(found))), rtol=1e-4)


def _windows(found):
    from pivident.estimation.covariance.sandwich import sandwich
    from pivident.estimation.equation_record import accumulate

    own = found.equations
    sums = accumulate(own.regressor, own.records, own.filters)
    return sandwich(sums, found.theta, own.variance)


def test_statsmodels_and_unweighted_rows(problem):
    sm = pytest.importorskip("statsmodels.api")

    def huber(phi, tau):
        size = np.linalg.norm(phi, axis=0)
        fit = sm.RLM(tau, phi / size).fit()
        return fit.params / size, fit.cov_params() / np.outer(size, size)

    found = identify(problem, huber)
    _, theta = nominal_parameters()
    assert found.value("mx1") == pytest.approx(theta[1], rel=0.02)
    assert (found.std > 0.0).all() and np.array_equal(found.covariance, found.robust_covariance)
    phi, tau = build_regression(replace(problem, mask=None))
    plain = identify(
        replace(problem, mask=None), OwnMethod(estimator=least_squares, weighted=False)
    )
    expected = least_squares(phi.reshape(-1, phi.shape[2]), tau.ravel())
    assert np.allclose(plain.theta, expected, rtol=1e-8)


def test_held_out_motion_is_that_of_the_function(problem):
    own = cross_validate(problem, shrunk, folds=3)
    least = cross_validate(problem, FULL, folds=3)
    again = cross_validate(problem, least_squares, folds=3)
    assert again.prediction.total == pytest.approx(least.prediction.total, rel=1e-4)
    assert 8.0 < own.prediction.total_in_band < 12.0
    for mine, same, theirs in zip(own.held_out, again.held_out, least.held_out, strict=True):
        theta = theirs.identification.theta
        assert np.allclose(same.identification.theta, theta, rtol=1e-3, atol=1e-5)
        assert np.allclose(mine.identification.theta, 0.9 * theta, rtol=0.01, atol=0.01)


def test_given_parameters_are_judged_as_they_are(problem, tmp_path):
    _, theta = nominal_parameters()
    best = identify(problem, FULL)
    wrong = Identification.of(problem, 0.9 * theta, 1e-4 * np.eye(13), name="guess")
    assert wrong.method == "guess" and (wrong.theta == 0.9 * theta).all()
    assert wrong.relative_error > 1.5 * best.relative_error
    assert np.array_equal(wrong.covariance, 1e-4 * np.eye(13))
    predicted = wrong.recordings[0]
    assert np.allclose(
        predicted.tau_model, wrong.predict(predicted.q, predicted.dq, predicted.ddq), atol=1e-9
    )
    by_name = Identification.of(problem, dict(zip(problem.names, best.theta, strict=True)))
    assert np.allclose(by_name.formula_std, best.formula_std, rtol=1e-3)
    assert by_name.relative_error == pytest.approx(best.relative_error, rel=1e-6)
    assert [w.kind for w in wrong.warnings].count("given") == 1
    judged = cross_validate(problem, "ls", identification=wrong, folds=3)
    assert 8.0 < judged.prediction.total_in_band < 12.0
    assert all((h.identification.theta == wrong.theta).all() for h in judged.held_out)
    wrong.save(tmp_path)
    back = load_identification(tmp_path)
    assert back.method == "guess" and back.method_used is None
    assert back.relative_error == wrong.relative_error


def test_verdict_report_and_comparison_are_of_that_estimate(problem, tmp_path):
    _, theta = nominal_parameters()
    results = {
        "ls": identify(problem, FULL),
        "mine": identify(problem, least_squares),
        "guess": Identification.of(problem, 0.5 * theta, name="guess", estimator=shrunk),
    }
    found = diagnose(problem, results)
    assert found.recommended != "guess"
    errors = found.out_of_sample.results
    assert errors["guess"].prediction.total_in_band > 2.0 * errors["mine"].prediction.total_in_band
    said = str(verdict(diagnose(problem, {"guess": results["guess"]})))
    assert "torque error on held-out motion is" in said
    page = write_report(list(results.values()), tmp_path / "r.html", diagnostics=found)
    assert "guess" in page.read_text("utf-8")
    side = compare([results["ls"], results["guess"]])
    assert "guess" in str(side)


def test_another_theta_cannot_show_errors_of_the_first(problem):
    found = identify(problem, FULL)
    with pytest.raises(UnusableValue, match=r"Identification\.of"):
        replace(found, theta=2.0 * found.theta)
    assert replace(found, theta=found.theta.copy(), method="same").method == "same"


@dataclass(frozen=True, kw_only=True)
class Doubled(LeastSquares):
    """A class of one's own with the protocol of built-in methods."""

    def estimate(self, problem, say, *, test_gains=True):
        found = super().estimate(problem, say)
        return Identification.of(problem, found.theta, found.covariance, name="doubled")


def test_a_class_of_ones_own_is_a_method(problem):
    assert identify(problem, Doubled(signals=RandomWalk())).method == "doubled"


def test_fixed_values_hold_for_functions_too(problem):
    fixed = {problem.names[0]: 0.9}
    found = identify(replace(problem, fixed=fixed), least_squares)
    expected = identify(replace(problem, fixed=fixed), FULL)
    assert np.allclose(found.theta, expected.theta, rtol=1e-7)
    own = Identification.of(replace(problem, fixed=fixed), expected.theta)
    assert np.allclose(own.formula_std, expected.formula_std, rtol=0.05)
    assert own.std[0] == 0.0
    with pytest.raises(IdentificationError, match="contradicts"):
        Identification.of(replace(problem, fixed=fixed), 1.1 * expected.theta)


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda phi, tau: np.ones(3), "shape"),
        (lambda phi, tau: np.full(13, np.nan), "finite"),
        (lambda phi, tau: (np.ones(13), np.ones(13)), "covariance of shape"),
        (lambda phi, tau: (np.ones(13), -np.eye(13)), "semidefinite"),
        (lambda phi, tau: "theta", "no numbers"),
        (lambda phi, tau: None, "shape|numbers"),
    ],
)
def test_what_is_no_estimate_is_refused(problem, made, words):
    with pytest.raises(IdentificationError, match=words):
        identify(problem, made)


def test_given_parameters_are_checked(problem):
    with pytest.raises(IdentificationError, match="shape"):
        Identification.of(problem, np.ones(4))
    with pytest.raises(IdentificationError, match="finite"):
        Identification.of(problem, {"zz1": 1.0})


def test_consistent_estimates_are_no_method_of_identify():
    with pytest.raises(IdentificationError, match=r"'piv' and give the result to make_consistent"):
        method_named("pc-piv")
