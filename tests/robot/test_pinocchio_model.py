"""Robots made from Pinocchio models: the robot of the same URDF, the torques of Pinocchio."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from pivident.robot.urdf import parse_urdf
from tests.robot.test_urdf_against_pinocchio import pinocchio_configuration, random_urdf

pin = pytest.importorskip("pinocchio")

FRICTIONLESS = FrictionLaw(())


def torque(robot, q, dq, ddq):
    """Inverse dynamics with nominal parameters, by joint name."""
    parameters = standard_parameters(robot)
    regressor = Regressor.build(robot, parameters)
    tau = regressor.torque(q, dq, ddq, nominal_values(robot, parameters))
    return dict(zip(robot.joint_names, tau.T, strict=True))


def pinocchio_torque(model, q, dq, ddq, names):
    data, rows = model.createData(), []
    index = [model.joints[model.getJointId(name)].idx_v for name in names]
    for k in range(len(q)):
        v, a = np.zeros(model.nv), np.zeros(model.nv)
        v[index], a[index] = dq[k], ddq[k]
        configuration = pinocchio_configuration(model, dict(zip(names, q[k], strict=True)))
        rows.append(pin.rnea(model, data, configuration, v, a)[index])
    return dict(zip(names, np.transpose(rows), strict=True))


@settings(max_examples=25, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_random_trees_need_the_same_torques(seed):
    rng = np.random.default_rng(seed)
    text = random_urdf(rng, int(rng.integers(1, 9)))
    model = pin.buildModelFromXML(text)
    model.armature = rng.uniform(0.0, 2.0, model.nv)
    model.gravity.linear = rng.normal(size=3)
    robot = Robot.from_pinocchio(model, FRICTIONLESS)
    read = parse_urdf(text, gravity=model.gravity.linear, friction=FRICTIONLESS)
    q, dq, ddq = rng.uniform(-2, 2, (3, 5, robot.size))
    ours = torque(robot, q, dq, ddq)
    theirs = pinocchio_torque(model, q, dq, ddq, robot.joint_names)
    order = [robot.joint_names.index(name) for name in read.joint_names]
    of_file = torque(read, *(x[:, order] for x in (q, dq, ddq)))
    for i, name in enumerate(robot.joint_names):
        np.testing.assert_allclose(ours[name], theirs[name], atol=1e-9, rtol=1e-9)
        rotor = robot.rotor_inertia[i] * ddq[:, i]
        np.testing.assert_allclose(ours[name] - rotor, of_file[name], atol=1e-9, rtol=1e-9)


def test_limits_friction_and_names_are_those_of_the_file():
    text = random_urdf(np.random.default_rng(3), 6).replace(
        "</joint>", '<dynamics damping="0.5" friction="0.25"/></joint>'
    )
    robot = Robot.from_pinocchio(pin.buildModelFromXML(text))
    read = parse_urdf(text)
    theirs = dict(zip(read.joint_names, zip(read.joints, read.links, strict=True), strict=True))
    assert robot.name == read.name and set(robot.joint_names) == set(read.joint_names)
    for joint, link in zip(robot.joints, robot.links, strict=True):
        same, body = theirs[joint.name]
        assert joint.kind == same.kind and link.name == body.name
        assert joint.position_limits == same.position_limits
        assert (joint.rated_speed, joint.torque_limit) == (same.rated_speed, same.torque_limit)
    assert set(robot.friction_nominal.values()) == {0.5, 0.25}
    assert len(robot.friction_nominal) == 2 * robot.size


def test_joints_about_any_axis_and_rotors_behind_gears():
    model = pin.Model()
    rng = np.random.default_rng(5)
    parent = 0
    for k, joint in enumerate(
        (
            pin.JointModelRevoluteUnaligned(0.6, 0.0, 0.8),
            pin.JointModelPrismaticUnaligned(0.0, -0.6, 0.8),
            pin.JointModelRUBY(),
            pin.JointModelPX(),
        )
    ):
        placement = pin.SE3(pin.rpy.rpyToMatrix(*rng.uniform(-3, 3, 3)), rng.normal(size=3))
        parent = model.addJoint(parent, joint, placement, f"j{k}")
        body = pin.Inertia.FromEllipsoid(2.0, 0.3, 0.2, 0.1)
        model.appendBodyToJoint(parent, body, pin.SE3(np.eye(3), rng.normal(size=3)))
    model.rotorInertia = np.full(4, 1e-4)
    model.rotorGearRatio = np.array([100.0, 50.0, 10.0, 1.0])
    robot = Robot.from_pinocchio(model, FrictionLaw((viscous(), coulomb())))
    assert [joint.kind for joint in robot.joints] == [
        "revolute",
        "prismatic",
        "revolute",
        "prismatic",
    ]
    np.testing.assert_allclose(robot.rotor_inertia, [1.0, 0.25, 0.01, 1e-4])
    assert all(j.position_limits is None and j.rated_speed is None for j in robot.joints)
    q, dq, ddq = rng.uniform(-2, 2, (3, 4, 4))
    ours = torque(robot, q, dq, ddq)
    theirs = pinocchio_torque(model, q, dq, ddq, robot.joint_names)
    for i, name in enumerate(robot.joint_names):
        expected = theirs[name] + robot.rotor_inertia[i] * ddq[:, i]
        np.testing.assert_allclose(ours[name], expected, atol=1e-9)


@pytest.mark.parametrize(
    ("joint", "message"),
    [
        (pin.JointModelFreeFlyer(), "'root' is a FreeFlyer joint.*only fixed bases"),
        (pin.JointModelSpherical(), "'root' is a Spherical joint.*buildReducedModel"),
        (pin.JointModelPlanar(), "'root' is a Planar joint.*buildReducedModel"),
        (pin.JointModelHX(0.1), "'root' is a HX joint"),
    ],
)
def test_other_joints_are_named_with_the_next_step(joint, message):
    model = pin.Model()
    model.addJoint(0, joint, pin.SE3.Identity(), "root")
    with pytest.raises(RobotDescriptionError, match=message):
        Robot.from_pinocchio(model)


def test_other_objects_are_refused():
    with pytest.raises(RobotDescriptionError, match=r"str is no pinocchio\.Model"):
        Robot.from_pinocchio("arm.urdf")
