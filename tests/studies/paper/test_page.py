"""The page of the quick form: the paper's pattern, links, tables and figures."""

import re
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import numpy as np
import pytest

from pivident.studies.many.batch.runner import GivenExecutor
from pivident.studies.many.study.scenario import load_scenario
from pivident.studies.paper import experiment
from pivident.studies.paper.claims import IV, LS, PIV, PRINTED, Claim, Judged, verdicts
from pivident.studies.paper.equations import EQUATIONS
from pivident.studies.paper.experiment import READINGS
from pivident.studies.paper.markdown import cell, html_of, markdown_of, object_named, table
from pivident.studies.paper.page import STUDY, make_page
from pivident.studies.paper.published import published_table
from pivident.studies.paper.repetition import ratio_of_deviations, read_repetition

pytest.importorskip("matplotlib")
pytest.importorskip("polars")


@pytest.fixture(scope="module")
def folder(tmp_path_factory) -> Path:
    """The experiment on motions of half their length, which shows the pattern as well."""
    place = tmp_path_factory.mktemp("paper")
    shorter = load_scenario("paper").changed(trajectory={"duration": 3.5})
    with pytest.MonkeyPatch.context() as patch, ThreadPoolExecutor(1) as executor:
        patch.setattr(experiment, "_loaded", lambda name: shorter)
        # each reading would start processes of its own
        made = make_page(place, quick=True, pool=GivenExecutor(executor, 1))
        assert made == place / "paper.html"
        yield place


@pytest.fixture(scope="module")
def page(folder) -> str:
    return (folder / "paper.html").read_text(encoding="utf-8")


@pytest.fixture(scope="module")
def repetition(folder):
    return read_repetition(folder / STUDY)


def test_the_pattern_of_the_paper_in_every_reading(repetition):
    assert set(repetition.readings) == set(READINGS) and repetition.runs == 2
    for forms in repetition.readings.values():
        assert forms[PIV].converged_share == 1.0 and np.median(forms[PIV].iterations) <= 5
        ratios, mean = ratio_of_deviations(forms[PIV], forms[IV])
        assert np.sum(ratios < 1.0) >= 20 and mean < 0.63
        assert forms[PIV].median_error < 0.5 * forms[LS].median_error
        assert np.median(forms[PIV].orders) > 100
    joint = repetition.readings["joint"]
    assert joint[LS].coverage < 0.954 and joint[LS].median_error > 0.01
    assert joint[IV].correlated.mean() > 0.05


def test_the_printed_form_needs_finer_encoders_than_the_joint_has(repetition):
    motor, joint = (repetition.readings[name] for name in ("motor", "joint"))
    assert motor[PRINTED].failed == 0
    assert motor[PIV].median_error < 0.25 * motor[PRINTED].median_error
    assert joint[PRINTED].failed > 0 and joint[PRINTED].message


def test_every_equation_leads_to_its_code_in_one_click(page):
    ids = set(re.findall(r'id="(code-[^"]+)"', page))
    links = re.findall(r'href="#(code-[^"]+)"', page)
    assert links and set(links) == ids
    assert [e.number for e in EQUATIONS] == list(range(1, 32))
    for equation in EQUATIONS:
        row = re.search(rf"<td>\({equation.number}\)</td>.*?</tr>", page, re.DOTALL)
        assert row and len(re.findall('href="#code-', row[0])) == len(equation.code)
        for name in equation.code:
            assert object_named(name).__doc__, name


def test_nothing_is_fetched_and_all_figures_are_inside(page, folder):
    assert not re.search(r'(?:src|href)="(?!#|data:)', page)
    images = re.findall(r'<img src="data:image/png;base64,([^"]+)" alt="([^"]+)"', page)
    names = [alt.partition(":")[0] for _, alt in images]
    assert names.pop(0).startswith("Residual of the true parameters")
    assert names == ["Figure 3", "Figure 4", "Figure A.7", "Figure 5", "Figure A.8", "Figure A.9"]
    assert all(data.startswith("iVBOR") for data, _ in images)


def test_table_1_is_printed_as_published(page):
    for row in published_table():
        cells = [f"{row.value[k]:g} ({row.relative_std[k]:g} %)" for k in row.value]
        assert "".join(f"<td>{text}</td>\n" for text in (row.name, *cells)) in page


def test_no_value_is_without_a_number(page):
    text = re.sub(r'<section class="source".*', "", page, flags=re.DOTALL)
    assert not re.search(r"\b(?:nan|None|inf)\b", text)


def test_a_second_page_uses_the_records_that_are_there(folder, monkeypatch):
    from pivident.studies.paper import page as module

    asked = []
    monkeypatch.setattr(module, "run_study", lambda s, place, **k: asked.append((s, place)))
    again = module.repeat(folder / STUDY, True, 2, None, print)
    assert again.runs == 2 and len(asked) == 9
    assert all(s.content.runs == 2 for s, _ in asked)


def test_a_verdict_names_its_condition():
    good, bad, unknown = Judged(True, ""), Judged(False, ""), Judged(None, "")
    claims = [
        Claim("5", "a", {"joint": good, "motor": good, "log": unknown}),
        Claim("5", "b", {"joint": bad, "motor": good}),
        Claim("5", "c", {"joint": bad}),
        Claim("5", "d", {"joint": unknown}),
    ]
    assert [c.verdict for c in claims] == [
        "holds", "holds with a condition: reading motor", "not reproduced", "not judged",
    ]  # fmt: skip
    assert verdicts(claims) == {
        "holds": 1, "holds with a condition": 1, "not reproduced": 1, "not judged": 1,
    }  # fmt: skip


def test_text_is_escaped(tmp_path):
    assert cell("a | b\nc") == "a \\| b c"
    made = html_of(table(["<b>"], [["<script>x</script>"]]), tmp_path)
    assert "<script>" not in made and "&lt;script&gt;" in made
    with pytest.raises(Exception, match="undefined"):
        markdown_of({})
