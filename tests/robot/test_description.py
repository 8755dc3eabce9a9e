from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.description import Coupling, Joint, Link, Robot
from pivident.robot.friction import FrictionLaw, coulomb, viscous
from pivident.robot.gallery import load_robot
from pivident.robot.transmission import Transmission

DOWN = np.array([0.0, 0.0, -9.81])


def joint(name, parent, **fields):
    return Joint(name, fields.pop("kind", "revolute"), parent, np.eye(3), np.zeros(3), **fields)


def robot(*joints, **fields):
    n = len(joints)
    values = {
        "name": "test",
        "joints": joints,
        "links": tuple(Link(j.name) for j in joints),
        "gravity": DOWN,
        "rotor_inertia": np.zeros(n),
        "transmission": Transmission.direct(n),
    }
    return Robot(**(values | fields))


def test_a_tree_knows_its_ancestors_and_that_it_is_not_a_chain():
    tree = robot(joint("a", -1), joint("b", 0), joint("c", 0), joint("d", 2))
    assert tree.ancestors(3) == (3, 2, 0)
    assert not tree.is_chain
    assert robot(joint("a", -1), joint("b", 0)).is_chain


def test_parameters_of_a_chain_are_numbered_and_those_of_a_tree_are_named():
    assert robot(joint("a", -1), joint("b", 0)).label(1) == "2"
    assert robot(joint("a", -1), joint("b", -1)).label(1) == "[b]"


def test_open_slopes_follow_from_each_joints_rated_speed():
    law = FrictionLaw((viscous(), coulomb()))
    arm = robot(joint("fast", -1, rated_speed=10.0), joint("slow", 0, rated_speed=1.0))
    arm = arm.with_friction(law)
    assert [j.friction.terms[1].gamma for j in arm.joints] == [75.0, 750.0]


def test_a_slope_that_is_given_stays():
    arm = robot(joint("a", -1, rated_speed=10.0)).with_friction(FrictionLaw((coulomb(gamma=150),)))
    assert arm.joints[0].friction.terms[0].gamma == 150


def test_unknown_rated_speeds_are_nan():
    assert np.isnan(robot(joint("a", -1)).rated_speeds).all()


def test_the_mounting_can_be_changed():
    tilted = robot(joint("a", -1)).with_gravity([9.81, 0, 0])
    np.testing.assert_array_equal(tilted.gravity, [9.81, 0, 0])


BAD_ROBOTS = {
    "no moving joint": lambda: robot(),
    "one of each per joint": lambda: robot(joint("a", -1), links=()),
    "used twice: a": lambda: robot(joint("a", -1), joint("a", 0)),
    "kind 'screw' is not supported": lambda: robot(joint("a", -1, kind="screw")),
    "parent 1 does not precede it": lambda: robot(joint("a", 1), joint("b", 0)),
    "not orthonormal": lambda: robot(replace(joint("a", -1), rotation=2 * np.eye(3))),
    "matrix is not orthonormal": lambda: robot(
        replace(joint("a", -1), rotation=np.eye(3) * np.nan)
    ),
    "translation .* is not finite": lambda: robot(
        replace(joint("a", -1), translation=np.array([np.inf, 0, 0]))
    ),
    "rated speed must be positive": lambda: robot(joint("a", -1, rated_speed=0.0)),
    "torque limit must be positive": lambda: robot(joint("a", -1, torque_limit=-3.0)),
    "empty position range": lambda: robot(joint("a", -1, position_limits=(1.0, -1.0))),
    "empty position range .*nan": lambda: robot(joint("a", -1, position_limits=(0.0, np.nan))),
    "inertia is not finite": lambda: robot(joint("a", -1), links=(Link("a", np.full(10, np.nan)),)),
    "three finite numbers": lambda: robot(joint("a", -1), gravity=np.zeros(2)),
    "two different joints": lambda: robot(joint("a", -1), couplings=(Coupling(0, 0),)),
}


@pytest.mark.parametrize("message", BAD_ROBOTS)
def test_a_robot_that_is_no_tree_with_proper_frames_is_refused(message):
    with pytest.raises(RobotDescriptionError, match=message):
        BAD_ROBOTS[message]()


def test_the_friction_of_a_robot_is_told_joint_by_joint_where_it_differs():
    arm = load_robot("planar_2r")
    assert arm.friction_text() == "fv dq + fc (2/π) atan(γ dq) + off, γ = 238.7, 179 s/rad"
    hard = arm.joints[1].with_friction(FrictionLaw((coulomb("sign"),)))
    mixed = replace(arm, joints=(arm.joints[0], hard))
    assert mixed.friction_text() == (
        "shoulder: fv dq + fc (2/π) atan(γ dq) + off, γ = 238.7 s/rad; elbow: fc sign(dq)"
    )


def test_links_are_found_by_name_joint_and_number():
    made = robot(joint("a", -1), joint("b", 0), links=(Link("arm"), Link("a")))
    assert [made.link_index(name) for name in ("arm", "a", "b", "1", "2")] == [0, 1, 1, 0, 1]
    for wrong in ("amr", "0", "3"):
        with pytest.raises(RobotDescriptionError, match=f"no link {wrong!r}"):
            made.link_index(wrong)
    with pytest.raises(RobotDescriptionError, match="'arm'"):
        made.link_index("amr")
