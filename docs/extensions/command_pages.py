"""The page of the commands, written from the commands themselves when the pages are built."""

from __future__ import annotations

import re

#: Headings of the commands are one below that of the page's section.
COMMAND_HEADING = 3


def command_reference() -> str:
    """All commands with their arguments and options, as Markdown."""
    from pivident.app.cli.app import app

    text = app.generate_docs(
        output_format="markdown",
        recursive=True,
        heading_level=COMMAND_HEADING - 1,
    )
    start = re.search(rf"^{'#' * COMMAND_HEADING} ", text, flags=re.MULTILINE)
    assert start is not None, "no command is documented"
    return text[start.start() :]


def fill(app, docname: str, source: list[str]) -> None:
    """Put the commands where the page asks for them."""
    if docname == "reference/command_line":
        source[0] = source[0].replace("@commands@", command_reference())


def setup(app) -> dict:
    """Listen for the page."""
    app.connect("source-read", fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
