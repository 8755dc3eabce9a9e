"""The report's section on physical consistency: what it says, and that a browser draws it."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL
from pivident.judgement.diagnostics.consistent_estimate import (
    ConsistentEstimate,
    NoConsistentEstimate,
    consistent_estimates,
)
from pivident.judgement.diagnostics.diagnostics import diagnose_one
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.report import builder
from pivident.judgement.report.builder import render_report
from pivident.judgement.report.sections.consistency import (
    VIEWS,
    ConsistencySection,
    _figures,
    bodies_figure,
    moved_figure,
)
from pivident.models.consistency.link_quantities import LinkRow, Quantity, ends_text, millimetres
from pivident.models.consistency.options import ConsistencyOptions
from pivident.robot.gallery import load_robot
from tests.browser import needs_browser, seen_on_a_phone
from tests.load_scenario import tx40_with_load
from tests.synthetic_identification import synthetic_identification


@pytest.fixture(scope="module")
def results():
    return {
        "ls": synthetic_identification("IDIM-WLS", relative_std=0.05, seed=3),
        "piv": synthetic_identification("IDIM-PIV", relative_std=0.02, seed=5),
    }


@pytest.fixture(scope="module")
def diagnostics(results):
    alone = diagnose_one(results)
    made = consistent_estimates(alone.identifications, None, ["piv"], ConsistencyOptions(), ())
    failed = NoConsistentEstimate("PC-IDIM-WLS", "no consistent parameters <near>")
    return replace(alone, consistent={"ls": failed, **made})


def test_section_shows_links_intervals_and_failures(results, diagnostics):
    page = render_report(list(results.values()), diagnostics=diagnostics)
    section = page[page.index('<section id="consistency"') : page.index('<section id="torque"')]
    assert "PC-IDIM-PIV" in section and "PC-IDIM-WLS" in section
    assert "no consistent parameters &lt;near&gt;" in section
    found = diagnostics.consistent["piv"]
    for row in found.links:
        assert row.name in section and millimetres(row.center_of_mass[0].value) in section
    assert found.model.headline() in section
    assert "open" in section  # no torque tells the mass of the upper arm
    assert section.count('class="plot"') == 3


def test_no_section_where_the_stage_did_not_run(results):
    page = render_report(list(results.values()))
    assert "Physical consistency" not in page


@needs_browser
def test_section_on_a_phone(results, diagnostics, tmp_path, monkeypatch):
    monkeypatch.setattr(builder, "sections_of", lambda data: (ConsistencySection,))
    seen = seen_on_a_phone(render_report(list(results.values()), diagnostics=diagnostics), tmp_path)
    assert seen["drawn"] == seen["plots"] == 3


def test_bodies_are_drawn_where_they_are():
    """At q = 0 the first body of the planar arm lies around its centre of mass on the link."""
    robot = load_robot("planar_2r")
    inertial = [link.inertia for link in robot.links]
    figure = bodies_figure(robot, inertial, np.zeros(2), VIEWS[0])
    (own,) = [
        t for t in figure.plot.data if t["name"] == "upper_arm, 4 kg" and t["mode"] == "lines"
    ]
    base = robot.joints[0].rotation @ (robot.links[0].inertia[6:9] / 4.0)
    middle = [(np.max(x) + np.min(x)) / 2.0 for x in (own["x"], own["y"])]
    np.testing.assert_allclose(middle, base[[0, 2]], atol=2e-3)
    assert figure.plot.layout["yaxis"]["scaleanchor"] == "x"


def test_moved_parameters_stand_where_they_moved_to():
    moved = np.array([0.5, -1.5])
    figure = moved_figure(["a", "b"], moved, moved - 1, moved + 1, 0, left_out=3)
    points = figure.plot.data[-1]
    np.testing.assert_allclose(points["x"], moved)
    assert "b moved most, by 1.5 σ" in figure.label and "3 base parameters" in figure.note


def test_ends_in_words():
    assert ends_text(-np.inf, np.inf) == "open"
    assert ends_text(0.00411, np.inf) == "0.00411 to open"
    assert ends_text(np.nan, np.nan) == "not found"
    assert ends_text(np.nan, 2.0) == "not found to 2.00"
    assert ends_text(1.0, 2.0) == "1.00 to 2.00"
    assert millimetres(-1e-9) == "0.0"


def test_table_and_figure_show_the_same_step():
    """With parameters left out as well: (θ - θ_free)/σ, in the table and in the figure."""
    free = essential_estimate()
    model = ConsistencyOptions(accept_far=True).make_consistent(free)
    some = Quantity(0.0, 0.0, 0.0)
    links = tuple(
        LinkRow(link.name, some, (some,) * 3, (some,) * 3, np.eye(3), model.values[place])
        for link, place in zip(model.robot.links, model._space.links, strict=True)
    )
    own = model.intervals()
    found = ConsistentEstimate("PC", model, own, own, links, ConsistencyOptions())
    assert len(found.model.base_values) > len(free.names)
    step = dict(zip(free.names, (found.model.theta - free.theta) / free.std, strict=True))
    assert max(map(abs, step.values())) > 0.1
    table = found.moved_table()
    spread = dict(zip(table["parameter"], table.columns["free"].spread, strict=True))
    for row in table.rows():
        assert row["moved_sigmas"] == pytest.approx(step[row["parameter"]])
        moved = row["moved_sigmas"] * spread[row["parameter"]] / 1.96
        assert moved == pytest.approx(row["consistent"] - row["free"])
    (figure,) = [f for f in _figures(found, 0) if f.title == "Free and consistent intervals"]
    points = figure.plot.data[-1]
    np.testing.assert_allclose(points["x"], [step[name] for name in points["y"]], atol=1e-5)


@cache
def essential_estimate():
    problem = tx40_with_load(seed=1, samples=6000).problem
    return identify(replace(problem, parameters=tuple(TX40_ESSENTIAL)), "iv-full-rate")


def verdict_of(diagnostics, found, **changes):
    """The verdict's sentence on physics after some change of the model."""
    changed = replace(found, model=replace(found.model, **changes), prediction=None)
    (statement,) = [
        s
        for s in verdict(replace(diagnostics, consistent={"piv": changed})).statements
        if s.topic == "physics" and "machine" in s.message
    ]
    return statement


def test_verdict_on_near_and_far_cheap_dear_and_unknown(diagnostics):
    found = diagnostics.consistent["piv"]
    told = {}
    for near, p in ((True, 0.5), (False, 1e-6)):
        for cost, error in (("cheap", 0.1005), ("dear", 0.12), ("unknown", np.nan)):
            told[near, cost] = verdict_of(
                diagnostics,
                found,
                was_consistent=False,
                p_value=p,
                least_distance=2.5,
                distance=2.75,
                torque_error_free=0.1,
                torque_error=error,
            )
    assert {key: s.severity for key, s in told.items()} == {
        (True, "cheap"): "ok",
        (True, "dear"): "warning",
        (True, "unknown"): "note",
        (False, "cheap"): "note",
        (False, "dear"): "warning",
        (False, "unknown"): "warning",
    }
    for (_, cost), s in told.items():
        assert ("cost in torque is unknown" in s.message) == (cost == "unknown")
        assert ("predict as well" in s.message) <= (cost == "cheap")
        assert "least distance 2.5 σ" in s.basis and "2.8 σ" in s.basis
