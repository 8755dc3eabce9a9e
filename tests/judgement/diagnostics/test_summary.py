"""One screen, at most 24 lines of 110 columns, whatever the robot; what uses are answered by."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.text.finding import Finding
from pivident.judgement.diagnostics import uses
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.summary import MAX_ITEMS, WIDTH, Item
from pivident.judgement.diagnostics.verdict import verdict
from pivident.robot.urdf import parse_urdf
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 20.0, 0.0, 0.005, "none", 0.8)


def problem_of(joints: int) -> Problem:
    log = make_log(6, SETTING, joints=joints)
    record = Recording(
        "run", log.arm.joint_names, log.q, log.tau, SETTING.rate, torque_timing="sampled"
    )
    return Problem(parse_urdf(log.arm.urdf), (record,))


@pytest.fixture(scope="module")
def judged():
    problem = problem_of(3)
    diagnostics = diagnose(problem, {"ls": identify(problem, "ls")})
    return diagnostics, verdict(diagnostics)


def test_the_screen_has_five_parts(judged):
    _, found = judged
    text = found.summary.in_folder("arm results", "arm.toml", "pivident excite x").text()
    lines = text.splitlines()
    assert len(lines) <= 24 and max(map(len, lines)) <= WIDTH
    assert found.headline in " ".join(lines[1:3])
    assert "not fitted" in text and "known to 10 %" in text
    assert "Take away  pivident export 'arm results' --to urdf" in text
    laws = any(item.command == "laws" for item in found.summary.items)
    step = "laws arm.toml   # compares friction laws" if laws else "excite x   # designs a motion"
    assert lines[-1].startswith(f"Next       pivident {step}")
    for name in found.held_out["ls"].joints:
        assert any(line.startswith(name) for line in lines)


def test_of_many_joints_the_worst_are_shown():
    problem = problem_of(8)
    found = verdict(diagnose(problem, {"ls": identify(problem, "ls")}))
    errors = found.held_out["ls"].joints
    shown = [row.joint for row in found.summary.joints]
    assert len(shown) < 8 and max(errors, key=errors.__getitem__) in shown
    long = Item("A sentence that has no end " * 20)
    full = replace(found.summary, items=(long,) * MAX_ITEMS, more=9)
    full = replace(full.in_folder("x", "x.toml", "pivident excite x"), details="x/report.html")
    lines = full.text().splitlines()
    assert len(lines) <= 24 and max(map(len, lines)) <= WIDTH


def test_no_number_and_no_command_is_cut_off(judged):
    """A long sentence goes on, a comment that has no room is left out."""
    _, found = judged
    error = f"Torque on motion that was not fitted: {'3.9 % off, ' * 10}plain least squares 4.1 %"
    long = f"pivident excite results --for {','.join(f'parameter_{k}' for k in range(12))}"
    text = replace(found.summary, error=error, next_step=long, items=()).text()
    assert "plain least squares 4.1 %" in " ".join(text.split())
    assert text.splitlines()[-1] == f"Next       {long}"


def test_errors_on_the_screen_are_those_of_the_tables(judged):
    diagnostics, found = judged
    error = diagnostics.out_of_sample.results["ls"].prediction
    assert found.uses[0].evidence["error"].value == error.total_in_band
    assert found.held_out["ls"].total == error.total_in_band


def test_the_plain_law_is_least_squares_with_plain_friction(judged):
    """This arm has no other friction, so that the baseline is the estimate itself."""
    diagnostics, _ = judged
    own = diagnostics.out_of_sample.results["ls"].prediction.total_in_band
    assert diagnostics.baselines.errors["plain law"] == pytest.approx(own, rel=1e-6)


def test_the_description_misses_what_it_does_not_have(judged):
    """The description has the masses of the truth, and neither its friction nor its rotors."""
    diagnostics, _ = judged
    described = diagnostics.baselines.errors["description"]
    own = diagnostics.out_of_sample.results["ls"].prediction.total_in_band
    assert described > 2.0 * own
    masses = [link.inertia[-1] for link in problem_of(3).robot.tree.links]
    assert diagnostics.baselines.described_mass > 0.0 and np.isfinite(masses).all()


def test_a_statement_that_the_estimate_is_wrong_rules_it_out(judged, monkeypatch):
    diagnostics, found = judged
    assert found.answer("torque") == "yes"
    wrong = Finding("error", "wrenches", "unmeasured force", "A force is not measured.")
    monkeypatch.setattr(
        "pivident.judgement.diagnostics.verdict.unmeasured_forces", lambda *given: iter([wrong])
    )
    assert verdict(diagnostics).headline == (
        "Do not use it for torque prediction: a force is not measured."
    )


@pytest.mark.parametrize(
    ("error", "plain", "answer"),
    [
        (0.9, 0.5, "yes"),
        (1.04, 0.69, "care"),
        (2.9, 2.2, "care"),
        (3.6, 2.2, "no"),
        (2.2, 2.3, "yes"),
    ],
)
def test_a_difference_of_errors_that_costs_nothing_forbids_nothing(
    monkeypatch, error, plain, answer
):
    monkeypatch.setattr(uses, "unexplained_joints", lambda judged: {})
    said, why = uses._against_baselines(
        SimpleNamespace(trials=()),
        SimpleNamespace(total_moving_in_band=error),
        {"error": error, "plain law": plain},
    )
    assert said == answer and ("misses less" in why) == (answer != "yes")
