"""Changes in an XML text at byte positions; everything else is kept byte for byte."""

from __future__ import annotations

import codecs
import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

from pivident.foundation.errors import ExportError

_START_TAG = re.compile(rb"""<(?:[^>"']|"[^"]*"|'[^']*')*>""")
_ATTRIBUTE = re.compile(rb"""\s+([^\s=/>]+)\s*=\s*("[^"]*"|'[^']*')""")
_DECLARED = re.compile(rb"""^<\?xml[^>]*?encoding\s*=\s*["']([A-Za-z0-9._-]+)["']""")

#: Byte order marks, longest first, and their encodings.
_MARKS = (
    (codecs.BOM_UTF8, "utf-8"),
    (codecs.BOM_UTF16_LE, "utf-16-le"),
    (codecs.BOM_UTF16_BE, "utf-16-be"),
)


@dataclass
class Element:
    """An element and its position in the text, in bytes of UTF-8."""

    tag: str
    attributes: Mapping[str, str]
    start: int  # of its start tag
    inside: int  # end of its start tag
    close: int = -1  # position of its end tag; of an empty element its end
    end: int = -1  # of its end tag
    children: list[Element] = field(default_factory=list)

    @property
    def is_empty(self) -> bool:
        """Whether it is one tag, ``<tag/>``."""
        return self.close == self.end

    def first(self, tag: str) -> Element | None:
        """The first child of that name."""
        return next((child for child in self.children if child.tag == tag), None)


class XmlText:
    """A well-formed XML text, its elements, and the requested changes."""

    root: Element

    def __init__(self, content: bytes) -> None:
        """Find the elements."""
        self._mark, self._encoding = _encoding(content)
        body = content[len(self._mark) :]
        self._bytes = body.decode(self._encoding).encode()
        if self._bytes.decode().encode(self._encoding) != body:
            raise ExportError(
                f"the original file's encoding {self._encoding} does not reproduce the same bytes",
                advice="save it as UTF-8",
            )
        self._newline = b"\r\n" if b"\r\n" in self._bytes else b"\n"
        self._changes: list[tuple[int, int, bytes]] = []
        self._open: list[Element] = []
        parser = expat.ParserCreate("utf-8")
        parser.StartElementHandler = lambda tag, attributes: self._start(parser, tag, attributes)
        parser.EndElementHandler = lambda tag: self._end(parser)
        parser.Parse(self._bytes, True)

    def _start(self, parser: expat.XMLParserType, tag: str, attributes: dict[str, str]) -> None:
        start = parser.CurrentByteIndex
        found = _START_TAG.match(self._bytes, start)
        assert found is not None
        element = Element(tag, attributes, start, found.end())
        if self._open:
            self._open[-1].children.append(element)
        else:
            self.root = element
        self._open.append(element)

    def _end(self, parser: expat.XMLParserType) -> None:
        element = self._open.pop()
        if self._bytes[element.inside - 2 : element.inside] == b"/>":
            element.close = element.end = element.inside
        else:
            element.close = parser.CurrentByteIndex
            element.end = self._bytes.index(b">", element.close) + 1

    def replace(self, element: Element, lines: list[str]) -> None:
        """Replace an element by other lines."""
        self._changes.append((element.start, element.end, self._laid_out(element, lines)))

    def set_attributes(self, element: Element, values: Mapping[str, str]) -> None:
        """Change values of attributes in a start tag, and add missing ones."""
        missing = dict(values)
        position = element.start + 1 + len(element.tag.encode())
        for found in _ATTRIBUTE.finditer(self._bytes, position, element.inside):
            value = missing.pop(found[1].decode(), None)
            if value is not None:
                self._changes.append((*found.span(2), quoteattr(value).encode()))
        if missing:
            end = element.inside - (2 if element.is_empty else 1)
            end = len(self._bytes[:end].rstrip())
            added = "".join(f" {key}={quoteattr(value)}" for key, value in missing.items())
            self._changes.append((end, end, added.encode()))

    def before(self, element: Element, lines: list[str]) -> None:
        """Put lines before an element."""
        text = self._newline.join(line.encode() for line in [*lines, ""])
        self._changes.append((element.start, element.start, text))

    def append(self, element: Element, lines: list[str]) -> None:
        """Put lines after the last child of an element."""
        if element.is_empty:
            first = self._bytes[element.start : element.inside - 2].rstrip() + b">"
            own = self._indent(element)
            text = self._between(own, lines) + self._newline + own
            close = f"</{element.tag}>".encode()
            self._changes.append((element.start, element.end, first + text + close))
            return
        if not element.children:
            text = self._between(self._indent(element), lines)
            self._changes.append((element.inside, element.inside, text))
            return
        last = element.children[-1]
        before = self._indent(last)
        alone = self._starts_line(last)
        glue = self._newline + before if alone else b""
        text = glue + self._laid_out(last, lines)
        self._changes.append((last.end, last.end, text))

    def content(self) -> bytes:
        """The changed text in its own encoding."""
        out, position = b"", 0
        for start, end, text in sorted(self._changes):
            out += self._bytes[position:start] + text
            position = end
        changed = (out + self._bytes[position:]).decode()
        return self._mark + changed.encode(self._encoding, errors="xmlcharrefreplace")

    def _between(self, indent: bytes, lines: list[str]) -> bytes:
        return b"".join(self._newline + indent + b"  " + line.encode() for line in lines)

    def _laid_out(self, element: Element, lines: list[str]) -> bytes:
        """Lines with the indentation of an element; one line where it shares its own."""
        if not self._starts_line(element):
            return "".join(line.strip() for line in lines).encode()
        return (self._newline + self._indent(element)).join(line.encode() for line in lines)

    def _line_before(self, element: Element) -> bytes:
        begin = self._bytes.rfind(b"\n", 0, element.start) + 1
        return self._bytes[begin : element.start]

    def _starts_line(self, element: Element) -> bool:
        return not self._line_before(element).strip()

    def _indent(self, element: Element) -> bytes:
        line = self._line_before(element)
        return line[: len(line) - len(line.lstrip())]


def _encoding(content: bytes) -> tuple[bytes, str]:
    """Byte order mark and encoding of a file."""
    for mark, encoding in _MARKS:
        if content.startswith(mark):
            return mark, encoding
    declared = _DECLARED.match(content)
    return b"", declared[1].decode("ascii") if declared else "utf-8"
