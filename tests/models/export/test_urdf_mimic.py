"""URDF of joints that follow others: Pinocchio, MuJoCo and pivident's reader."""

from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.foundation.errors import ExportError, RobotDescriptionError
from pivident.models.export.load_back import verify_with_mujoco, verify_with_pinocchio
from pivident.models.export.urdf import to_urdf
from pivident.models.exported import random_states
from pivident.models.runnable_model import runnable_model
from pivident.robot.closed_chains import closed_robot, proportions
from pivident.robot.constraints import LinearConstraint
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf
from tests.dynamics.closed.mechanisms import geared
from tests.models.export.robots import with_values
from tests.robot.test_mimic import FOLLOWS, arm

FREE = arm("").replace('<limit lower="-2" upper="2"', "<limit")


def coupled(text, rules, names):
    """A robot of the arm of three joints in which some follow others: rows of ratios, offsets."""
    tree = parse_urdf(text)
    linear = [LinearConstraint(f"gear {k}", np.array(r), off) for k, (r, off) in enumerate(rules)]
    return closed_robot(tree, names, linear=linear)


ROBOTS = {
    "mimic": lambda: parse_urdf(arm(FOLLOWS)),
    "geared": geared,
    "turning without limit": lambda: coupled(
        FREE.replace('type="revolute"', 'type="continuous"'),
        [([0.0, 2.0, 1.0], 0.4)],
        ["j0", "j1"],
    ),
    "a chain of followers": lambda: coupled(
        arm(""), [([1.0, -2.0, 0.0], 0.1), ([0.0, 3.0, -1.0], 0.2)], ["j0"]
    ),
    "a slide that a nut moves": lambda: coupled(
        arm("").replace('"j2" type="revolute"', '"j2" type="prismatic"'),
        [([0.0, -0.01, 1.0], 0.02)],
        ["j0", "j1"],
    ),
    "one that stands still": lambda: coupled(arm(""), [([0.0, 1.0, 0.0], 0.3)], ["j0", "j2"]),
    "with friction": lambda: parse_urdf(arm(FOLLOWS)).with_friction(
        {"j2": FrictionLaw((viscous(), coulomb()))}
    ),
}


@pytest.mark.parametrize("name", ROBOTS)
def test_pinocchio_and_mujoco_have_the_models_torques(name):
    model = with_values(ROBOTS[name]())
    file = to_urdf(model)
    for verify in (verify_with_pinocchio, verify_with_mujoco):
        verified = verify(file, model)
        assert verified.agrees or "seven digits" in verified.skipped, verified
    assert verify_with_pinocchio(file, model).agrees


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_comes_back_with_its_motion_and_torques(name):
    model = with_values(ROBOTS[name]())
    back = parse_urdf(to_urdf(model).content, gravity=model.robot.gravity)
    followers = set(model.robot.tree.joint_names) - set(model.robot.joint_names)
    assert {joint.name for joint in back.passive_joints} == followers
    place = [model.robot.tree.joint_names.index(name) for name in back.tree.joint_names]
    own = [model.robot.joint_names.index(name) for name in back.joint_names]
    q, dq, ddq = random_states(model.robot, 20)
    one = ClosedChains(model.robot).motion(q.T, dq.T, ddq.T)
    two = ClosedChains(back).motion(q.T[own], dq.T[own], ddq.T[own])
    np.testing.assert_allclose(one.q[place], two.q, rtol=0, atol=1e-12)
    np.testing.assert_allclose(one.gain[place][:, own], two.gain, rtol=0, atol=1e-12)
    again = runnable_model(back)
    ours = model.regressor.torque(q, dq, ddq, rigid(model))[:, own]
    theirs = again.regressor.torque(q[:, own], dq[:, own], ddq[:, own], rigid(again))
    np.testing.assert_allclose(ours, theirs, rtol=0, atol=1e-10 * np.abs(ours).max())


def rigid(model):
    """Values of the links alone."""
    return np.where([p.is_inertial for p in model.parameters], model.values, 0.0)


def test_the_original_keeps_its_followers_byte_for_byte():
    text = arm(FOLLOWS)
    model = with_values(parse_urdf(text))
    file = to_urdf(model, text.encode())
    assert FOLLOWS in file.text
    assert verify_with_pinocchio(file, model).agrees
    wrong = replace(file, content=file.content.replace(b'multiplier="-0.5"', b'multiplier="-0.6"'))
    assert not verify_with_pinocchio(wrong, model).agrees
    assert not verify_with_mujoco(wrong, model).agrees


def test_an_original_with_other_followers_is_refused():
    model = with_values(parse_urdf(arm(FOLLOWS)))
    with pytest.raises(ExportError, match=r"another robot: its joints mimic others"):
        to_urdf(model, arm(FOLLOWS.replace("-0.5", "0.5")).encode())


def test_a_frozen_joint_beside_a_follower_is_kept():
    text = arm(FOLLOWS)
    robot = parse_urdf(text, frozen={"j0": 0.4})
    model = with_values(robot, mass=30.0)  # heavier than the nominal bodies behind the joint
    file = to_urdf(model, text.encode())
    assert verify_with_pinocchio(file, model, frozen={"j0": 0.4}).agrees
    assert verify_with_mujoco(file, model, frozen={"j0": 0.4}).agrees


def test_followers_are_read_by_pinocchio_as_such():
    file = to_urdf(with_values(ROBOTS["a chain of followers"]()))
    loaded = pin.buildModelFromXML(file.text, mimic=True)
    assert (loaded.nv, loaded.nvExtended) == (1, 3)


def test_a_leader_behind_its_follower_is_read_by_mujoco_alone():
    model = with_values(coupled(arm(""), [([0.0, 2.0, 1.0], 0.4)], ["j0", "j2"]))
    file = to_urdf(model)
    assert "not in the kinematic tree" in verify_with_pinocchio(file, model).skipped
    assert verify_with_mujoco(file, model).agrees


def test_what_mimic_cannot_say_is_refused_with_the_next_step():
    scara, bar = with_values(load_robot("scara")), with_values(load_robot("five_bar"))
    with pytest.raises(ExportError, match=r"'lift' follows 'screw_nut' and 'spline_nut'.*as MJCF"):
        to_urdf(scara)
    with pytest.raises(
        RobotDescriptionError, match=r"closed loops.*URDF.*export it as MJCF, or as"
    ):
        to_urdf(bar)


def test_proportions_of_followers_of_followers():
    gain, rest = proportions(ROBOTS["a chain of followers"]())
    np.testing.assert_allclose(gain[:, 0], [1.0, 0.5, 1.5])
    np.testing.assert_allclose(rest, [0.0, -0.05, -0.15 - 0.2])
    assert proportions(load_robot("five_bar")) is None
    gain, rest = proportions(load_robot("planar_2r"))
    np.testing.assert_array_equal(gain, np.eye(2))
    np.testing.assert_array_equal(rest, np.zeros(2))
