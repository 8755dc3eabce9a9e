"""IV and PIV on records that come without law, without reference, or without both."""

import dataclasses

import numpy as np
import pytest

from pivident.data.recording.public_records import load_emps, load_staubli_tx40
from pivident.estimation.control_law.unknown_loop import feedback_from_noise, reconstruct_loop
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL, tx40_scenario
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import Cascade
from pivident.robot.gallery import load_robot

EMPS_GAIN = 35.15065188248547


def blind(recording):
    """The same run with its reference hidden."""
    return dataclasses.replace(recording, q_ref=None, dq_ref=None, ddq_ref=None)


def median_error(problem, truth, method="piv"):
    found = identify(problem, method)
    expected = np.array([truth[p.name] for p in problem.regressor.parameters])
    error = np.abs(found.theta - expected)
    return np.median(error / np.abs(expected)), np.mean(error < 2 * found.std), found


@pytest.fixture(scope="module", params=["fine", "loop"])
def known(request):
    problem, truth = tx40_scenario(request.param, 1)
    return request.param, problem, truth, median_error(problem, truth)[0]


def test_with_an_identified_law_piv_is_as_accurate(known):
    scenario, problem, truth, error = known
    recordings, loop = reconstruct_loop(problem.robot, problem.recordings)
    assert recordings == problem.recordings
    own, covered, found = median_error(dataclasses.replace(problem, loop=loop), truth)
    assert own <= 1.2 * error and covered > 0.85
    assert found.method == "IDIM-PIV (Ĉ)"
    # where the encoders' noise comes through the law alone, its inverse gives the best prefilter
    assert found.options["prefilter"] in ("controller", "direct")
    assert scenario != "loop" or found.options["prefilter"] == "controller"


def test_with_a_reconstructed_reference(known):
    _, problem, truth, error = known
    recordings, loop = reconstruct_loop(
        problem.robot, [blind(r) for r in problem.recordings], problem.loop.controller, True
    )
    assert loop.reconstructed[0].kind == "point_to_point"
    changed = dataclasses.replace(problem, recordings=recordings, loop=loop)
    own, covered, found = median_error(changed, truth)
    assert own < 1.6 * error and covered > 0.8
    assert found.method == "IDIM-PIV"
    assert any("Durbin-Wu-Hausman" in w.message for w in found.warnings)


def test_with_neither(known):
    scenario, problem, truth, error = known
    recordings, loop = reconstruct_loop(
        problem.robot, [blind(r) for r in problem.recordings], reconstruct=True
    )
    changed = dataclasses.replace(problem, recordings=recordings, loop=loop)
    own, covered, found = median_error(changed, truth)
    assert own < 2.5 * error and covered > 0.8
    # in *fine* the sensor's noise hides the wrist's feedback: the law is declared, and said so
    assert bool(loop.feedback) == (scenario == "loop")
    assert ("virtual" in " ".join(w.message for w in found.warnings)) == (scenario == "fine")


def test_feedback_is_told_from_the_noise_in_the_loop():
    problem, _ = tx40_scenario("loop", 0)
    given = problem.loop.controller
    for j, own in enumerate(feedback_from_noise(problem.recordings[0], np.ones(6))):
        assert own.known
        assert own.kp == pytest.approx(given.kp[j], rel=2e-3)
        assert own.kd == pytest.approx(given.kd[j], rel=1e-4)


def test_a_slow_log_cannot_tell_a_law():
    problem, _ = tx40_scenario("loop", 0)
    slow = blind(problem.recordings[0])
    slow = dataclasses.replace(
        slow, q=slow.q[::100], tau=slow.tau[::100], rate=50.0, control_rate=None
    )
    with pytest.raises(IdentificationError, match="50 Hz is too slow"):
        reconstruct_loop(problem.robot, [slow], reconstruct=True)


def test_a_hidden_reference_must_be_asked_for():
    problem, _ = tx40_scenario("loop", 0)
    with pytest.raises(ExperimentError, match="q_ref"):
        reconstruct_loop(problem.robot, [blind(problem.recordings[0])])


@pytest.mark.record
def test_emps_with_the_law_identified_and_with_everything_hidden(public_data):
    robot, record = load_robot("emps"), load_emps()
    exact = Loop(
        Cascade(np.array([160.18]), np.array([243.45]), averaged=True), EMPS_GAIN, limit=10.0
    )
    reference = identify(Problem(robot, (record,), exact), "piv")
    recordings, loop = reconstruct_loop(robot, [record], None, False, EMPS_GAIN, 10.0)
    with_law = identify(Problem(robot, recordings, loop), "piv")
    assert abs(with_law.value("m1r") - reference.value("m1r")) < reference.std[0]
    recordings, loop = reconstruct_loop(robot, [blind(record)], None, True, EMPS_GAIN, 10.0)
    hidden = identify(Problem(robot, recordings, loop), "piv")
    assert hidden.converged
    for k in range(3):  # M, Fv, Fc
        spread = max(hidden.std[k], reference.std[k])
        assert abs(hidden.theta[k] - reference.theta[k]) < 2 * spread
    assert "cannot be identified" in " ".join(w.message for w in hidden.warnings)


@pytest.mark.record
def test_tx40_with_everything_hidden_converges(public_data):
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40()
    recordings, loop = reconstruct_loop(robot, [record], reconstruct=True)
    (reference,) = loop.reconstructed
    assert reference.kind == "point_to_point" and len(reference.moves.moves) == 13
    assert reference.relative.max() < 3e-4
    names = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    found = identify(Problem(robot, recordings, loop, names), "piv")
    assert found.converged and found.iterations <= 8
    friction = [v for p, v in zip(found.parameters, found.theta, strict=True) if p.is_dissipative]
    assert min(friction) > 0
