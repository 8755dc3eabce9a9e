"""Closed robots as plain values for a file, and back."""

import copy
import json

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.gallery import load_robot
from pivident.robot.robot_values import robot_of_values, robot_values


def stored(name):
    return json.loads(json.dumps(robot_values(load_robot(name)), allow_nan=False))


@pytest.mark.parametrize("name", ["five_bar", "delta", "scara"])
def test_a_closed_robot_comes_back_with_its_parameters(name):
    before, after = load_robot(name), robot_of_values(stored(name))
    assert base_parameters(before).expressions == base_parameters(after).expressions
    np.testing.assert_array_equal(before.constraints.posture, after.constraints.posture)
    assert [link.is_body for link in before.tree.links] == [x.is_body for x in after.tree.links]


@pytest.mark.parametrize(
    ("key", "value", "message"),
    [
        ("places", [0, 0], "constraints.places does not fit 2 joints and 2 passive"),
        ("places", [0, 9], "constraints.places does not fit"),
        ("posture", [0.0], "constraints.posture does not fit"),
        ("kept", [0, 7], "constraints.kept does not fit"),
        ("kept", [1, 0], "constraints.kept does not fit"),
        ("links", [], "constraints.links does not fit"),
        ("linear", [{"name": "x", "ratios": [1.0], "offset": 0.0}], "constraints.linear does not"),
        ("joints", [], "constraints.links does not fit 2 joints and 0 passive"),
        ("closures", [], "constraints.kept does not fit"),
        ("more", 1, "constraints.more"),
    ],
)
def test_values_that_do_not_belong_together_are_refused(key, value, message):
    content = copy.deepcopy(stored("five_bar"))
    content["constraints"][key] = value
    with pytest.raises(RobotDescriptionError, match=message):
        robot_of_values(content)


def test_a_link_that_is_not_there_is_refused():
    content = stored("five_bar")
    content["constraints"]["closures"][0]["links"] = [1, 4]
    with pytest.raises(RobotDescriptionError, match=r"constraints\.closures does not fit"):
        robot_of_values(content)


def test_a_frame_that_is_none_is_refused():
    content = stored("five_bar")
    content["constraints"]["closures"][0]["frames"][1]["rotation"][0][0] = 1.1
    with pytest.raises(RobotDescriptionError, match="rotation of a frame is not orthonormal"):
        robot_of_values(content)
