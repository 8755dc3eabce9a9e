"""Faults of known size are named first and measured; without one nothing is named."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.estimation.identify import identify
from pivident.foundation.errors import IdentificationError
from pivident.judgement.model_errors.cause import Cause, RecordMotion
from pivident.judgement.model_errors.corrections import (
    CORRECTED,
    INSTEAD,
    corrections,
    kinds_of,
    with_corrections,
)
from pivident.judgement.model_errors.coupling_errors import COUPLED
from pivident.judgement.model_errors.named_causes import (
    is_found,
    missing_causes,
    named_causes,
    score_tests,
)
from pivident.judgement.model_errors.score_tests import Score
from pivident.judgement.model_errors.time_errors import WARMTH, Instants, time_causes

from .faulty_tx40 import causes, right_estimate, right_problem, with_fault, with_uneven_friction

FAULTS = {
    "delay: torques logged later than positions": [0.2],
    "torque gain of joint_3: excess of the logged torques": [5.0],
    "gear ratio of joint_3: excess of the assumed ratio": [2.0],
    "zero position of joint_2: correction of the zero position": [0.1],
    "geometry of joint_3: correction of the length along x from joint_2 to joint_3": [1.0],
    "geometry of joint_3: correction of the angle about x from joint_2 to joint_3": [0.1],
    "encoder of joint_2: correction of the encoder once per turn of the motor": [0.2, 0.1],
    "position scale of joint_2: correction of the scale of the positions": [0.5],
}


def test_right_model_has_no_cause():
    found = named_causes(right_problem()[0], right_estimate())
    assert found.named == ()
    assert found.tried == len(causes())


@pytest.mark.parametrize("name", FAULTS)
def test_fault_is_named_first_with_its_size(name):
    problem = with_fault(causes()[name], FAULTS[name])
    result = identify(problem, "piv")
    found = named_causes(problem, result)
    first = found.named[0]
    assert str(first.cause) == name
    assert np.all(np.abs(first.score.size - FAULTS[name]) < 0.1 * np.max(FAULTS[name]))
    assert first.score.explained > 0 and first.score.unseen > 0
    np.testing.assert_array_equal(first.changes[0], first.score.shift)
    if first.matters:
        truth = right_problem()[1]
        estimates = (result.theta, result.theta + first.changes[0])
        far, near = (np.max(np.abs(theta - truth) / result.std) for theta in estimates)
        assert near < max(6.0, 0.5 * far)


@pytest.mark.parametrize("late", [15.0, 40.0])
def test_torques_that_are_late_by_many_samples_are_named_with_the_delay(late):
    """A delay is believed as long as the motion hardly changes meanwhile, not up to 8 ms."""
    problem, _ = right_problem()
    (recording,) = problem.recordings
    samples = round(1e-3 * late * recording.rate)
    tau = np.concatenate([np.repeat(recording.tau[:1], samples, 0), recording.tau[:-samples]])
    problem = replace(problem, recordings=(replace(recording, tau=tau),))
    (first, *_) = named_causes(problem, identify(problem, "ls")).named
    assert str(first.cause) == "delay: torques logged later than positions"
    assert abs(first.score.size[0] - late) < max(3.0 * first.score.std[0], 0.1 * late)


def test_friction_that_grows_along_the_travel_is_named_with_its_size():
    problem = with_uneven_friction(1, 2.0)
    (first, *_) = named_causes(problem, identify(problem, "piv")).named
    assert str(first.cause) == "uneven friction of joint_2: along the travel"
    assert np.all(np.abs(first.score.size - [2.0, 0.0]) < 0.2)


def test_what_is_alike_is_said():
    """Fewer parameters than the robot has: what is left out looks like a wrong zero position."""
    name = "zero position of joint_5: correction of the zero position"
    problem = with_fault(causes()[name], [1.0])
    found = identify(problem, "piv")
    (first, *_) = named_causes(problem, found).named
    known = [str(first.cause), *map(str, first.alternatives)]
    assert name in known
    tests = score_tests(problem, found)
    numbers = [[str(cause) for cause in tests.causes].index(one) for one in known]
    start, *fits = (tests.fit(tests.columns(own)).theta for own in ([], *([k] for k in numbers)))
    expected = [fit[: start.size] - start for fit in fits]
    scale = np.abs(start).max()
    np.testing.assert_allclose(first.changes, expected, rtol=1e-6, atol=1e-8 * scale)


@pytest.mark.parametrize("name", ["delay: torques logged later than positions"])
def test_corrected_with_the_estimate(name):
    size = FAULTS[name]
    problem = with_fault(causes()[name], size)
    made = corrections(problem, "piv", ["delay"])
    (cause,) = made.causes
    value, std = made.of(cause)
    assert str(cause) == name
    assert np.abs(value - size) < 4.0 * std
    assert std < 0.01
    found = with_corrections(identify(made.problem, "piv"), made)
    truth = right_problem()[1]
    assert np.mean(np.abs(found.theta - truth) < 2.0 * found.std) > 0.85
    assert found.warnings[0].topic == "correction"
    assert "0.2" in found.warnings[0].message and "ms" in found.warnings[0].message


def test_nothing_to_correct_leaves_the_problem():
    problem, _ = right_problem()
    made = corrections(problem, "piv", ["geometry"])
    assert made.causes == () and made.problem is problem
    found = right_estimate()
    assert with_corrections(found, made) is found


def test_kinds_that_cannot_be_corrected():
    problem, _ = right_problem()
    with pytest.raises(IdentificationError, match=r"unknown kind 'geometri'.*geometry"):
        corrections(problem, "ls", ["geometri"])
    with pytest.raises(IdentificationError, match=r"friction cannot be corrected.*pivident laws"):
        corrections(problem, "ls", ["friction"])
    assert kinds_of(["gear-ratio", "Torque_Gain"]) == ("gear ratio", "torque gain")


def test_an_estimate_from_a_file_has_no_signals(tmp_path):
    from pivident import load_identification

    right_estimate().save(tmp_path)
    stored = load_identification(tmp_path / "identification.json")
    with pytest.raises(IdentificationError, match="identify again"):
        score_tests(right_problem()[0], stored)


@pytest.mark.parametrize("method", ["ls", "iv"])
def test_decimated_estimates_are_tested_too(method):
    name = "torque gain of joint_3: excess of the logged torques"
    problem = with_fault(causes()[name], [5.0])
    (first, *_) = named_causes(problem, identify(problem, method)).named
    assert str(first.cause) == name
    assert abs(first.score.size[0] - 5.0) < 0.5


def test_every_kind_is_corrected_or_says_what_to_do_instead():
    able = {cause.kind for cause in causes().values() if cause.correct is not None}
    others = {cause.kind for cause in causes().values()} - able
    # the arm of these tests has no force sensor
    assert able == set(CORRECTED) - {"wrench frame", "wrench gain"}
    # a load in one recording needs several; coupled joints and changes are counted apart
    changes = {c.kind for c in time_causes(right_problem()[0].robot, Instants((1.0,), (), (), 1.0))}
    # and friction by temperature needs one
    assert others == set(INSTEAD) - {"payload", COUPLED, WARMTH} - changes


def test_a_column_that_others_hide_stays_out_of_the_correction():
    """About y the axis of the second joint turns as its own zero position and the first do."""
    name = "geometry of joint_2: correction of the direction of its axis from joint_1 to joint_2"
    problem = with_fault(causes()[name], [0.1, 0.0])
    found = identify(problem, "piv")
    tests = score_tests(problem, found, ["geometry"])
    number = [str(cause) for cause in tests.causes].index(name)
    columns = tests.columns([number])
    assert columns.size == tests.sums.parameters + 1
    made = corrections(problem, "piv", ["geometry"])
    total = sum(cause.count for cause in made.causes)
    assert made.size.shape == (total,) and np.isfinite(made.covariance).all()
    assert np.isfinite(with_corrections(identify(made.problem, "piv"), made).std).all()


def test_the_size_of_a_load_is_its_mass():
    """A mass at the flange of the second recording alone: m, then its first moments."""
    problem, _ = right_problem()
    (load,) = (
        cause
        for cause in missing_causes(problem.robot, problem.regressor.parameters, ["one", "two"])
        if cause.kind == "payload"
    )
    rng = np.random.default_rng(5)
    q, dq, ddq = rng.uniform(-1.0, 1.0, (3, 6, 5))
    motion = RecordMotion(problem.regressor, right_estimate().theta, q, dq, ddq, 100.0, 1)
    mass = next(p for p in standard_parameters(problem.robot) if p.name == "m6")
    expected = Regressor.build(problem.robot, [mass]).matrix(q.T, dq.T, ddq.T)[:, :, 0].T
    np.testing.assert_allclose(load.columns(motion)[0], expected)
    assert load.by_first and load.unit == "kg"
    assert not load.columns(replace(motion, number=0)).any()


@pytest.mark.parametrize(
    ("unseen", "least", "found"),
    [(0.05, 0.0, False), (0.11, 0.0, True), (0.15, 0.1, False), (0.25, 0.1, True)],
)
def test_what_foretells_much_needs_less_certainty(unseen, least, found):
    """Beyond what it has to foretell, as ties of many columns have to anyway."""
    cause = Cause("kind", "", "what", "", lambda motion: motion.q, least=least)
    score = Score(cause, np.ones(1), np.eye(1), 5e-5, 0.3, unseen, np.zeros(1))
    assert is_found(score, 100) is found  # 0.005 among all of them
    assert is_found(replace(score, significance=5e-6), 100)
    assert not is_found(replace(score, significance=5e-4), 100)
