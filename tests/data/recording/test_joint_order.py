"""Joints of recordings are found by their names: permuted columns change nothing."""

from dataclasses import replace

import numpy as np
import pytest
from tests.planar_log import RATE, planar_log
from tests.planar_results import LAW

from pivident.data.recording.joint_order import in_order_of, reordered
from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError
from pivident.judgement.validation.held_out.cross_validation import cross_validate
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.gallery import load_robot
from pivident.studies.prediction.predict import predict

ROBOT = load_robot("planar_2r")


def record(start=0, stop=6000, names=ROBOT.joint_names):
    table = planar_log()[start:stop]
    q, q_ref = np.deg2rad(table[:, 1:3]), np.deg2rad(table[:, 3:5])
    valid = np.ones(q.shape, dtype=bool)
    valid[100:140, 1] = False
    inputs = {"added": np.column_stack([np.zeros(len(q)), np.ones(len(q))])}
    return Recording("run", names, q, table[:, 5:7], RATE, q_ref=q_ref, valid=valid, inputs=inputs)


def exchanged(recording):
    return reordered(recording, [1, 0])


def test_all_channels_change_places_together():
    beside = np.linspace(1.0, 2.0, 2 * record().samples).reshape(-1, 2)
    one = replace(record(), weights=beside, temperature=20.0 * beside)
    other = exchanged(one)
    assert other.joint_names == ("elbow", "shoulder")
    for mine, theirs in zip(one.channels().values(), other.channels().values(), strict=True):
        np.testing.assert_array_equal(mine, theirs[:, ::-1])
    for name in ("valid", "weights", "temperature"):
        np.testing.assert_array_equal(getattr(one, name), getattr(other, name)[:, ::-1])
    back = in_order_of(ROBOT, other)
    assert back.joint_names == ROBOT.joint_names
    np.testing.assert_array_equal(back.tau, one.tau)


@pytest.mark.parametrize("method", ["ls", "iv", "piv"])
def test_permuted_recordings_give_the_same_estimate(method):
    one, other = record(0, 3000), record(3000, 6000)
    loop = Loop(LAW)
    found = identify(Problem(ROBOT, (one, other), loop), method)
    again = identify(Problem(ROBOT, (exchanged(one), exchanged(other)), loop), method)
    np.testing.assert_allclose(again.theta, found.theta, rtol=1e-12)
    np.testing.assert_allclose(again.std, found.std, rtol=1e-12)
    assert [joint.name for joint in again.joints] == list(ROBOT.joint_names)


def test_prediction_and_held_out_motion_find_joints_by_name():
    one, other = record(), record(6000, 8000)
    problem = Problem(ROBOT, (one,), Loop(LAW))
    found = identify(problem, "ls")
    np.testing.assert_allclose(
        predict(found, exchanged(other)).tau_model, predict(found, other).tau_model, rtol=1e-12
    )
    held = cross_validate(problem, "ls", folds=3)
    again = cross_validate(replace(problem, recordings=(exchanged(one),)), "ls", folds=3)
    np.testing.assert_allclose(again.prediction.relative, held.prediction.relative, rtol=1e-12)


def test_joints_that_nobody_named_are_those_of_the_robot():
    one = record()
    plain = Recording.from_arrays(one.q, one.tau, RATE)
    assert plain.joint_names == ("joint_1", "joint_2")
    assert in_order_of(ROBOT, plain).joint_names == ROBOT.joint_names
    assert Problem(ROBOT, plain).recordings[0].joint_names == ROBOT.joint_names


@pytest.mark.parametrize(
    ("names", "said"),
    [
        (("shoulder", "wrist"), "shoulder, wrist, robot 'planar 2R' has shoulder, elbow; rename"),
        (("joint_2", "joint_1"), "joint_2, joint_1, robot 'planar 2R' has shoulder, elbow"),
        (("shoulder", "elbwo"), "elbwo may be elbow. Rename them .* joint_names=robot.joint_names"),
    ],
)
def test_other_names_are_refused_with_both_lists(names, said):
    named = record(names=names)
    for refused in (
        lambda: Problem(ROBOT, named),
        lambda: Problem(ROBOT, (record(), named)),
        lambda: predict(identify(Problem(ROBOT, record()), "ls"), named),
    ):
        with pytest.raises(ExperimentError, match=said):
            refused()


def test_a_column_too_many_is_counted():
    one = record()
    more = Recording.from_arrays(
        one.q[:, [0, 1, 1]], one.tau[:, [0, 1, 1]], RATE, joint_names=("shoulder", "elbow", "hand")
    )
    said = r"elbow, hand, robot .* \(3 joints instead of 2\); give one column for each joint"
    with pytest.raises(ExperimentError, match=said):
        Problem(ROBOT, more)
