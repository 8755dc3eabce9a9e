"""What a notebook shows: valid, small, escaped, accessible, and without anything active."""

import re
from dataclasses import replace
from html.parser import HTMLParser

import numpy as np
import pytest

import pivident as pv
from pivident.data.recording.recording import Recording
from pivident.foundation.text.finding import Finding
from tests.synthetic_identification import synthetic_identification

HOSTILE = "<script>alert(1)</script><img src=x onerror=alert(1)> & {{ 7 * 7 }}"

VOID = {"br", "hr", "img", "input", "meta", "line", "circle", "polyline"}


class Fragment(HTMLParser):
    """Checks that every element is closed, and collects elements and text."""

    def __init__(self, text):
        super().__init__()
        self.open, self.tags, self.text = [], [], ""
        self.feed(text)
        assert self.open == []

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag not in VOID:
            self.open.append(tag)

    def handle_startendtag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))

    def handle_endtag(self, tag):
        assert self.open.pop() == tag

    def handle_data(self, data):
        self.text += data

    def of(self, tag):
        return [attributes for name, attributes in self.tags if name == tag]


def recording(name="run"):
    t = np.arange(1000) / 500.0
    q = np.column_stack([np.sin(3 * t), np.cos(2 * t)])
    return Recording(name, ("shoulder", "elbow"), q, 5.0 * q, 500.0)


@pytest.fixture(scope="module")
def things():
    result = synthetic_identification(
        warnings=(Finding("warning", HOSTILE, "kind", HOSTILE),), method=HOSTILE
    )
    robot = replace(result.robot, description=HOSTILE, name=HOSTILE)
    result = replace(result, robot=robot)
    records = (recording(HOSTILE),)
    return {
        "identification": result,
        "robot": robot,
        "recording": records[0],
        "problem": pv.Problem(robot, records),
        "verdict": pv.verdict(result),
        "comparison": pv.compare([result, synthetic_identification()], [HOSTILE, "b"]),
        "table": pv.table(result),
    }


KINDS = ("identification", "robot", "recording", "problem", "verdict", "comparison", "table")


@pytest.mark.parametrize("kind", KINDS)
def test_it_is_small_closed_and_inert(things, kind):
    text = things[kind]._repr_html_()
    page = Fragment(text)
    assert len(text) < 60_000
    assert not page.of("script") and not page.of("img") and not page.of("link")
    assert not re.search(r'(src|href|url\()\s*=?\s*["\']?(https?:|//)', text)
    assert "49" not in re.findall(r"\{\{[^}]*\}\}|\b49\b(?= <)", text)
    assert not any(key.startswith("on") for _, attributes in page.tags for key in attributes)


@pytest.mark.parametrize("kind", KINDS)
def test_tables_have_captions_and_headers_with_a_scope(things, kind):
    page = Fragment(things[kind]._repr_html_())
    assert len(page.of("caption")) == len(page.of("table")) > 0
    assert all(cell.get("scope") in ("col", "row") for cell in page.of("th"))
    assert all(svg.get("aria-label") for svg in page.of("svg"))
    assert all(region.get("aria-label") for region in page.of("div") if "role" in region)


@pytest.mark.parametrize("kind", KINDS)
def test_text_takes_the_colour_of_the_notebook(things, kind):
    style = things[kind]._repr_html_().partition("</style>")[0]
    colours = re.findall(r"(?<![-\w])color: ([^;]+);", style)
    assert set(colours) == {"inherit"}
    assert all(rule.strip().startswith(".pivident") for rule in style.splitlines()[2:] if rule)


def test_numbers_have_intervals_and_units(things):
    result = synthetic_identification()
    text = Fragment(result._repr_html_()).text
    for name, unit in zip(result.names, result.units, strict=True):
        assert name in text and unit in text
    assert "± 2σ" in text and "relative error" in text


@pytest.mark.parametrize("kind", KINDS)
def test_repr_is_one_short_line(things, kind):
    line = repr(things[kind])
    assert line.startswith("<") and line.endswith(">") and "\n" not in line and len(line) < 500
    assert "array(" not in line


def test_a_long_table_shows_its_beginning():
    made = pv.table(recording())
    assert len(made) == 2000
    page = Fragment(made._repr_html_())
    assert len(page.of("tr")) == 61 and "the first 60 shown" in page.text
    assert "… and 1980 more rows" in str(made)
