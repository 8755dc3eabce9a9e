"""Ready robots, and one door for every way to name a robot: gallery name, TOML, URDF or MJCF."""

from __future__ import annotations

import re
from importlib.resources import files
from pathlib import Path

from pivident.foundation.errors import RobotDescriptionError, require_known
from pivident.robot.description import Robot
from pivident.robot.mjcf import read_mjcf
from pivident.robot.modified_dh import parse_modified_dh, read_modified_dh
from pivident.robot.naming import MJCF_FILES, URDF_FILES, refuse_xacro
from pivident.robot.urdf import read_urdf


def gallery_names() -> tuple[str, ...]:
    """Names of the robots that come with pivident, sorted."""
    entries = (entry.name for entry in files(__name__).iterdir())
    return tuple(sorted(name.removesuffix(".toml") for name in entries if name.endswith(".toml")))


def load_robot(name_or_path: str | Path) -> Robot:
    """A robot by gallery name, modified DH file (``.toml``), URDF or MJCF.

    Args:
        name_or_path: such as ``staubli_tx40`` or ``robots/arm.urdf``. A text that ends with
            ``.toml``, ``.urdf``, ``.urdf.gz``, ``.xml`` or ``.mjcf`` is a path, every other text
            is a name.

    Returns:
        The robot.

    Raises:
        RobotDescriptionError: there is no such robot, or its file cannot be used.

    Example:
        >>> pv.load_robot("planar_2r")
        <Robot 'planar 2R': 2 joints (shoulder, elbow)>
        >>> robot = pv.load_robot("staubli_tx40")
        >>> np.degrees(robot.rated_speeds).round()
        array([287., 287., 430., 410., 320., 700.])
    """
    text = str(name_or_path)
    if text.endswith(".toml"):
        return read_modified_dh(text)
    if text.endswith(URDF_FILES):
        return read_urdf(text)
    if text.endswith(MJCF_FILES):
        return read_mjcf(text)
    refuse_xacro(text)
    if not re.fullmatch(r"\w+", text):
        raise RobotDescriptionError(
            f"{text!r} is neither a gallery name nor a robot file",
            advice="a file ends with .toml, .urdf, .urdf.gz, .xml or .mjcf, and the gallery has "
            f"{', '.join(gallery_names())}",
        )
    require_known(
        text, gallery_names(), f"the gallery has no robot {text!r}", RobotDescriptionError
    )
    source = files(__name__) / f"{text}.toml"
    return parse_modified_dh(source.read_text(encoding="utf-8"), source=f"gallery robot {text!r}")
