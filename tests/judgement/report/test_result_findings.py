from dataclasses import replace

import numpy as np

from pivident.foundation.text.finding import Finding
from pivident.judgement.report.sections.verdict import disagreements, findings as remarks
from pivident.judgement.validation.residuals.residual_tests import residual_tests
from tests.synthetic_identification import synthetic_identification

FIRST = Finding("warning", "estimator", "noticed", "First.")


def findings(identification):
    return remarks(identification, residual_tests(identification))


def said(found):
    return " ".join(f.advised for f in found)


def good(**changes):
    """A result with parameters far from zero and, without a noise model, white residuals."""
    identification = synthetic_identification(**changes)
    return replace(
        identification,
        robust_covariance=identification.covariance * 1e-4,
        joints=tuple(replace(joint, ar_order=0) for joint in identification.joints),
    )


def with_residual(identification, residual):
    recording = replace(identification.recordings[0], whitened=residual)
    return replace(identification, recordings=(recording,))


def test_own_warnings_come_first():
    assert findings(replace(good(), warnings=(FIRST,)))[0] == FIRST


def test_nothing_to_remark():
    assert findings(good()) == ()


def test_remarks_on_convergence():
    text = said(findings(replace(good(), converged=False)))
    assert "did not converge within 5 passes (last change 0.00080 %);" in text
    assert "within 0 passes;" in said(findings(replace(good(), converged=False, history=())))


def test_remarks_on_parameters():
    identification = good()
    theta = identification.theta.copy()
    theta[identification.names.index("fv1")] *= -1.0
    theta[identification.names.index("zz2")] = 0.0
    text = said(findings(replace(identification, judged=None, theta=theta)))
    assert "1 of 13 parameters are not significantly different from zero, which their ±2σ" in text
    assert "includes: zz2." in text
    assert "Negative, which friction and rotor inertia cannot be: fv1." in text


def test_remarks_on_noise():
    identification = good()
    joints = (replace(identification.joints[0], ar_at_bound=True), identification.joints[1])
    walk = np.cumsum(identification.recordings[0].whitened, axis=0)
    text = said(findings(with_residual(replace(identification, joints=joints), walk)))
    assert "largest order allowed: shoulder" in text
    assert "not white: shoulder, elbow. The standard errors account for that" in text
    assert "assume" not in text
    unknown = np.full_like(identification.covariance, np.nan)
    text = said(findings(with_residual(replace(identification, robust_covariance=unknown), walk)))
    assert "not white: shoulder, elbow. The method's own standard errors assume" in text


def test_residuals_that_are_hardly_correlated_are_not_remarked_on():
    long = np.random.default_rng(8).standard_normal((200_000, 2))
    hardly = with_residual(good(samples=199_999), long[1:] + 0.02 * long[:-1])
    assert not any("not white" in f.message for f in findings(hardly))


def test_short_or_constant_residuals_are_not_tested():
    for residual in (np.zeros((2000, 2)), np.ones((20, 2)), np.full((2000, 2), np.nan)):
        assert not any("not white" in f.message for f in findings(with_residual(good(), residual)))


def test_disagreements_name_parameter_and_methods():
    first = good()
    theta = first.theta.copy()
    theta[0] += 5.0 * np.hypot(first.robust_std[0], first.robust_std[0])
    text = disagreements([first, replace(first, judged=None, theta=theta)], ["IDIM-IV", "IDIM-PIV"])
    assert "zz1r (IDIM-IV and IDIM-PIV)" in text
    assert disagreements([first, first], ["a", "b"]) is None
