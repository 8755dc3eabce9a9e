"""The verdict says what is there to be said, with numbers, and tells good from bad results."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.diagnostics.diagnostics import diagnose, diagnose_one
from pivident.diagnostics.estimate_statements import further_warnings
from pivident.diagnostics.prediction_statements import prediction, simulated_loop
from pivident.diagnostics.residual_statements import friction_law
from pivident.diagnostics.verdict import Verdict, save_verdict, verdict
from pivident.diagnostics.wanted_motion import wanted_motions
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.signals.spectral_lines import SpectralLine
from pivident.text.finding import Finding


@pytest.fixture(scope="module")
def simulated():
    problem, _ = tx40_fine(samples=16000)
    return problem, {name: identify(problem, name) for name in ("ls", "piv")}


@pytest.fixture(scope="module")
def judged(simulated):
    problem, found = simulated
    methods = {name: METHODS[name] for name in found}
    return verdict(diagnose(problem, found, methods, folds=2))


def statement(found: Verdict, topic: str) -> Finding:
    return next(s for s in found.statements if s.topic == topic)


def test_a_good_record_gets_a_good_verdict(judged):
    assert judged.method == "IDIM-PIV" and judged.severity in ("ok", "warning")
    assert judged.headline.startswith("Take the estimate of IDIM-PIV")
    for topic in ("iteration", "instruments", "noise", "prediction"):
        assert statement(judged, topic).severity == "ok", str(judged)


def test_every_statement_that_judges_has_numbers(judged):
    for s in judged.statements:
        digits = any(c.isdigit() for c in s.message + s.basis)
        assert digits or s.severity == "note", s


def test_the_text_marks_each_statement(judged):
    lines = str(judged).splitlines()
    assert lines[0].startswith("Verdict: ")
    assert all(line[2] in "+·!×" for line in lines[1:])


def test_without_held_out_motion_the_verdict_says_so(simulated):
    found = verdict(diagnose_one(simulated[1]))
    assert statement(found, "prediction").severity == "warning"
    assert "no motion was held out" in statement(found, "estimate").message


def test_least_squares_alone_cannot_tell_its_bias(simulated):
    found = verdict(diagnose_one({"ls": simulated[1]["ls"]}))
    assert statement(found, "feedback").severity == "warning"
    assert "Without instruments" in statement(found, "feedback").message


def test_an_iteration_that_did_not_converge_is_no_estimate(simulated):
    unfinished = dataclasses.replace(simulated[1]["piv"], converged=False)
    found = verdict(diagnose_one({"piv": unfinished}))
    assert found.severity == "error" and "Do not use" in found.headline
    assert statement(found, "iteration").severity == "error"


def test_negative_friction_is_refused(simulated):
    piv = simulated[1]["piv"]
    theta = piv.theta.copy()
    k = piv.names.index("fc3")
    theta[k] = -theta[k]
    found = verdict(diagnose_one({"piv": dataclasses.replace(piv, theta=theta)}))
    assert statement(found, "physics").severity == "error"
    assert "fc3" in statement(found, "physics").message


def test_undetermined_parameters_are_named_with_a_motion(simulated):
    piv = simulated[1]["piv"]
    covariance = piv.covariance.copy()
    for name in ("fv4", "xx3r"):
        k = piv.names.index(name)
        covariance[k, k] = (3.0 * piv.theta[k]) ** 2
    doubtful = dataclasses.replace(piv, covariance=covariance)
    found = verdict(diagnose_one({"piv": doubtful}))
    text = statement(found, "parameters").message
    assert "26 of 28" in text and "fv4" in text and "xx3r" in text
    motions = [s.message for s in found.statements if s.topic == "motion"]
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
    found = verdict(diagnose_one({"piv": changed}))
    assert "does not whiten" in statement(found, "noise").message


def test_the_file_holds_the_statements(judged, tmp_path):
    save_verdict(judged, tmp_path / "verdict.json")
    content = json.loads((tmp_path / "verdict.json").read_text("utf-8"))
    assert content["schema"] == 2 and content["severity"] == judged.severity
    assert len(content["statements"]) == len(judged.statements)
    assert content["statements"] == [s.as_json() for s in judged.statements]
    assert {"severity", "topic", "message", "evidence", "basis"} <= set(content["statements"][0])


def with_residual_tests(diagnosed, name, joint, **changes):
    """The diagnostics with other tests on the residual of one joint."""
    tests = diagnosed.residuals[name]
    joints = list(tests.joints)
    joints[joint] = dataclasses.replace(joints[joint], **changes)
    residuals = {name: dataclasses.replace(tests, joints=tuple(joints))}
    return dataclasses.replace(diagnosed, residuals=residuals)


@pytest.fixture(scope="module")
def quiet(simulated):
    """PIV alone, with residuals that no test objects to."""
    diagnosed = diagnose_one({"piv": simulated[1]["piv"]})
    for j, own in enumerate(diagnosed.residuals["piv"].joints):
        calm = dataclasses.replace(own.variance, p_value=1.0)
        diagnosed = with_residual_tests(diagnosed, "piv", j, motion=None, variance=calm)
    return diagnosed


def test_intervals_of_friction_hold_for_the_assumed_law(quiet):
    (said,) = [s for s in verdict(quiet).statements if s.topic == "friction"]
    assert said.severity == "note" and "machine's" not in said.message
    assert said.message.startswith("The intervals of fv1, fc1, fv2, fc2")
    assert "hold for the assumed friction law only: fv dq + fc" in said.message


def test_a_residual_that_follows_the_motion_speaks_against_the_friction_law(quiet):
    follows = with_residual_tests(quiet, "piv", 2, motion=SimpleNamespace(matters=True))
    (said,) = friction_law(follows, "piv")
    assert said.severity == "note" and "the residual follows the motion on joint_3" in said.message
    for mostly, severity in ((True, "warning"), (False, "note")):
        split = SimpleNamespace(mostly_model_error=mostly)
        (said,) = friction_law(dataclasses.replace(follows, model_error=split), "piv")
        assert (
            said.severity == severity
            and ("most of the error is model error" in said.message) == mostly
        )


def test_a_residual_that_grows_with_the_speed_does_so_too(quiet):
    variance = quiet.residuals["piv"].joints[1].variance
    for ratio, told in ((0.1, True), (0.9, False)):
        grown = dataclasses.replace(variance, p_value=1e-9, ratios={"speed": ratio})
        (said,) = friction_law(with_residual_tests(quiet, "piv", 1, variance=grown), "piv")
        assert ("the residual's size changes with the motion on joint_2" in said.message) == told


def test_without_friction_parameters_nothing_is_said_of_their_law(quiet):
    piv = quiet.identifications["piv"]
    kept = [k for k, p in enumerate(piv.parameters) if p.is_inertial]
    few = dataclasses.replace(
        piv,
        parameters=tuple(piv.parameters[k] for k in kept),
        names=tuple(piv.names[k] for k in kept),
    )
    diagnosed = dataclasses.replace(quiet, identifications={"piv": few})
    assert list(friction_law(diagnosed, "piv")) == []


def diagnostics_with(loop_error: float, direct_error: float, reference: str = "recorded"):
    """Held-out errors over all frequencies [%], of a method called piv."""
    judged = SimpleNamespace(
        replay=SimpleNamespace(total=loop_error),
        prediction=SimpleNamespace(total=direct_error, total_in_band=2.0, band=20.0),
        training=SimpleNamespace(total_in_band=1.9),
        held_out=[SimpleNamespace(prediction=1, failure="")],
        identification=SimpleNamespace(loop=SimpleNamespace(reference=reference)),
    )
    return SimpleNamespace(out_of_sample=SimpleNamespace(results={"piv": judged}))


def test_a_simulated_loop_that_misses_half_the_torque_is_a_reservation():
    fine = diagnostics_with(49.0, 2.5)
    assert list(simulated_loop(fine, "piv")) == []
    assert "simulated loop 49 %" in next(prediction(fine, "piv")).basis
    for diagnosed, cause in (
        (diagnostics_with(96.0, 91.0), "most of the measured torque is noise"),
        (diagnostics_with(64.0, 1.9), "gains, reference or delay of the loop"),
        (diagnostics_with(64.0, 1.9, "smoothed"), "virtual law does not follow"),
    ):
        (said,) = simulated_loop(diagnosed, "piv")
        assert said.severity == "warning" and cause in said.message and "above 50 %" in said.basis
        (good,) = prediction(diagnosed, "piv")
        assert good.severity == "ok" and "simulated loop" not in good.basis


def test_a_loop_that_cannot_be_simulated_is_a_reservation():
    diagnosed = diagnostics_with(0.0, 2.0)
    judged = diagnosed.out_of_sample.results["piv"]
    judged.replay = None
    judged.held_out[0].failure = "the loop cannot be simulated with this estimate: it diverges"
    (said,) = simulated_loop(diagnosed, "piv")
    assert said.severity == "warning" and "On 1 of 1 stretches the loop cannot be" in said.message


def test_spectral_lines_of_the_encoders_are_told(simulated):
    piv = simulated[1]["piv"]
    record = piv.equations.records[0]
    lines = ((), (SpectralLine(99.8, 0.5, 1.2e-6),), (), (), (), ())
    kinematics = dataclasses.replace(record.kinematics, lines=lines)
    records = (dataclasses.replace(record, kinematics=kinematics),)
    equations = dataclasses.replace(piv.equations, records=records)
    found = verdict(dataclasses.replace(piv, equations=equations))
    assert "joint_2 at 99.8 Hz, 1.2e-06 rad" in statement(found, "encoders").message


def test_many_uncertainties_of_one_law_are_one_statement():
    def law(j):
        text = f"kd of joint {j}: the record hardly determines it."
        return Finding("warning", "law", "uncertain", text)

    other = Finding("warning", "noise model", "replaced", "another")
    converged = Finding("error", "iteration", "not converged", "Not converged at all")
    noted = Finding("note", "law", "found", "It compensates gravity.")
    uncertain = [law(j) for j in range(11)]
    result = SimpleNamespace(warnings=[noted, other, *uncertain, converged])
    first, one = further_warnings(result)
    assert first == other and "has 11 uncertainties" in one.message
    assert uncertain[0].message in one.message
    assert list(further_warnings(SimpleNamespace(warnings=uncertain[:2]))) == uncertain[:2]
