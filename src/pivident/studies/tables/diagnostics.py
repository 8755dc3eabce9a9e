"""Tables of what supports a result, and of reservations: tests, held-out motion, verdict."""

from __future__ import annotations

from typing import Any

from pivident.foundation.document.table import Table
from pivident.judgement.diagnostics.verdict import Verdict
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.residuals.autocorrelation import LjungBoxTest
from pivident.judgement.validation.residuals.residual_tests import ResidualTests


def residual_tests(tests: ResidualTests) -> Table:
    """One row for each joint and test."""
    rows = []
    for joint in tests.joints:
        for name, test in joint.tests.items():
            robust = isinstance(test, LjungBoxTest)
            found: Any = test
            rows.append(
                {
                    "joint": joint.name,
                    "test": name,
                    "statistic": float(found.robust_statistic if robust else found.statistic),
                    "p_value": float(found.robust_p_value if robust else found.p_value),
                    "significant": bool(test.significant),
                    "matters": bool(test.matters),
                    "samples": joint.samples,
                    "sentence": str(test),
                }
            )
    meanings = {
        "p_value": "of the test in the sentence; NaN where there is no test behind a noise model",
        "matters": "significant, and of practical size",
    }
    empty = ("joint", "test", "statistic", "p_value", "significant", "matters", "samples")
    return Table.of_rows("tests", rows, meanings, (*empty, "sentence"))


validation_folds = CrossValidation.stretch_table


def validation_joints(found: CrossValidation) -> Table:
    """One row for each joint and held-out stretch."""
    rows = []
    for h in found.held_out:
        if h.prediction is None:
            continue
        p = h.prediction
        for j, joint in enumerate(p.joint_names):
            rows.append(
                {
                    "method": found.method,
                    "recording": h.recording,
                    "start_s": float(h.start),
                    "stop_s": float(h.stop),
                    "joint": joint,
                    "rms_error": float(p.rms[j]),
                    "rms_error_in_band": float(p.rms_in_band[j]),
                    "rms_torque": float(p.torque[j]),
                    "noise_in_band": float(p.noise_in_band[j]),
                    "torque_unit": p.units[j],
                    "error_percent": float(p.relative[j]),
                    "error_in_band_percent": float(p.relative_in_band[j]),
                }
            )
    return Table.of_rows("joints", rows, {"noise_in_band": "noise level just beyond the band"})


def verdict_statements(found: Verdict) -> Table:
    """One row for each statement."""
    rows = [
        {"topic": s.topic, "severity": s.severity, "message": s.message, "basis": s.basis}
        for s in found.statements
    ]
    return Table.of_rows("statements", rows, empty=("topic", "severity", "message", "basis"))
