"""Friction that falls as a gear warms up is found on motion that was not fitted, and no other."""

import numpy as np
import pytest

from pivident.data.logs.log import Log
from pivident.judgement.audit.friction_drift import friction_drifts
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.timing import check_timing
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_log

ROBOT = load_robot("planar_2r")


def warming(course, fall):
    """Time, positions and torques of the planar arm whose friction falls by a share.

    ``course``: from 0 to 1, shape (samples,); ``fall``: share, by joint.
    """
    rows = planar_log()
    t, q, tau = rows[:, 0], np.radians(rows[:, 1:3]), rows[:, 5:7]
    dq = np.gradient(q, t, axis=0)
    known = ROBOT.friction_nominal
    friction = np.column_stack(
        [known[f"fv{j + 1}"] * dq[:, j] + known[f"fc{j + 1}"] * np.sign(dq[:, j]) for j in (0, 1)]
    )
    return t, q, tau - np.asarray(fall) * course[:, None] * friction


def model_of(t, q, tau):
    channels = {"q": q, "tau": tau}
    log = Log("log", ROBOT.joint_names, {}, {"t": t}, logged=channels, channels=channels,
              robot=ROBOT)  # fmt: skip
    return build_inverse_model(log, check_timing(log))


@pytest.mark.parametrize("fall", [0.05, 0.1, 0.3])
def test_the_change_is_that_of_the_friction(fall):
    course = np.linspace(0.0, 1.0, 8000)
    model = model_of(*warming(course, [fall, fall]))
    shoulder, elbow = friction_drifts(model, 25.0 + 15.0 * course)
    for drift in (shoulder, elbow):
        assert drift.change == pytest.approx(-fall, rel=0.25) and drift.gain > 0.5
        assert f"friction of {drift.joint} falls by" in str(drift)


def test_one_joint_warms_and_the_other_does_not():
    course = np.linspace(0.0, 1.0, 8000) ** 0.5
    model = model_of(*warming(course, [0.0, 0.2]))
    assert [d.joint for d in friction_drifts(model, np.column_stack([course, course]))] == ["elbow"]


def test_steady_friction_and_a_temperature_that_stands_still_change_nothing():
    model = model_of(*warming(np.zeros(8000), [0.0, 0.0]))
    assert friction_drifts(model, np.linspace(0.0, 1.0, 8000)) == ()
    assert friction_drifts(model, np.full(8000, 30.0)) == ()
