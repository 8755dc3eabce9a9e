"""The page as a reader has it: drawn, linked in time, legible, usable from the keyboard."""

import json
from pathlib import Path

import numpy as np
import pytest

from pivident.judgement.audit.audit import audit_log
from pivident.judgement.report import builder
from pivident.judgement.report.audit_account import render_page
from pivident.judgement.report.builder import render_report
from tests.browser import PHONE, asked, needs_browser, words_printed
from tests.judgement.audit.logs import planar
from tests.synthetic_identification import (
    synthetic_identification,
    synthetic_loop,
    true_parameters,
)

pytestmark = needs_browser


@pytest.fixture(scope="module")
def text():
    results = [
        synthetic_identification("IDIM-LS", seed=3),
        synthetic_identification("IDIM-PIV", seed=5, loop=synthetic_loop("law")),
    ]
    return render_report(results, true_parameters())


def question(name):
    """Body of a function that runs in the page."""
    return (Path(__file__).parent / "questions" / f"{name}.js").read_text(encoding="utf-8")


def all_of(*scripts):
    """One question out of several: each has a scope of its own, and one browser answers all."""
    calls = ",".join("await (async () => {\n" + script + "\n})()" for script in scripts)
    return f"return [{calls}];"


@pytest.fixture(scope="module")
def answers(text, tmp_path_factory):
    names = ("replay", "tables", "time", "structure", "contrast")
    scripts = [question(name) for name in names]
    found = asked(text, tmp_path_factory.mktemp("page"), all_of(*scripts))
    return dict(zip(names, found, strict=True))


def test_texts_stand_out_in_both_themes(answers):
    assert answers["contrast"]["texts"] > 1000
    assert answers["contrast"]["low"] == []


def test_structure_is_told_to_those_who_do_not_see_it(answers):
    assert_accessible(answers["structure"])


def test_files_come_out_as_they_should(answers):
    files = {name: (size, head) for name, size, head in answers["structure"]["files"]}
    assert len(files) == 6
    for name, (size, head) in files.items():
        stem, ending = name.split(".")
        assert stem.replace("_", "").isalnum()
        assert size > 300
        start = {"csv": ("name,value,std", "time [s],"), "json": ("{",), "tex": ("% Base",)}[ending]
        assert head.startswith(start)


def test_a_window_of_time_goes_to_all_figures_and_back(answers):
    found = answers["time"]
    assert found["plots"] == 8
    assert found["before"] and found["after"] and found["open"]
    assert found["wanted"] == pytest.approx([0.2, 0.7])
    assert all(shown == pytest.approx(found["wanted"]) for shown in found["shown"])
    assert float(found["from"]) == pytest.approx(0.2)
    assert found["narrower"] == pytest.approx([0.4, 0.7])
    assert all(found["back"])


def test_an_instant_goes_from_the_arm_to_the_figures_and_back(answers):
    assert answers["time"]["instant"] == pytest.approx(1.2, abs=0.01)
    assert answers["time"]["clicked"] == pytest.approx(0.5)


def test_the_arm_turns_and_plays_from_the_keyboard(answers):
    found = answers["replay"]
    counts, sums = np.array(found["pictures"]).T
    assert (counts > 2000).all()
    assert len(set(sums)) == 4
    assert (found["playing"], found["paused"]) == ("Pause", "Play")
    assert 0.01 < found["moved"] < 1.9
    before, after = found["posture"]
    assert len(before) == 2 and before != after and before[0].endswith(" rad")
    assert found["said"].startswith(f"t = {found['moved']:.2f} s of 2.00 s")


def test_tables_sort_and_filter(answers):
    found = answers["tables"]
    assert found["focused"]
    assert found["sort"] == "ascending"
    assert found["up"] == sorted(found["up"])
    assert found["down"] == sorted(found["down"], reverse=True)
    assert found["again"] == found["original"]
    assert found["filtered"] == ["fv1", "fv2"]
    assert found["count"].split() == ["2", "of", str(len(found["original"]))]


def test_printed_tables_repeat_all_heads_on_every_page(tmp_path):
    """A table that can be sorted prints as many words as one that cannot, page by page."""
    script = '<script src="tables.js"></script>'
    (tmp_path / "tables.js").write_text(template("tables.js"), encoding="utf-8")
    row = "<tr><td>fv</td><td>1.5</td></tr>"
    counts = []
    for kind in ("sortable", ""):
        text = (
            f"<html><head><style>{template('style.css')}</style></head><body><main>"
            f'<div class="scroll"><table class="{kind}"><thead><tr><th>Parameter</th><th>Value</th>'
            f"</tr></thead><tbody>{row * 150}</tbody></table></div></main>{script}</body></html>"
        )
        counts.append(words_printed(text, tmp_path))
    assert len(counts[1]) > 2 and counts[0] == counts[1]


def template(name):
    return (Path(builder.__file__).parent / "templates" / name).read_text(encoding="utf-8")


def test_a_phone_shows_the_same(tmp_path):
    """All figures are drawn, nothing scrolls sideways; also of instruments of given motion."""
    results = [
        synthetic_identification("IDIM-IV", seed=4, loop=synthetic_loop("law")),
        synthetic_identification("IDIM-PIV", seed=5, loop=synthetic_loop("moves")),
    ]
    page = render_report(results, true_parameters())
    found = asked(page, tmp_path, question("structure"), PHONE)
    assert_accessible(found)
    assert found["drawn"] == found["plots"] > 10


def test_the_audit_has_the_same_frame(tmp_path):
    page = render_page([audit_log(planar())])
    structure, contrast = asked(page, tmp_path, all_of(question("structure"), question("contrast")))
    assert_accessible(structure)
    assert contrast["low"] == []


def assert_accessible(found):
    assert found["drawn"] == found["plots"] >= 8
    assert (found["titles"], found["jumps"]) == (1, 0)
    assert found["landmarks"] == [1, 1, 1, 1]
    assert found["first"] == "skip"
    for flaw in ("dead", "silent", "nameless", "unscoped", "doubled"):
        assert found[flaw] == [], flaw
    assert found["cloud"] == 0
    assert json.dumps(found["files"]).count("undefined") == 0
