"""A result as a document: what it says, once, for terminal, page, notebook and files."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from os import PathLike
from typing import Any

from pivident.foundation.document.curves import Curves
from pivident.foundation.document.table import Table
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.plain_values import plain, write_json


@dataclass(frozen=True, eq=False)
class Part:
    """What stands under one heading.

    Attributes:
        heading: on pages.
        blocks: paragraphs, the first of which is the headline, and tables.
        figures: curves, on pages below the rest.
    """

    heading: str
    blocks: Sequence[str | Table] = ()
    figures: Sequence[Curves] = ()


@dataclass(frozen=True, eq=False)
class Document(Displayed):
    """One account of a result, from which all ways of showing it follow.

    Attributes:
        title: of a page.
        parts: in order.
        findings: what a reader should know, below the first part of a page, else at the end.
        values: the result as it is stored, by key.
        sheet: the table that a file of its own holds.
    """

    title: str
    parts: Sequence[Part]
    findings: Sequence[Finding | str] = ()
    values: Mapping[str, Any] = field(default_factory=dict)
    sheet: Table | None = None

    @property
    def tables(self) -> dict[str, Table]:
        """The tables by name, the first one first."""
        blocks = [block for part in self.parts for block in part.blocks]
        sheet = [] if self.sheet is None else [self.sheet]
        return {one.name: one for one in [*blocks, *sheet] if isinstance(one, Table)}

    @property
    def body(self) -> str:
        """The text without the findings."""
        blocks = (block for part in self.parts for block in part.blocks)
        return "\n\n".join(b if isinstance(b, str) else b.text() for b in blocks)

    def __str__(self) -> str:
        return "\n\n".join([self.body, *map(str, self.findings)])

    def save(
        self,
        folder: str | PathLike[str],
        name: str,
        page: str = "",
        files: Mapping[str, bytes] | None = None,
    ) -> None:
        """Write ``NAME.json``, ``NAME.csv``, ``NAME.txt`` and ``NAME.html``, all or nothing.

        Args:
            folder: where.
            name: of the files.
            page: text of the page; empty: none is written.
            files: what else belongs there, by name.
        """
        table = "" if self.sheet is None else self.sheet.to_csv()
        texts = {"csv": table, "txt": f"{self}\n", "html": page}
        with atomic_folder(folder) as build:
            write_json(build / f"{name}.json", plain(self.values))
            for ending, text in texts.items():
                if text:
                    # File names may contain bytes that are not text; they become escapes.
                    content = text.encode("utf-8", errors="backslashreplace")
                    (build / f"{name}.{ending}").write_bytes(content)
            for other, content in (files or {}).items():
                (build / other).write_bytes(content)


class Accounted(Displayed):
    """A result that accounts for itself."""

    def account(self) -> Document:
        """The result as a document."""
        raise NotImplementedError

    def __str__(self) -> str:
        return str(self.account())
