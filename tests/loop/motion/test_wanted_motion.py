"""The motion that would determine a parameter, and which joints it is asked of."""

import numpy as np
import pytest

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.loop.motion.wanted_motion import (
    ACCELERATION,
    OWN_POSITION,
    POSTURE,
    SPEED,
    FullMotion,
    MotionLimits,
    motions_for,
)


def wanted(robot, names, used=0.0):
    """The motions for some parameters of a robot that used a share of what it can do."""
    base = base_parameters(robot)
    parameters = dict(zip(base.names, base.parameters, strict=True))
    rng = np.random.default_rng(4)
    q, dq, ddq = 0.01 * rng.standard_normal((3, 50, robot.size))
    limits = MotionLimits.of(robot, q, dq, ddq)
    limits.used[:] = used
    found = motions_for([parameters[n] for n in names], FullMotion.within(robot, limits), limits)
    return dict(zip(names, found, strict=True))


def test_a_turn_about_a_vertical_axis_is_no_posture_against_gravity():
    robot = pv.load_robot("staubli_tx40")
    found = wanted(robot, ["mx2r", "my2", "zz6", "fv3", "off4"])
    assert found["mx2r"].kind == POSTURE and found["mx2r"].joints == ("joint_2",)
    assert str(found["mx2r"]).startswith("let joint_2 hold more postures against gravity")
    assert found["zz6"].kind != POSTURE and "joint_6" in found["zz6"].joints
    assert (found["fv3"].kind, found["fv3"].joints) == (SPEED, ("joint_3",))
    # its column is constant: a motion both ways tells it from Coulomb friction
    assert (found["off4"].kind, found["off4"].joints) == (SPEED, ("joint_4",))


def test_joints_that_used_all_they_can_are_left_out():
    robot = pv.load_robot("staubli_tx40")
    used = np.zeros((robot.size, 3))
    used[1:4] = 0.9
    found = wanted(robot, ["mx4", "fv3"], used)
    assert set(found["mx4"].joints).isdisjoint({"joint_2", "joint_3", "joint_4"})
    assert found["fv3"].joints == ("joint_3",)  # nobody else can do it


@pytest.mark.parametrize("name", ["five_bar", "delta", "scara", "parallelogram_palletizer"])
def test_joints_of_mechanisms_are_those_with_a_motor(name):
    robot = pv.load_robot(name)
    names = base_parameters(robot).names
    motors = {joint.name for joint in robot.joints if joint.motion == "driven"}
    for parameter, motion in wanted(robot, names).items():
        assert motion.joints and set(motion.joints) <= motors, parameter


def test_what_a_joint_changes_alone_adds_up_to_the_acceleration_s_part():
    """Linear in ddq: columns of joints that accelerate alone sum up to those of all."""
    robot = pv.load_robot("mitsubishi_rv2sq")
    parameters = base_parameters(robot).parameters
    still = np.zeros((50, robot.size))
    full = FullMotion.within(robot, MotionLimits.of(robot, still - 0.1, still + 0.1, still + 0.1))
    parts, by_joint = full.parts(parameters), full.parts_by_joint(parameters)
    assert (by_joint[:, ACCELERATION].sum(axis=1) >= parts[:, ACCELERATION] * (1 - 1e-12)).all()
    alone = np.count_nonzero(by_joint[:, ACCELERATION], axis=1) == 1
    np.testing.assert_allclose(
        by_joint[alone, ACCELERATION].sum(axis=1), parts[alone, ACCELERATION], rtol=1e-12
    )
    assert not by_joint[:, POSTURE, 0].any()  # the first axis stands upright


def test_ripple_needs_slow_motion_of_its_own_joint():
    from pivident.robot.friction import FrictionLaw, ripple, viscous

    robot = pv.load_robot("planar_2r").with_friction(FrictionLaw((viscous(), *ripple(3.0))))
    names = [
        p.name
        for p in base_parameters(robot).parameters
        if p.friction is not None and p.friction.depends_on_position and p.joint == 1
    ]
    assert names
    for motion in wanted(robot, names).values():
        assert (motion.kind, motion.joints) == (OWN_POSITION, (robot.joints[1].name,))
