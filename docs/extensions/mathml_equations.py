"""Equations as MathML, which browsers draw by themselves: no script, no network.

The translation from TeX is that of docutils. Sphinx numbers the labelled equations and resolves
the references to them; this writes the number beside the formula.
"""

from __future__ import annotations

import re

from docutils.utils.math import MathError
from docutils.utils.math.latex2mathml import tex2mathml
from sphinx.application import Sphinx
from sphinx.errors import SphinxError
from sphinx.util.math import get_node_equation_number

#: A fraction without braces, whose parts are the next two signs; docutils wants braces.
BARE_FRACTION = re.compile(r"(\\[dt]?frac)(\d)(\w)")


def braced(formula: str) -> str:
    r"""``\tfrac12`` as ``\tfrac{1}{2}``."""
    return BARE_FRACTION.sub(r"\1{\2}{\3}", formula)


def translated(self, node, as_block: bool) -> str:
    """The formula of a node as MathML; an error of the formula stops the build."""
    try:
        return tex2mathml(braced(node.astext().strip()), as_block=as_block)
    except MathError as error:
        place = f"{node.source}:{node.line}"
        raise SphinxError(f"{place}: {error} in the formula {node.astext()!r}") from error


def visit_inline(self, node) -> None:
    """Write a formula within a line."""
    import docutils.nodes

    self.body.append(f'<span class="math">{translated(self, node, as_block=False)}</span>')
    raise docutils.nodes.SkipNode


def visit_block(self, node) -> None:
    """Write a displayed formula, with its number and a link to itself where it has a label."""
    import docutils.nodes

    self.body.append(self.starttag(node, "div", CLASS="equation"))
    self.body.append(translated(self, node, as_block=True))
    if node["number"]:
        number = get_node_equation_number(self, node)
        self.body.append(f'<span class="eqno">({number})')
        self.add_permalink_ref(node, "Link to this equation")
        self.body.append("</span>")
    self.body.append("</div>\n")
    raise docutils.nodes.SkipNode


def setup(app: Sphinx) -> dict:
    """Register the renderer ``mathml``."""
    app.add_html_math_renderer("mathml", (visit_inline, None), (visit_block, None))
    return {"version": "1", "parallel_read_safe": True, "parallel_write_safe": True}
