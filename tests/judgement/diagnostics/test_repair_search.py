"""Logs whose joints are mixed up are not called good, and the right reading is named.

Arms, motions and torques are Pinocchio's; `benchmarks/exchanged_joints.py` counts over many.
"""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import save_identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.estimation.stored_identification import load_identification
from pivident.foundation.text.repair import Reordered, Repair
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.reading_rows import ReadingRows
from pivident.judgement.diagnostics.repair_search import search
from pivident.judgement.diagnostics.repaired_problem import repaired
from pivident.judgement.diagnostics.verdict import verdict
from pivident.robot.urdf import parse_urdf
from tests.judgement.diagnostics.gains_of_masses import by_masses
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 20.0, 0.0, 0.002, "none", 0.8)

GAIN = np.array([20.0, 8.0, 3.0, 3.0])  # N m/A


@pytest.fixture(scope="module")
def log():
    return make_log(3, SETTING, joints=4)


@pytest.fixture(scope="module")
def short():
    return make_log(3, SETTING, joints=3)


def problem_of(log, q, tau, **options) -> Problem:
    record = Recording(
        "run", log.arm.joint_names, q, tau, SETTING.rate, torque_timing="sampled", **options
    )
    return Problem(parse_urdf(log.arm.urdf), (record,))


def judged(problem):
    return verdict(diagnose(problem, {"ls": identify(problem, "ls")}))


def exchanged(values, j, k):
    order = list(range(values.shape[1]))
    order[j], order[k] = k, j
    return values[:, order]


def test_a_right_log_is_left_as_it_is(log):
    problem = problem_of(log, log.q, log.tau)
    assert search(ReadingRows.of(problem)) == ()
    found = judged(problem)
    assert not found.repairs
    assert [s.severity for s in found.statements if s.topic == "physics"] in (["ok"], ["note"])


@pytest.mark.parametrize(("j", "k"), [(0, 1), (1, 2)])
def test_exchanged_joints_are_named(log, j, k):
    problem = problem_of(log, exchanged(log.q, j, k), exchanged(log.tau, j, k))
    found = judged(problem)
    (trial,) = found.repairs
    assert trial.after < 0.5 * trial.before
    assert found.severity == "error" and found.headline.startswith("Do not use it")
    (said,) = [s for s in found.statements if s.topic == "log"]
    (edit,) = said.repairs[0].edits
    assert edit.channel == "" and {edit.order[j], edit.order[k]} == {j, k}
    for name in (log.arm.joint_names[j], log.arm.joint_names[k]):
        assert name in said.message and name in found.headline


@pytest.mark.parametrize("j", [1, 2])
def test_a_joint_that_counts_backwards_is_named(log, j):
    sign = np.where(np.arange(4) == j, -1.0, 1.0)
    (one,) = search(ReadingRows.of(problem_of(log, sign * log.q, sign * log.tau)))
    (edit,) = one.repair.edits
    assert (edit.channel, edit.joints) == ("", (log.arm.joint_names[j],))


def test_an_arm_in_a_mirror_is_an_arm(short):
    """Turned backwards about the vertical, three joints have the torques of their mirror image."""
    sign = np.array([-1.0, 1.0, 1.0])
    problem = problem_of(short, sign * short.q, sign * short.tau)
    assert search(ReadingRows.of(problem)) == ()
    assert identify(problem, "ls").relative_error < 0.02


def test_readings_that_no_torque_tells_apart_are_all_given(short):
    sign = np.array([1.0, 1.0, -1.0])
    problem = problem_of(short, sign * short.q, sign * short.tau)
    (one,) = search(ReadingRows.of(problem))
    joints = {repair.edits[0].joints for repair in (one.repair, *one.alike)}
    assert joints == {(name,) for name in short.arm.joint_names[1:]}
    (said,) = [s for s in judged(problem).statements if s.topic == "log"]
    assert "As well explained by" in said.message
    assert all(short.arm.joint_names[j] in said.message for j in (1, 2))


def test_two_faults_at_once(log):
    sign = np.array([1.0, 1.0, 1.0, -1.0])
    q, tau = (exchanged(sign * x, 0, 1) for x in (log.q, log.tau))
    found = judged(problem_of(log, q, tau))
    right = judged(problem_of(log, log.q, log.tau)).uses[0].evidence["error"].value
    assert found.repairs[0].after < 1.05 * right


def test_exchanged_currents_have_the_gains_of_their_places(log):
    """The gains belong to the joints in the file's order, whatever its columns hold."""
    q, current = exchanged(log.q, 0, 1), exchanged(log.tau / GAIN, 0, 1)
    units = {"tau": [{"unit": "A", "gain": g} for g in GAIN.tolist()]}
    problem = problem_of(log, q, current * GAIN, reading={"units": units, "side": "joint"})
    repair = Repair((Reordered(channel="", order=(1, 0, 2, 3)),))
    made, right = repaired(problem, repair), problem_of(log, log.q, log.tau)
    np.testing.assert_allclose(made.recordings[0].tau, right.recordings[0].tau)


def test_torques_that_are_computed_say_nothing_about_the_log(log):
    problem = problem_of(log, exchanged(log.q, 0, 1), exchanged(log.tau, 0, 1))
    made = replace(problem.recordings[0], torque_source="law")
    assert ReadingRows.of(replace(problem, recordings=(made,))) is None


def test_a_wrong_direction_of_gravity_is_named(log):
    problem = problem_of(log, log.q, log.tau)
    turned = replace(problem, robot=problem.robot.with_gravity(np.array([-9.81, 0.0, 0.0])))
    (one,) = search(ReadingRows.of(turned))
    assert one.repair.edits[0].place == ("robot", "gravity")


def test_a_result_from_a_file_is_asked_for_a_machine_too(log, tmp_path):
    """It has no signals, but the sums that were made when it was saved."""
    problem = problem_of(log, log.q, log.tau)
    save_identification(identify(problem, "ls"), tmp_path)
    loaded = load_identification(tmp_path / "identification.json")
    found = verdict(diagnose(problem, {"ls": loaded}))
    assert [s for s in found.statements if s.topic == "physics"]


@pytest.mark.parametrize(("j", "k"), [(0, 1), (1, 2), (2, 3)])
def test_gains_from_the_masses_do_not_hide_exchanged_joints(log, j, k):
    amperes = log.tau / GAIN
    wrong = problem_of(log, exchanged(log.q, j, k), exchanged(amperes, j, k))
    found = search(ReadingRows.of(by_masses(wrong)))
    edit = found[0].repair.edits[0]
    assert isinstance(edit, Reordered) and {edit.order[j], edit.order[k]} == {j, k}
    assert search(ReadingRows.of(by_masses(problem_of(log, log.q, amperes)))) == ()


def test_ratios_of_gains_that_nobody_verified_are_offered_where_the_error_falls(log):
    """Each gain is off by less than what single gains are searched for."""
    off = np.array([1.12, 0.9, 1.08, 0.94])
    rows = ReadingRows.of(problem_of(log, log.q, log.tau / off))
    names = log.arm.joint_names
    assert (
        search(rows) == () and search(ReadingRows.of(problem_of(log, log.q, log.tau)), names) == ()
    )
    (found,) = search(rows, names)
    (edit,) = found.repair.edits
    gains = np.array([dict(edit.factors).get(name, np.nan) for name in names])
    ratios = gains / off
    assert np.isfinite(ratios).sum() >= 3
    np.testing.assert_allclose(
        ratios / np.nanmedian(ratios), np.where(np.isfinite(gains), 1.0, np.nan), rtol=0.05
    )
    assert dict(search(rows, names[1:])[0].repair.edits[0].factors).get(names[0]) is None
