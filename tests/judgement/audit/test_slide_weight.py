"""A vertical slide carries its weight, whichever way it counts."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.logs.torque_scale import ASSUMED, TorqueScale
from pivident.judgement.audit.recording_audit import recording_faults
from tests.judgement.audit.scara import arm, recording

ONE = np.ones(3)


def said(robot, record):
    return [
        (f.severity, f.kind, f.subject)
        for f in recording_faults(robot, [record])
        if f.topic == "power"
    ]


@pytest.mark.parametrize("slide", ["0 0 1", "0 0 -1", "1 0 0"])
def test_a_right_log_is_left_as_it_is(slide):
    assert said(arm(slide), recording(arm(slide), ONE)) == []


@pytest.mark.parametrize("slide", ["0 0 1", "0 0 -1"])
def test_a_slide_that_counts_the_other_way_is_named(slide):
    record, sign = recording(arm(slide), ONE), np.array([1.0, 1.0, -1.0])
    assert said(arm(slide), replace(record, q=sign * record.q, tau=sign * record.tau)) == [
        ("error", "weight", "slide")
    ]


def test_a_weight_that_something_else_carries_is_named():
    robot = arm("0 0 1")
    record = recording(robot, ONE)
    lifted = replace(record, tau=record.tau - np.array([0.0, 0.0, 2.0 * 9.81]))
    assert said(robot, lifted) == [("warning", "weight", "slide")]


def test_a_load_is_no_fault_and_an_unknown_gain_says_nothing():
    robot = arm("0 0 1")
    record = recording(robot, ONE)
    loaded = replace(record, tau=record.tau + np.array([0.0, 0.0, 3.0 * 9.81]))
    assert said(robot, loaded) == []
    scale = (TorqueScale("slide", "A", ASSUMED),)
    assert said(robot, replace(record, tau=record.tau * [1.0, 1.0, 0.2], torque_scale=scale)) == []
