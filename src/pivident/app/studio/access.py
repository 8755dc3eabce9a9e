"""Who may ask: the browser that was given the token, on this machine, from the page itself.

Other programs and other pages on the same machine can reach a local port, too. Four things keep
them out: every request carries the token, its ``Host`` is this server (against DNS rebinding), a
request that changes something comes from a page of this server (``Origin``, against forged
requests), and what is answered may neither be framed nor read by another site.

What requests that change something carry, as JSON; anything else is refused.
"""

from __future__ import annotations

import secrets
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qsl, urlencode

from pydantic import BaseModel, ConfigDict
from starlette.datastructures import Headers, MutableHeaders
from starlette.responses import PlainTextResponse, RedirectResponse, Response
from starlette.types import ASGIApp, Message, Receive, Scope, Send

#: Requests that change nothing.
SAFE = ("GET", "HEAD")

#: Name of the token in the first address.
TOKEN = "token"

#: What a page of the studio may load: scripts, styles, pictures and answers of this server only.
POLICY = (
    "default-src 'none'; script-src 'self'; style-src 'self' 'unsafe-inline'; img-src 'self' data: "
    "blob:; connect-src 'self'; font-src 'self'; base-uri 'none'; form-action 'none'; "
    "frame-ancestors 'none'"
)

#: Headers of every answer.
HEADERS = {
    "x-content-type-options": "nosniff",
    "x-frame-options": "DENY",
    "referrer-policy": "no-referrer",
    "cross-origin-opener-policy": "same-origin",
    "cross-origin-resource-policy": "same-origin",
    "cache-control": "no-store",
    "content-security-policy": POLICY,
}


def new_token() -> str:
    """A token that nobody guesses: 256 bits in letters of an address."""
    return secrets.token_urlsafe(32)


class Access:
    """Middleware (ASGI) that answers only who may ask.

    Args:
        app: the application behind it.
        token: the secret of this server.
        port: the port that it listens on.
    """

    def __init__(self, app: ASGIApp, token: str, port: int) -> None:
        self.app, self.token = app, token
        self.hosts = {f"127.0.0.1:{port}", f"localhost:{port}"}
        self.cookie = f"pivident-{port}"  # cookies are shared by all ports of a host

    async def __call__(self, scope: Scope, receive: Receive, send: Send) -> None:
        """Answer, refuse, or exchange the token of the address for a cookie."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        if scope["type"] != "http":
            raise ValueError(f"a connection of kind {scope['type']!r} is not served")
        answer = self._refusal(scope) or self._with_cookie(scope)
        await (answer or self.app)(scope, receive, _with_headers(send))

    def _refusal(self, scope: Scope) -> Response | None:
        """The answer to who may not ask; None to who may."""
        headers = Headers(scope=scope)
        if headers.get("host", "") not in self.hosts:
            return _refused(421, "this server answers to 127.0.0.1 and localhost only")
        if not self._knows_token(scope, headers):
            return _refused(
                401,
                "this address needs the token of the studio; open the whole address that "
                "`pivident studio` printed when it started",
            )
        origin = headers.get("origin")
        own = f"http://{headers['host']}"
        if origin != own and (origin is not None or scope["method"] not in SAFE):
            return _refused(403, "the request does not come from a page of this server")
        if headers.get("sec-fetch-site", "same-origin") not in ("same-origin", "none"):
            return _refused(403, "the request comes from another site")
        return None

    def _knows_token(self, scope: Scope, headers: Headers) -> bool:
        """Whether the token stands in the cookie, or in the address of a page that is opened."""
        given = _cookies(headers).get(self.cookie, "")
        if scope["method"] in SAFE:
            given = dict(_query(scope)).get(TOKEN, given)
        return secrets.compare_digest(given.encode(), self.token.encode())

    def _with_cookie(self, scope: Scope) -> Response | None:
        """The same address without the token, which does not stay in the browser's history."""
        query = _query(scope)
        if TOKEN not in dict(query):
            return None
        rest = urlencode([(key, value) for key, value in query if key != TOKEN])
        path = "/" + scope["path"].lstrip("/")  # not //host, which is another server
        answer = RedirectResponse(f"{path}?{rest}" if rest else path, status_code=303)
        answer.set_cookie(self.cookie, self.token, httponly=True, samesite="strict", path="/")
        return answer


def _query(scope: Scope) -> list[tuple[str, str]]:
    return parse_qsl(scope["query_string"].decode("latin-1"), keep_blank_values=True)


def _cookies(headers: Headers) -> dict[str, str]:
    """Cookies by name; none where they cannot be read."""
    try:
        read = SimpleCookie(headers.get("cookie", ""))
    except CookieError:
        return {}
    return {name: morsel.value for name, morsel in read.items()}


def _refused(status: int, reason: str) -> Response:
    return PlainTextResponse(f"{reason}\n", status_code=status)


def _with_headers(send: Send) -> Send:
    """Send with the headers of every answer, where the answer has none of its own."""

    async def sending(message: Message) -> None:
        if message["type"] == "http.response.start":
            headers = MutableHeaders(scope=message)
            for name, value in HEADERS.items():
                headers.setdefault(name, value)
        await send(message)

    return sending


class _Body(BaseModel):
    model_config = ConfigDict(extra="forbid", strict=True)


class NewProject(_Body):
    """Name of a project to make."""

    name: str


class RobotChoice(_Body):
    """A robot of the gallery or a file that was brought."""

    model: str
    version: str


class DraftRequest(_Body):
    """Draft the experiment file anew."""

    answers: dict[str, str] = {}
    column_names: str = ""


class Edit(_Body):
    """A new value of a key as TOML; None takes the key away."""

    place: list[str | int]
    value: str | None
    version: str


class Confirmation(_Body):
    """An assumption that is right."""

    place: list[str | int]
    version: str


class Text(_Body):
    """The whole experiment file."""

    text: str
    version: str


class FixRequest(_Body):
    """The fix of a finding, by their numbers."""

    remark: int
    fix: int
    version: str


class RepairRequest(_Body):
    """A repair that the verdict of a run has tried, by its number."""

    run: str
    number: int
    version: str


class LawsRequest(_Body):
    """The friction laws that a run has chosen."""

    run: str
    version: str


class RunRequest(_Body):
    """A step of the way, with its arguments; ``go_on``: also where it is held back."""

    step: str
    arguments: dict[str, Any] = {}
    go_on: bool = False
