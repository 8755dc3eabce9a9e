"""All formats by name: how each is written and loaded back."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, Literal, get_args

from pivident.errors import ExportError
from pivident.export.c_source import to_c, verify_c
from pivident.export.latex import to_latex
from pivident.export.load_back import verify_with_mujoco, verify_with_pinocchio
from pivident.export.mjcf import to_mjcf
from pivident.export.numpy_function import to_numpy, verify_numpy
from pivident.export.sdf import to_sdf
from pivident.export.urdf import to_urdf
from pivident.models.exported import ExportedText, Verification
from pivident.models.model_json import to_json, verify_json
from pivident.models.runnable_model import RunnableModel
from pivident.robot.naming import nearest
from pivident.robot.refusals import without_base

Format = Literal["urdf", "mjcf", "sdf", "c", "numpy", "json", "latex"]


@dataclass(frozen=True)
class FileOptions:
    """What some formats need besides the model."""

    name: str = "robot_model"  # prefix of the functions of a C file
    original: bytes | None = None  # URDF whose inertials are replaced; None: a new one
    #: Positions of the other joints of that file [rad or m], by name.
    frozen: Mapping[str, float] = field(default_factory=dict)


@dataclass(frozen=True)
class FormatEntry:
    """One format; each of its checks loads the file with another program and compares."""

    title: str  # name in a sentence
    write: Callable[[RunnableModel, FileOptions], ExportedText]
    checks: tuple[Callable[[Any, RunnableModel, FileOptions], Verification], ...] = ()
    not_loaded: str = ""  # why there are no checks


#: All formats.
FORMATS: dict[Format, FormatEntry] = {
    "urdf": FormatEntry(
        "URDF",
        lambda model, options: to_urdf(model, options.original, frozen=options.frozen),
        (
            lambda file, model, o: verify_with_pinocchio(file, model, frozen=o.frozen),
            lambda file, model, o: verify_with_mujoco(file, model, frozen=o.frozen),
        ),
    ),
    "mjcf": FormatEntry(
        "MJCF",
        lambda model, _: to_mjcf(model),
        (lambda file, model, o: verify_with_mujoco(file, model, frozen=o.frozen),),
    ),
    "sdf": FormatEntry(
        "SDF",
        lambda model, _: to_sdf(model),
        not_loaded="nothing here reads SDF; Gazebo does",
    ),
    "c": FormatEntry(
        "C99",
        lambda model, options: to_c(model, options.name),
        (lambda file, model, _: verify_c(file, model),),
    ),
    "numpy": FormatEntry(
        "Python with NumPy",
        lambda model, _: to_numpy(model),
        (lambda file, model, _: verify_numpy(file, model),),
    ),
    "json": FormatEntry(
        "JSON",
        lambda model, _: to_json(model),
        (lambda file, model, _: verify_json(file, model),),
    ),
    "latex": FormatEntry(
        "LaTeX",
        lambda model, _: to_latex(model),
        not_loaded="a table computes no torques",
    ),
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

    Returns:
        The text, what the format leaves out, and further files such as a C header.

    Raises:
        ExportError: the format cannot say the model, or there is no such format.
        RobotDescriptionError: a robot with closed loops in a format that has none, or on a
            measured base.
    """
    if to not in FORMATS:
        raise ExportError(f"there is no format {to!r}; {nearest(str(to), get_args(Format))}")
    if to != "json":
        without_base(model.robot, f"a file of {FORMATS[to].title}", "export it as JSON")
    return FORMATS[to].write(model, FileOptions(name, original, frozen or {}))


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

    Returns:
        One comparison for each program that can load the file.

    Raises:
        ExportError: a C file does not compile, or a Python file does not run.
    """
    entry, options = FORMATS[to], FileOptions(frozen=frozen or {})
    if not entry.checks:
        return (Verification(entry.title, skipped=entry.not_loaded),)
    return tuple(check(exported, model, options) for check in entry.checks)
