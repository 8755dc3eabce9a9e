"""The verdict says what is there to be said, with numbers, and tells good from bad results."""

import dataclasses
import json
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.summary import identification_table
from pivident.experiment.simulated_tx40 import tx40_fine
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import with_spread
from pivident.judgement.diagnostics.consistency_statements import consistency
from pivident.judgement.diagnostics.diagnostics import diagnose, diagnose_one
from pivident.judgement.diagnostics.estimate_statements import further_warnings, wanted_motions
from pivident.judgement.diagnostics.prediction_statements import prediction, simulated_loop
from pivident.judgement.diagnostics.residual_statements import friction_law
from pivident.judgement.diagnostics.stored_verdict import held_out_errors, recommended_method
from pivident.judgement.diagnostics.verdict import Verdict, beside_verdict, verdict
from pivident.judgement.diagnostics.verdict_file import save_verdict
from pivident.judgement.validation.held_out.prediction import PredictionError
from pivident.models.consistency.metric import is_far
from pivident.signals.spectral_lines import SpectralLine


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
    assert judged.headline.startswith("Good for torque prediction")
    assert judged.answer("torque") == "yes" and judged.repairs == ()
    for topic in ("iteration", "instruments", "prediction"):
        assert statement(judged, topic).severity == "ok", str(judged)
    assert statement(judged, "noise").severity in ("ok", "note"), str(judged)


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
    assert statement(found, "feedback").severity == "note"
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
    found = verdict(diagnose_one({"piv": dataclasses.replace(piv, judged=None, theta=theta)}))
    assert statement(found, "physics").severity == "warning"
    assert found.answer("simulation") == "no" and "fc3" in found.headline
    assert "fc3" in statement(found, "physics").message


def test_undetermined_parameters_are_named_with_a_motion(simulated):
    piv = simulated[1]["piv"]
    covariance = piv.covariance.copy()
    for name in ("fv4", "xx3r"):
        k = piv.names.index(name)
        covariance[k, k] = (3.0 * piv.theta[k]) ** 2
    doubtful = dataclasses.replace(piv, covariance=covariance, robust_covariance=covariance)
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
    assert content["schema"] == 3 and content["severity"] == judged.severity
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


def with_joints(error, wrist: float = 3.0, noise: float = 0.01, moving: float | None = None):
    """Errors of two joints below 20 Hz, that of the second in per cent and with its noise.

    ``moving``: its error without standstill [%]; None: the same.
    """
    error.joint_names, error.units = ("shoulder", "wrist"), ("N m", "N m")
    error.torque_in_band = np.array([50.0, 0.8])
    error.relative_in_band = np.array([1.9, wrist])
    error.rms_in_band = error.torque_in_band * error.relative_in_band / 100.0
    error.noise_in_band = np.array([0.01, noise])
    error.moving_in_band = np.array([1.9, wrist if moving is None else moving])
    error.total_moving_in_band = error.total_in_band
    error.is_poor = False
    return error


def diagnostics_with(loop_error: float, direct_error: float, reference: str = "recorded"):
    """Held-out errors over all frequencies [%], of a method called piv."""
    judged = SimpleNamespace(
        replay=SimpleNamespace(total=loop_error),
        prediction=with_joints(SimpleNamespace(total=direct_error, total_in_band=2.0, band=20.0)),
        motion="held-out motion",
        where="3 held-out blocks",
        training=SimpleNamespace(total_in_band=1.9),
        held_out=[SimpleNamespace(prediction=1, failure="")],
        identification=SimpleNamespace(loop=SimpleNamespace(reference=reference)),
    )
    return SimpleNamespace(validations={"piv": judged})


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


def test_predictions_that_are_farther_off_than_none_are_an_error():
    diagnosed = diagnostics_with(2.0, 2.5)
    judged = diagnosed.validations["piv"]
    judged.prediction.total_in_band, judged.prediction.total_moving_in_band = 153.0, 150.0
    said = next(prediction(diagnosed, "piv"))
    assert (said.severity, said.kind) == ("error", "predicts nothing")
    assert "no torque at all would be nearer" in said.message and "pivident audit" in said.next_step
    judged.prediction.total_moving_in_band = 3.0  # the arm stands for most of the time
    assert next(prediction(diagnosed, "piv")).severity == "warning"


def test_a_loop_that_cannot_be_simulated_is_a_reservation():
    diagnosed = diagnostics_with(0.0, 2.0)
    judged = diagnosed.validations["piv"]
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


def test_a_joint_that_a_small_error_of_all_joints_hides_is_named():
    diagnosed = diagnostics_with(2.0, 2.5)
    judged = diagnosed.validations["piv"]
    (said,) = prediction(diagnosed, "piv")
    assert "is 2.0 %; the largest of a joint is 3.0 %, wrist." in said.message
    assert said.evidence["largest of a joint"].value == 3.0
    with_joints(judged.prediction, wrist=52.0)
    total, missed = prediction(diagnosed, "piv")
    assert total.severity == "ok" and missed.severity == "warning" and missed.subject == "wrist"
    assert "its error on held-out motion is 52 %, 0.416 of 0.800 N m rms" in missed.message
    assert "Noise" not in missed.message
    with_joints(judged.prediction, wrist=52.0, noise=0.4)
    assert "Noise of the logged torque may" in list(prediction(diagnosed, "piv"))[1].message
    with_joints(judged.prediction, wrist=52.0, moving=1.2)  # it stands, held by friction
    (said,) = prediction(diagnosed, "piv")
    assert "is 52 %, wrist (1.2 % without standstill, where dry friction" in said.message
    judged.prediction.total_moving_in_band = 0.4
    (said,) = prediction(diagnosed, "piv")
    assert "is 2.0 % (0.40 % without standstill" in said.message
    assert said.message.count("standstill") == 1


def test_a_validation_recording_is_called_by_its_name(simulated, tmp_path):
    problem, found = simulated
    (record,) = problem.recordings
    other = dataclasses.replace(record.part(0, 8000), name="friday", q=record.q[:8000] + 1e-9)
    diagnosed = diagnose(problem, {"ls": found["ls"]}, METHODS, folds=3, recordings=(other,))
    judged = verdict(diagnosed)
    assert "error on the validation recording friday is" in statement(judged, "prediction").message
    assert "on the validation recording friday" in statement(judged, "estimate").basis
    compared = diagnosed.out_of_sample
    assert "on the validation recording friday, below 20 Hz" in compared.joint_heading()
    errors = compared.results["ls"].prediction
    rows = compared.joint_table().text().splitlines()[1:]
    (largest,) = [row for row in rows if row.endswith("largest")]
    assert largest.split()[0] == errors.joint_names[int(np.argmax(errors.relative_in_band))]
    save_verdict(judged, tmp_path / "verdict.json")
    stored = held_out_errors(tmp_path, "IDIM-WLS")
    assert stored.where == "the validation recording friday"
    assert stored.joints == pytest.approx(
        dict(zip(errors.joint_names, errors.relative_in_band, strict=True))
    )
    assert held_out_errors(tmp_path, "IDIM-PIV") is None
    assert recommended_method(tmp_path) == "ls"


def test_the_verdict_counts_by_robust_standard_errors(simulated):
    """What is known, zero or negative does not rest on errors that the residual contradicts."""
    ls = simulated[1]["ls"]
    k = ls.names.index("fv4")
    robust = ls.robust_covariance.copy()
    robust[k, k] = (0.6 * ls.theta[k]) ** 2
    wide = dataclasses.replace(ls, robust_covariance=robust)
    assert (
        "not significantly different from zero: fv4"
        in statement(verdict(wide), "parameters").message
    )
    row = parameter_rows(wide)[k]
    assert row.std == pytest.approx(0.6 * abs(ls.theta[k]))
    assert row.method_std == ls.method_std[k]
    spread = with_spread(row.value, 1.2 * abs(row.value))[1]
    (line,) = [x for x in identification_table(wide).splitlines() if x.startswith("fv4 ")]
    assert line.split()[2] == spread
    unknown = dataclasses.replace(ls, robust_covariance=np.full_like(robust, np.nan))
    assert parameter_rows(unknown)[k].std == ls.method_std[k]


def test_what_the_verdict_says_is_not_said_again():
    def finding(topic, text, severity="warning"):
        return Finding(severity, topic, "k", text)

    scale, reference = finding("torque scale", "s"), finding("reference", "r")
    law, another = finding("law", "l"), finding("noise model", "n")
    found = Verdict("IDIM-PIV", "piv", (finding("torque scale", "S"), reference))
    noticed = {
        "ls": [scale, another],
        "iv": [scale, reference, law, another],
        "piv": [scale, reference, law, finding("exogeneity", "e")],
    }
    assert beside_verdict(found, noticed) == [(("ls", "iv"), another), (("piv",), law)]


def held_out(piv, rms, noise, torque=10.0):
    """Diagnostics of an estimate whose held-out errors are given, the same for all joints."""
    n = len(piv.joints)
    same = {
        "rms": rms, "torque": torque, "rms_in_band": rms, "torque_in_band": torque,
        "noise_in_band": noise, "rest_in_band": 0.0,
    }  # fmt: skip
    error = PredictionError(
        tuple(j.name for j in piv.joints),
        ("N m",) * n,
        **{key: np.full(n, value) for key, value in same.items()},
        band=20.0,
        samples=1000,
    )
    judged = SimpleNamespace(
        prediction=error, training=error, replay=None, motion="held-out motion", where="5 blocks"
    )
    found = diagnose_one({"piv": piv})
    return dataclasses.replace(found, out_of_sample=SimpleNamespace(results={"piv": judged}))


@pytest.mark.parametrize(
    ("rms", "noise", "kind"),
    [(0.5, 0.1, "predicts"), (1.8, 0.1, "predicts poorly"), (1.8, 1.7, "predicts")],
)
def test_a_model_that_misses_much_of_the_torque_is_a_reservation(simulated, rms, noise, kind):
    (said,) = prediction(held_out(simulated[1]["piv"], rms, noise), "piv")
    assert said.kind == kind
    assert said.severity == ("warning" if kind == "predicts poorly" else "ok")


def nearest(distance, p_value, free, possible):
    """A consistent model at some distance, of which the verdict needs these numbers."""
    return SimpleNamespace(
        was_consistent=distance == 0.0, least_distance=distance, p_value=p_value,
        torque_error_free=free, torque_error=possible, active=(SimpleNamespace(subject="link_3"),),
        is_far=is_far(p_value, free, possible),
    )  # fmt: skip


@pytest.mark.parametrize(
    ("model", "severity", "words"),
    [
        ((0.0, 1.0, 0.05, 0.05), "ok", "physically possible"),
        ((1.0, 0.6, 0.05, 0.05), "ok", "within the intervals"),
        ((5.0, 1e-4, 0.05, 0.0502), "note", "outside the intervals"),
        ((9.0, 1e-9, 0.05, 0.09), "warning", "No machine has these parameters"),
    ],
)
def test_every_result_is_asked_whether_a_machine_can_have_it(simulated, model, severity, words):
    found = diagnose_one({"piv": simulated[1]["piv"]})
    (said,) = consistency(dataclasses.replace(found, nearest=nearest(*model)), "piv")
    assert said.severity == severity and words in said.message and said.topic == "physics"
    assert ("link_3" in said.next_step) == (severity == "warning")
