"""Documents as one page that needs nothing else, in the look of the report."""

from __future__ import annotations

from collections.abc import Sequence
from os import PathLike
from pathlib import Path

from markupsafe import Markup

from pivident.foundation.document.document import Accounted, Document
from pivident.foundation.document.figure import drawn
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.identifiers import identifier
from pivident.judgement.report.builder import page_environment, page_of


def page_of_documents(documents: Sequence[Document], names: Sequence[str] = ("",)) -> str:
    """The page of a document, or of several one below the other.

    Args:
        documents: they have their headings in common.
        names: what distinguishes them, in front of the headings.
    """
    environment = page_environment()
    template = environment.get_template("document_part.html")
    sections = []
    for number, (document, name) in enumerate(zip(documents, names, strict=True), start=1):
        several = len(documents) > 1
        for k, part in enumerate(document.parts):
            body = template.render(
                part=part,
                first="note" if k else "headline",
                findings=[] if k else [f for f in document.findings if not isinstance(f, str)],
                remarks=[] if k else [f for f in document.findings if isinstance(f, str)],
                figures=[drawn(curves) for curves in part.figures],
                kinds={(c.name, c.role): None for f in part.figures for c in f.curves},
            )
            anchor = identifier(part.heading.lower()) + (f"-{number}" if several else "")
            heading = f"{name}: {part.heading}" if several else part.heading
            sections.append((anchor, heading, Markup(body)))
    return page_of(environment, documents[0].title, sections, headed=len(documents) == 1)


def write_account(
    results: Accounted | Sequence[Accounted], path: str | PathLike[str], names: Sequence[str] = ()
) -> Path:
    """Write what is said of a result, or of several of one kind, as one HTML file.

    Args:
        results: such as a `Prediction` or several.
        path: the file.
        names: what distinguishes several, in front of their headings; none: their numbers.

    Returns:
        The file.

    Raises:
        PividentError: it cannot be written.
    """
    path = Path(path)
    several = [results] if isinstance(results, Accounted) else results
    documents = [one.account() for one in several]
    page = page_of_documents(documents, names or [str(k + 1) for k in range(len(documents))])
    with atomic_folder(path.parent) as build:
        (build / path.name).write_text(page, encoding="utf-8", errors="xmlcharrefreplace")
    return path
