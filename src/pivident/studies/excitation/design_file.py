"""A design as strict JSON with checked keys, from which it is restored exactly.

    {"format": "pivident-design", "schema": 1, "version": …, "robot": {…}, "motion": {…},
     "criterion": …, "cost": […], …, "predicted": [{…} …], "correlation": [[…] …], …}

JSON has no numbers that are not finite; they are written as null, which means in its place

- no lower or upper limit (−∞, ∞),
- a parameter that is not determined: an infinite standard error, cost or condition number,
- an unknown value or correlation (NaN).

The file is read as data of a stranger: types, shapes, names of joints, and a motion that is one.

The layout of a design's file: which keys, types and sizes are accepted.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path

from pivident.foundation.codec import Layout, decode
from pivident.foundation.errors import IdentificationFileError, UnusableValue
from pivident.foundation.text.plain_values import json_of_entries, plain
from pivident.foundation.version import __version__
from pivident.studies.excitation.design import PAGE_RATE, Design


class DesignFileError(IdentificationFileError):
    """A design on disk that cannot be used.

    Attributes:
        file: the file.
        reason: what is wrong with it.
    """


DESIGN = Layout(
    "design",
    1,
    give="give design.json of a folder that `pivident excite` wrote",
    again="design it again with `pivident excite`",
    name="pivident-design",
    error=DesignFileError,
    max_bytes=2**26,
)


def design_json(design: Design) -> str:
    """The design as strict JSON, one line for each parameter, limit and row of a matrix.

    Args:
        design: the design.
    """
    return json_of_entries({**DESIGN.header, "version": __version__, **plain(design)})


def load_design(path: str | PathLike[str]) -> Design:
    """The design that `write_design` has written, exactly.

    Args:
        path: ``design.json``, or the folder that holds it.

    Returns:
        The design; its settings are plain values.

    Raises:
        DesignFileError: the file cannot be read, has another layout or is damaged.
    """
    file = Path(path)
    if file.is_dir():
        file = file / "design.json"
    content = DESIGN.raised(DESIGN.json(file), str(file))
    with DESIGN.damage(str(file)):
        content.pop("version", None)
        design = decode(Design, content)
        _check(design)
    return design


def _check(design: Design) -> None:
    """Refuse parts that do not belong together."""
    samples = math.floor(design.motion.duration * PAGE_RATE + 1e-9) + 1
    for name in ("torque", "torque_margin"):
        rows = getattr(design, name)
        if rows is not None and len(rows) != samples:
            raise UnusableValue(f"{name}: {len(rows)} rows", advice=f"{samples} rows are needed")
    robot = design.robot
    for body in design.bodies:
        if body.link >= robot.size:
            raise ValueError(f"the body {body.name!r} is on link {body.link} of {robot.size}")
    for use in design.limits:
        if use.joint not in robot.joint_names:
            raise ValueError(f"limits name the joint {use.joint!r}, which the robot does not have")
        if not use.low < use.high or (use.quantity != "position" and not use.low <= 0.0 < use.high):
            raise ValueError(
                f"limits: {use.quantity} of {use.joint!r} has the limits {use.low:g} and "
                f"{use.high:g}, between which no motion fits"
            )
