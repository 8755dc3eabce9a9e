"""Finding things by name, and suggesting the nearest known name where there is none."""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from pivident.foundation.errors import RobotDescriptionError
from pivident.foundation.text.sentences import near_names as near_names, nearest as nearest

#: Endings of robot files: a name with one of them is a path.
URDF_FILES = (".urdf", ".urdf.gz", ".URDF")
MJCF_FILES = (".xml", ".mjcf", ".XML")
XACRO_FILES = (".xacro", ".xacro.gz")
ROBOT_FILES = (".toml", *URDF_FILES, *MJCF_FILES)

#: Maximum digits of a joint number; Python refuses to read numbers of thousands of digits.
MAX_DIGITS = 9


def refuse_xacro(name: str) -> None:
    """Refuse the template of a URDF, with how to expand it."""
    if name.endswith(XACRO_FILES):
        raise RobotDescriptionError(
            f"{name!r} is a xacro, the template of a URDF", advice=expand_xacro(name)
        )


def expand_xacro(name: str = "arm.urdf.xacro") -> str:
    """How a xacro becomes a URDF."""
    stem = re.sub(r"(\.urdf)?\.xacro(\.gz)?$", "", name.rpartition("/")[2])
    return (
        f"expand it first: xacro {name} > {stem}.urdf, or without ROS: pip install xacrodoc, "
        f"xacrodoc {name} -o {stem}.urdf; then give {stem}.urdf"
    )


def numbered_joints(joints: int) -> list[str]:
    """Names of joints that nobody named."""
    return [f"joint_{j + 1}" for j in range(joints)]


def frozen_example(joint: str) -> str:
    """How an experiment file freezes a joint, as TOML with its table."""
    key = joint if re.fullmatch(r"[A-Za-z0-9_-]+", joint) else f'"{joint}"'
    return f"frozen = {{{key} = 0.0}} under [robot]"


def repeated(names: Sequence[str]) -> list[str]:
    """Names that occur more than once, sorted."""
    return sorted(name for name, count in Counter(names).items() if count > 1)


def find_joint(names: Sequence[str], reference: str) -> int:
    """Index of a joint given by its name or by its number, counted from 1."""
    if reference in names:
        return list(names).index(reference)
    digits = reference.isdecimal() and len(reference) <= MAX_DIGITS
    if digits and 1 <= int(reference) <= len(names):
        return int(reference) - 1
    if reference.lstrip("-").isdecimal():
        raise RobotDescriptionError(
            f"there is no joint number {reference}",
            advice=f"the moving joints count from 1 to {len(names)}",
        )
    raise RobotDescriptionError(
        f"there is no joint {reference!r}", advice=nearest(reference, names)
    )


@contextmanager
def errors_name(source: str) -> Iterator[None]:
    """Put the file (or other source) in front of every robot description error."""
    try:
        yield
    except RobotDescriptionError as error:
        raise RobotDescriptionError.of_part(f"{source}: ", error).about(*error.place) from error
