"""Changes in an XML text at byte positions; everything else is kept byte for byte.

Pieces of XML: escaped names, numbers with all their digits, a robot drawn as sticks.

A robot as sticks for display: along each link, and along its joint's axis.
"""

from __future__ import annotations

import codecs
import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from xml.parsers import expat
from xml.sax.saxutils import quoteattr

import numpy as np

from pivident.foundation.errors import ExportError
from pivident.models.runnable_model import RunnableModel, link_inertias
from pivident.robot.frames import rotation_from_z_to

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
        glue = self._newline + before if self._starts_line(last) else b""
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


#: Characters that XML 1.0 cannot hold, escaped or not.
_FORBIDDEN = re.compile("[^\t\n\r -\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
#: Radius of a stick over the sum of all link lengths; axes are twice as thick.
SLENDERNESS = 0.02
#: Reach that is assumed where all joints are in one point [m].
MIN_REACH = 0.1


def quoted(name: str) -> str:
    """A name as the value of an attribute, quotes included."""
    bad = _FORBIDDEN.search(name)
    if bad:
        raise ExportError(
            f"the name {name!r} holds the character {bad[0]!r}, which XML cannot write even "
            "escaped",
            advice="rename it",
        )
    return quoteattr(name)


def number(value: float) -> str:
    """The shortest text that reads back as the same number; no negative zero."""
    if not np.isfinite(value):
        raise ExportError(
            f"a value is {value}, which robot files cannot hold", advice="identify again"
        )
    return repr(float(value) + 0.0).removesuffix(".0")


def numbers(values: Iterable[float]) -> str:
    """Numbers with a space between them."""
    return " ".join(number(value) for value in values)


def comment(text: str) -> str:
    """A comment; two hyphens would end it and are separated."""
    return f"<!-- {_FORBIDDEN.sub('?', text).replace('--', '- -').rstrip('-')} -->"


def unlike(name: str, taken: Iterable[str]) -> str:
    """A name that is not taken: the name itself, or with underscores added."""
    used = set(taken)
    while name in used:
        name += "_"
    return name


def distinct(
    names: Sequence[str], others: Sequence[str], reserved: Sequence[str] = ()
) -> tuple[str, ...]:
    """Names of links, each once: repeated or empty ones become ``<joint>_link``."""
    out: list[str] = []
    for name, joint in zip(names, others, strict=True):
        own = name if name and names.count(name) == 1 else f"{joint}_link"
        out.append(unlike(own, [*reserved, *out, *(names if own != name else ())]))
    return tuple(out)


def rpy(rotation: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw [rad] of R = Rz(yaw) Ry(pitch) Rx(roll), accurate at pitch = ±90° too.

    The yaw is removed from R first, then roll and pitch are read from the rest; where roll and yaw
    cannot be separated, the roll compensates for any yaw.
    """
    yaw = np.arctan2(rotation[1, 0], rotation[0, 0])
    c, s = np.cos(yaw), np.sin(yaw)
    rest = np.array([[c, s, 0.0], [-s, c, 0.0], [0.0, 0.0, 1.0]]) @ rotation
    pitch = np.arctan2(-rest[2, 0], rest[0, 0])
    roll = np.arctan2(-rest[1, 2], rest[1, 1])
    return np.array([roll, pitch, yaw])


@dataclass(frozen=True, eq=False)
class Stick:
    """A straight stick in the frame of its link."""

    start: np.ndarray  # [m], shape (3,)
    end: np.ndarray  # [m], shape (3,)
    radius: float  # [m]

    def cylinder(self) -> tuple[np.ndarray, np.ndarray, float]:
        """Centre [m], roll pitch yaw [rad] and length [m] of a cylinder from end to end."""
        along = self.end - self.start
        length = float(np.linalg.norm(along))
        return 0.5 * (self.start + self.end), rpy(rotation_from_z_to(along / length)), length


def sticks(model: RunnableModel) -> dict[int, tuple[Stick, ...]]:
    """Sticks of every link by its index, -1 for the base.

    A link reaches to the joints that it carries and to where it closes loops; the last ones to
    their centre of mass.
    """
    robot, constraints = model.robot.tree, model.robot.constraints
    reach = sum(float(np.linalg.norm(joint.translation)) for joint in robot.joints)
    radius = SLENDERNESS * max(reach, MIN_REACH)
    inertia = link_inertias(model)
    found: dict[int, tuple[Stick, ...]] = {}
    for i in range(-1, robot.size):
        ends = [joint.translation for joint in robot.joints if joint.parent == i]
        for closure in constraints.closures if constraints else ():
            pairs = zip(closure.links, closure.frames, strict=True)
            ends += [frame.translation for link, frame in pairs if link == i]
        if i >= 0 and not ends and inertia[i, 9] > 0.0:
            ends = [inertia[i, 6:9] / inertia[i, 9]]
        own = [Stick(np.zeros(3), end, radius) for end in ends if np.linalg.norm(end) > radius]
        if i >= 0:
            axis = np.array([0.0, 0.0, 2.0 * radius])
            own.insert(0, Stick(-axis, axis, 2.0 * radius))
        found[i] = tuple(own)
    return found
