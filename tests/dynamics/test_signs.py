"""Reversed torques are told once, by joint or for the whole robot."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import load_experiment
from tests.planar_log import write_experiment


@pytest.fixture(scope="module")
def problem(tmp_path_factory):
    return load_experiment(write_experiment(tmp_path_factory.mktemp("log"))).problem()


def with_signs(problem, *signs):
    (record,) = problem.recordings
    turned = Recording("run", record.joint_names, record.q, record.tau * signs, record.rate)
    return Problem(problem.robot, (turned,))


def test_torques_with_their_own_sign_are_not_remarked_on(problem):
    assert identify(problem, "ls").warnings == ()


def test_all_torques_reversed_are_told_once(problem):
    (found,) = identify(with_signs(problem, -1.0, -1.0), "ls").warnings
    assert found.message.startswith("All signs are reversed") and "tau = -1.0" in found.next_step


def test_one_reversed_joint_is_named(problem):
    warnings = identify(with_signs(problem, 1.0, -1.0), "ls").warnings
    assert any("signs of elbow seem to be reversed" in w.message for w in warnings)
    assert not any(w.subject in ("fv2", "fc2") for w in warnings)


def test_a_single_negative_friction_keeps_its_own_remark(problem):
    robot = problem.robot
    few = replace(problem, parameters=("zz1", "zz2", "mx1", "mx2", "fv2"))
    found = identify(few, "ls")
    assert robot.size == 2
    turned = identify(replace(with_signs(problem, 1.0, -1.0), parameters=few.parameters), "ls")
    assert np.sign(found.value("fv2")) == 1.0
    (said,) = [w for w in turned.warnings if w.subject == "fv2"]
    assert said.message.startswith("fv2 = ") and said.evidence["fv2"].value < 0
