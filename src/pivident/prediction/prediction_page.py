"""Predictions as one HTML page that needs nothing else, in the look of the report, and as CSV."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

import numpy as np
from markupsafe import Markup

from pivident.files import atomic_folder
from pivident.prediction.prediction import Prediction
from pivident.report.builder import page_environment, page_of
from pivident.report.plotly_figures import Figure, compared_figure
from pivident.text.numbers import format_significant, percent
from pivident.text.plain_values import csv_table

#: Points of a trace.
POINTS = 3000


def write_html(predictions: Prediction | Sequence[Prediction], path: str | PathLike[str]) -> Path:
    """Write the errors and a drawing of each joint's torque as one HTML file.

    Args:
        predictions: of one log or several.
        path: the file.

    Returns:
        The file.

    Raises:
        PividentError: it cannot be written.
    """
    path = Path(path)
    page = render_page([predictions] if isinstance(predictions, Prediction) else predictions)
    with atomic_folder(path.parent) as build:
        (build / path.name).write_text(page, encoding="utf-8", errors="xmlcharrefreplace")
    return path


def render_page(predictions: Sequence[Prediction]) -> str:
    """The page as text."""
    environment = page_environment("pivident.prediction")
    sections = []
    for number, one in enumerate(predictions, start=1):
        tag = f"-{number}" if len(predictions) > 1 else ""
        name = f"{one.recording}: " if tag else ""
        content = {
            "prediction": one,
            "columns": list(one.columns()),
            "figures": [torque_figure(one, j) for j in range(one.robot.size)],
        }
        for key, heading in (("errors", "Errors"), ("torques", "Torques")):
            body = environment.get_template(f"prediction_{key}.html").render(content)
            sections.append((f"{key}{tag}", f"{name}{heading}", Markup(body)))
    first = predictions[0]
    title = f"{first.robot.name}: torques predicted by {first.method}"
    return page_of(environment, title, sections, headed=len(predictions) == 1)


def torque_figure(prediction: Prediction, joint: int) -> Figure:
    """Measured and predicted torque of one joint, and their difference."""
    name, unit = prediction.robot.joint_names[joint], prediction.units[joint]
    note = ""
    if prediction.error is not None:
        e = prediction.error.errors
        note = (
            f"error {percent(e.relative[joint])}, rms {format_significant(e.rms[joint])} {unit}, "
            "from the first to the last motion"
        )
    tau = prediction.tau
    return compared_figure(
        name,
        unit,
        prediction.t,
        None if tau is None else tau[:, joint],
        prediction.tau_model[:, joint],
        POINTS,
        note,
    )


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
