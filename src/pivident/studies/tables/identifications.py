"""Tables of an identification.

Tables of what supports a result, and of reservations: tests, held-out motion, verdict.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows
from pivident.foundation.document.table import Table, TableError
from pivident.judgement.diagnostics.verdict import Verdict
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.residuals.autocorrelation import LjungBoxTest
from pivident.judgement.validation.residuals.residual_tests import ResidualTests
from pivident.studies.tables.inputs import signals_table

#: Meanings that the columns of estimates share.
ESTIMATES = {
    "value": "estimate",
    "low": "lower end of the interval, value - 2 std; the value where a bound holds it",
    "high": "upper end of the interval, value + 2 std; the value where a bound holds it",
    "std": "robust standard error, the method's own where no robust one is known",
    "method_std": "standard error by the method's covariance",
    "relative_std_percent": "100 std/|value|",
    "group": "standard parameters that the base parameter stands for",
}


def identification_parameters(result: Identification) -> Table:
    """One row for each estimated parameter."""
    names = result.robot.tree.joint_names
    rows = [
        {
            "parameter": row.name,
            "joint": names[p.joint],
            "kind": p.stem,
            "value": row.value,
            "low": row.low,
            "high": row.high,
            "std": row.std,
            "method_std": row.method_std,
            "relative_std_percent": row.relative_std,
            "unit": row.unit,
            "group": row.expression,
        }
        for row, p in zip(parameter_rows(result), result.parameters, strict=True)
    ]
    return Table.of_rows("parameters", rows, ESTIMATES)


def identification_covariance(result: Identification) -> Table:
    """One row for each pair of parameters."""
    names, units = np.array(result.names, dtype=object), np.array(result.units, dtype=object)
    n = names.size
    first, second = np.repeat(np.arange(n), n), np.tile(np.arange(n), n)
    std = result.method_std
    with np.errstate(divide="ignore", invalid="ignore"):
        correlation = result.covariance / np.outer(std, std)
    unit = [f"({units[a]})·({units[b]})" for a, b in zip(first, second, strict=True)]
    return Table(
        "covariance",
        {
            "parameter": tuple(names[first]),
            "other": tuple(names[second]),
            "covariance": result.covariance.ravel(),
            "robust_covariance": result.robust_covariance.ravel(),
            "unit": tuple(unit),
            "correlation": correlation.ravel(),
        },
        {"covariance": "by the method", "correlation": "of the method's covariance, -1 to 1"},
    )


def identification_joints(result: Identification) -> Table:
    """How each joint was fitted."""
    rows = [
        {
            "joint": fit.name,
            "relative_error_percent": 100.0 * fit.relative_error,
            "rms_error": fit.rms_error,
            "torque_unit": fit.torque_unit,
            "noise_std": fit.noise_std,
            "noise_unit": fit.noise_unit,
            "ar_order": fit.ar_order,
            "ar_at_bound": fit.ar_at_bound,
            "rows": fit.rows,
            "masked_percent": 100.0 * fit.masked,
            "smoother_f50_hz": fit.f50,
            "encoder_std": fit.encoder_std,
            "position_unit": joint.position_unit,
        }
        for fit, joint in zip(result.joints, result.robot.joints, strict=True)
    ]
    meanings = {
        "relative_error_percent": "‖τ - Φθ‖/‖τ‖ over the rows in use",
        "rms_error": "rms of τ - Φθ over the same rows [torque_unit]",
        "noise_std": "standard deviation of the innovations of the filtered equation [noise_unit]",
        "encoder_std": "measurement noise found by the smoother [position_unit]",
        "smoother_f50_hz": "half-power frequency of the position smoother",
    }
    return Table.of_rows("joints", rows, meanings)


def identification_iterations(result: Identification) -> Table:
    """How the iteration went; the error of a fitted simulation is weighted by its noise."""
    error = "relative_error_percent" if result.simulation is None else "weighted_error_percent"
    rows = [
        {
            "iteration": k,
            "change_percent": 100.0 * step.change,
            error: 100.0 * step.residual,
            "halvings": step.halvings,
        }
        for k, step in enumerate(result.history, start=1)
    ]
    meanings = {"change_percent": "largest |Δθ|/max(|θ|, 2σ)"}
    if result.simulation is not None:
        meanings[error] = "rms of the simulation errors, 100 % where they are as large as the noise"
    empty = ("iteration", "change_percent", error, "halvings")
    return Table.of_rows("iterations", rows, meanings, empty)


def identification_history(result: Identification) -> Table:
    """Every parameter after every iteration."""
    rows = [
        {"iteration": k, "parameter": name, "value": float(value), "unit": unit}
        for k, step in enumerate(result.history, start=1)
        for name, value, unit in zip(result.names, step.theta, result.units, strict=True)
    ]
    return Table.of_rows("history", rows, empty=("iteration", "parameter", "value", "unit"))


def identification_signals(result: Identification) -> Table:
    """The estimator's signals, one row for each joint of each sample; a file holds none."""
    if not result.recordings:
        raise TableError(
            "the identification holds no signals, as after reading it from a file",
            advice="identify again",
        )
    names = ("q", "dq", "ddq", "q_measured", "q_ref", "tau", "tau_model", "whitened", "used")
    recordings = []
    for recording in result.recordings:
        channels = {name: getattr(recording, name) for name in names}
        if recording.q_ref is None:
            channels["q_ref"] = np.full(recording.q.shape, np.nan)
        recordings.append((recording.name, recording.t, channels))
    meanings = {
        "q": "estimated position; dq and ddq per second and per second squared",
        "tau_model": "reconstructed torque",
        "whitened": "residual of the equation that was solved, of unit variance; NaN: not used",
    }
    return Table("signals", signals_table(recordings, result.robot.joints).columns, meanings)


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
        rows += [
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
            for j, joint in enumerate(p.joint_names)
        ]
    return Table.of_rows("joints", rows, {"noise_in_band": "noise level just beyond the band"})


def verdict_statements(found: Verdict) -> Table:
    """One row for each statement."""
    rows = [
        {"topic": s.topic, "severity": s.severity, "message": s.message, "basis": s.basis}
        for s in found.statements
    ]
    return Table.of_rows("statements", rows, empty=("topic", "severity", "message", "basis"))
