"""Tables of an identification."""

from __future__ import annotations

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import parameter_rows
from pivident.foundation.document.table import Table, TableError
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
