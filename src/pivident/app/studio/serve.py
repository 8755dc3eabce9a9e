"""Start the studio: a server on this machine alone, and its page in the browser."""

from __future__ import annotations

import socket
import threading
import webbrowser
from pathlib import Path

from pivident.foundation.errors import PividentError
from pivident.foundation.extras import require

#: The only address that the server listens on.
HOST = "127.0.0.1"

#: Time that requests have to end when the server is stopped [s].
GRACE = 2


def serve(root: Path, port: int = 0, *, at_once: int = 1, browser: bool = True) -> None:
    """Serve the projects of a folder until Ctrl-C.

    Args:
        root: folder of the projects, or of a single one.
        port: port to listen on; 0: any that is free.
        at_once: runs that are computed at the same time.
        browser: whether a browser is opened.

    Raises:
        PividentError: the folder does not exist, or the port is taken.
        MissingExtra: the extra ``studio`` is not installed.
    """
    purpose = "pivident studio"
    uvicorn = require("uvicorn", extra="studio", purpose=purpose)
    require("starlette.applications", extra="studio", purpose=purpose)
    require("plotly", extra="studio", purpose=purpose)
    from pivident.app.studio.access import TOKEN, new_token
    from pivident.app.studio.server import application
    from pivident.app.studio.studio import Studio

    if not root.is_dir():
        raise PividentError(f"{root} is no folder", advice="create it, or name another one")
    if at_once < 1:
        raise PividentError(f"--at-once is {at_once}", advice="at least 1 is needed")
    listening = _socket(port)
    port = listening.getsockname()[1]
    token = new_token()
    address = f"http://{HOST}:{port}/?{TOKEN}={token}"
    app = application(Studio(root, at_once), token, port)
    config = uvicorn.Config(
        app, log_level="warning", access_log=False, timeout_graceful_shutdown=GRACE
    )
    print(f"pivident studio: {address}", flush=True)
    print("The address is a key to your projects: give it to nobody. Ctrl-C ends the server, runs "
          "go on.", flush=True)  # fmt: skip
    if browser:
        threading.Timer(0.5, webbrowser.open, (address,)).start()
    uvicorn.Server(config).run(sockets=[listening])


def _socket(port: int) -> socket.socket:
    """A socket on this machine's own address.

    Raises:
        PividentError: the port is taken, or may not be used.
    """
    listening = socket.socket(socket.AF_INET, socket.SOCK_STREAM)
    listening.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
    try:
        listening.bind((HOST, port))
        listening.listen()  # who opens the address before the server is ready waits for it
    except (OSError, OverflowError) as error:
        listening.close()
        raise PividentError(
            f"port {port} cannot be used ({error})", advice="choose another --port, or 0 for any"
        ) from error
    return listening
