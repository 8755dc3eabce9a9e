"""Descriptions of mechanisms with closed loops: equations, assembly, and what is refused."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, strategies as st

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.closed_chains import assembled, closed_robot, equations
from pivident.robot.constraints import DIRECTIONS, Closure, LinearConstraint
from tests.dynamics.closed.mechanisms import (
    MECHANISMS,
    UPRIGHT,
    at,
    delta,
    five_bar,
    hinge,
    parallelogram,
    poses,
    random_body as body,
    spatial_loop,
    tree_of,
)

TIP = Closure("tip", (1, 3), (at(0.5, 0.0, 0.0), at(0.5, 0.0, 0.0)))
POSTURE = np.array([2.0, -1.2, 1.1, 1.2])


def gaps(tree, constraints, q):
    """What stays open, from the poses of the links: vectors in the first frame, and cosines."""
    placed, values = poses(tree, q), []
    for closure in constraints.closures:
        first, second = (
            placed[link] @ frame if link >= 0 else frame
            for link, frame in zip(closure.links, closure.frames, strict=True)
        )
        between = first.rotation.T @ second.rotation
        values += list(first.rotation.T @ (first.translation - second.translation))
        values += [between[a, b] for a, b in DIRECTIONS[closure.kind]]
    values += [one.ratios @ q - one.offset for one in constraints.linear]
    return np.array(values)


@pytest.mark.parametrize("name", MECHANISMS)
def test_equations_are_what_stays_open_and_its_differences(name):
    robot = MECHANISMS[name]()
    tree, constraints = robot.tree, robot.constraints
    rng, step = np.random.default_rng(0), 1e-6
    for _ in range(5):
        q = constraints.posture + rng.uniform(-0.8, 0.8, tree.size)
        value, slope = equations(tree, constraints, q)
        assert len(value) == len(constraints.names)
        np.testing.assert_allclose(value, gaps(tree, constraints, q), rtol=0, atol=1e-14)
        differences = [
            (gaps(tree, constraints, q + step * e) - gaps(tree, constraints, q - step * e))
            / (2.0 * step)
            for e in np.eye(tree.size)
        ]
        np.testing.assert_allclose(slope, np.transpose(differences), rtol=0, atol=1e-9)


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_posture_of_the_description_closes_all_loops(name):
    robot = MECHANISMS[name]()
    value = gaps(robot.tree, robot.constraints, robot.constraints.posture)
    np.testing.assert_allclose(value, 0.0, atol=1e-12)


@given(st.floats(-0.25, 0.25), st.floats(-0.25, 0.25))
def test_an_assembly_closes_the_loop_and_leaves_the_independent_joints(one, two):
    robot = five_bar()
    wanted = robot.constraints.posture + np.array([one, 0.3, two, -0.3])
    q = assembled(robot.tree, robot.constraints, wanted)
    assert (q[[0, 2]] == wanted[[0, 2]]).all()
    np.testing.assert_allclose(gaps(robot.tree, robot.constraints, q), 0.0, atol=1e-12)


@pytest.mark.parametrize("name", ["hinge", "weld", "hinge on the base"])
def test_a_full_closure_holds_a_frame_and_a_hinge_its_axis(name):
    robot = MECHANISMS[name]()
    (loop,) = robot.constraints.closures
    turns = []
    for shift in (0.0, 0.04, -0.03):
        start = robot.constraints.posture.copy()
        start[list(robot.places)] += shift
        placed = poses(robot.tree, assembled(robot.tree, robot.constraints, start))
        first, second = (
            placed[link] @ frame if link >= 0 else frame
            for link, frame in zip(loop.links, loop.frames, strict=True)
        )
        np.testing.assert_allclose(first.translation, second.translation, rtol=0, atol=1e-12)
        between = first.rotation.T @ second.rotation
        np.testing.assert_allclose(between[:, 2], [0.0, 0.0, 1.0], rtol=0, atol=1e-12)
        turns.append(np.arctan2(between[1, 0], between[0, 0]))
    if loop.kind == "full":
        np.testing.assert_allclose(turns, 0.0, atol=1e-12)
    else:
        assert np.ptp(turns) > 1e-3


def test_the_tree_of_a_closed_robot_is_the_tree_it_was_made_of():
    robot = delta()
    tree = robot.tree
    assert robot.joint_names == ("arm1", "arm2", "arm3") and robot.places == (0, 3, 6)
    assert tree.joint_names == (
        *(f"{name}{k}" for k in (1, 2, 3) for name in ("arm", "fork", "rod")),
        *"xyz",
    )
    assert [j.parent for j in tree.joints] == [-1, 0, 1, -1, 3, 4, -1, 6, 7, -1, 9, 10]
    assert [link.is_body for link in tree.links] == [True, False, True] * 3 + [False, False, True]
    np.testing.assert_array_equal(tree.rotor_inertia, [0.02, 0, 0] * 3 + [0, 0, 0])
    assert tree.constraints is None and tree.tree is tree
    assert robot.label(3) == "[arm2]" and not robot.is_chain


@pytest.mark.parametrize(
    ("robot", "kept", "redundant"),
    [
        (five_bar(kind="point"), 2, ("1 of 'tip'",)),
        (five_bar(kind="axis"), 2, ("3 of 'tip'",)),
        (parallelogram(kind="axis"), 2, ("3 of 'corner'",)),
        (delta(), 9, ()),
        (spatial_loop(0, "axis"), 5, ()),
        (spatial_loop(0, "full"), 6, ()),
    ],
    ids=["ball", "hinge", "parallelogram", "delta", "spatial hinge", "spatial weld"],
)
def test_equations_that_follow_from_others_are_found_and_said(robot, kept, redundant):
    constraints = robot.constraints
    assert len(constraints.kept) == kept == robot.tree.size - robot.size
    assert constraints.redundant == redundant
    slope = equations(robot.tree, constraints, constraints.posture)[1]
    others = [i for i in range(robot.tree.size) if i not in robot.places]
    assert np.linalg.matrix_rank(slope) == kept
    assert np.linalg.matrix_rank(slope[np.ix_(constraints.kept, others)]) == kept


@pytest.mark.parametrize(("turn", "kept"), [(UPRIGHT, (0, 2)), (UPRIGHT[:, [1, 2, 0]], (1, 2))])
def test_the_equation_across_the_plane_is_the_one_that_is_left_out(turn, kept):
    frame = at(0.5, 0.0, 0.0, rotation=turn)
    robot = closed_robot(
        five_bar_tree(), ["a1", "b1"], [replace(TIP, frames=(frame, frame))], posture=POSTURE
    )
    assert robot.constraints.kept == kept
    np.testing.assert_allclose(
        robot.constraints.posture, five_bar().constraints.posture, rtol=0, atol=1e-12
    )


def five_bar_tree():
    return five_bar().tree


def test_a_loop_that_does_not_close_names_the_gap():
    short = Closure("tip", (1, 3), (at(0.05, 0.0, 0.0), at(0.05, 0.0, 0.0)))
    elbows = [c * np.array([np.cos(q), np.sin(q)]) for c, q in ((0.4, 2.0), (0.4, 1.1))]
    apart = np.linalg.norm(elbows[1] + [0.3, 0.0] - elbows[0])
    with pytest.raises(RobotDescriptionError, match="loop 'tip' does not close: ") as caught:
        closed_robot(five_bar_tree(), ["a1", "b1"], [short], posture=POSTURE)
    assert "only passive joints may move (a2, b2)" in str(caught.value)
    said = float(str(caught.value).split("its ends are ")[1].split(" m apart")[0])
    assert 0.7 * (apart - 0.1) < said < 1.5 * (apart - 0.1)


def test_the_loop_that_stays_open_most_is_the_one_that_is_named():
    robot = delta()
    loops = list(robot.constraints.closures)
    far = at(0.0, 0.0, 2.0)
    loops[1] = replace(loops[1], name="torn", frames=(loops[1].frames[0], far))
    with pytest.raises(RobotDescriptionError, match="loop 'torn' does not close"):
        closed_robot(robot.tree, robot.joint_names, loops, posture=robot.constraints.posture)


def test_a_posture_of_another_length_is_refused():
    with pytest.raises(RobotDescriptionError, match=r"4 positions.*shape \(2,\)"):
        closed_robot(five_bar_tree(), ["a1", "b1"], [TIP], posture=np.zeros(2))


def test_an_unknown_independent_joint_is_named_with_the_nearest():
    with pytest.raises(RobotDescriptionError, match=r"no joint 'crank1'; known are 'a1', 'a2'"):
        closed_robot(five_bar_tree(), ["a1", "crank1"], [TIP], posture=POSTURE)


@pytest.mark.parametrize(
    ("names", "message"),
    [(["a1", "a1"], "independent joints are a1, a1; name each once"), ([], "are missing")],
)
def test_independent_joints_are_named_once_each(names, message):
    with pytest.raises(RobotDescriptionError, match=message):
        closed_robot(five_bar_tree(), names, [TIP], posture=POSTURE)


def test_a_joint_by_name_and_by_number_is_named_twice():
    with pytest.raises(RobotDescriptionError, match="independent joints are a1, 1; name each"):
        closed_robot(five_bar_tree(), ["a1", "1"], [TIP], posture=POSTURE)


def test_a_joint_that_nothing_determines_is_named():
    tree = five_bar_tree()
    rng = np.random.default_rng(0)
    loose = tree_of(
        "with a tail",
        (*tree.joints, hinge("tail", 1, (0.2, 0.0, 0.0))),
        (*tree.links, replace(tree.links[0], name="T", inertia=body(rng))),
    )
    with pytest.raises(RobotDescriptionError, match="nothing determines tail at the posture"):
        closed_robot(loose, ["a1", "b1"], [TIP], posture=np.append(POSTURE, 0.0))
    robot = closed_robot(loose, ["a1", "b1", "tail"], [TIP], posture=np.append(POSTURE, 0.0))
    assert robot.size == 3


def test_too_few_independent_joints_leave_joints_that_nothing_determines():
    with pytest.raises(RobotDescriptionError, match="nothing determines a2, b1, b2"):
        closed_robot(five_bar_tree(), ["a1"], [TIP], posture=POSTURE)


def test_more_independent_joints_than_the_loops_leave_free_are_refused():
    posture = five_bar().constraints.posture
    with pytest.raises(RobotDescriptionError, match=r"a1, a2, b1.*fewer independent joints"):
        closed_robot(five_bar_tree(), ["a1", "a2", "b1"], [TIP], posture=posture)


def test_a_hinge_out_of_the_plane_holds_a_planar_loop():
    tilted = at(0.5, 0.0, 0.0, rotation=UPRIGHT)
    loop = Closure("bent", (1, 3), (at(0.5, 0.0, 0.0), tilted), "axis")
    with pytest.raises(RobotDescriptionError, match=r"'bent' does not close: its axes are 90° off"):
        closed_robot(five_bar_tree(), ["a1", "b1"], [loop], posture=POSTURE)


def test_two_proportions_that_contradict_are_refused():
    tree = MECHANISMS["geared"]().tree
    ratios = np.array([0.0, -0.7, 1.0])
    for unit in (np.degrees(1.0), 1.0):  # in degrees the gap is still one in radians
        belts = [
            LinearConstraint(name, unit * ratios, unit * rest)
            for name, rest in (("belt", 0.3), ("brake", 0.4))
        ]
        said = r"gear '(belt|brake)' does not hold: joint 'g3' is 0\.05 rad off; check its ratios"
        with pytest.raises(RobotDescriptionError, match=said):
            closed_robot(tree, ["g1", "g2"], linear=belts)
    same = [belts[0], replace(belts[0], name="second belt", ratios=2.0 * ratios, offset=0.6)]
    robot = closed_robot(tree, ["g1", "g2"], linear=same)
    assert len(robot.constraints.redundant) == 1
    assert robot.constraints.posture[2] == pytest.approx(0.3)


def test_a_four_bar_that_is_stretched_is_a_singular_posture_to_start_from():
    tree = parallelogram().tree
    loop = Closure("corner", (1, 2), (at(0.7, 0.0, 0.0), at(0.4, 0.0, 0.0)))
    with pytest.raises(RobotDescriptionError, match="not singular"):
        closed_robot(tree, ["crank"], [loop], posture=np.zeros(3))
