"""A design as strict JSON with checked keys, from which it is restored exactly.

    {"format": "pivident-design", "schema": 1, "version": …, "robot": {…}, "motion": {…},
     "criterion": …, "cost": […], …, "predicted": [{…} …], "correlation": [[…] …], …}

JSON has no numbers that are not finite; they are written as null, which means in its place

- no lower or upper limit (−∞, ∞),
- a parameter that is not determined: an infinite standard error, cost or condition number,
- an unknown value or correlation (NaN).

The file is read as data of a stranger: types, shapes, names of joints, and a motion that is one.

The layout of a design's file: which keys, types and sizes are accepted.

A design as a folder: file, samples, postures, programs of robots and the page.
"""

from __future__ import annotations

import math
from os import PathLike
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from pivident.foundation.codec import Layout, decode
from pivident.foundation.errors import IdentificationFileError, PividentError, UnusableValue
from pivident.foundation.extras import is_installed
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.plain_values import json_of_entries, plain
from pivident.foundation.version import __version__
from pivident.studies.excitation.design import (
    PAGE_RATE,
    Design,
    postures_csv,
    sample_arrays,
    samples_csv,
)
from pivident.studies.excitation.robot_programs import PROGRAM_FILES, robot_programs

if TYPE_CHECKING:
    from pivident.studies.excitation.design_view import DesignFile


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


#: Samples of the motion per second [Hz], where nothing else is asked for.
RATE = 1000.0

#: All files of a design: those that one does not have are taken away from its folder.
DESIGN_FILES = (
    *("design.json", "motion.csv", "motion.npz", "postures.csv", "design.html"),
    *PROGRAM_FILES,
)

#: Largest number of samples of a file.
MAX_SAMPLES = 10_000_000


def write_design(
    design: Design, folder: str | PathLike[str], rate: float = RATE
) -> tuple[Path, ...]:
    """Write a design as files, all of them or none.

    ===============================  =======================================================
    ``design.json``                  everything, read back by `load_design`
    ``motion.csv``                   t, q, dq and ddq of all joints at the rate
    ``motion.npz``                   the same as arrays of the same names, and ``joint_names``
    ``postures.csv``                 of a motion between postures: for a teach pendant
    ``trajectory.yaml``              ``trajectory_msgs/msg/JointTrajectory`` of ROS 2
    ``trajectory_slow.yaml``         the same at a quarter of the speed, for a first run
    ``pivident_motion.script``       URScript, for six revolute joints
    ``pivident_motion_slow.script``  the same at a quarter of the speed
    ``pivident_motion.src``          KUKA KRL, for up to six revolute joints and postures
    ``pivident_motion.mod``          ABB RAPID, for six revolute joints and postures
    ``design.html``                  the page, where plotly is installed
    ===============================  =======================================================

    Args:
        design: the design.
        folder: folder to write to; it is created. Files of another design in it are replaced or
            removed, all others stay.
        rate: of the samples in ``motion.csv`` and ``motion.npz`` [Hz].

    Returns:
        The files, in this order.

    Raises:
        PividentError: the rate is no positive number of samples per second, or asks for too many;
            or the folder cannot be written.
    """
    check_rate(rate)
    if design.motion.duration * rate > MAX_SAMPLES:
        raise PividentError(
            f"{design.motion.duration:g} s at {rate:g} Hz are more than {MAX_SAMPLES} samples",
            advice="give a lower rate",
        )
    folder = Path(folder)
    if folder.exists() and not folder.is_dir():
        raise PividentError(f"{folder} is a file", advice="name a folder for the design")
    texts = _texts(design, rate)
    with atomic_folder(folder) as build:
        for name, _, text in texts:
            _write(build / name, text)
        names = [name for name, _, _ in texts]
        arrays: dict[str, Any] = sample_arrays(design, rate)
        np.savez_compressed(build / "motion.npz", **arrays)
        names.insert(2, "motion.npz")
        if is_installed("plotly"):
            _write(build / "design.html", _page(design, texts, rate))
            names.append("design.html")
        for stale in set(DESIGN_FILES).difference(names):
            (folder / stale).unlink(missing_ok=True)
    return tuple(folder / name for name in names)


def check_rate(rate: float) -> None:
    """Refuse a rate of samples that means nothing.

    Args:
        rate: of the samples [Hz].

    Raises:
        PividentError: it is not positive and finite.
    """
    if not (np.isfinite(rate) and rate > 0.0):
        raise PividentError(
            f"the rate is {rate:g} Hz", advice=f"give a positive number, such as {RATE:g}"
        )


def _texts(design: Design, rate: float) -> list[tuple[str, str, str]]:
    """Name, words and text of every file that is text, but the page."""
    texts = [
        ("design.json", "the whole design, for pivident", design_json(design)),
        ("motion.csv", f"samples at {rate:g} Hz", samples_csv(design, rate)),
    ]
    if design.motion.kind == "postures":
        texts.append(("postures.csv", "postures for a teach pendant", postures_csv(design)))
    return texts + [(p.name, p.words, p.text) for p in robot_programs(design)]


def _page(design: Design, texts: list[tuple[str, str, str]], rate: float) -> str:
    from pivident.studies.excitation.design_view import DesignFile, render_page

    files: list[DesignFile] = [DesignFile(*own) for own in texts]
    files.insert(2, DesignFile("motion.npz", f"arrays of NumPy at {rate:g} Hz", None))
    return render_page(design, files)


def _write(path: Path, text: str) -> None:
    """Text as UTF-8 with plain line ends; parts of names that are no text become escapes."""
    escapes = "xmlcharrefreplace" if path.suffix == ".html" else "backslashreplace"
    with path.open("w", encoding="utf-8", errors=escapes, newline="\n") as file:
        file.write(text)
