"""Scripts and styles of the pages: those of the reports, the studio's own, and plotly.js."""

from __future__ import annotations

import hashlib
from functools import cache

from jinja2 import Environment

from pivident.foundation.document.plot import library_text
from pivident.judgement.report.builder import page_environment

#: Files of which a script or a style is put together, in the order in which they build on another.
PARTS = {
    "early.js": ("theme_early.js",),
    "studio.css": ("colours.css", "style.css", "studio.css"),
    "studio.js": (
        "theme.js",
        "contents.js",
        "talk.js",
        "instant.js",
        "signals.js",
        "arm.js",
        "replay.js",
        "bring.js",
        "parts.js",
    ),
    "front.js": ("theme.js", "talk.js", "bring.js"),
}

#: Everything that may be asked for.
ASSETS = (*PARTS, "plotly.js")

_KINDS = {"js": "text/javascript; charset=utf-8", "css": "text/css; charset=utf-8"}


@cache
def templates() -> Environment:
    """Templates of the studio, then of the reports."""
    environment = page_environment("pivident.app.studio")
    environment.globals["asset_address"] = asset_address
    return environment


@cache
def asset(name: str) -> tuple[bytes, str, str]:
    """Content, media type, and a mark that changes with the content."""
    parts = (templates().get_template(part).render() for part in PARTS.get(name, ()))
    content = (library_text() if name == "plotly.js" else "\n".join(parts)).encode("utf-8")
    return content, _KINDS[name.rpartition(".")[2]], hashlib.sha256(content).hexdigest()[:16]


def asset_address(name: str) -> str:
    """Address of a script or style, another one for another content; a browser keeps each."""
    mark = "library" if name == "plotly.js" else asset(name)[2]
    return f"/static/{name}?v={mark}"
