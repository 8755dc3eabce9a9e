"""The command ``pivident studio``: the whole path in a browser."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

from cyclopts import Parameter


def studio(
    folder: Path = Path(),
    /,
    *,
    port: int = 0,
    at_once: int = 1,
    browser: Annotated[bool, Parameter(negative="--no-browser")] = True,
) -> int:
    """Serve projects to a browser on this machine: bring files, check, identify, share.

    Parameters
    ----------
    folder
        Folder of the projects, or of a single one. Default: the current folder.
    port
        Port to listen on at 127.0.0.1; 0: any that is free.
    at_once
        Runs that are computed at the same time.
    browser
        Open the page in a browser.
    """
    from pivident.app.studio.serve import serve

    serve(folder, port, at_once=at_once, browser=browser)
    return 0
