"""The library that draws the figures, packed: it is two thirds of a page otherwise."""

from __future__ import annotations

import base64
import zlib
from dataclasses import dataclass
from functools import cache
from typing import TYPE_CHECKING

from pivident.extras import require

if TYPE_CHECKING:
    from plotly.colors import get_colorscale as colour_scale
    from plotly.io import to_json
else:
    _FIGURES = {"extra": "report", "purpose": "a page with figures"}
    colour_scale = require("plotly.colors", **_FIGURES).get_colorscale
    to_json = require("plotly.io", **_FIGURES).to_json

__all__ = ["DrawingLibrary", "colour_scale", "drawing_library", "to_json"]


@dataclass(frozen=True)
class DrawingLibrary:
    """plotly.js as a page carries it; ``inflate.js`` unpacks it when the first figure wants it."""

    packed: str  # deflated (RFC 1951) UTF-8 text in base64
    size: int  # bytes of the text


@cache
def drawing_library() -> DrawingLibrary:
    """plotly.js of the installed package, packed once per process."""
    from plotly.offline import get_plotlyjs

    text = get_plotlyjs().encode("utf-8")
    packer = zlib.compressobj(9, wbits=-zlib.MAX_WBITS)  # without header and checksum
    packed = packer.compress(text) + packer.flush()
    return DrawingLibrary(base64.b64encode(packed).decode("ascii"), len(text))
