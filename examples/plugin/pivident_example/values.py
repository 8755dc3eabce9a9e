"""Standard parameters as a table: a line ``name,value,unit`` for each."""

from dataclasses import replace

import numpy as np

from pivident.models.export_format import FileOptions, Format
from pivident.models.exported import ExportedText, Verification, compared
from pivident.models.runnable_model import RunnableModel


def write(model: RunnableModel, options: FileOptions) -> ExportedText:
    """The table, and what it leaves out."""
    rows = zip(model.parameters, model.values.tolist(), strict=True)
    lines = ["name,value,unit", *(f"{p.name},{value!r},{p.unit}" for p, value in rows)]
    return ExportedText(
        "\n".join([*lines, ""]).encode(), differences=("it has no geometry of the robot",)
    )


def check(file: ExportedText, model: RunnableModel, options: FileOptions) -> Verification:
    """Torques with the values of the table against the model's, at random states."""
    rows = [line.split(",") for line in file.text.splitlines()[1:]]
    loaded = replace(model, values=np.array([float(value) for _, value, _ in rows]))
    return compared("the values of the table", model.robot, model.torque, loaded.torque)


VALUES = Format("table of values", ".csv", write, (check,))
