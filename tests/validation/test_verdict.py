"""The verdict says what is there to be said, with numbers, and tells good from bad results."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.signals.spectral_lines import SpectralLine
from pivident.simulation.scenarios import tx40_fine
from pivident.validation.estimate_statements import further_warnings
from pivident.validation.examination import examine, examine_alone
from pivident.validation.statement import Statement
from pivident.validation.verdict import Verdict, save_verdict, verdict
from pivident.validation.wanted_motion import wanted_motions


@pytest.fixture(scope="module")
def simulated():
    problem, _ = tx40_fine(samples=16000)
    return problem, {name: identify(problem, name) for name in ("ls", "piv")}


@pytest.fixture(scope="module")
def judged(simulated):
    problem, found = simulated
    methods = {name: METHODS[name] for name in found}
    return verdict(examine(problem, found, methods, folds=2))


def statement(found: Verdict, topic: str) -> Statement:
    return next(s for s in found.statements if s.topic == topic)


def test_a_good_record_gets_a_good_verdict(judged):
    assert judged.method == "IDIM-PIV" and judged.grade in ("good", "caution")
    assert judged.headline.startswith("Take the estimate of IDIM-PIV")
    for topic in ("iteration", "instruments", "noise", "prediction"):
        assert statement(judged, topic).grade == "good", str(judged)


def test_every_statement_that_judges_has_numbers(judged):
    for s in judged.statements:
        digits = any(c.isdigit() for c in s.text + s.evidence)
        assert digits or s.grade == "note", s


def test_the_text_marks_each_statement(judged):
    lines = str(judged).splitlines()
    assert lines[0].startswith("Verdict: ")
    assert all(line[2] in "+·!×" for line in lines[1:])


def test_without_held_out_motion_the_verdict_says_so(simulated):
    found = verdict(examine_alone(simulated[1]))
    assert statement(found, "prediction").grade == "caution"
    assert "nothing was held out" in statement(found, "estimate").text


def test_least_squares_alone_cannot_tell_its_bias(simulated):
    found = verdict(examine_alone({"ls": simulated[1]["ls"]}))
    assert statement(found, "feedback").grade == "caution"
    assert "without instruments" in statement(found, "feedback").text


def test_an_iteration_that_did_not_converge_is_no_estimate(simulated):
    unfinished = dataclasses.replace(simulated[1]["piv"], converged=False)
    found = verdict(examine_alone({"piv": unfinished}))
    assert found.grade == "bad" and "Do not use" in found.headline
    assert statement(found, "iteration").grade == "bad"


def test_negative_friction_is_refused(simulated):
    piv = simulated[1]["piv"]
    theta = piv.theta.copy()
    k = piv.names.index("fc3")
    theta[k] = -theta[k]
    found = verdict(examine_alone({"piv": dataclasses.replace(piv, theta=theta)}))
    assert statement(found, "physics").grade == "bad"
    assert "fc3" in statement(found, "physics").text


def test_undetermined_parameters_are_named_with_a_motion(simulated):
    piv = simulated[1]["piv"]
    covariance = piv.covariance.copy()
    for name in ("fv4", "xx3r"):
        k = piv.names.index(name)
        covariance[k, k] = (3.0 * piv.theta[k]) ** 2
    doubtful = dataclasses.replace(piv, covariance=covariance)
    found = verdict(examine_alone({"piv": doubtful}))
    text = statement(found, "parameters").text
    assert "26 of 28" in text and "fv4" in text and "xx3r" in text
    motions = [s.text for s in found.statements if s.topic == "motion"]
    assert any("fv4" in m and "joint_4 faster" in m for m in motions)
    assert any("xx3r" in m for m in motions)


def test_motions_by_kind_of_parameter(simulated):
    piv = simulated[1]["piv"]
    (inertia,) = wanted_motions(piv, ("ia5",))
    assert "accelerate" in inertia and "joint_5" in inertia
    (gravity,) = wanted_motions(piv, ("mx2r",))
    assert "gravity" in gravity
    assert wanted_motions(piv, ()) == ()


def test_coloured_residuals_are_noticed(simulated):
    piv = simulated[1]["piv"]
    record = piv.recordings[0]
    slow = np.cumsum(np.random.default_rng(1).standard_normal(record.whitened.shape), axis=0)
    coloured = dataclasses.replace(record, whitened=slow / slow.std(axis=0))
    changed = dataclasses.replace(piv, recordings=(coloured,), equations=None)
    found = verdict(examine_alone({"piv": changed}))
    assert "does not whiten" in statement(found, "noise").text


def test_the_file_holds_the_statements(judged, tmp_path):
    save_verdict(judged, tmp_path / "verdict.json")
    content = json.loads((tmp_path / "verdict.json").read_text("utf-8"))
    assert content["schema"] == 1 and content["grade"] == judged.grade
    assert len(content["statements"]) == len(judged.statements)
    assert set(content["statements"][0]) == {"topic", "grade", "text", "evidence"}


def test_spectral_lines_of_the_encoders_are_told(simulated):
    piv = simulated[1]["piv"]
    record = piv.equations.records[0]
    lines = ((), (SpectralLine(99.8, 0.5, 1.2e-6),), (), (), (), ())
    kinematics = dataclasses.replace(record.kinematics, lines=lines)
    records = (dataclasses.replace(record, kinematics=kinematics),)
    equations = dataclasses.replace(piv.equations, records=records)
    found = verdict(dataclasses.replace(piv, equations=equations))
    assert "joint_2 at 99.8 Hz, 1.2e-06 rad" in statement(found, "encoders").text


def test_many_doubts_about_one_law_are_one_statement():
    doubts = [f"kd of joint {j}: the record hardly tells it." for j in range(11)]
    law = SimpleNamespace(identified=SimpleNamespace(warnings=doubts))
    result = SimpleNamespace(loop=law, warnings=["another", *doubts, "Not converged at all"])
    other, one = further_warnings(result)
    assert other == "another" and "leaves 11 doubts" in one and doubts[0] in one
    few = SimpleNamespace(identified=SimpleNamespace(warnings=doubts[:2]))
    shown = list(further_warnings(SimpleNamespace(loop=few, warnings=doubts[:2])))
    assert shown == doubts[:2]
