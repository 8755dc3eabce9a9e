"""The URDF that a robot was identified with, located and verified by its hash."""

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
    """The file that inertials are written into."""

    path: Path
    content: bytes  # its text, unpacked
    notes: tuple[str, ...] = ()  # sentences for the user


def original_urdf(robot: Robot, given: Path | None, folder: Path) -> OriginalUrdf | None:
    """The robot's URDF, by its path or in the folder of the result; None if it has none.

    A ``given`` file replaces it; its joints must be the robot's.
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
            f"the URDF of the robot {robot.name!r} no longer exists, neither {places[0]} nor "
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
