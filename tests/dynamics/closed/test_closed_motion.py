"""Assembly, N and γ of closed mechanisms: other equations, differences, circles that intersect."""

import numpy as np
import pytest
from hypothesis import assume, given, settings, strategies as st

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.closed_chains.closure_equations import (
    find_drifts,
    find_gaps,
    find_slopes,
    place_closures,
)
from pivident.dynamics.closed_chains.closure_table import closure_table, closure_work
from pivident.foundation.compiled import kernel
from pivident.foundation.errors import LoopNotClosed
from pivident.robot.closed_chains import equations
from tests.dynamics.closed.mechanisms import (
    MECHANISMS,
    five_bar,
    parallelogram,
    poses,
    smooth_path,
    spatial_loop,
    start,
    states,
)

STEP = 2e-3


@kernel
def evaluate(table, work):
    place_closures(table, work)
    find_gaps(table, work)
    find_slopes(table, work)
    find_drifts(table, work)


def compiled_equations(robot, q, dq):
    """C, A and dA/dt dq of the kept equations by the kernel, anywhere."""
    table = closure_table(robot)
    work = closure_work(table)
    work.q[:], work.dq[:] = q, dq
    evaluate(table, work)
    return work.gap[0].copy(), work.jacobian.copy(), work.gap[1].copy()


def differentiated(values, step):
    """Derivative along the last axis by five points, two samples lost at either end."""
    return (
        values[..., :-4] - 8.0 * values[..., 1:-3] + 8.0 * values[..., 3:-1] - values[..., 4:]
    ) / (12.0 * step)


@pytest.mark.parametrize("name", MECHANISMS)
def test_both_sets_of_equations_are_one_wherever_the_loops_are_open(name):
    robot = MECHANISMS[name]()
    kept = list(robot.constraints.kept)
    rng = np.random.default_rng(1)
    for _ in range(10):
        q = robot.constraints.posture + rng.uniform(-0.7, 0.7, robot.tree.size)
        gap, slope, _ = compiled_equations(robot, q, np.zeros(robot.tree.size))
        value, jacobian = equations(robot.tree, robot.constraints, q)
        assert np.abs(value).max() > 1e-2
        np.testing.assert_allclose(gap, value[kept], rtol=0, atol=1e-14)
        np.testing.assert_allclose(slope, jacobian[kept], rtol=0, atol=1e-14)


@pytest.mark.parametrize("name", MECHANISMS)
def test_slopes_are_differences_of_the_gap(name):
    robot = MECHANISMS[name]()
    rng = np.random.default_rng(2)
    size, step = robot.tree.size, 1e-6
    still = np.zeros(size)
    for _ in range(5):
        q = robot.constraints.posture + rng.uniform(-0.7, 0.7, size)
        _, slope, _ = compiled_equations(robot, q, still)
        ahead, behind = (
            np.transpose([compiled_equations(robot, q + h * e, still)[0] for e in np.eye(size)])
            for h in (step, -step)
        )
        np.testing.assert_allclose(slope, (ahead - behind) / (2.0 * step), rtol=0, atol=2e-9)


@pytest.mark.parametrize("name", MECHANISMS)
def test_drift_is_the_difference_of_the_slopes_where_the_loops_are_closed(name):
    robot = MECHANISMS[name]()
    chains, step = ClosedChains(robot), 1e-6
    q, dq, ddq = (x.T for x in states(robot, 5, 3))
    for t in range(5):
        motion = chains.motion(*(x[:, t : t + 1] for x in (q, dq, ddq)))
        here, speed = motion.q[:, 0], motion.dq[:, 0]
        _, slope, drift = compiled_equations(robot, here, speed)
        turned = [compiled_equations(robot, here + h * speed, speed)[1] for h in (step, -step)]
        expected = (turned[0] - turned[1]) @ speed / (2.0 * step)
        np.testing.assert_allclose(drift, expected, rtol=0, atol=2e-8)
        np.testing.assert_allclose(slope @ motion.ddq[:, 0], -expected, rtol=0, atol=2e-8)


@pytest.mark.parametrize("name", MECHANISMS)
def test_speeds_and_accelerations_are_derivatives_of_the_positions(name):
    robot = MECHANISMS[name]()
    motion = ClosedChains(robot).motion(*smooth_path(robot, 400, STEP))
    inside = slice(2, -2)
    np.testing.assert_allclose(
        motion.dq[:, inside], differentiated(motion.q, STEP), rtol=0, atol=1e-9
    )
    np.testing.assert_allclose(
        motion.ddq[:, inside], differentiated(motion.dq, STEP), rtol=0, atol=1e-9
    )
    passive = [i for i in range(len(motion.q)) if i not in robot.places]
    assert np.abs(motion.ddq[passive]).max() > 1e-2


@pytest.mark.parametrize("name", MECHANISMS)
def test_the_loops_are_closed_all_along_and_the_gain_leaves_them_closed(name):
    robot = MECHANISMS[name]()
    q, dq, ddq = smooth_path(robot, 50, 0.05)
    motion = ClosedChains(robot).motion(q, dq, ddq)
    places = list(robot.places)
    np.testing.assert_array_equal(motion.q[places], q)
    for t in range(50):
        value, slope = equations(robot.tree, robot.constraints, motion.q[:, t])
        np.testing.assert_allclose(value, 0.0, atol=1e-12)
        np.testing.assert_allclose(slope @ motion.gain[:, :, t], 0.0, atol=1e-11)
        np.testing.assert_array_equal(motion.gain[places, :, t], np.eye(robot.size))
        np.testing.assert_allclose(motion.dq[:, t], motion.gain[:, :, t] @ dq[:, t], atol=1e-13)


def tip_of_circles(first, second, radius, other, side):
    """Where circles around two points meet, left (1) or right (-1) of the way between them."""
    way = second - first
    distance = np.linalg.norm(way)
    along = (distance**2 + radius**2 - other**2) / (2.0 * distance)
    height = np.sqrt(radius**2 - along**2)
    unit = way / distance
    return first + along * unit + side * height * np.array([-unit[1], unit[0]])


def check_the_tip(lengths, base, robot, q):
    a, b, c, d = lengths
    chains = ClosedChains(robot)
    tree, first = robot.tree, robot.constraints.posture

    def elbows(one, two):
        return (
            a * np.array([np.cos(one), np.sin(one)]),
            np.array([base, 0.0]) + c * np.array([np.cos(two), np.sin(two)]),
        )

    def tip_of(whole):
        frame = poses(tree, whole)[1]
        place = frame.translation + b * frame.rotation[:, 0]
        return place[[0, 2]]

    left, right = elbows(first[0], first[2])
    way, here = right - left, tip_of(first) - left
    side = np.sign(way[0] * here[1] - way[1] * here[0])
    for one, two in q:
        left, right = elbows(one, two)
        tip = tip_of_circles(left, right, b, d, side)
        whole = chains.start(np.array([one, two])).q
        np.testing.assert_allclose(tip_of(whole), tip, rtol=0, atol=1e-9)
        rods = [np.arctan2(*(tip - elbow)[::-1]) for elbow in (left, right)]
        turned = np.array([rods[0] - one - whole[1], rods[1] - two - whole[3]])
        np.testing.assert_allclose(np.exp(1j * turned), 1.0, rtol=0, atol=1e-9)


def test_the_tip_of_the_five_bar_lies_on_two_circles():
    robot = five_bar()
    q, _, _ = states(robot, 50, 3)
    check_the_tip((0.4, 0.5, 0.4, 0.5), 0.3, robot, q)


link = st.floats(0.3, 0.6)


@settings(max_examples=40)
@given(link, link, link, link, st.floats(0.1, 0.5))
def test_the_tip_of_any_five_bar_lies_on_two_circles(a, b, c, d, base):
    start_of_cranks, far = np.array([2.0, 1.1]), 0.2
    nodes = start_of_cranks + far * np.array(
        [[x, y] for x in (-1, -0.5, 0, 0.5, 1) for y in (-1, -0.5, 0, 0.5, 1)]
    )
    one, two = nodes.T
    distance = np.hypot(base + c * np.cos(two) - a * np.cos(one), c * np.sin(two) - a * np.sin(one))
    assume(abs(b - d) + 0.1 < distance.min() and distance.max() < b + d - 0.1)
    robot = five_bar(lengths=(a, b, c, d), base=base)
    check_the_tip((a, b, c, d), base, robot, nodes)


@given(st.floats(0.2, 0.6), st.floats(0.3, 0.9), st.floats(0.6, 2.2))
def test_the_rocker_of_a_parallelogram_turns_as_its_crank(crank, coupler, q):
    robot = parallelogram(crank=crank, coupler=coupler)
    motion = ClosedChains(robot).motion([[q]], [[1.3]], [[-0.7]])
    for whole, driven in ((motion.q, q), (motion.dq, 1.3), (motion.ddq, -0.7)):
        np.testing.assert_allclose(whole[:, 0], [driven, -driven, driven], rtol=0, atol=1e-10)


def test_an_assembly_stays_on_its_side_of_the_circles():
    robot = five_bar()
    chains = ClosedChains(robot)
    there = smooth_path(robot, 300, 0.02)
    motion = chains.motion(*there)
    for t in (0, 120, 299):
        np.testing.assert_allclose(
            chains.start(there[0][:, t]).q, motion.q[:, t], rtol=0, atol=1e-11
        )


def test_a_path_out_of_reach_names_its_sample():
    robot = five_bar(lengths=(0.4, 0.45, 0.4, 0.45))
    q = np.repeat(start(robot)[:, None], 300, axis=1)
    q[0] += np.linspace(0.0, 3.0, 300)
    still = np.zeros(q.shape)
    left = 0.4 * np.array([np.cos(q[0]), np.sin(q[0])])
    right = np.array([0.3, 0.0]) + 0.4 * np.array([np.cos(1.1), np.sin(1.1)])
    apart = int(np.argmax(np.hypot(*(left - right[:, None])) > 0.45 + 0.45))
    assert apart > 0
    with pytest.raises(LoopNotClosed, match=f"at sample {apart}, a1 = ") as caught:
        ClosedChains(robot).motion(q, still, still)
    assert caught.value.sample == apart
    assert caught.value.q == tuple(q[:, apart])
    assert not caught.value.singular
    good = ClosedChains(robot).motion(q[:, :apart], still[:, :apart], still[:, :apart])
    assert np.isfinite(good.q).all()


def test_a_first_posture_out_of_reach_is_refused_by_the_names_of_its_joints():
    chains = ClosedChains(five_bar())
    with pytest.raises(LoopNotClosed, match=r"a1 = 3\.1, b1 = 0\.1: the mechanism cannot be"):
        chains.start(np.array([3.1, 0.1]))


@pytest.mark.parametrize("kind", ["point", "axis", "full"])
def test_random_loops_move_as_their_differences_say(kind):
    for seed in range(20, 30):
        robot = spatial_loop(seed, kind)
        motion = ClosedChains(robot).motion(*smooth_path(robot, 60, STEP))
        for whole, slope in ((motion.q, motion.dq), (motion.dq, motion.ddq)):
            np.testing.assert_allclose(
                slope[:, 2:-2], differentiated(whole, STEP), rtol=0, atol=1e-8
            )
