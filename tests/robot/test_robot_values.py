import copy
import json
from dataclasses import fields, is_dataclass, replace

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.friction import FrictionLaw
from pivident.robot.gallery import gallery_names, load_robot
from pivident.robot.robot_values import robot_of_values, robot_values
from tests.dynamics.friction_laws import LAWS
from tests.robot.random_robots import random_robot


def same(a, b) -> bool:
    """Whether two objects are equal to the last bit, arrays and their kinds included."""
    if is_dataclass(a):
        names = [f.name for f in fields(a)]
        return type(a) is type(b) and all(same(getattr(a, k), getattr(b, k)) for k in names)
    if isinstance(a, np.ndarray):
        return a.dtype == b.dtype and np.array_equal(a, b)
    if isinstance(a, tuple):
        return isinstance(b, tuple) and len(a) == len(b) and all(map(same, a, b))
    return type(a) is type(b) and a == b


def through_json(robot):
    return robot_of_values(json.loads(json.dumps(robot_values(robot), allow_nan=False)))


@pytest.mark.parametrize("name", gallery_names())
def test_gallery_comes_back_exactly(name):
    robot = load_robot(name)
    assert same(robot, through_json(robot))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_random_trees_come_back_exactly(seed):
    robot = random_robot(seed)
    assert same(robot, through_json(robot))


@pytest.mark.parametrize("name", LAWS)
def test_every_law_comes_back_exactly(name):
    robot = load_robot("planar_2r").with_friction(FrictionLaw(LAWS[name]))
    assert same(robot, through_json(robot))
    for term in robot.joints[0].friction.terms:
        assert len(term.shapes) in term.column.shape_counts


def test_numpy_numbers_are_plain_numbers():
    robot = load_robot("staubli_tx40")
    coupling = replace(robot.couplings[0], motor=np.int64(5), ratio=np.float64(1.0))
    loose = replace(robot, couplings=(coupling,))
    assert json.dumps(robot_values(loose)) == json.dumps(robot_values(robot))


def test_robot_that_no_file_can_hold_is_refused():
    robot = replace(load_robot("planar_2r"), rotor_inertia=np.array([0.1, np.nan]))
    with pytest.raises(RobotDescriptionError, match=r"robot 'planar 2R': rotor_inertia\.1"):
        robot_values(robot)


def changed(path, value):
    content = copy.deepcopy(robot_values(load_robot("staubli_tx40")))
    *above, last = path
    place = content
    for part in above:
        place = place[part]
    if value is KeyError:
        del place[last]
    else:
        place[last] = value
    return content


TERM = {"stem": "x", "function": "stribeck", "smoothing": "sign", "gamma": None, "shapes": []}


@pytest.mark.parametrize(
    ("path", "value", "message"),
    [
        (["gravity", 2], "9.81", "gravity.2 = '9.81': must be a valid number"),
        (["gravity"], [0.0, 0.0], "gravity = .*at least 3"),
        (["gravity", 0], float("nan"), "gravity.0 = nan: must be a finite number"),
        (["joints"], [], "joints = .*at least 1"),
        (["joints", 0, "kind"], "screw", "joints.0.kind = 'screw': must be 'revolute' or"),
        (["joints", 0, "speed"], 1.0, "joints.0.speed = 1.0: extra inputs"),
        (["joints", 0, "name"], KeyError, "joints.0.name: field required"),
        (["joints", 1, "parent"], 4, "parent 4 does not precede"),
        (["joints", 1, "rotation", 0, 0], 2.0, "not orthonormal"),
        (["joints", 1, "rotation", 0], [1.0], "joints.1.rotation.0"),
        (["joints", 1, "rated_speed"], -1.0, "rated speed must be positive"),
        (["joints", 1, "rated_speed"], float("nan"), "not NaN"),
        (["joints", 1, "position_limits"], [1.0, 1.0], "empty position range"),
        (["joints", 1, "name"], "joint_1", "used twice"),
        (["joints", 1, "name"], "x" * 2000, "joints.1.name: string should have at most 1000"),
        (["joints", 0, "friction", 0], TERM, "has 0 constants of shape; it needs 2"),
        (["joints", 0, "friction", 0, "function"], "coulmb", "did you mean 'coulomb'"),
        (["joints", 0, "friction", 0, "stem"], "fc", "named twice"),
        (["joints", 0, "friction", 1, "gamma"], -1.0, "gamma of 'fc' must be positive"),
        (["links"], [], "0 links"),
        (["links"], [{"name": "a", "inertia": [0.0] * 10}] * 1001, "links: .*at most 1000"),
        (["links", 0, "inertia"], [0.0] * 9, "links.0.inertia = .*at least 10"),
        (["rotor_inertia"], [0.0], r"rotor_inertia = \[0.0\]: has shape \(1,\); 6 joints need"),
        (["couplings", 0, "motor"], 9, "coupling of motor 10"),
        (["couplings", 0, "motor"], True, "couplings.0.motor"),
        (["transmission", "reduction"], [[1.0]], "reduction = .*6 joints need shape .6, 6"),
        (["transmission", "reduction", 0, 0], 0.0, "singular"),
        (["transmission", "gain_given"], [True], "gain_given = .*6 joints need"),
        (["transmission", "drive_gain"], [1.0], "drive_gain = .*6 joints need"),
        (["urdf"], {"path": "a", "sha256": "0", "frozen": {}}, "urdf.sha256"),
    ],
)
def test_bad_values_are_named(path, value, message):
    with pytest.raises(RobotDescriptionError, match=message):
        robot_of_values(changed(path, value))


@pytest.mark.parametrize("content", [None, [], "robot", {}, {"name": 3}])
def test_what_is_no_robot_is_refused(content):
    with pytest.raises(RobotDescriptionError):
        robot_of_values(content)


def test_a_mechanism_that_was_stored_open_is_refused():
    content = robot_values(load_robot("five_bar"))
    content["constraints"]["posture"][1] += 0.01
    with pytest.raises(RobotDescriptionError, match=r"loop 'tip' does not close: its ends are"):
        robot_of_values(content)
