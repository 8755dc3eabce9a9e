"""The page as a file: complete, small enough, self-contained, and safe against its input."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

from pivident.estimation.identification import JointFit
from pivident.foundation.document.plot import drawing_library
from pivident.foundation.errors import PividentError
from pivident.foundation.text.finding import Finding
from pivident.judgement.diagnostics.diagnostics import diagnose_one
from pivident.judgement.report.builder import render_report, write_report
from pivident.judgement.report.report_data import MIN_POINTS, TOTAL_POINTS, ReportData
from tests.synthetic_identification import (
    synthetic_identification,
    synthetic_loop,
    true_parameters,
)

MEGABYTE = 1e6

HOSTILE = (
    "<script>alert(1)</script>",
    '"><img src=x onerror=alert(1)>',
    "</style></script><b>",
    "{{ 7 * 7 }}",
    "a & b < c 'd'",
)


class Page(HTMLParser):
    """Elements, headings and visible text of a page."""

    def __init__(self, text: str) -> None:
        super().__init__()
        self.tags: list[tuple[str, dict[str, str | None]]] = []
        self.text: list[str] = []
        self.inside = ""
        self.feed(text)

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        self.inside = tag

    def handle_endtag(self, tag):
        self.inside = ""

    def handle_data(self, data):
        if self.inside not in ("script", "style"):
            self.text.append(data)

    def count(self, tag: str) -> int:
        return sum(name == tag for name, _ in self.tags)

    @property
    def anchors(self) -> list[str]:
        return [a["id"] for tag, a in self.tags if tag == "section"]


@pytest.fixture(scope="module")
def methods():
    return [
        synthetic_identification("IDIM-LS", bias=6.0, seed=3),
        synthetic_identification("IDIM-IV", seed=4),
        synthetic_identification("IDIM-PIV", seed=5),
    ]


@pytest.fixture(scope="module")
def page(methods):
    return Page(render_report(methods, true_parameters()))


def test_one_result_has_all_sections_but_the_comparison():
    page = Page(render_report([synthetic_identification()]))
    assert page.anchors == (
        "verdict summary parameters correlations replay torque joints residuals spectra tests "
        "convergence signals downloads provenance".split()
    )
    assert page.count("h1") == 1


def test_several_methods_are_compared(page, methods):
    assert page.anchors[:3] == ["verdict", "summary", "comparison"]
    text = " ".join(page.text)
    for identification in methods:
        assert identification.method in text
    assert "differ by more than 3 combined standard errors" in text


def test_least_squares_alone_has_no_convergence():
    assert "convergence" not in Page(render_report([synthetic_identification("IDIM-LS")])).anchors


def test_every_parameter_has_its_value_unit_and_truth(page):
    cells = [text.strip() for text in page.text]
    for name, value in true_parameters().items():
        assert name in cells
        assert f"{value:.6g}" in cells
    assert {"kg m²", "kg m", "N m s/rad", "N m"} <= set(cells)


def test_every_figure_has_words(page):
    plots = [a for tag, a in page.tags if tag == "div" and a.get("class") == "plot"]
    drawings = [a for tag, a in page.tags if tag == "svg" and not a.get("aria-hidden")]
    assert len(plots) == 3 * 2 * 4 + 3 + 2 * 2
    for attributes in plots + drawings:
        assert attributes["role"] == "img"
        assert len(attributes["aria-label"]) > 10


def test_the_page_needs_nothing_else(page, methods):
    for tag, attributes in page.tags:
        for key in ("src", "href"):
            assert attributes.get(key, "#").startswith("#"), (tag, attributes)
    policies = [a["content"] for _, a in page.tags if a.get("http-equiv")]
    assert policies[0].startswith("default-src 'none'")
    assert "@import" not in render_report(methods[:1]).split("</style>")[0]


def test_plotly_is_there_once(methods):
    text = render_report(methods)
    assert text.count('id="plotly"') == 1
    assert text.count(drawing_library().packed) == 1
    assert len(text.encode()) < 4 * MEGABYTE


@pytest.mark.parametrize(("count", "samples"), [(1, 20_000), (40, 3000)])
def test_long_records_stay_small(count, samples):
    """Drawn in full, either would take more than 20 MB."""
    identification = synthetic_identification(robot_name="staubli_tx40", samples=samples)
    recordings = tuple(replace(identification.recordings[0], name=f"run {k}") for k in range(count))
    long = replace(identification, recordings=recordings)
    text = render_report([long] * 3)
    assert len(text.encode()) < 8 * MEGABYTE
    assert ("Not drawn" in text) == (count > 1)


def test_points_are_shared_among_the_traces():
    identification = synthetic_identification()
    one = material(identification)
    assert one.points == 3000
    many = material(replace(identification, recordings=identification.recordings * 500))
    assert many.points >= MIN_POINTS
    assert many.points * many.shown_recordings * 2 * 7 <= TOTAL_POINTS
    runs = replace(synthetic_identification(), recordings=identification.recordings * 5)
    found = replace(runs, loop=synthetic_loop("law"))
    assert material(found).points < material(runs).points


def material(identification):
    return ReportData((identification,), {}, "", diagnose_one({"piv": identification}))


@pytest.mark.parametrize(
    ("found", "figures", "words"),
    [
        (
            "law",
            2,
            "5000.0 4.0|u per rad/s|lag 2.000 ± 0.020 ms|two-sample means|accepted|rejected|0.40 %"
            "|900|12|1 N m per u",
        ),
        ("moves", 2, "5000.0 ± 4.0 u per rad|45.0 Hz|3.0 %|moves from point to point 2 0.60 %"),
        ("spline", 2, "smoothing spline – 0.60 %|The law was not identified"),
    ],
)
def test_what_was_found_of_the_loop_is_shown(found, figures, words):
    loop = synthetic_loop(found)
    results = [
        synthetic_identification("IDIM-LS"),
        synthetic_identification("IDIM-IV", loop=loop),
        synthetic_identification("IDIM-PIV", loop=loop),
    ]
    text = render_report(results)
    start = text.index('<section id="control-loop"')
    part = text[start : text.index("</section>", start)]
    section = Page(part)
    assert section.count("figure") == figures
    assert section.count("details") == 0
    shown = " ".join(" ".join(section.text).split())
    for word in words.split("|"):
        assert word in shown, shown
    assert "Simulated by IDIM-IV IDIM-PIV" in shown
    plots = [a for tag, a in section.tags if a.get("class") == "plot"]
    assert all(len(a["aria-label"]) > 10 for a in plots)


def test_every_loop_has_its_own_part_of_the_section():
    results = [synthetic_identification(loop=synthetic_loop(found)) for found in ("law", "moves")]
    text = " ".join(Page(render_report(results)).text)
    assert "Law identified from run1" in text
    assert "Law identified from the noise in the loop" in text


def test_a_declared_loop_has_no_section():
    declared = replace(synthetic_loop("law"), identified=None)
    page = Page(render_report([synthetic_identification(loop=declared)]))
    assert "control-loop" not in page.anchors


@pytest.mark.parametrize("found", ["law", "moves"])
@pytest.mark.parametrize("name", HOSTILE)
def test_names_in_a_loop_do_not_break_html(name, found):
    names = (f"{name}1", f"{name}2")
    loop = synthetic_loop(found, names)
    if loop.identified:
        loop = replace(loop, identified=replace(loop.identified, recordings=(name, name)))
    identification = synthetic_identification(loop=synthetic_loop(found))
    recording = replace(identification.recordings[0], name=name)
    innocent = Page(render_report([identification]))
    page = Page(render_report([replace(identification, loop=loop, recordings=(recording,))]))
    for tag in ("script", "img", "b", "style"):
        assert page.count(tag) == innocent.count(tag)
    assert all("onerror" not in attributes for _, attributes in page.tags)
    assert name in "".join(page.text)


@pytest.mark.parametrize("name", HOSTILE)
def test_names_that_break_html_do_not(name):
    identification = synthetic_identification()
    joints = tuple(replace(j, name=f"{name}{k}") for k, j in enumerate(identification.joints))
    hostile = replace(
        identification,
        method=name,
        robot=replace(identification.robot, name=name, description=name),
        names=(name, *identification.names[1:]),
        expressions=(name, *identification.expressions[1:]),
        joints=joints,
        recordings=(replace(identification.recordings[0], name=name),),
        options={name: {name: name}},
        warnings=(Finding("warning", name, "kind", name, name, name, basis=name),),
        sources={name: name},
        version=name,
    )
    text = render_report([hostile], title=name)
    innocent = Page(render_report([identification]))
    page = Page(text)
    for tag in ("script", "img", "b", "style"):
        assert page.count(tag) == innocent.count(tag)
    assert all("onerror" not in attributes for _, attributes in page.tags)
    assert name in "".join(page.text)


def test_figures_hold_no_markup_of_a_name():
    identification = synthetic_identification()
    names = ("</script><i>", *identification.names[1:])
    text = render_report([replace(identification, names=names)])
    figures = re.findall(r'<script type="application/json">(.*?)</script>', text, re.DOTALL)
    assert any(r"\u0026lt;/script\u0026gt;" in figure.replace(r"\u002f", "/") for figure in figures)
    assert all("<" not in figure for figure in figures)


def test_degenerate_results_have_a_report():
    identification = synthetic_identification("IDIM-LS")
    bare = JointFit("shoulder", "N", 0.1, 1.0, np.nan, "N", 0, False, 0, 0.0, np.nan, np.nan)
    odd = replace(
        identification,
        judged=None,
        theta=np.zeros(13),
        covariance=np.zeros((13, 13)),
        robust_covariance=np.full((13, 13), np.nan),
        history=(),
        converged=False,
        joints=(bare, identification.joints[1]),
        recordings=(),
        relative_error=np.nan,
        condition=np.inf,
        options={},
        sources={},
    )
    page = Page(render_report([odd], {"zz1": 1.0}))
    expected = "verdict summary parameters joints tests downloads provenance"
    assert page.anchors == expected.split()
    assert "nan" not in " ".join(page.text).lower().split()


def test_a_recording_too_short_to_test_has_a_report():
    text = render_report([synthetic_identification(samples=40)])
    assert "Too few samples" in text


def test_report_is_written_and_replaced(tmp_path):
    path = tmp_path / "new" / "report.html"
    assert write_report(synthetic_identification(), path, title="First") == path
    write_report([synthetic_identification()], path, title="Second")
    assert "<h1>Second</h1>" in path.read_text("utf-8")
    assert [p.name for p in path.parent.iterdir()] == ["report.html"]


def test_there_must_be_something_to_report_on(tmp_path):
    with pytest.raises(PividentError, match="at least one"):
        write_report([], tmp_path / "report.html")
    with pytest.raises(PividentError, match="is a folder"):
        write_report([synthetic_identification()], tmp_path)


def test_same_input_same_page(methods):
    assert render_report(methods) == render_report(methods)


def test_plotly_and_jinja_are_imported_by_reports_only():
    import subprocess
    import sys

    code = (
        "import sys, pivident, pivident.estimation.identification_file, "
        "pivident.estimation.summary, "
        "pivident.judgement.report; print([m for m in ('plotly', 'jinja2') if m in sys.modules])"
    )
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout.strip() == "[]"
