"""The studio's addresses: pages, their parts, and what may be done to a project.

Everything is answered from files: the experiment file, what was computed of it, and results. A page
asks twice a second which of its parts have changed, and fetches those; so two tabs show the same,
and a tab or a server that is gone takes nothing along.
"""

from __future__ import annotations

import json
import sys
import traceback
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

from pydantic import BaseModel, ValidationError
from starlette.applications import Starlette
from starlette.background import BackgroundTask
from starlette.concurrency import run_in_threadpool
from starlette.middleware import Middleware
from starlette.requests import Request
from starlette.responses import FileResponse, HTMLResponse, JSONResponse, RedirectResponse, Response
from starlette.routing import Route

from pivident.app.studio import uploads
from pivident.app.studio.access import (
    Access,
    Confirmation,
    DraftRequest,
    Edit,
    FixRequest,
    LawsRequest,
    NewProject,
    RepairRequest,
    RobotChoice,
    RunRequest,
    Text,
)
from pivident.app.studio.assets import ASSETS, asset
from pivident.app.studio.pages import front_page, one_piece, project_page, state
from pivident.app.studio.projects import Changed, Project, ProjectError
from pivident.app.studio.signals import window
from pivident.app.studio.studio import Studio
from pivident.foundation.errors import PividentError

#: Largest body of a request that is no file [bytes].
MAX_BODY = 4 * 2**20

#: What a page that was written as a file may do: run its own scripts, and ask nobody.
WRITTEN_PAGE = (
    "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; "
    "img-src data: blob:; connect-src data: blob:; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'self'"
)


def application(studio: Studio, token: str, port: int) -> Starlette:
    """The application of a studio.

    Args:
        studio: projects, and what is being computed.
        token: the secret that every request must carry.
        port: port that the server listens on.
    """

    @asynccontextmanager
    async def lifespan(app: Starlette) -> AsyncIterator[None]:
        await run_in_threadpool(studio.resume)
        yield
        await run_in_threadpool(studio.close)

    app = Starlette(
        routes=_routes(),
        middleware=[Middleware(Access, token=token, port=port)],
        exception_handlers={PividentError: _refused, Exception: _broken},
        lifespan=lifespan,
    )
    app.state.studio = studio
    return app


def _routes() -> list[Route]:
    """Addresses and what answers them."""
    one = "/p/{name}"
    return [
        Route("/", _front),
        Route("/static/{asset}", _static),
        Route(
            "/projects",
            _making(lambda studio, name: studio.projects.create(name)),
            methods=["POST"],
        ),
        Route("/projects/example", _making(Studio.example), methods=["POST"]),
        Route("/projects/archive", _open_archive, methods=["PUT"]),
        Route(one, _project),
        Route(f"{one}/state", _state),
        Route(f"{one}/part/{{part}}", _part),
        Route(f"{one}/files/{{path:path}}", _bring, methods=["PUT"]),
        Route(f"{one}/files/{{path:path}}", _remove_file, methods=["DELETE"]),
        Route(f"{one}/robot", _changing(RobotChoice, Studio.choose_robot), methods=["POST"]),
        Route(f"{one}/example", _doing(Studio.simulate_log), methods=["POST"]),
        Route(f"{one}/draft", _changing(DraftRequest, Studio.draft), methods=["POST"]),
        Route(f"{one}/edit", _changing(Edit, Studio.edit), methods=["POST"]),
        Route(f"{one}/confirm", _changing(Confirmation, Studio.confirm), methods=["POST"]),
        Route(
            f"{one}/text",
            _changing(Text, lambda studio, *of, **text: studio.projects.write(*of, **text)),
            methods=["POST"],
        ),
        Route(f"{one}/undo", _doing(Studio.undo), methods=["POST"]),
        Route(f"{one}/fix", _changing(FixRequest, Studio.fix), methods=["POST"]),
        Route(f"{one}/repair", _changing(RepairRequest, Studio.repair), methods=["POST"]),
        Route(f"{one}/laws", _changing(LawsRequest, Studio.write_laws), methods=["POST"]),
        Route(f"{one}/window", _window),
        Route(f"{one}/audit.html", _audit_page),
        Route(f"{one}/run", _changing(RunRequest, Studio.run), methods=["POST"]),
        Route(
            f"{one}/runs/{{run}}/cancel",
            _doing(lambda studio, project, run: studio.runs.cancel(project.folder, run)),
            methods=["POST"],
        ),
        Route(
            f"{one}/runs/{{run}}",
            _doing(lambda studio, project, run: studio.runs.remove(project.folder, run)),
            methods=["DELETE"],
        ),
        Route(f"{one}/results/{{path:path}}", _result),
        Route(f"{one}/archive.zip", _archive),
    ]


def _studio(request: Request) -> Studio:
    return request.app.state.studio


def _project_of(request: Request) -> Project:
    return _studio(request).projects.find(request.path_params["name"])


async def _body(request: Request, kind: type[BaseModel]) -> dict[str, Any]:
    """What a request asks for, by name.

    Raises:
        ProjectError: it is too long, or not what is expected here.
    """
    content = b""
    async for part in request.stream():
        content += part
        if len(content) > MAX_BODY:
            raise ProjectError(f"the request has more than {MAX_BODY} bytes")
    try:
        return dict(kind.model_validate_json(content))
    except ValidationError as error:
        raise ProjectError(f"the request cannot be read: {error.errors()[0]['msg']}") from None


def _done(**content: Any) -> JSONResponse:
    return JSONResponse({"done": True, **content})


async def _refused(request: Request, error: Exception) -> Response:
    """What is wrong, in a sentence."""
    status = 409 if isinstance(error, Changed) else 422
    notes = "".join(f" ({note})" for note in getattr(error, "__notes__", ()))
    return JSONResponse({"error": f"{error}{notes}"}, status_code=status)


async def _broken(request: Request, error: Exception) -> Response:
    """A mistake of ours: its trace goes to the terminal, its name to the page."""
    traceback.print_exception(error, file=sys.stderr)
    text = (
        f"unexpected {type(error).__name__} in the studio; this is a bug in pivident, the terminal "
        "of pivident studio shows where. Nothing was changed"
    )
    return JSONResponse({"error": text}, status_code=500)


Answer = Callable[[Request], Awaitable[Response]]


def _threaded(answer: Callable[[Request], Response]) -> Answer:
    """An answer that reads files, beside the loop that serves."""

    async def threaded(request: Request) -> Response:
        return await run_in_threadpool(answer, request)

    return threaded


def _making(make: Callable[..., Project]) -> Answer:
    """An answer that reads a name, makes a project of it, and says where it is."""

    async def making(request: Request) -> Response:
        studio, asked = _studio(request), await _body(request, NewProject)
        project = await run_in_threadpool(make, studio, **asked)
        return _done(to=studio.address(project))

    return making


def _changing(kind: type[BaseModel], act: Callable[..., str | None]) -> Answer:
    """An answer that reads a body of some kind and changes a project by it.

    ``act`` takes what the body holds by name; what it returns is the number of a new run.
    """

    async def changing(request: Request) -> Response:
        asked = await _body(request, kind)
        project = await run_in_threadpool(_project_of, request)
        run = await run_in_threadpool(act, _studio(request), project, **asked)
        return _done() if run is None else _done(run=run)

    return changing


def _doing(act: Callable[..., None]) -> Answer:
    """An answer that changes a project by no more than what the address says."""

    def doing(request: Request) -> Response:
        said = {key: value for key, value in request.path_params.items() if key != "name"}
        act(_studio(request), _project_of(request), **said)
        return _done()

    return _threaded(doing)


@_threaded
def _front(request: Request) -> Response:
    """All projects; a single one at once."""
    studio = _studio(request)
    if studio.projects.is_single:
        return RedirectResponse(studio.address(studio.projects.listed()[0]), status_code=303)
    return HTMLResponse(front_page(studio))


@_threaded
def _static(request: Request) -> Response:
    """Scripts and styles."""
    name = request.path_params["asset"]
    if name not in ASSETS:
        raise ProjectError(f"there is no {name!r}")
    content, kind, mark = asset(name)
    headers = {"cache-control": "private, max-age=31536000, immutable", "etag": mark}
    return Response(content, media_type=kind, headers=headers)


async def _open_archive(request: Request) -> Response:
    """A project from an archive that is sent."""
    studio, name = _studio(request), request.query_params.get("name", "")
    with TemporaryDirectory(dir=studio.projects.root, prefix=".archive-") as folder:
        path = Path(folder) / "archive.zip"
        await uploads.receive(path, request.stream(), _declared(request))
        project = await run_in_threadpool(uploads.open_archive, studio.projects, path, name)
    return _done(to=studio.address(project))


@_threaded
def _project(request: Request) -> Response:
    return HTMLResponse(project_page(_studio(request), _project_of(request)))


@_threaded
def _state(request: Request) -> Response:
    """Which parts there are, and what tells an old one from a new one."""
    return JSONResponse(state(_studio(request), _project_of(request)))


@_threaded
def _part(request: Request) -> Response:
    """One part of the page as it is now."""
    return HTMLResponse(
        one_piece(_studio(request), _project_of(request), request.path_params["part"])
    )


def _declared(request: Request) -> int | None:
    """How many bytes are announced."""
    length = request.headers.get("content-length", "")
    return int(length) if length.isascii() and length.isdigit() else None


async def _bring(request: Request) -> Response:
    """A file comes into a project."""
    studio = _studio(request)
    project = await run_in_threadpool(_project_of, request)
    path = uploads.target(project, request.path_params["path"])
    size = await uploads.receive(path, request.stream(), _declared(request))
    await run_in_threadpool(studio.brought, project, path)
    return _done(bytes=size)


@_threaded
def _remove_file(request: Request) -> Response:
    project = _project_of(request)
    uploads.remove(project, request.path_params["path"])
    _studio(request).removed(project)
    return _done()


@_threaded
def _window(request: Request) -> Response:
    """A stretch of a signal with as many points as a picture needs."""
    query = request.query_params
    try:
        found = window(
            _studio(request).looks.folder(_project_of(request).folder) / "signals",
            int(query.get("recording", "0")),
            query.get("channel", ""),
            [int(j) for j in query.get("joints", "0").split(",")][:64],
            float(query["from"]) if "from" in query else None,
            float(query["to"]) if "to" in query else None,
            min(int(query.get("points", "1500")), 20_000),
        )
    except ValueError as error:
        raise ProjectError(f"there is no such signal: {error}") from None
    except (KeyError, OSError):
        found = None  # signals that are being read anew
    content = json.dumps(found, allow_nan=False, separators=(",", ":"))
    return Response(content, media_type="application/json")


@_threaded
def _audit_page(request: Request) -> Response:
    path = _studio(request).looks.folder(_project_of(request).folder) / "findings" / "audit.html"
    if not path.is_file():
        raise ProjectError("the log has not been audited yet")
    return _written_page(path)


@_threaded
def _result(request: Request) -> Response:
    """A file of the results: a page to read, all else to keep."""
    path = _project_of(request).path_of(f"results/{request.path_params['path']}")
    if not path.is_file():
        raise ProjectError(f"there is no {path.name} in these results")
    if path.suffix == ".html" and "download" not in request.query_params:
        return _written_page(path)
    return FileResponse(path, filename=path.name, media_type="application/octet-stream")


def _written_page(path: Path) -> Response:
    return FileResponse(
        path,
        media_type="text/html; charset=utf-8",
        headers={"content-security-policy": WRITTEN_PAGE, "x-frame-options": "SAMEORIGIN"},
    )


@_threaded
def _archive(request: Request) -> Response:
    """The project as one file."""
    project, query = _project_of(request), request.query_params
    folder = TemporaryDirectory(dir=project.folder, prefix=".archive-")
    try:
        path = uploads.pack(
            project,
            Path(folder.name) / "archive.zip",
            logs=query.get("logs") == "1",
            results=query.get("results") == "1",
        )
    except OSError as error:
        folder.cleanup()
        raise ProjectError(f"the archive cannot be written: {error.strerror or error}") from error
    return FileResponse(
        path,
        filename=f"{project.name}.zip",
        media_type="application/zip",
        background=BackgroundTask(folder.cleanup),
    )
