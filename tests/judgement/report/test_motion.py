"""The motion that a page replays: the recorded one, small, without holes."""

import json
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from pivident.judgement.report.motion import MAX_POSITIONS, joint_ranges, motion_values
from pivident.robot.gallery import load_robot
from tests.robot.kinematics import link_poses
from tests.synthetic_identification import synthetic_identification


@pytest.fixture(scope="module")
def identification():
    return synthetic_identification(samples=4000)


def positions(values, recording):
    """Positions of a replay, on the instants of a recording."""
    q = np.array(values["recordings"][0]["q"])
    t = recording.t - recording.t[0]
    instants = np.linspace(0.0, t[-1], q.shape[1])
    return np.stack([np.interp(t, instants, column) for column in q], axis=1)


def test_replay_is_the_recorded_motion(identification):
    recording = identification.recordings[0]
    values = motion_values(identification.robot, identification.recordings)
    error = positions(values, recording) - recording.q_measured
    assert np.abs(error).max() < 5e-3  # rad, of an amplitude of one
    assert values["recordings"][0]["duration"] == pytest.approx(3.999)
    json.dumps(values, allow_nan=False)


def test_samples_that_are_missing_are_bridged(identification):
    recording = identification.recordings[0]
    q = recording.q_measured.copy()
    q[100:130, 0] = np.nan
    q[:, 1] = np.nan
    values = motion_values(identification.robot, [replace(recording, q_measured=q)])
    found = positions(values, recording)
    assert np.abs(found[:, 0] - recording.q_measured[:, 0]).max() < 2e-2
    assert (found[:, 1] == 0.0).all()


def test_long_recordings_stay_small(identification):
    recording = identification.recordings[0]
    slow = replace(recording, t=1000.0 * recording.t)
    values = motion_values(identification.robot, [slow] * 3)
    total = sum(len(q) for own in values["recordings"] for q in own["q"])
    assert 0.9 * MAX_POSITIONS < total <= MAX_POSITIONS


def test_robot_is_complete(identification):
    values = motion_values(identification.robot, identification.recordings)
    for own, joint in zip(values["joints"], identification.robot.joints, strict=True):
        np.testing.assert_allclose(np.reshape(own["rotation"], (3, 3)), joint.rotation, atol=1e-9)
        np.testing.assert_allclose(own["translation"], joint.translation, atol=1e-6)
    assert values["tip"][0] is None and len(values["tip"][1]) == 3
    assert np.dot(values["up"], identification.robot.gravity) < 0.0
    floating = identification.robot.with_gravity(np.zeros(3))
    assert motion_values(floating, identification.recordings)["up"] == [0.0, 0.0, 1.0]


def test_ranges_are_the_motion_in_words(identification):
    recording = identification.recordings[0]
    first = joint_ranges(identification, recording)[0]
    assert (first.name, first.unit) == ("shoulder", "rad")
    assert first.low == recording.q_measured[:, 0].min()
    assert first.high == recording.q_measured[:, 0].max()
    assert first.speed == np.abs(recording.dq[:, 0]).max()


def test_loops_are_drawn_closed():
    robot = load_robot("delta")
    q = np.tile(robot.constraints.posture[list(robot.places)], (50, 1))
    t = np.linspace(0.0, 1.0, 50)
    values = motion_values(robot, [SimpleNamespace(name="still", t=t, q_measured=q)])
    assert values["rows"] == list(robot.places) and len(values["ends"]) == 6
    poses = link_poses(robot.tree, robot.constraints.posture)
    ends = [(poses[link] @ [*point, 1.0])[:3] for link, *point in values["ends"]]
    for first, second in zip(ends[::2], ends[1::2], strict=True):
        np.testing.assert_allclose(first, second, atol=1e-5)
    assert not any(values["tip"][link] for link, *_ in values["ends"])


def test_axes_of_a_measured_base_are_not_drawn():
    robot = load_robot("quadruped")
    still = SimpleNamespace(
        name="still", t=np.linspace(0.0, 1.0, 20), q_measured=np.zeros((20, 18))
    )
    values = motion_values(robot, [still])
    assert [joint["axis"] for joint in values["joints"]] == [False] * 6 + [True] * 12
    # legs hang on the trunk, whose last joint is none
    assert [joint["way"] for joint in values["joints"]][6:9] == [True, True, True]
