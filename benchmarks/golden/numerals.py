"""Numbers of a file: by key where the format has keys, else as numerals in lines of text."""

from __future__ import annotations

import csv
import hashlib
import json
import re
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from html.parser import HTMLParser
from pathlib import Path
from typing import Any
from xml.etree import ElementTree

import numpy as np

#: A numeral that is no part of a name (x12), of another numeral or of a version.
NUMERAL = re.compile(r"(?<![\w.])-?(?:\d+(?:\.\d+)?|\.\d+)(?:[eE][-+]?\d+)?|\b(?:nan|inf)\b")

#: Exponents as they are printed, 10⁻³: a number as well.
EXPONENT = re.compile(r"(?<=\d)[⁻⁰¹²³⁴⁵⁶⁷⁸⁹]+")
PLAIN = str.maketrans("⁻⁰¹²³⁴⁵⁶⁷⁸⁹", "-0123456789")

#: The same among the letters of a path of SVG, where M-3.2 is a letter and a number.
COORDINATE = re.compile(r"-?(?:\d+\.?\d*|\.\d+)(?:e[-+]?\d+)?")

#: What may differ between two runs: dates, versions of three parts, hashes, a time at a line's end.
PASSING = re.compile(
    r"\d{4}-\d\d-\d\d(?:[T ]\d\d:\d\d(?::\d\d(?:\.\d+)?)?(?:Z|[+-]\d\d:?\d\d)?)?"
    r"|(?<![\w.])\d+\.\d+\.\d+[\w.+-]*(?: \([0-9a-f]{12}\))?"
    r"|(?<![\w.])(?=[0-9a-f]*[a-f])[0-9a-f]{32,}\b"
    r"|\(\d+(?:\.\d+)? (?:ms|s|min)\)$"
    r"|\b\d+(?:\.\d+)? (?:s|min) for this page"
)

#: A study says how long a run of each method takes.
RUN_TIME = re.compile(r"(?<![\w.])\d+(?:\.\d+)? s$")

#: Lines of progress, which come by the clock, and the time that compiling will take.
PROGRESS = re.compile(r"\d+ of \d+ (?:runs|logs)\b|motions tried|\"compiling\": ")

#: Keys and columns of such values.
PASSING_KEY = re.compile(
    r"(?:^|[./_\]])(?:seconds|elapsed|wall|compiling|computed|versions?|created|hostname)\b"
)

#: Attributes of a page with coordinates, and those with words.
COORDINATES = {"d", "points", "x", "y", "x1", "x2", "y1", "y2", "cx", "cy", "data-value"}
WORDS = {"aria-label", "title", "alt"}

#: Formats in which the order of numbers has a meaning.
ORDERED = {".c", ".h", ".py", ".tex"}


@dataclass
class Content:
    """What is compared of a file.

    Attributes:
        values: by key, as they are written.
        lines: text in which numerals are looked for.
        coordinates: of figures.
        ordered: whether the order of the numerals counts.
    """

    values: dict[str, str] = field(default_factory=dict)
    lines: list[str] = field(default_factory=list)
    coordinates: list[str] = field(default_factory=list)
    ordered: bool = False

    def add(self, key: str, value: Any) -> None:
        """A leaf: a string is text, all else a value."""
        if PASSING_KEY.search(key):
            return
        if not isinstance(value, str):
            self.values[key] = "null" if value is None else str(value)
        elif is_number(value):
            self.values[key] = value
        elif len(value) > 200 and " " not in value:
            self.values[key] = digest(value.encode())
        else:
            self.lines += value.splitlines()

    def numerals(self) -> list[tuple[str, str]]:
        """Numerals of the lines in their order, each with its line."""
        found = []
        for line in self.lines:
            if PROGRESS.search(line):
                continue
            plain = PASSING.sub(" ", line.replace("\N{MINUS SIGN}", "-").rstrip())
            plain = EXPONENT.sub(lambda found: " " + found[0].translate(PLAIN), plain)
            found += [(number, line.strip()) for number in NUMERAL.findall(plain)]
        return found


def is_number(text: str) -> bool:
    """Whether a text is one number and nothing else."""
    return NUMERAL.fullmatch(text.strip()) is not None


def digest(content: bytes) -> str:
    """SHA-256, by which bytes are compared."""
    return f"sha256 {hashlib.sha256(content).hexdigest()}"


def flatten(value: Any, key: str = "") -> Iterator[tuple[str, Any]]:
    """Leaves of nested tables and lists, each with its path."""
    if isinstance(value, dict):
        for name, inner in value.items():
            yield from flatten(inner, f"{key}.{name}" if key else str(name))
    elif isinstance(value, list | tuple):
        for k, inner in enumerate(value):
            yield from flatten(inner, f"{key}[{k}]")
    else:
        yield key, value


def _leaves(nested: Any) -> Content:
    made = Content()
    for key, value in flatten(nested):
        made.add(key, value)
    return made


def _json(path: Path) -> Content:
    return _leaves(json.loads(path.read_text("utf-8"), parse_float=_Written, parse_int=_Written))


def _toml(path: Path) -> Content:
    made = _leaves(tomllib.loads(path.read_text("utf-8"), parse_float=_Written))
    comments = re.findall(r"#(?!\w*[\"']).*", path.read_text("utf-8"))
    made.lines += comments
    return made


class _Written:
    """A number as it stands in the file, so that not even its last digit is rounded."""

    def __init__(self, text: str) -> None:
        self.text = text

    def __str__(self) -> str:
        return self.text


def _csv(path: Path) -> Content:
    made = Content()
    with path.open(newline="", encoding="utf-8") as file:
        header, *rows = list(csv.reader(file)) or [[]]
    for k, row in enumerate(rows):
        for name, value in zip(header, row, strict=False):
            made.add(f"{name}[{k}]", value)
    return made


def _arrays(path: Path) -> Content:
    made = Content()
    with np.load(path) as file:
        for name, array in file.items():
            told = f"{array.dtype} {array.shape} {digest(np.ascontiguousarray(array).tobytes())}"
            made.values[name] = told
    return made


def _parquet(path: Path) -> Content:
    import polars

    return _leaves({"rows": polars.read_parquet(path).to_dicts()})


def _xml(path: Path) -> Content:
    made = Content()
    seen: dict[str, int] = {}

    def walk(element: ElementTree.Element, above: str) -> None:
        key = f"{above}/{element.tag}({element.get('name', '')})"
        seen[key] = seen.get(key, -1) + 1
        key += f"[{seen[key]}]"
        for name, value in [*element.attrib.items(), ("text", (element.text or "").strip())]:
            for k, word in enumerate(value.split()):
                if is_number(word):
                    made.values[f"{key}@{name}[{k}]"] = word
                else:
                    made.lines.append(word)
        for inner in element:
            walk(inner, key)

    walk(ElementTree.parse(path).getroot(), "")
    return made


class _Page(HTMLParser):
    """Text, labels and coordinates of a page, and the data of its scripts; no style, no program."""

    def __init__(self) -> None:
        super().__init__()
        self.content, self.inside, self.script = Content(), "", ""

    def handle_starttag(self, tag: str, attrs: list[tuple[str, str | None]]) -> None:
        given = {name: value or "" for name, value in attrs}
        self.inside = tag
        if tag == "script":
            self.inside = "json" if given.get("type") == "application/json" else "program"
        for name, value in given.items():
            if name in COORDINATES:
                self.content.coordinates += COORDINATE.findall(value)
            elif name in WORDS:
                self.content.lines += value.splitlines()

    def handle_endtag(self, tag: str) -> None:
        if self.inside == "json":
            self._data(json.loads(self.script, parse_float=_Written, parse_int=_Written))
        self.inside, self.script = "", ""

    def handle_data(self, data: str) -> None:
        if self.inside == "json":
            self.script += data
        elif self.inside not in ("style", "program"):
            self.content.lines += [line for line in data.splitlines() if line.strip()]

    def _data(self, nested: Any) -> None:
        for key, value in flatten(nested):
            if isinstance(value, _Written):
                self.content.coordinates.append(str(value))
            elif isinstance(value, str) and len(value) > 200 and " " not in value:
                self.content.coordinates.append(digest(value.encode()))
            elif isinstance(value, str) and not PASSING_KEY.search(key):
                self.content.lines += value.splitlines()


def _html(path: Path) -> Content:
    page = _Page()
    page.feed(path.read_text("utf-8"))
    page.close()
    return page.content


def _text(path: Path) -> Content:
    lines = path.read_text("utf-8", errors="replace").splitlines()
    return Content(lines=lines, ordered=path.suffix in ORDERED)


def _bytes(path: Path) -> Content:
    return Content(values={"content": digest(path.read_bytes())})


READERS: dict[str, Callable[[Path], Content]] = {
    ".json": _json,
    ".toml": _toml,
    ".csv": _csv,
    ".npz": _arrays,
    ".parquet": _parquet,
    ".html": _html,
    ".gz": _bytes,
    ".xml": _xml,
    ".urdf": _xml,
    ".sdf": _xml,
}


def read(path: Path, roots: list[str]) -> Content:
    """The numbers of a file; roots are folders whose names are no content."""
    made = READERS.get(path.suffix, _text)(path)
    if "study" in path.parts:
        made.lines = [RUN_TIME.sub("", line.rstrip()) for line in made.lines]
    for root in roots:
        made.lines = [line.replace(root, "") for line in made.lines]
    return made
