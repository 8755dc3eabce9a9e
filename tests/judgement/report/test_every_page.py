"""Every page that pivident writes, as a reader has it: one frame, nothing cut off, all legible."""

from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import pytest

import pivident as pv
from pivident.studies.comparison.account import render_page as comparison_page
from pivident.studies.flexibility.account import render_page as flexibility_page
from pivident.studies.flexibility.joint_study import study_flexibility
from pivident.studies.friction.curves import render_page as friction_page
from pivident.studies.friction.friction_study import FrictionStudy, joint_friction
from pivident.studies.many.fleet.conclusion import conclude_fleet
from pivident.studies.many.fleet.identify_fleet import identify_fleet
from pivident.studies.many.study.conclusion import conclude_study
from pivident.studies.many.study.run import run_study
from tests.browser import asked, needs_browser, seen_on_a_phone
from tests.studies.comparison.results import result
from tests.studies.flexibility.flexible_joint import record
from tests.studies.friction.made_up import friction_torque
from tests.studies.many.fleet.planar_fleet import write_fleet
from tests.studies.many.study.small import small

pytestmark = needs_browser

QUESTIONS = Path(__file__).parent / "questions"


def comparison(folder):
    return comparison_page(pv.compare([result(1), result(3, fv1=1.25)], labels=["new", "worn"]))


def friction(folder):
    joint = joint_friction(friction_torque(5, 6000, load_factor=0.25))
    return friction_page(FrictionStudy("arm", "IDIM-IV", ("run",), (joint,), {}))


def flexibility(folder):
    return flexibility_page(study_flexibility(pv.load_robot("emps"), [record(1)]))


def fleet(folder):
    write_fleet(folder / "logs", robots=2, days=5, worn={"arm_2": 1.2})
    with ThreadPoolExecutor(1) as executor:
        found = identify_fleet(folder / "logs", out=folder / "out", executor=executor, workers=1)
    conclude_fleet(found)
    return (folder / "out" / "fleet.html").read_text("utf-8")


def study(folder):
    scenario = small()
    with ThreadPoolExecutor(1) as executor:
        run_study(scenario, folder / "study", runs=3, executor=executor, workers=1)
    conclude_study(scenario, folder / "study")
    return (folder / "study" / "report.html").read_text("utf-8")


PAGES = (comparison, friction, flexibility, fleet, study)


@pytest.fixture(scope="module", params=PAGES, ids=lambda page: page.__name__)
def text(request, tmp_path_factory):
    return request.param(tmp_path_factory.mktemp("made"))


def question(name):
    script = (QUESTIONS / f"{name}.js").read_text("utf-8")
    return "await (async () => {\n" + script + "\n})()"


def test_the_frame_is_that_of_the_report(text, tmp_path):
    found, contrast = asked(
        text, tmp_path, f"return [{question('structure')}, {question('contrast')}];"
    )
    assert found["drawn"] == found["plots"] >= 1
    assert (found["titles"], found["jumps"]) == (1, 0)
    assert found["landmarks"] == [1, 1, 1, 1]
    for flaw in ("dead", "silent", "nameless", "unscoped", "doubled"):
        assert found[flaw] == [], flaw
    assert contrast["texts"] > 60
    assert contrast["low"] == []


def test_a_phone_shows_all_of_it(text, tmp_path):
    found = seen_on_a_phone(text, tmp_path)
    assert found["drawn"] == found["plots"] >= 1


def test_a_summary_stands_above_the_contents(text):
    assert text.index('class="head"') < text.index('class="contents"')
