"""Ties from equations to the code that computes them.

``{code}`pivident.signals.random_walk.irwsm` `` in a page names the function behind the equation
above it and leads to its source. An object that does not exist stops the build. The page of the
tied objects (`reference/implementation.md`) is filled here from all pages.
"""

from __future__ import annotations

import inspect
import re
from pathlib import Path

from pivident.studies.paper.markdown import MissingObject as MissingObject, object_named

TIE = re.compile(r"\{code\}`(pivident[\w.]*)`")


def tied_names(folder: Path) -> dict[str, list[str]]:
    """Names of the tied objects, and the pages that name each (relative to the folder)."""
    found: dict[str, list[str]] = {}
    for page in sorted(folder.rglob("*.md")):
        for name in TIE.findall(page.read_text(encoding="utf-8")):
            pages = found.setdefault(name, [])
            text = page.relative_to(folder).as_posix()
            if text not in pages:
                pages.append(text)
    return found


def directive_of(name: str) -> str:
    """The autodoc directive for an object."""
    found = object_named(name)
    if inspect.ismodule(found):
        return "automodule"
    if inspect.isclass(found):
        return "autoclass"
    return "autofunction"


def implementation_list(folder: Path) -> str:
    """The tied objects by module, as reStructuredText with autodoc."""
    lines: list[str] = []
    names = sorted(tied_names(folder), key=lambda name: name.rsplit(".", 1))
    previous = ""
    for name in names:
        module = name.rsplit(".", 1)[0]
        if module != previous:
            lines += ["", f".. rubric:: {module}", ""]
            previous = module
        lines += [f".. {directive_of(name)}:: {name}", ""]
    return "\n".join(lines)


def setup(app) -> dict:
    """Add the role and fill the page of the tied objects."""
    from sphinx.util.docutils import SphinxRole

    class CodeRole(SphinxRole):
        def run(self):
            from docutils import nodes
            from sphinx import addnodes

            object_named(self.text)
            shown = ".".join(self.text.split(".")[-2:])
            reference = addnodes.pending_xref(
                self.rawtext,
                nodes.literal(self.text, shown, classes=["xref", "py"]),
                refdomain="py",
                reftype="obj",
                reftarget=self.text,
                refexplicit=True,
                refwarn=True,
                refdoc=self.env.docname,
            )
            return [reference], []

    def fill(app, docname, source) -> None:
        if docname == "reference/implementation":
            source[0] = source[0].replace(
                "@implementations@", implementation_list(Path(app.srcdir))
            )

    app.add_role("code", CodeRole())
    app.connect("source-read", fill)
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
