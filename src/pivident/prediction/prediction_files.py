"""Predicted torques as CSV."""

from __future__ import annotations

from os import PathLike
from pathlib import Path

import numpy as np

from pivident.files import atomic_folder
from pivident.prediction.prediction import Prediction
from pivident.text.plain_values import csv_table


def write_csv(prediction: Prediction, path: str | PathLike[str]) -> Path:
    """Write time, positions, measured and predicted torques as CSV, one line per sample.

    Columns are ``t [s]``, and of each joint ``q_NAME``, ``tau_NAME`` where it was measured and
    ``tau_model_NAME``, each with its unit.

    Args:
        prediction: the torques.
        path: the file.

    Returns:
        The file.

    Raises:
        PividentError: it cannot be written.
    """
    path = Path(path)
    columns, values = ["t [s]"], [prediction.t]
    for j, (joint, torque) in enumerate(
        zip(prediction.robot.joints, prediction.units, strict=True)
    ):
        columns.append(f"q_{joint.name} [{joint.position_unit}]")
        values.append(prediction.q[:, j])
        if prediction.tau is not None:
            columns.append(f"tau_{joint.name} [{torque}]")
            values.append(prediction.tau[:, j])
        columns.append(f"tau_model_{joint.name} [{torque}]")
        values.append(prediction.tau_model[:, j])
    with atomic_folder(path.parent) as build, (build / path.name).open("w") as file:
        file.write(csv_table(columns, []))
        # stamps since 1970 have ten digits before the point, and microseconds behind it
        digits = max(10, len(str(int(np.abs(prediction.t).max(initial=0.0)))) + 6)
        formats = [f"%.{digits}g"] + ["%.10g"] * (len(columns) - 1)
        np.savetxt(file, np.column_stack(values), fmt=formats, delimiter=",")
    return path
