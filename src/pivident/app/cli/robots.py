"""The command ``pivident robots``: the gallery, or one robot."""

from __future__ import annotations

from pivident.app.cli.console import DONE


def robots(name: str | None = None, /) -> int:
    """List the robots of the gallery, or show one: geometry and base parameters.

    Parameters
    ----------
    name
        Name in the gallery, or a robot file (.toml, .urdf, .urdf.gz, .xml, .mjcf).
    """
    from pivident.app.cli.robot_sheet import gallery_text, robot_text

    print(gallery_text() if name is None else robot_text(name))
    return DONE
