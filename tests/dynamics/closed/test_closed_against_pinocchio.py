"""Accelerations of closed mechanisms against Pinocchio's dynamics with rigid constraints."""

import numpy as np
import pytest

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from tests.dynamics.closed.mechanisms import MECHANISMS, delta, five_bar, spatial_loop, states
from tests.forward_dynamics import acceleration

pin = pytest.importorskip("pinocchio")

CASES = {
    "five bar": lambda: five_bar(rotor=0.0),
    "delta": lambda: delta(rotor=0.0),
    "ball": MECHANISMS["ball"],
    "ball of a prism": lambda: spatial_loop(11, "point", 3),
    "weld": MECHANISMS["weld"],
    "weld on the base": lambda: spatial_loop(6, "full", 2, on_base=True),
}

#: Regularisation of its equations, which repeated steps take away again.
PROXIMAL = (1e-13, 1e-6, 200)


def pinocchio_twin(robot):
    """The tree as a model, and its closures as rigid constraints."""
    tree, model, rigid = robot.tree, pin.Model(), pin.StdVec_RigidConstraintModel()
    model.gravity.linear = tree.gravity
    for joint, link in zip(tree.joints, tree.links, strict=True):
        kind = pin.JointModelPZ() if joint.kind == "prismatic" else pin.JointModelRZ()
        place = pin.SE3(joint.rotation, joint.translation)
        index = model.addJoint(joint.parent + 1, kind, place, joint.name)
        xx, xy, xz, yy, yz, zz, mx, my, mz, m = link.inertia
        if m:
            ten = np.array([m, mx, my, mz, xx, xy, yy, xz, yz, zz])
            model.appendBodyToJoint(
                index, pin.Inertia.FromDynamicParameters(ten), pin.SE3.Identity()
            )
    for closure in robot.constraints.closures:
        kind = pin.ContactType.CONTACT_6D if closure.kind == "full" else pin.ContactType.CONTACT_3D
        (first, second), frames = closure.links, closure.frames
        one, other = (pin.SE3(frame.rotation, frame.translation) for frame in frames)
        rigid.append(
            pin.RigidConstraintModel(
                kind, model, first + 1, one, second + 1, other, pin.ReferenceFrame.LOCAL
            )
        )
    return model, rigid


def begin(model, data, rigid, rigid_data):
    """Room for its equations; Pinocchio 3 makes the data of the constraints itself."""
    try:
        pin.initConstraintDynamics(model, data, rigid, rigid_data)
    except TypeError:
        pin.initConstraintDynamics(model, data, rigid)


@pytest.mark.parametrize("name", CASES)
def test_accelerations_are_those_of_its_constrained_dynamics(name):
    robot = CASES[name]()
    model, rigid = pinocchio_twin(robot)
    data, rigid_data = model.createData(), pin.StdVec_RigidConstraintData()
    rigid_data.extend(c.createData() for c in rigid)
    begin(model, data, rigid, rigid_data)
    parameters = standard_parameters(robot)
    theta = nominal_values(robot, parameters)
    friction = np.zeros(robot.tree.size)
    for p, value in zip(parameters, theta, strict=True):
        if p.stem == "fv":
            friction[p.joint] = value
    q, dq, _ = states(robot, 12, 5, speed=2.0)
    tau = np.random.default_rng(6).uniform(-10.0, 10.0, q.shape)
    ours = acceleration(robot, parameters, theta, q, dq, tau)
    chains, places = ClosedChains(robot), list(robot.places)
    for own, x, v, t in zip(ours, q, dq, tau, strict=True):
        motion = chains.motion(x[:, None], v[:, None], own[:, None])
        force = -friction * motion.dq[:, 0]
        force[places] += t
        settings = pin.ProximalSettings(*PROXIMAL)
        theirs = pin.constraintDynamics(
            model, data, motion.q[:, 0], motion.dq[:, 0], force, rigid, rigid_data, settings
        )
        np.testing.assert_allclose(
            motion.ddq[:, 0], theirs, rtol=0, atol=1e-8 * np.abs(theirs).max()
        )


@pytest.mark.parametrize("name", CASES)
def test_torques_are_projections_of_its_recursion(name):
    robot = CASES[name]()
    model, _ = pinocchio_twin(robot)
    data = model.createData()
    parameters = tuple(p for p in standard_parameters(robot) if p.is_inertial)
    theta = nominal_values(robot, parameters)
    q, dq, ddq = states(robot, 20, 9, speed=2.0)
    ours = regressor_of(robot, parameters).torque(q, dq, ddq, theta)
    chains = ClosedChains(robot)
    for own, x, v, a in zip(ours, q, dq, ddq, strict=True):
        motion = chains.motion(x[:, None], v[:, None], a[:, None])
        whole = pin.rnea(model, data, motion.q[:, 0], motion.dq[:, 0], motion.ddq[:, 0])
        theirs = motion.gain[:, :, 0].T @ whole
        np.testing.assert_allclose(own, theirs, rtol=0, atol=1e-11 * max(1.0, abs(whole).max()))
