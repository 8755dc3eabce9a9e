"""The page "Which method for which record": its tables are those of the shipped results."""

import re
from pathlib import Path

import pytest
from benchmarks.league_tables import filled, rows, tables

from pivident.studies.many.study.scenario import league_methods, load_scenario

#: Methods of a league of their own, which take as long as all others together.
SLOW = ("ukf", "cdkf", "set-membership")

PAGE = (Path(__file__).resolve().parents[2] / "docs" / "which_method.md").read_text("utf-8")


def test_tables_are_those_of_the_results():
    made = tables()
    shown = re.findall(r"% table ([^\n]+)", PAGE)
    assert sorted(shown) == sorted(made)
    assert filled(PAGE, made) == PAGE


def test_all_conditions_and_methods_were_run():
    found = rows("league")
    own = {(r["condition"], r["method"]) for r in found if r["scenario"] == "birdy"}
    conditions = {c.condition for c in load_scenario("birdy").conditions}
    assert {condition for condition, _ in own} == conditions
    every = set(league_methods(["all", "-particle"]))
    for condition in conditions:
        if condition.endswith("-d1"):
            assert every <= {method for c, method in own if c == condition}


def test_the_page_says_how_many_runs_there_are():
    own = [r for r in rows("league") if r["scenario"] == "birdy"]
    ((many, fewer),) = re.findall(
        r"has (\d+) runs of each condition and method, (\d+) or more of `ukf`, `cdkf` and", PAGE
    )
    assert int(many) == min(int(r["runs"]) for r in own if r["method"] not in SLOW) >= 130
    assert int(fewer) == min(int(r["runs"]) for r in own if r["method"] in SLOW)


@pytest.mark.parametrize("record", ["EMPS", "TX40", "KR300"])
def test_real_records_are_there(record):
    assert any(r["record"] == record for r in rows("records"))
