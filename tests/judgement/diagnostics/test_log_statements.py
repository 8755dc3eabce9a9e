"""The verdict knows what an audit has against the recordings."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.foundation.text.finding import Quantity
from pivident.foundation.text.repair import setting
from pivident.judgement.audit.delay import JOINT_EARLY
from pivident.judgement.audit.scale import GAIN, LOAD, MEDIAN
from pivident.judgement.diagnostics.diagnostics import Diagnostics, diagnose
from pivident.judgement.diagnostics.model_error_statements import log_faults
from pivident.judgement.diagnostics.verdict import Verdict, verdict
from pivident.robot.gallery import load_robot


@pytest.fixture(scope="module")
def good() -> Problem:
    return tx40_fine(samples=16000)[0]


def judged(problem: Problem, recording: Recording) -> tuple[Diagnostics, Verdict]:
    problem = replace(problem, recordings=(recording,))
    diagnostics = diagnose(problem, {"ls": identify(problem, "ls")}, folds=0)
    return diagnostics, verdict(diagnostics)


def test_no_finding_is_no_statement(good):
    diagnostics, _ = judged(good, good.recordings[0])
    assert diagnostics.log == ()


def test_lost_samples_are_a_reservation(good):
    made = good.recordings[0]
    rows = np.flatnonzero(np.random.default_rng(2).random(made.samples) >= 0.005)
    channels = {name: getattr(made, name)[rows] for name in ("q", "tau", "q_ref")}
    _, found = judged(good, replace(made, **channels, dq_ref=None, ddq_ref=None))
    (lost,) = [s for s in found.statements if s.topic == "timing"]
    assert (lost.severity, lost.kind) == ("warning", "lost")
    assert found.severity == "warning"


def test_a_torque_logged_one_sample_late_is_a_reservation(good):
    made = good.recordings[0]
    tau = np.vstack([made.tau[:1], made.tau[:-1]])
    diagnostics, found = judged(good, replace(made, tau=tau))
    (late,) = diagnostics.log
    assert late.kind == "late"
    assert late.quantity.value == pytest.approx(1e3 / made.rate, rel=0.1)
    # the causes of model error know it more precisely, and it is said once
    (delay,) = (s for s in found.statements if s.kind in ("late", "delay"))
    assert (delay.topic, delay.severity) == ("model", "warning")
    assert delay.quantity.value == pytest.approx(1e3 / made.rate, rel=0.02)


@pytest.mark.parametrize(
    ("timely", "looked"),
    [({"elbow": 3.1}, True), ({"elbow": 12.0}, False), ({"shoulder": 3.1}, False), (None, False)],
)
def test_a_joint_s_own_delay_that_the_residual_rules_out_is_a_note(timely, looked):
    """An audit has an assumed law of friction; the causes have what was estimated."""
    finding = JOINT_EARLY.finding(
        "warning", "9.8 ms earlier.", "elbow", "Log them at once.", {"delay": Quantity(-9.8, "ms")}
    )
    known = SimpleNamespace(named=(), checked_gains=(), timely=timely)
    diagnostics = SimpleNamespace(
        log=[finding],
        model_errors=None if timely is None else known,
        identifications={"piv": SimpleNamespace(robot=load_robot("planar_2r"))},
        recommended="piv",
    )
    (said,) = log_faults(diagnostics)
    assert (said.severity == "note") == looked == ("rules that out" in said.message)
    assert bool(said.next_step) != looked


def severities(median, declared, *checked, repairs=()):
    """Of what an audit has against a torque, where the scale of these joints is checked."""
    finding = declared.finding(
        "warning", "1.4 times.", "elbow", "Check it.",
        evidence={"value": Quantity(1.4), MEDIAN: Quantity(median)}, repairs=repairs,
    )  # fmt: skip
    diagnostics = SimpleNamespace(
        log=[finding],
        model_errors=SimpleNamespace(named=(), checked_gains=checked, timely={}),
        identifications={"piv": SimpleNamespace(robot=load_robot("planar_2r"))},
        recommended="piv",
    )
    (said,) = log_faults(diagnostics)
    return said.severity


def test_a_factor_that_other_joints_rule_out_is_one_of_the_described_masses():
    assert severities(1.1, GAIN, "shoulder", "elbow") == "note"
    assert severities(1.1, GAIN, "shoulder") == "warning"  # nobody knows its own
    assert severities(0.6, GAIN, "shoulder", "elbow") == "warning"  # a scale that all have
    on_motor = [setting("side", value="motor")]
    assert severities(1.1, GAIN, "shoulder", "elbow", repairs=on_motor) == "warning"


def test_a_load_is_a_reservation_only_where_the_scale_is_another():
    assert [severities(median, LOAD) for median in (1.1, 0.6)] == ["note", "warning"]
