"""Terms of no consequence are left out on trial: the error in motion says whether they may be."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.reading_rows import ReadingRows, scores
from pivident.judgement.diagnostics.slight_terms import left_out
from pivident.judgement.diagnostics.verdict import verdict
from pivident.robot.urdf import parse_urdf
from tests.judgement.diagnostics.test_torque_shares import with_estimate
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 30.0, 0.0, 0.002, "true", 0.8)


@pytest.fixture(scope="module")
def problem() -> Problem:
    """A record of one of Pinocchio's arms."""
    log = make_log(5, SETTING, joints=4)
    record = Recording(
        "run", log.arm.joint_names, log.q, log.tau, SETTING.rate, torque_timing="sampled"
    )
    return Problem(parse_urdf(log.arm.urdf), (record,))


@pytest.fixture(scope="module")
def fitted(problem):
    return identify(problem, "ls")


def test_rows_without_parameters_are_those_of_a_model_without_them(problem):
    rows = ReadingRows.of(problem)
    names = rows.parameters[3], rows.parameters[-1]
    kept = [k for k, name in enumerate(rows.parameters) if name not in names]
    parameters = [rows.regressor.parameters[k] for k in kept]
    fewer = replace(rows, regressor=regressor_of(rows.robot, parameters))
    np.testing.assert_allclose(rows.without(names), scores(fewer.sums), rtol=1e-9)


def test_what_makes_no_torque_may_be_left_out(problem, fitted):
    """The smallest friction, made to look certainly negative and slight."""
    rows = ReadingRows.of(problem)
    given = float(rows.scores().mean())
    frictions = [n for n in fitted.names if n.startswith(("fv", "fc"))]
    name = min(frictions, key=lambda n: abs(float(rows.without([n]).mean()) - given))
    trial = left_out(problem, with_estimate(fitted, name, -1e-6, 1e-8))
    assert name in trial.names and trial.before == pytest.approx(100.0 * np.exp(given))
    other = float(rows.without(trial.names).mean())
    assert trial.after == pytest.approx(100.0 * np.exp(other))


def test_what_the_motion_needs_is_needed_however_small_it_is_said_to_be(problem, fitted):
    trial = left_out(problem, with_estimate(fitted, "fc2", -1e-6, 1e-8))
    assert "fc2" in trial.names and trial.is_needed and trial.after > trial.before


def test_the_verdict_says_what_leaving_them_out_did(problem, fitted):
    small = with_estimate(fitted, "fv4", -1e-6, 1e-8)
    made = diagnose(problem, {"ls": small}, folds=3)
    assert made.left_out is not None and "fv4" in made.left_out.names
    (said,) = [s for s in verdict(made).statements if s.kind in ("left out", "needed")]
    assert said.severity == "note" and "fv4" in said.message
    assert said.evidence["without"].value == pytest.approx(made.left_out.after)


def test_where_nothing_is_slight_nothing_is_left_out(problem, fitted):
    sure = replace(fitted, judged=None, theta=np.abs(fitted.theta) + 1.0)
    assert left_out(problem, sure) is None
