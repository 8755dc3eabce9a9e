"""Methods of a league by name, and the page that puts conditions side by side."""

import math
import re
from pathlib import Path

import pytest

from pivident.estimation.methods import METHODS
from pivident.foundation.errors import ExperimentError
from pivident.studies.many.study.account import STANDINGS, render_league
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.run import Task, execute
from pivident.studies.many.study.scenario import league_methods, load_scenario, read_scenario
from pivident.studies.many.study.summary import summarise
from tests.studies.many.study.small import TEXT, small

VARIED = (
    TEXT
    + """
[vary.noise]
low = {noise = {torque = 0.01}}
high = {noise = {torque = 1.0}, identify = {methods = ["ls"], bandpass = {cutoff = 40}}}
"""
)


def test_all_methods_but_some():
    every = league_methods(["all"])
    assert set(every) == set(METHODS) - {"oloe"}
    assert league_methods(["all", "-particle"]) == [m for m in every if m != "particle"]
    assert league_methods(["piv", "ls", "piv"]) == ["piv", "ls"]
    assert league_methods(["oloe"]) == ["oloe"]  # who names it wants it


@pytest.mark.parametrize(
    ("names", "message"),
    [
        (["pif"], "there is no method 'pif'; did you mean 'piv'"),
        (["-pif", "all"], "there is no method 'pif'"),
        (["ls", "-ls"], "no method is left"),
    ],
)
def test_methods_that_are_not_there(names, message):
    with pytest.raises(ExperimentError, match=message):
        league_methods(names)


def test_methods_hold_in_all_conditions_and_nothing_else_changes():
    low, high = read_scenario(VARIED, "small").with_methods(["iv", "ekf"]).conditions
    assert list(low.methods) == list(high.methods) == ["iv", "ekf"]
    assert high.methods["iv"].signals.cutoff == 40 and low.methods["iv"].signals.cutoff is None
    assert high.content.noise.torque == 1.0
    birdy = load_scenario("birdy").with_methods(["all"]).conditions
    assert {c.methods["ls"].signals.decimation for c in birdy} == {1, 4}


@pytest.fixture(scope="module")
def summaries():
    import polars as pl

    from pivident.studies.many.study.run import Store

    made = {}
    for condition in read_scenario(VARIED, "small").with_methods(["ls", "iv"]).conditions:
        task = Task.of(condition, None)
        rows = [row for run in range(3) for row in execute(task, run)]
        frame = pl.DataFrame(rows, schema=Store(Path()).schema())
        made[condition.condition] = summarise(Bench(condition), frame)
    return made


def test_simulations_of_the_loop_are_counted(summaries):
    for summary in summaries.values():
        assert summary.methods["ls"].simulations == 0
        assert summary.methods["iv"].simulations >= summary.methods["iv"].iterations[0] >= 1


def test_the_page_has_a_table_for_each_figure_and_its_best_value(summaries):
    page = render_league(summaries)
    for standing in STANDINGS:
        assert f"<h3>{standing.heading}</h3>" in page
    table = page.partition("<h3>Error of a run</h3>")[2].partition("</table>")[0]
    bold = [float(x) for x in re.findall(r"<strong>([\d.]+)", table)]
    assert len(bold) == 2
    for value, summary in zip(bold, summaries.values(), strict=True):
        least = min(100 * m.median_relative_error for m in summary.methods.values())
        assert math.isclose(value, least, rel_tol=0.01)
    assert '<td class="number">3</td>' in table  # runs


def test_rows_of_an_older_program_have_no_simulations(summaries):
    import polars as pl

    from pivident.studies.many.study.run import Store

    scenario = small(identify={"methods": ["ls"]})
    rows = pl.DataFrame(execute(Task.of(scenario, None), 0), schema=Store(Path()).schema())
    old = summarise(Bench(scenario), rows.drop("simulations"))
    assert math.isnan(old.methods["ls"].simulations)
