"""The page of a comparison in a browser: tools of its figures, contrast, structure."""

import json

import pytest

from pivident.judgement.report.builder import render_report
from tests.browser import PHONE, asked, needs_browser
from tests.judgement.report.test_page_in_a_browser import all_of, assert_accessible, question
from tests.planar_results import planar_results

pytestmark = needs_browser


#: Sections with a figure whose tools are pressed.
SECTIONS = ("torque", "spectra", "correlations", "closed-loop", "filters", "prefilters")


def zoomed(*sections):
    return question("zoom").replace("SECTIONS", json.dumps(sections))


@pytest.fixture(scope="module")
def answers(tmp_path_factory):
    """Of both kinds of methods: those that filter no rows, and those that do and have a loop."""
    text = render_report(planar_results("ls", "piv"))
    script = all_of(zoomed(*SECTIONS), question("structure"), question("contrast"))
    found = asked(text, tmp_path_factory.mktemp("tools"), script)
    return dict(zip(("zoom", "structure", "contrast"), found, strict=True))


def test_new_sections_stand_out_in_both_themes(answers):
    assert answers["contrast"]["texts"] > 1500
    assert answers["contrast"]["low"] == []


def test_new_sections_are_told_to_those_who_do_not_see_them(answers):
    assert_accessible(answers["structure"])


def test_buttons_move_the_window_of_a_figure(answers):
    assert_zooms(answers["zoom"]["found"], SECTIONS)


def test_a_phone_draws_all_and_a_finger_has_the_same_buttons(tmp_path):
    """Of the method with all kinds of figures; buttons of one over time and of a square one."""
    text = render_report(planar_results("piv"))
    sections = ("torque", "correlations")
    pressed, found = asked(text, tmp_path, all_of(zoomed(*sections), question("structure")), PHONE)
    assert_zooms(pressed["found"], sections)
    assert found["drawn"] == found["plots"] > 10


def test_a_figure_is_saved_as_an_image(answers):
    name, scheme = answers["zoom"]["saved"]
    assert name == "torque_shoulder.png"
    assert scheme in ("data:", "blob:")


def assert_zooms(found, sections):
    assert tuple(found) == sections
    for name, own in found.items():
        assert own["hidden"] and own["shown"] and own["closed"], name
        begin, closer, right, left, wider, everything = (spans[0] for spans in own["spans"])
        width = begin[1] - begin[0]
        quarter = [begin[0] + 0.25 * width, begin[1] - 0.25 * width]
        assert closer == pytest.approx(quarter, abs=1e-6 * width), name
        step = 0.125 * width
        assert right == pytest.approx([end + step for end in quarter], abs=1e-6 * width), name
        assert left == pytest.approx(quarter, abs=1e-6 * width), name
        assert wider == pytest.approx(begin, abs=1e-6 * width), name
        assert everything == pytest.approx(begin, abs=1e-6 * width), name
        rows = [spans[1] for spans in own["spans"]]
        assert rows[0] == pytest.approx(rows[-1]), name
        moved = rows[1] != pytest.approx(rows[0])
        assert moved == (name == "correlations"), name  # both of its axes are parameters
