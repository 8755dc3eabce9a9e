"""Repairs are tried on logs of Pinocchio's arms: the right one wins, none wins on a right log."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.foundation.text.finding import FindingKind, Quantity, Topic
from pivident.foundation.text.repair import (
    Edit,
    Multiplied,
    Reordered,
    Repair,
    Retimed,
    Reversed,
    Shifted,
    setting,
)
from pivident.judgement.audit.scale import GAIN
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.reading_rows import ReadingRows
from pivident.judgement.diagnostics.repair_search import search
from pivident.judgement.diagnostics.repaired_problem import repaired
from pivident.judgement.diagnostics.trials import consequences, tried
from pivident.judgement.diagnostics.verdict import verdict
from pivident.judgement.model_errors.named_causes import named_causes
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.robot.urdf import parse_urdf
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 30.0, 0.0, 0.002, "true", 0.8)

#: Names of the joints.
ONE, TWO = "joint_2", "joint_3"

ODD = FindingKind(Topic("odd"), "odd", reservation=True)


def right_log(seconds: float) -> Problem:
    log = make_log(5, replace(SETTING, seconds=seconds), joints=4)
    record = Recording(
        "run", log.arm.joint_names, log.q, log.tau, SETTING.rate, torque_timing="sampled", dq=log.dq
    )
    return Problem(parse_urdf(log.arm.urdf), (record,))


@pytest.fixture(scope="module")
def right() -> Problem:
    return right_log(SETTING.seconds)


@pytest.fixture(scope="module")
def brief() -> Problem:
    """Half as long, which tells gross faults as well."""
    return right_log(15.0)


@pytest.fixture(scope="module")
def error_of_brief(brief) -> float:
    return identify(brief, "ls").relative_error


def after(problem: Problem, *edits) -> Problem:
    return repaired(problem, Repair(edits))


def joint(problem: Problem, number: int) -> str:
    return problem.robot.joint_names[number]


@pytest.fixture(scope="module")
def slow() -> Problem:
    """The same log at 29 Hz."""
    log = make_log(5, SETTING, joints=4)
    q, tau, dq = (x[::7] for x in (log.q, log.tau, log.dq))
    rate = SETTING.rate / 7
    record = Recording("run", log.arm.joint_names, q, tau, rate, torque_timing="sampled", dq=dq)
    return Problem(parse_urdf(log.arm.urdf), (record,))


def test_nothing_is_found_in_a_right_log(right):
    assert search(ReadingRows.of(right)) == ()
    assert tried(right, (), METHODS["ls"], 5) == ()


@pytest.mark.parametrize("number", [1, 2])
@pytest.mark.parametrize("fault", ["sign", "turned", "zero", "degrees", "order", "gravity"])
def test_the_repair_that_undoes_a_fault_wins(brief, error_of_brief, fault, number):
    name, quarter, circle = joint(brief, number), float(np.pi / 2), float(180.0 / np.pi)
    order = (0, 2, 1, 3) if number == 1 else (0, 1, 3, 2)
    faults = {
        "sign": Reversed(channel="tau", joints=(name,)),
        "turned": Reversed(channel="q", joints=(name,)),
        "zero": Shifted(offsets=((name, quarter),)),
        "degrees": Multiplied(channel="q", factors=((name, 1.0 / circle),)),
        "order": Reordered(channel="tau", order=order),
        "gravity": Edit(("robot", "gravity"), [9.81, 0.0, 0.0]),
    }
    wrong = after(brief, faults[fault])
    diagnostics = diagnose(wrong, {"ls": identify(wrong, "ls")})
    trial = diagnostics.trials[0]
    assert trial.wins and trial.after < 0.9 * trial.before, trial
    made = identify(repaired(wrong, trial.repair), "ls").relative_error
    assert made < 1.05 * error_of_brief
    found = verdict(diagnostics)
    assert found.answer("torque") == "no"
    assert found.repairs[0].cause.rstrip(".").lower() in found.headline.lower()


def test_two_faults_are_found_one_after_the_other(right):
    wrong = after(
        right,
        Reversed(channel="tau", joints=(joint(right, 2),)),
        Shifted(offsets=((joint(right, 1), float(np.pi / 2)),)),
    )
    candidates = search(ReadingRows.of(wrong))
    assert {type(one.repair.edits[0]) for one in candidates} == {Reversed, Shifted}


@pytest.mark.parametrize("factor", [2.0, 0.5])
@pytest.mark.parametrize("given", ["for each joint", "for all"])
def test_a_clock_on_trial_has_the_filters_of_its_motion(slow, factor, given):
    """Those of the log as it is would leave too few rows, or a motion of twice the band."""
    wrong = after(slow, Retimed(factor=factor))
    method = METHODS["ls"].settled(wrong)
    if given == "for all":
        one = replace(method.signals, cutoff=max(method.signals.cutoff))
        method = replace(method, signals=one)
    first = tried(wrong, (), method, 3)[0]
    own = METHODS["ls"].settled(slow)
    right = cross_validate(slow, own, folds=3).prediction.total_moving_in_band
    assert first.wins and first.after == pytest.approx(right, rel=1e-3)


def test_a_late_torque_of_a_slow_log_is_named(slow):
    """By 15 ms, more than any delay at 200 Hz that is believed."""
    late = replace(slow, recordings=(replace(slow.recordings[0], delay=-0.015),))
    first = named_causes(late, identify(late, "piv")).named[0]
    assert str(first.cause) == "delay: torques logged later than positions"
    assert first.size[0] == pytest.approx(15.0, abs=1.0)
    right = named_causes(slow, identify(slow, "piv")).named
    assert "delay" not in [one.cause.kind for one in right]


@pytest.mark.parametrize("factor", [2.0, 0.5])
def test_the_logged_speeds_know_the_clock(right, factor):
    """Without them the fit finds it: gravity stays as it is where inertia changes by a square."""
    wrong = after(right, Retimed(factor=factor))
    trial = tried(wrong, (), METHODS["ls"], 5)[0]
    assert trial.evidence and trial.wins
    (edit,) = trial.repair.edits
    assert edit.factor == pytest.approx(1.0 / factor, rel=0.01)
    without = replace(wrong, recordings=(replace(wrong.recordings[0], dq=None),))
    (trial,) = tried(without, (), METHODS["ls"], 5)
    (edit,) = trial.repair.edits
    assert trial.wins and not trial.evidence
    assert edit.factor == pytest.approx(1.0 / factor, rel=0.05)


def test_one_speed_of_another_size_is_a_unit(right):
    name = joint(right, 3)
    wrong = after(right, Multiplied(channel="q", factors=((name, 0.8),)))
    found = [t for t in tried(wrong, (), METHODS["ls"], 5) if t.evidence]
    assert any(name in trial.evidence for trial in found)


def test_a_repair_that_leaves_nothing_is_a_lost_trial(right):
    nothing = setting("part", value=[1e3, 2e3])
    finding = ODD.finding("error", "It is odd.", repairs=[nothing])
    (trial,) = tried(right, (finding,), METHODS["ls"], 5)
    assert trial.outcome == "unsolvable" and not trial.wins
    assert consequences((finding,), (trial,)) == ()


def test_advice_that_changes_nothing_is_a_note(right):
    same = setting("torque_timing", value="sampled")
    finding = ODD.finding("warning", "It is odd.", repairs=[same])
    trials = tried(right, (finding,), METHODS["ls"], 5)
    (left,) = consequences((finding,), trials)
    assert left.severity == "note" and "Of no consequence" in left.message


@pytest.mark.parametrize(("blocks", "outcome"), [(5, "better"), (2, "unclear")])
def test_what_helps_on_two_blocks_stays_a_reservation(right, blocks, outcome):
    """Two blocks have no interval: neither is it shown as a repair, nor of no consequence."""
    name = joint(right, 1)
    wrong = after(right, Multiplied(channel="q", factors=((name, 1.05),)))
    repair = Repair((Multiplied(channel="q", factors=((name, 1.0 / 1.05),)),))
    finding = ODD.finding("warning", "It is odd.", repairs=[repair])
    without = replace(wrong, recordings=(replace(wrong.recordings[0], dq=None),))
    (trial,) = tried(without, (finding,), METHODS["ls"], blocks)
    assert trial.outcome == outcome and trial.after < 0.98 * trial.before
    left = consequences((finding,), (trial,))
    assert [(one.severity, one.repairs) for one in left] == (
        [] if outcome == "better" else [("warning", finding.repairs)]
    )
    assert all("two blocks" in one.message for one in left)


def test_advice_that_makes_it_worse_is_not_given(right):
    wrong_way = Repair((Reversed(channel="tau", joints=(joint(right, 1),)),))
    finding = ODD.finding("warning", "It is odd.", repairs=[wrong_way])
    trials = tried(right, (finding,), METHODS["ls"], 5)
    assert [trial.outcome for trial in trials] == ["worse"]
    assert consequences((finding,), trials) == ()


@pytest.mark.parametrize("scaled", [True, False])
def test_a_gain_is_told_from_a_wrong_mass(right, scaled):
    """A torque of three times its size is repaired; a description of a third of it is none."""
    name = joint(right, 2)
    size = {"factor": Quantity(3.0)}
    finding = GAIN.finding("warning", "It is 3 times that.", name, evidence=size)
    problem = after(right, Multiplied(channel="tau", factors=((name, 3.0),))) if scaled else right
    trials = tried(problem, (finding,), METHODS["ls"], 5)
    if scaled:
        assert trials[0].wins and "times as large" in trials[0].cause
    else:
        (left,) = consequences((finding,), trials)
        assert left.severity == "note" and "It is no gain (tried: error in motion" in left.message


def test_what_nobody_can_try_is_a_reservation_at_most():
    finding = ODD.finding("error", "It is odd.")
    assert [f.severity for f in consequences((finding,), ())] == ["warning"]
