"""The page as Markdown for the documentation, or as one HTML file that needs nothing else."""

from __future__ import annotations

import base64
import importlib
import inspect
import re
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup, escape

from pivident.foundation.errors import PividentError
from pivident.foundation.version import __version__


class MissingObject(PividentError, LookupError):
    """A page names code that does not exist."""


def object_named(name: str) -> Any:
    """The object of a dotted name, such as ``pivident.signals.random_walk.irwsm``.

    Raises:
        MissingObject: there is none.
    """
    parts = name.split(".")
    for count in range(len(parts), 0, -1):
        module = ".".join(parts[:count])
        try:
            found: Any = importlib.import_module(module)
        except ModuleNotFoundError as error:
            if error.name and not module.startswith(error.name):
                raise
            continue
        for part in parts[count:]:
            if not hasattr(found, part):
                raise MissingObject(f"{name}: {module} has no {part!r}")
            found = getattr(found, part)
        return found
    raise MissingObject(f"there is no {name}")


def source_of(name: str) -> str:
    """Source of an object, below a line with its module and where it stands there.

    Raises:
        MissingObject: there is no such object.
    """
    found = object_named(name)
    found = inspect.unwrap(getattr(found, "py_func", found))  # kernels are compiled
    lines, first = inspect.getsourcelines(found)
    return f"# {found.__module__}, line {first}\n{''.join(lines).rstrip()}"


#: A reference to code in the documentation.
_CODE = re.compile(r"\{code\}`(pivident[\w.]*)`")


def markdown_of(content: Mapping[str, Any]) -> str:
    """The page as MyST Markdown; code is tied by ``{code}`name```, figures lie in ``figures``."""
    environment = Environment(
        loader=PackageLoader(__package__),
        autoescape=False,  # Markdown, whose own characters `cell` takes care of
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
    )
    environment.globals |= {"table": table, "figure": lambda n, text: f"![{text}](figures/{n}.png)"}
    text = environment.get_template("paper.md").render(content)
    return re.sub(r"\n{3,}", "\n\n", text).strip() + "\n"


def table(head: Sequence[str], rows: Sequence[Sequence[object]]) -> str:
    """A Markdown table."""
    lines = [head, ["---"] * len(head), *rows]
    return "\n".join("| " + " | ".join(cell(x) for x in line) + " |" for line in lines)


def cell(text: object) -> str:
    """Text for a cell of a table: on one line, without bars."""
    return " ".join(str(text).split()).replace("|", "\\|")


def code(*names: str) -> str:
    """Ties to code by their dotted names."""
    return ", ".join(f"{{code}}`{name}`" for name in names)


def html_of(markdown: str, figures: Path) -> str:
    """The Markdown page as HTML with its figures and the source of all code it names inside."""
    from markdown_it import MarkdownIt

    from pivident.judgement.report.builder import page_environment

    names = list(dict.fromkeys(_CODE.findall(markdown)))
    linked = _CODE.sub(
        lambda found: f"[`{'.'.join(found[1].split('.')[-2:])}`](#{_anchor(found[1])})", markdown
    )
    body = re.sub(  # behind the renderer, which looks at every character of an address
        r'"figures/(\w+\.png)"',
        lambda found: f'"{_data(figures / found[1])}"',
        MarkdownIt("commonmark", {"html": False}).enable("table").render(linked),
    )
    sources = [(_anchor(name), name, source_of(name)) for name in names]
    return (
        page_environment(__package__)
        .get_template("paper.html")
        .render(body=Markup(body), sources=sources, version=__version__)
    )


def _anchor(name: str) -> str:
    return "code-" + str(escape(name.replace(".", "-").replace("_", "-").lower()))


def _data(file: Path) -> str:
    """An image as a data URI."""
    return "data:image/png;base64," + base64.b64encode(file.read_bytes()).decode("ascii")
