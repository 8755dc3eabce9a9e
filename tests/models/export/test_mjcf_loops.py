"""MJCF of mechanisms with closed loops: MuJoCo's tree and constraints, and pivident's reader."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.models.export.load_back import verify_with_mujoco
from pivident.models.export.mjcf import to_mjcf
from pivident.models.exported import random_states
from pivident.models.runnable_model import runnable_model
from pivident.robot.closed_chains import closed_robot
from pivident.robot.constraints import Closure
from pivident.robot.frames import Pose
from pivident.robot.friction import FrictionLaw, offset, viscous
from pivident.robot.gallery import load_robot
from pivident.robot.mjcf import read_mjcf
from tests.dynamics.closed.mechanisms import MECHANISMS
from tests.models.export.robots import with_values

GALLERY = ("five_bar", "parallelogram_palletizer", "delta", "orthoglide", "scara")

ROBOTS = {name: lambda name=name: load_robot(name) for name in GALLERY} | MECHANISMS


def without_stops(robot):
    """Narrow ranges around the posture of the description, where loops close."""
    if all(joint.position_limits for joint in robot.joints):
        return robot
    middle = robot.constraints.posture[list(robot.places)]
    joints = tuple(
        replace(joint, position_limits=(at - 0.15, at + 0.15), rated_speed=2.0)
        for joint, at in zip(robot.joints, middle.tolist(), strict=True)
    )
    return replace(robot, joints=joints)


@pytest.mark.parametrize("name", ROBOTS)
def test_mujoco_has_the_models_torques_and_loops(name):
    model = with_values(without_stops(ROBOTS[name]()))
    verified = verify_with_mujoco(to_mjcf(model), model)
    assert verified.agrees and verified.states > 20, verified


@pytest.mark.parametrize("name", ROBOTS)
def test_a_robot_comes_back_with_its_motion_and_torques(name, tmp_path):
    model = with_values(without_stops(ROBOTS[name]()))
    robot, path = model.robot, tmp_path / "robot.xml"
    path.write_bytes(to_mjcf(model).content)
    passive = [joint.name for joint in robot.passive_joints]
    back = read_mjcf(path, joints=robot.joint_names)
    assert back.joint_names == robot.joint_names
    assert sorted(joint.name for joint in back.passive_joints) == sorted(passive)
    place = [robot.tree.joint_names.index(name) for name in back.tree.joint_names]
    q, dq, ddq = (x[:20] for x in random_states(robot, 60))
    ours, theirs = ClosedChains(robot), ClosedChains(back)
    for state in zip(q, dq, ddq, strict=True):
        one, two = (c.motion(*(x[:, None] for x in state)) for c in (ours, theirs))
        np.testing.assert_allclose(one.gain[place], two.gain, rtol=0, atol=1e-8)
        np.testing.assert_allclose(one.ddq[place], two.ddq, rtol=1e-7, atol=1e-7)
    again = runnable_model(back)
    one, two = (m.regressor.torque(q, dq, ddq, without_sharp_signs(m)) for m in (model, again))
    np.testing.assert_allclose(one, two, rtol=0, atol=1e-8 * np.abs(one).max())


def without_sharp_signs(model):
    """Values without what an MJCF has otherwise: dry friction, and offsets as a motor's bias."""
    left = [p.friction is not None and p.stem in ("fc", "off") for p in model.parameters]
    return np.where(left, 0.0, model.values)


def test_a_wrong_file_is_noticed():
    model = with_values(load_robot("five_bar"))
    file = to_mjcf(model)
    moved = replace(file, content=file.content.replace(b'pos="0.42 0 0"', b'pos="0.421 0 0"', 1))
    assert moved.content != file.content
    assert not verify_with_mujoco(moved, model).agrees
    open_loop = replace(
        file, content=file.content.replace(b"<connect ", b'<connect active="false" ')
    )
    assert not verify_with_mujoco(open_loop, model).agrees
    heavier = replace(file, content=file.content.replace(b'mass="', b'mass="1', 1))
    assert not verify_with_mujoco(heavier, model).agrees


def test_a_planar_loop_needs_one_connect_and_a_spatial_hinge_two():
    planar = mujoco.MjModel.from_xml_string(to_mjcf(with_values(load_robot("five_bar"))).text)
    assert planar.neq == 1
    hinge = MECHANISMS["hinge"]()
    spatial = mujoco.MjModel.from_xml_string(to_mjcf(with_values(hinge)).text)
    assert spatial.neq == 2


@pytest.mark.parametrize("name", ["hinge", "weld"])
@pytest.mark.parametrize("axis", [0, 2])
def test_frames_that_are_half_a_turn_apart_meet_as_they_do_in_the_model(name, axis):
    robot = MECHANISMS[name]()
    (loop,) = robot.constraints.closures
    one, two = loop.frames
    half = -np.eye(3)
    half[axis, axis] = 1.0
    turned = Closure(
        loop.name, loop.links, (one, Pose(two.rotation @ half, two.translation)), loop.kind
    )
    other = closed_robot(robot.tree, robot.joint_names, [turned], posture=robot.constraints.posture)
    model = with_values(without_stops(other))
    verified = verify_with_mujoco(to_mjcf(model), model)
    assert verified.agrees, verified


def test_friction_of_passive_joints_is_in_the_file_but_for_constant_torques():
    robot = load_robot("five_bar")
    robot = robot.with_friction({"left_elbow": FrictionLaw((viscous(), offset()))})
    model = with_values(robot)
    file = to_mjcf(model)
    assert set(file.left_out) == {"off[left_elbow]"}
    assert "no constant torque of a joint without a motor; apply it" in file.differences[0]
    assert any("off[left_elbow]" in sentence for sentence in file.differences)
    loaded = mujoco.MjModel.from_xml_string(file.text)
    assert loaded.dof_damping[loaded.joint("left_elbow").dofadr[0]] > 0.0
    assert loaded.nu == 2
    assert verify_with_mujoco(file, model).agrees


def test_frames_without_a_body_are_joints_of_the_next_one_or_almost_massless():
    delta = mujoco.MjModel.from_xml_string(to_mjcf(with_values(load_robot("delta"))).text)
    assert delta.body("platform").jntnum[0] == 3 and delta.body("rod_1").jntnum[0] == 2
    file = to_mjcf(with_values(load_robot("scara")))
    scara = mujoco.MjModel.from_xml_string(file.text)
    assert scara.body("screw_nut").mass[0] == 1e-12 and scara.ntendon == 1
    assert any("1e-12 kg are written for 'screw_nut', 'spline_nut'" in s for s in file.differences)


@pytest.mark.parametrize("name", ["five_bar", "delta", "scara"])
def test_mujoco_starts_closed_and_the_motors_hold_the_mechanism(name):
    robot = load_robot(name)
    model = with_values(robot)
    loaded = mujoco.MjModel.from_xml_string(to_mjcf(model).text)
    loaded.dof_frictionloss[:] = 0.0
    loaded.actuator_ctrllimited[:] = 0
    data = mujoco.MjData(loaded)
    rest = robot.constraints.posture[list(robot.places)][None]
    still = np.zeros_like(rest)
    data.ctrl[:] = model.torque(rest, still, still)[0]
    mujoco.mj_forward(loaded, data)
    assert np.abs(data.efc_pos[: data.ne]).max() < 1e-9
    start = data.qpos.copy()
    for _ in range(20):
        mujoco.mj_step(loaded, data)
    free = 0.5 * 9.81 * (20 * loaded.opt.timestep) ** 2
    assert np.abs(data.qpos - start).max() < 0.05 * free
    assert np.abs(data.efc_pos[: data.ne]).max() < 2e-5
