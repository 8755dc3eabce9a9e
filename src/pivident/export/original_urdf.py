"""The URDF that a robot was identified with: found again, and known by its hash."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pivident.errors import ExportError
from pivident.robot.description import Robot
from pivident.robot.naming import errors_name
from pivident.robot.urdf import text_digest
from pivident.robot.urdf_xml import file_content


@dataclass(frozen=True)
class OriginalUrdf:
    """The file that inertials are put into.

    Attributes:
        path: the file.
        content: its text, unpacked.
        notes: what is to be said about it, sentences.
    """

    path: Path
    content: bytes
    notes: tuple[str, ...] = ()


def original_urdf(robot: Robot, given: Path | None, folder: Path) -> OriginalUrdf | None:
    """The robot's URDF, by its path or beside the result.

    Args:
        robot: the robot.
        given: a file to take in its place; its joints must be the robot's.
        folder: folder of the result, where a file of the same name is looked for, too.

    Returns:
        The file; None where the robot comes from no URDF and none is given.

    Raises:
        ExportError: it is not there, or its content is another one.
        RobotDescriptionError: it cannot be read.
    """
    known = robot.urdf
    if given is not None:
        content = _content(given)
        notes: tuple[str, ...] = ()
        if known is not None and text_digest(content) != known.sha256:
            notes = (
                f"{given} is not the file that was identified (SHA-256 "
                f"{text_digest(content)[:12]}… instead of {known.sha256[:12]}…); its joints are "
                "the same",
            )
        return OriginalUrdf(given, content, notes)
    if known is None or not known.path:
        return None
    places = (Path(known.path), folder / Path(known.path).name)
    present = [place for place in places if place.is_file()]
    if not present:
        raise ExportError(
            f"the URDF of the robot {robot.name!r} is not there any more, neither {places[0]} nor "
            f"{places[1]}; give it with --robot FILE.urdf"
        )
    for place in present:
        content = _content(place)
        if text_digest(content) == known.sha256:
            return OriginalUrdf(place, content)
    raise ExportError(
        f"{present[0]} has changed since the robot was identified with it (SHA-256 "
        f"{text_digest(_content(present[0]))[:12]}… instead of {known.sha256[:12]}…); give the old "
        "file, or the new one by name, with --robot FILE.urdf"
    )


def _content(path: Path) -> bytes:
    with errors_name(str(path)):
        return file_content(path)
