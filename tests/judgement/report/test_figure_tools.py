"""The page of a whole comparison in a browser: tools of its figures, contrast, structure."""

import pytest

from pivident.judgement.report.builder import render_report
from tests.browser import PHONE, asked, needs_browser
from tests.judgement.report.test_page_in_a_browser import all_of, assert_accessible, question
from tests.planar_results import planar_results

pytestmark = needs_browser


@pytest.fixture(scope="module")
def text():
    return render_report(planar_results("ls", "iv", "piv"))


@pytest.fixture(scope="module")
def answers(text, tmp_path_factory):
    names = ("zoom", "structure", "contrast")
    found = asked(text, tmp_path_factory.mktemp("tools"), all_of(*map(question, names)))
    return dict(zip(names, found, strict=True))


def test_new_sections_stand_out_in_both_themes(answers):
    assert answers["contrast"]["texts"] > 1500
    assert answers["contrast"]["low"] == []


def test_new_sections_are_told_to_those_who_do_not_see_them(answers):
    assert_accessible(answers["structure"])


def test_buttons_move_the_window_of_a_figure(answers):
    assert_zooms(answers["zoom"]["found"])


def test_a_phone_draws_all_and_a_finger_has_the_same_buttons(text, tmp_path):
    zoomed, found = asked(text, tmp_path, all_of(question("zoom"), question("structure")), PHONE)
    assert_zooms(zoomed["found"])
    assert found["drawn"] == found["plots"] > 20


def test_a_figure_is_saved_as_an_image(answers):
    name, scheme = answers["zoom"]["saved"]
    assert name == "torque_shoulder.png"
    assert scheme in ("data:", "blob:")


def assert_zooms(found):
    assert len(found) == 6
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
