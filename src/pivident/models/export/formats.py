"""All formats by name: how each is written and loaded back."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import TYPE_CHECKING

from pivident.foundation.errors import ExportError
from pivident.foundation.registry import Registry
from pivident.models.export_format import FileOptions, Format

if TYPE_CHECKING:
    from pivident.models.exported import ExportedText, Verification
    from pivident.models.runnable_model import RunnableModel

#: All formats by name.
FORMATS = Registry(
    "pivident.formats",
    Format,
    {
        "urdf": "pivident.models.export.urdf:URDF",
        "mjcf": "pivident.models.export.mjcf:MJCF",
        "sdf": "pivident.models.export.sdf:SDF",
        "c": "pivident.models.export.c_source:C",
        "numpy": "pivident.models.export.numpy_function:NUMPY",
        "json": "pivident.models.model_json:JSON",
        "latex": "pivident.models.export.latex:LATEX",
    },
)


def export_model(
    model: RunnableModel,
    to: str,
    *,
    name: str = "robot_model",
    original: bytes | None = None,
    frozen: Mapping[str, float] | None = None,
) -> ExportedText:
    """The model in a format.

    Args:
        model: the model.
        to: name of the format.
        name: what functions of a C file are called.
        original: URDF in which the inertials are to be replaced; None: a new one.
        frozen: positions of that file's other joints [rad or m], by name.

    Returns:
        The text, what the format leaves out, and further files such as a C header.

    Raises:
        ExportError: the format cannot represent the model, or there is no such format.
        RobotDescriptionError: a robot with closed loops in a format that has none, or on a
            measured base.
    """
    from pivident.robot.naming import nearest
    from pivident.robot.refusals import without_base

    if to not in FORMATS:
        raise ExportError(f"there is no format {to!r}", advice=nearest(str(to), FORMATS))
    entry = FORMATS[to]
    if not entry.holds_base:
        without_base(model.robot, f"a file of {entry.title}", "export it as JSON")
    return _with_provenance(entry.write(model, FileOptions(name, original, frozen or {})), model)


def _with_provenance(made: ExportedText, model: RunnableModel) -> ExportedText:
    """A file of XML with comments on its parameters; others say it in their headers."""
    from pivident.models.export.differences import RobotFile
    from pivident.models.export.numpy_function import provenance_lines
    from pivident.models.export.xml_edit import XmlText, comment

    if not isinstance(made, RobotFile):
        return made
    text = XmlText(made.content)
    text.before(text.root, [comment(line) for line in provenance_lines(model)])
    return replace(made, content=text.content())


def verify_export(
    exported: ExportedText,
    model: RunnableModel,
    to: str,
    *,
    frozen: Mapping[str, float] | None = None,
) -> tuple[Verification, ...]:
    """Load an export back, with everything that can load it here, and compare.

    Args:
        exported: what `export_model` returned.
        model: the model.
        to: name of the format.
        frozen: positions of a URDF's other joints [rad or m], by name.

    Returns:
        One comparison for each program that can load the file.

    Raises:
        ExportError: a C file does not compile, or a Python file does not run.
    """
    from pivident.models.exported import Verification

    entry, options = FORMATS[to], FileOptions(frozen=frozen or {})
    if not entry.checks:
        return (Verification(entry.title, skipped=entry.not_loaded),)
    return tuple(check(exported, model, options) for check in entry.checks)
