"""Put the sections together: one HTML file that needs nothing else, no network included.

Documents as one page that needs nothing else, in the look of the report.

Compiled templates are kept beside their sources as Python keeps its modules. A page consists of
some forty templates, and to translate them takes as long as to fill them in. As with modules, a
file is found by a digest of its source and the versions of both languages, is written whole or not
at all, and whatever cannot be read is translated again.
"""

from __future__ import annotations

import marshal
import re
from collections.abc import Mapping, Sequence
from contextlib import suppress
from functools import cache
from os import PathLike
from pathlib import Path
from typing import Any

from jinja2 import BytecodeCache, ChoiceLoader, Environment, PackageLoader, StrictUndefined
from jinja2.bccache import Bucket, bc_magic
from jinja2.utils import htmlsafe_json_dumps
from markupsafe import Markup, escape

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import method_labels
from pivident.foundation.document.document import Accounted, Document
from pivident.foundation.document.plot import (
    DARK_COLOURS,
    ERROR,
    MEASURED,
    METHOD_COLOURS,
    Figure,
    drawing_library,
    drawn,
    to_json,
)
from pivident.foundation.errors import Attempts, PividentError, in_words, require_kind
from pivident.foundation.files import keep, write_file
from pivident.foundation.text.identifiers import identifier
from pivident.foundation.text.numbers import format_exact, format_significant, percent, with_spread
from pivident.foundation.text.plain_values import write_json
from pivident.foundation.text.sentences import capital
from pivident.foundation.version import __version__
from pivident.judgement.diagnostics.diagnostics import Diagnostics, diagnose_one
from pivident.judgement.diagnostics.summary import Summary
from pivident.judgement.report.intervals import marker
from pivident.judgement.report.report_data import ReportData
from pivident.judgement.report.sections import Section, sections_of

_FOLDER = Path(__file__).parent / "templates" / "__pycache__"


class TemplateCache(BytecodeCache):
    """Code of templates in a folder that may be missing, read-only or deleted at any time."""

    def __init__(self, folder: Path = _FOLDER) -> None:
        self.folder = folder

    def load_bytecode(self, bucket: Bucket) -> None:
        """Take the code that was kept, if there is any of this source."""
        with suppress(OSError, EOFError, ValueError, TypeError):
            code = marshal.loads(self._file(bucket).read_bytes())
            bucket.code = code if hasattr(code, "co_code") else None

    def dump_bytecode(self, bucket: Bucket) -> None:
        """Keep the code, where Python itself may keep any."""
        keep(self._file(bucket), marshal.dumps(bucket.code))

    def _file(self, bucket: Bucket) -> Path:
        return self.folder / f"{bucket.key}.{bucket.checksum}.{bc_magic.hex()}"


#: Scripts of the page, in the order in which they build on each other.
PAGE_SCRIPTS = (
    "theme.js",
    "contents.js",
    "inflate.js",
    "figures.js",
    "zoom.js",
    "instant.js",
    "time.js",
    "tables.js",
    "downloads.js",
    "arm.js",
    "replay.js",
)


def write_report(
    identifications: Identification | Sequence[Identification],
    path: str | PathLike[str],
    truth: Mapping[str, float] | None = None,
    title: str | None = None,
    diagnostics: Diagnostics | None = None,
    *,
    screen: Summary | None = None,
    designs: Sequence[Document] = (),
    attempts: Attempts | None = None,
) -> Path:
    """Write a report about one result, or several side by side, as one HTML file.

    Args:
        identifications: a result, or several of one robot; the last one is unfolded where
            several would take much room.
        path: file to write; its folder is created.
        truth: known values by parameter name, with or without the trailing ``r``.
        title: title of the page; None: robot and methods.
        diagnostics: what was found out about the results; None: the tests that need nothing else.
        screen: the verdict on one screen with the commands of its folder; None: without commands.
        designs: what designs predicted of the motions that were recorded.
        attempts: what each section is attempted by; one that fails says so on the page.

    Returns:
        The file.

    Raises:
        PividentError: there is nothing to report on, or the file cannot be written.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> made = pv.simulate(robot, loop, duration=5.0, encoder=1e-5)
        >>> problem = pv.Problem(robot, (made.recording,), loop)
        >>> results = [pv.identify(problem, method) for method in ("ls", "piv")]
        >>> pv.write_report(results, "reports/arm.html", truth=made.truth).name
        'arm.html'
    """
    path = Path(path)
    if path.is_dir():
        raise PividentError(f"{path} is a folder", advice="name a file in it, such as report.html")
    if isinstance(identifications, Identification):
        identifications = [identifications]
    page = render_report(
        identifications,
        truth,
        title,
        diagnostics,
        screen=screen,
        designs=designs,
        attempts=attempts,
    )
    write_file(path, page, errors="xmlcharrefreplace")
    return path


def render_report(
    identifications: Sequence[Identification],
    truth: Mapping[str, float] | None = None,
    title: str | None = None,
    diagnostics: Diagnostics | None = None,
    *,
    screen: Summary | None = None,
    designs: Sequence[Document] = (),
    attempts: Attempts | None = None,
) -> str:
    """The page as text; arguments as of `write_report`."""
    if not identifications:
        raise PividentError("there is no identification to report on", advice="give at least one")
    for each in identifications:
        require_kind("an identification", each, Identification, "give a list of results")
    if title is None:
        robots = dict.fromkeys(i.robot.name for i in identifications)
        title = f"{', '.join(robots)}: identification of the dynamics"
    if diagnostics is None:
        names = method_labels(identifications)
        diagnostics = diagnose_one(dict(zip(names, identifications, strict=True)))
    data = ReportData(
        tuple(identifications),
        dict(truth or {}),
        title,
        diagnostics,
        screen,
        tuple(designs),
    )
    environment, attempts, sections = page_environment(), attempts or Attempts(), []
    for kind in sections_of(data):
        tried, failed = len(attempts.errors), f'The section "{kind.title}" could not be written'
        body = attempts.of(failed, _body, environment, kind, data, otherwise="")
        if len(attempts.errors) > tried:
            why = in_words(attempts.errors[-1])
            body = Markup('<p class="remark">{}: {}</p>').format(failed, why)
        if body:
            sections.append((kind.anchor, kind.title, Markup(body)))
    return page_of(environment, title, sections)


def _body(environment: Environment, kind: type[Section], data: ReportData) -> str:
    """The text of a section, empty where it does not apply."""
    section = kind(data)
    if not section.applies:
        return ""
    return environment.get_template(section.template).render(section.context())


def page_of(
    environment: Environment,
    title: str,
    sections: Sequence[tuple[str, str, Markup]],
    *,
    headed: bool = True,
) -> str:
    """The page of sections (anchor, heading, body); the first may stand before the contents."""
    head = {"head": sections[0]} if headed else {}
    return environment.get_template("page.html").render(
        title=title, sections=sections[len(head) :], **head, version=__version__
    )


def write_page(build: Path, name: str, page: str, content: Any) -> None:
    """Write ``NAME.html`` and, as ``NAME.json``, the values that it shows."""
    write_json(build / f"{name}.json", content)
    (build / f"{name}.html").write_text(page, encoding="utf-8", errors="xmlcharrefreplace")


@cache
def page_environment(*packages: str) -> Environment:
    """Templates of these packages, then of the report; all is escaped but marked HTML.

    Made once: they take as long to compile as a page to write.
    """
    environment = Environment(
        loader=ChoiceLoader(
            [PackageLoader(name) for name in (*packages, "pivident.judgement.report")]
        ),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        bytecode_cache=TemplateCache(),
    )
    environment.filters |= {
        "percent": percent,
        "significant": format_significant,
        "known": format_exact,
        "script_json": _script_json,
        "powers": _powers,
        "sentence": _sentence,
        "capitalised": capital,
    }
    environment.globals |= {
        "with_spread": with_spread,
        "method_class": lambda method: f"m{method % len(METHOD_COLOURS)}",
        "page_scripts": PAGE_SCRIPTS,
        "drawing_library": drawing_library,
        "method_colours": METHOD_COLOURS,
        "dark_colours": DARK_COLOURS,
        "measured_colour": MEASURED,
        "error_colour": ERROR,
        "method_marker": marker,
    }
    return environment


def _script_json(figure: Figure) -> Markup:
    """A figure as JSON that is safe inside a script element."""
    return htmlsafe_json_dumps(figure.plot.content(), to_json)


def _sentence(text: str) -> Markup:
    """A sentence with its powers of ten written as such, and commands in backticks as code."""
    parts = re.split(r"`([^`]+)`", str(text))
    return Markup("").join(
        Markup("<code>{}</code>").format(part) if k % 2 else _with_powers(part)
        for k, part in enumerate(parts)
    )


def _with_powers(text: str) -> Markup:
    """Text whose numbers in powers of ten are written as such."""
    parts = re.split(r"(?<![\w.])(-?\d+(?:\.\d+)?e[+-]\d+)(?!\w)", text)
    return Markup("").join(_powers(part) if k % 2 else part for k, part in enumerate(parts))


def _powers(number: str) -> Markup:
    """``1.2e-05`` as 1.2 × 10⁻⁵."""
    mantissa, _, power = str(number).partition("e")
    if not power or not re.fullmatch(r"[+-]\d+", power):
        return escape(number)
    return Markup("{}&thinsp;×&thinsp;10<sup>{}</sup>").format(mantissa, int(power))


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
    write_file(path, page, errors="xmlcharrefreplace")
    return path
