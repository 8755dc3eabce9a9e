"""All formats by name: how each is written, and how it is loaded back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Literal, get_args

from pivident.errors import ExportError
from pivident.export.exported import ExportedText, Verification
from pivident.export.runnable_model import RunnableModel
from pivident.robot.naming import nearest

Format = Literal["urdf", "mjcf", "sdf", "c", "numpy", "json", "latex"]

#: What each format is called in a sentence.
TITLES: dict[Format, str] = {
    "urdf": "URDF",
    "mjcf": "MJCF",
    "sdf": "SDF",
    "c": "C99",
    "numpy": "Python with NumPy",
    "json": "JSON",
    "latex": "LaTeX",
}

#: Why some formats are not loaded back.
NOT_LOADED: dict[Format, str] = {
    "sdf": "nothing here reads SDF; Gazebo does",
    "latex": "a table computes no torques",
}


def export_model(
    model: RunnableModel,
    to: Format,
    *,
    name: str = "robot_model",
    original: bytes | None = None,
    frozen: Mapping[str, float] | None = None,
) -> ExportedText:
    """The model in a format.

    Args:
        model: the model.
        to: the format.
        name: what functions of a C file are called.
        original: URDF in which the inertials are to be replaced; None: a new one.
        frozen: positions of that file's other joints [rad or m], by name.

    Raises:
        ExportError: the format cannot say the model, or there is no such format.
    """
    if to == "urdf":
        from pivident.export.urdf import to_urdf

        return to_urdf(model, original, frozen=frozen)
    if to == "mjcf":
        from pivident.export.mjcf import to_mjcf

        return to_mjcf(model)
    if to == "sdf":
        from pivident.export.sdf import to_sdf

        return to_sdf(model)
    if to == "c":
        from pivident.export.c_source import to_c

        return to_c(model, name)
    if to == "numpy":
        from pivident.export.numpy_function import to_numpy

        return to_numpy(model)
    if to == "json":
        from pivident.export.model_json import to_json

        return to_json(model)
    if to == "latex":
        from pivident.export.latex import to_latex

        return to_latex(model)
    raise ExportError(f"there is no format {to!r}; {nearest(str(to), get_args(Format))}")


def verify_export(
    exported: ExportedText,
    model: RunnableModel,
    to: Format,
    *,
    frozen: Mapping[str, float] | None = None,
) -> tuple[Verification, ...]:
    """Load an export back, with everything that can load it here, and compare.

    Args:
        exported: what `export_model` returned.
        model: the model.
        to: the format.
        frozen: positions of a URDF's other joints [rad or m], by name.

    Raises:
        ExportError: a C file does not compile.
    """
    if to in ("urdf", "mjcf"):
        from pivident.export.load_back import verify_with_mujoco, verify_with_pinocchio
        from pivident.export.robot_file import RobotFile

        assert isinstance(exported, RobotFile)
        by_mujoco = verify_with_mujoco(exported, model, frozen=frozen)
        if to == "mjcf":
            return (by_mujoco,)
        return verify_with_pinocchio(exported, model, frozen=frozen), by_mujoco
    if to == "c":
        from pivident.export.c_source import verify_c

        return (verify_c(exported, model),)
    if to == "numpy":
        from pivident.export.numpy_function import verify_numpy

        return (verify_numpy(exported, model),)
    if to == "json":
        from pivident.export.model_json import verify_json

        return (verify_json(exported, model),)
    return (Verification(TITLES[to], skipped=NOT_LOADED[to]),)
