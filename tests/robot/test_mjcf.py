"""Robots read from MJCF, against MuJoCo's own dynamics, and what is refused."""

import re

import mujoco
import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.experiment.file_keys import RobotEntry
from pivident.experiment.init.kept_joints import robot_file
from pivident.experiment.robot_table import robot_of
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.gallery import load_robot
from pivident.robot.mjcf import read_mjcf
from pivident.robot.mjcf_actuators import actuator_law
from tests.forward_dynamics import acceleration

#: Signs without smoothing would add MuJoCo's dry friction; only the linear part is compared.
STATES = 5


def random_mjcf(rng, bodies):
    """A tree of bodies with no, one or two joints each, turned and shifted at random."""
    spec = mujoco.MjSpec()
    spec.modelname = "tree"
    spec.option.gravity = rng.uniform(-10, 10, 3)
    made, joints = [spec.worldbody], 0
    for b in range(bodies):
        parent = made[int(rng.integers(len(made)))]
        body = parent.add_body(name=f"b{b}", pos=rng.uniform(-1, 1, 3), quat=rng.normal(size=4))
        moments = rng.uniform(0.5, 1.0, 3)
        body.mass, body.inertia, body.explicitinertial = rng.uniform(0.5, 3.0), moments, True
        body.ipos, body.iquat = rng.uniform(-0.3, 0.3, 3), unit(rng.normal(size=4))
        for _ in range(1 if b == 0 else int(rng.integers(3))):
            slides = rng.random() < 0.3
            joint = body.add_joint(
                name=f"j{joints}",
                type=mujoco.mjtJoint.mjJNT_SLIDE if slides else mujoco.mjtJoint.mjJNT_HINGE,
                pos=rng.uniform(-0.3, 0.3, 3),
                axis=unit(rng.normal(size=3)),
                ref=rng.uniform(-1, 1),
                armature=rng.uniform(0, 0.5),
                frictionloss=rng.uniform(0, 1),
            )
            joint.damping[0] = rng.uniform(0, 2)
            if rng.random() < 0.3:
                joint.stiffness[0], joint.springref = rng.uniform(1, 5), rng.uniform(-1, 1)
            joints += 1
        made.append(body)
    spec.compiler.degree = False
    return spec


def unit(v):
    return v / np.linalg.norm(v)


def engine(model, names, q, dq, ddq):
    """Inverse dynamics and mass matrices of MuJoCo, dry friction and limits left out."""
    model.opt.disableflags |= mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
    data = mujoco.MjData(model)
    at_q = [model.joint(name).qposadr[0] for name in names]
    at_v = [model.joint(name).dofadr[0] for name in names]
    tau, mass = np.empty_like(q), np.empty((len(q), len(names), len(names)))
    for k in range(len(q)):
        data.qpos[at_q], data.qvel[at_v], data.qacc[at_v] = q[k], dq[k], ddq[k]
        mujoco.mj_inverse(model, data)
        tau[k] = data.qfrc_inverse[at_v]
        full = np.zeros((model.nv, model.nv))
        mujoco.mj_fullM(model, data, full)
        mass[k] = full[np.ix_(at_v, at_v)]
    return tau, mass


def without_dry_friction(robot):
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    values[[p.stem == "fc" for p in parameters]] = 0.0
    return parameters, values


def written(spec, folder):
    path = folder / "robot.xml"
    spec.compile()
    path.write_text(spec.to_xml())
    return path


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_have_mujocos_dynamics(tmp_path_factory, seed):
    rng = np.random.default_rng(seed)
    path = written(random_mjcf(rng, int(rng.integers(1, 7))), tmp_path_factory.mktemp("tree"))
    robot = read_mjcf(path)
    q, dq, ddq = rng.uniform(-2, 2, (3, STATES, robot.size))
    model = mujoco.MjModel.from_xml_path(str(path))
    tau, mass = engine(model, robot.joint_names, q, dq, ddq)
    parameters, values = without_dry_friction(robot)
    ours = Regressor.build(robot, parameters).torque(q, dq, ddq, values)
    scale = 1.0 + np.abs(tau).max()
    np.testing.assert_allclose(ours, tau, rtol=0, atol=1e-9 * scale)
    np.testing.assert_allclose(
        mass_matrix(robot, parameters, values, q), mass, rtol=0, atol=1e-9 * scale
    )
    back = acceleration(robot, parameters, values, q, dq, tau)
    np.testing.assert_allclose(back, ddq, rtol=0, atol=1e-8 * scale)


def test_frozen_joints_hold_their_position(tmp_path):
    rng = np.random.default_rng(3)
    spec = random_mjcf(rng, 6)
    path = written(spec, tmp_path)
    whole = read_mjcf(path)
    held = {whole.joint_names[1]: 0.4}
    kept = [name for name in whole.joint_names if name not in held]
    robot = read_mjcf(path, joints=kept, frozen=held)
    q, dq, ddq = np.zeros((3, STATES, whole.size))
    moving = [whole.joint_names.index(name) for name in kept]
    q[:, 1] = 0.4
    for channel in (q, dq, ddq):
        channel[:, moving] = rng.uniform(-2, 2, (STATES, len(kept)))
    model = mujoco.MjModel.from_xml_path(str(path))
    tau, _ = engine(model, whole.joint_names, q, dq, ddq)
    parameters, values = without_dry_friction(robot)
    ours = Regressor.build(robot, parameters).torque(
        q[:, moving], dq[:, moving], ddq[:, moving], values
    )
    np.testing.assert_allclose(ours, tau[:, moving], rtol=0, atol=1e-9 * (1 + np.abs(tau).max()))


ARM = """<mujoco model="arm"><compiler angle="radian"/>{option}
<worldbody><body name="base"{body}>{root}<inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/>
<body name="l1" pos="0 0 .1"><joint name="a" axis="0 1 0" range="-1 2" armature=".1" damping=".2"
frictionloss=".3"/><geom type="capsule" size=".02 .1"/>
<body name="l2"><joint name="b" axis="1 0 0"/><geom type="sphere" size=".1"/></body></body></body>
</worldbody>{more}</mujoco>"""


def arm(folder, option="", body="", root="", more=""):
    path = folder / "arm.xml"
    path.write_text(ARM.format(option=option, body=body, root=root, more=more))
    return path


def test_joint_properties_are_nominal_values(tmp_path):
    robot = load_robot(arm(tmp_path))
    assert robot.joint_names == ("a", "b")
    assert robot.joints[0].position_limits == (-1.0, 2.0)
    np.testing.assert_allclose(robot.rotor_inertia, [0.1, 0.0])
    assert robot.friction_nominal == {"fv1": 0.2, "fc1": 0.3}


LAWS = """<default><default class="stiff"><position kp="30" kv="1.5" forcerange="-7 7"/></default>
</default><actuator><position class="stiff" name="pa" joint="a" gear="-2" ctrlrange="-1 3"/>
<velocity joint="a" kv="0.5"/><general name="gb" joint="b" gear="0.5" gainprm="40" biastype="affine"
biasprm="3 -80 -4"/></actuator>"""


def test_the_law_of_actuators_is_the_torque_of_mujoco(tmp_path):
    path = arm(tmp_path, more=LAWS)
    law = actuator_law(path, ("a", "b"))
    assert not law.reasons
    model = mujoco.MjModel.from_xml_path(str(path))
    data, rng = mujoco.MjData(model), np.random.default_rng(1)
    for _ in range(20):
        data.qpos, data.qvel, command, speed = rng.uniform(-0.1, 0.1, (4, 2))
        data.ctrl = [command[0], speed[0], command[1]]
        mujoco.mj_forward(model, data)
        q_ref = np.array([-0.5, 1.0]) * command + [0.0, 0.075]  # as the notes say
        dq_ref = np.array([speed[0] * (law.servo[0] > 0.0), 0.0])
        torque = law.kp * (q_ref - data.qpos) - law.kd * data.qvel + law.servo * dq_ref
        np.testing.assert_allclose(data.qfrc_actuator, torque, rtol=0, atol=1e-12)
    said = " ".join(law.notes)
    assert "actuator 'pa' holds -0.5 times its control (joint 'a')" in said
    assert "actuator 'gb' holds 1 times its control +0.075 (joint 'b')" in said
    assert "actuator 'number 2' is one of several" in said
    np.testing.assert_allclose(law.limit, [14.0, np.inf])
    np.testing.assert_allclose(law.reach[0], [-1.5, 0.5])
    assert law.speed_feed_forward(with_speeds=False) == 0.0
    assert law.speed_feed_forward(with_speeds=True) is None  # another share at each joint


@pytest.mark.parametrize(
    ("actuators", "says"),
    [
        ('<motor name="m" joint="b" gear="3"/>', "'m' is a motor.* 3 N m.*joint 'b'"),
        (
            '<velocity name="v" joint="b" kv="1"/>',
            "'b' follows a speed and no position, of .*'v'",
        ),
        ('<intvelocity name="i" joint="b" kp="9"/>', "'i' has dyntype=integrator.*joint 'b'"),
        ('<position name="l" joint="b" timeconst="0.1"/>', "'l' has dyntype=filter.*joint 'b'"),
        (
            '<position joint="b"/><position joint="b"/>',
            "'b' follows two commands, of .*number 2.* and .*number 3",
        ),
        ("", "no actuator moves joint 'b'"),
    ],
)
def test_actuators_that_are_no_position_loop_are_named(tmp_path, actuators, says):
    path = arm(tmp_path, more=f'<actuator><position joint="a" kp="5"/>{actuators}</actuator>')
    law = actuator_law(path, ("a", "b"))
    (reason,) = law.reasons
    assert re.search(says, reason), reason
    assert law.kp.tolist() == [5.0, 0.0]


def test_actuators_of_tendons_and_of_other_joints_are_no_law_of_a_joint(tmp_path):
    more = """<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>
    <actuator><position joint="a" kp="5"/><motor name="m" tendon="t"/><motor joint="b"/>
    </actuator>"""
    law = actuator_law(arm(tmp_path, more=more), ("a",))
    assert not law.reasons and law.kp.tolist() == [5.0]
    assert law.notes == ("actuator 'm' acts on a tendon and is in no law",)


def test_a_floating_base_can_be_held(tmp_path):
    path = arm(tmp_path, root='<freejoint name="root"/>')
    assert read_mjcf(path).joint_names[6:] == ("a", "b")
    assert read_mjcf(path, frozen={"root": 0.0}).joint_names == ("a", "b")
    with pytest.raises(RobotDescriptionError, match="can only be frozen at 0"):
        read_mjcf(path, frozen={"root": 1.0})


@pytest.mark.parametrize(
    ("given", "says"),
    [
        ({"root": '<joint name="s" type="ball"/>'}, "joint 's': a ball joint.*freeze it"),
        (
            {"more": '<tendon><fixed name="t"><joint joint="a" coef="1"/></fixed></tendon>'},
            "tendons .t.*remove <tendon>",
        ),
        ({"option": '<option density="1.2"/>'}, "fluid.*density = 1.2.*remove both"),
        ({"body": ' gravcomp="1"'}, "gravcomp = 1"),
        ({"more": "<nonsense/>"}, "MuJoCo refuses it"),
    ],
)
def test_what_is_no_tree_of_joints_is_refused(tmp_path, given, says):
    with pytest.raises(RobotDescriptionError, match=f"arm.xml: .*{says}"):
        read_mjcf(arm(tmp_path, **given))


def test_unknown_and_repeated_joints_are_refused(tmp_path):
    path = arm(tmp_path)
    with pytest.raises(RobotDescriptionError, match="no joint 'c'"):
        read_mjcf(path, joints=["c"])
    with pytest.raises(RobotDescriptionError, match="kept and frozen"):
        read_mjcf(path, joints=["a"], frozen={"a": 0.1})
    with pytest.raises(RobotDescriptionError, match="'b' is listed before 'a'"):
        read_mjcf(path, joints=["b", "a"])


MESHES = """<mujoco><asset><mesh name="m" file="none.stl"/></asset><worldbody><body name="l1">
<joint name="a"/>{inertial}<geom type="mesh" mesh="m"/></body></worldbody></mujoco>"""


def test_meshes_may_be_missing_where_inertias_are_written(tmp_path):
    path = tmp_path / "meshes.xml"
    inertial = '<inertial pos="0 0 .1" mass="2" diaginertia=".1 .1 .1"/>'
    path.write_text(MESHES.format(inertial=inertial))
    assert read_mjcf(path).links[0].inertia[9] == 2.0
    path.write_text(MESHES.format(inertial=""))
    with pytest.raises(RobotDescriptionError, match=r"none\.stl"):
        read_mjcf(path)


def test_an_experiment_file_names_an_mjcf(tmp_path):
    arm(tmp_path, root='<freejoint name="root"/>')
    entry = RobotEntry(model="arm.xml", joints=["a", "b"])
    assert robot_of(entry, tmp_path).joint_names == ("a", "b")


def test_pivident_init_chooses_joints_of_an_mjcf(tmp_path):
    path = arm(tmp_path, root='<freejoint name="root"/>')
    machine = robot_file(str(path), [tmp_path / "log.csv"])
    assert (machine.joint_names, machine.fixed) == (("a", "b"), ("root",))
    assert machine.robot(["b"]).joint_names == ("b",)
