import time

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.robot.gallery import load_robot
from pivident.studies import DesignRequest, design_motion, joint_limits
from pivident.studies.excitation.checked_motion import with_more_room
from pivident.studies.excitation.design_task import DesignTask
from pivident.studies.excitation.knowledge import knowledge
from pivident.studies.excitation.questions import load_columns, load_question, robot_question
from pivident.studies.excitation.search import Best, Descent, coefficient_box, random_coefficients
from tests.studies.excitation.test_constraints import Wall

PLANAR = load_robot("planar_2r")


def planar_task(clearances=None, motion="splines", criterion="a"):
    limits = joint_limits(PLANAR)
    known = knowledge(PLANAR, limits)
    request = DesignRequest(duration=5.0, motion=motion, criterion=criterion)
    question = robot_question(known.base, known.values)
    return DesignTask(PLANAR, request, limits, known, question, clearances)


def objective(task):
    return task.objective(with_more_room(task.constraints(task.family(5.0)), 0.95, 0.0))


@pytest.mark.parametrize("motion", ["fourier", "splines", "postures"])
def test_random_motions_keep_every_limit_and_use_one(motion):
    for clearances in (None, Wall()):
        made = objective(planar_task(clearances, motion)).constraints
        rng = np.random.default_rng(0)
        drawn = [random_coefficients(made, rng, None) for _ in range(20)]
        ratios = [made.largest_ratio(x) for x in drawn if x is not None]
        assert len(ratios) >= 5 and max(ratios) <= 1.0
        if clearances is None:
            assert max(ratios) > 0.9


def test_the_unit_of_a_coefficient_reaches_a_limit_alone():
    made = objective(planar_task()).constraints
    middle, scale = coefficient_box(made)
    for k in range(1, made.family.size):
        x = middle.copy()
        x[k] = scale[k]
        moved = made.motion(x) - made.motion(middle)
        limits = made.limits
        reached = [
            np.abs(m).max(axis=0) / size
            for m, size in zip(
                moved[:3], (limits.half, limits.speed, limits.acceleration), strict=False
            )
        ]
        np.testing.assert_allclose(np.max(reached, axis=0), 1.0)


def left_of_slope(start):
    """What the slopes of active limits leave of the criterion's at the end of a descent, a share.

    By a least squares of our own.
    """
    from scipy.optimize import nnls

    goal = objective(planar_task())
    best = Best(time.perf_counter() + 20.0)
    Descent.of(goal, start, False, best).run()
    x = best.coefficients
    value, gradient = goal.value_and_gradient(x)
    assert value < goal.value(start) - 1.0
    ratios, slopes = goal.constraints.ratios_and_gradients(x)
    active = ratios > 0.99
    assert active.any()
    _, scale = coefficient_box(goal.constraints)
    columns = (slopes[active] * scale).reshape(active.sum(), -1).T
    _, residual = nnls(columns, -(gradient * scale).ravel())
    return residual / np.linalg.norm(gradient * scale)


def test_descents_end_where_the_slope_of_the_lagrangian_vanishes():
    """First-order conditions of Karush, Kuhn and Tucker; one of three may end a little before.

    The best motion that keeps all limits is an earlier one where the last break some by rounding.
    """
    constraints = objective(planar_task()).constraints
    starts = [random_coefficients(constraints, np.random.default_rng(k), None) for k in (1, 2, 3)]
    assert np.median([left_of_slope(start) for start in starts]) < 0.03


def test_a_posture_at_both_ends_that_was_given_stays():
    task = planar_task(Wall())
    goal, home = objective(task), np.array([0.2, -0.3])
    start = random_coefficients(goal.constraints, np.random.default_rng(2), home)
    best = Best(time.perf_counter() + 2.0)
    Descent.of(goal, start, True, best).run()
    np.testing.assert_array_equal(best.coefficients[0], home)
    assert not np.array_equal(best.coefficients[1:], start[1:])


def test_nothing_that_breaks_a_limit_is_ever_the_best():
    goal = objective(planar_task(Wall(0.3)))
    seen = []

    class Watched(Best):
        def offer(self, value, coefficients, first=False):
            seen.append(goal.constraints.largest_ratio(coefficients))
            super().offer(value, coefficients, first)

    best = Watched(time.perf_counter() + 2.0)
    start = None
    rng = np.random.default_rng(3)
    while start is None:
        start = random_coefficients(goal.constraints, rng, None)
    Descent.of(goal, start, False, best).run()
    assert len(seen) > 5 and max(seen) <= 1.0


def test_torque_limits_hold_in_the_run_with_the_load():
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    values = base.values(nominal_values(robot, base.standard))
    heavy = np.array([0.05, 0, 0, 0.05, 0, 0.02, 0.1, 0.1, 0.6, 6.0])
    design = design_motion(
        robot,
        DesignRequest(duration=10.0, seconds=2.0),
        question=lambda known: load_question(known.base, known.model_values, heavy),
    )
    from pivident.dynamics.regressor import Regressor

    regressor = Regressor.build(robot, base.parameters)
    q, dq, ddq = design.motion.sampled(500.0)
    limits = np.array([j.torque_limit for j in robot.joints])
    largest = [
        np.abs(regressor.torque(q, dq, ddq, theta)).max(axis=0)
        for theta in (values, values + load_columns(base) @ heavy)
    ]
    assert (np.max(largest, axis=0) <= limits).all()
    assert (largest[1] > largest[0]).any()
    shown = [max(u.largest, -u.least) for u in design.limits if u.quantity == "torque"]
    np.testing.assert_allclose(shown, np.max(largest, axis=0), rtol=5e-3)


def test_a_motion_on_the_way_is_taken_where_the_best_one_cannot_be_kept():
    """The best motion breaks a limit between its samples, and no smaller one keeps it."""
    from pivident.studies.excitation.design_motion import _kept

    goal = objective(planar_task())
    start = random_coefficients(goal.constraints, np.random.default_rng(1), None)
    best = Best(time.perf_counter() + 20.0)
    best.offer(goal.value(start), start, first=True)
    Descent.of(goal, start, False, best).run()
    values = [goal.value(x) for x in best.earlier]
    assert len(values) > 3 and (np.diff(values) < -0.09).all()

    class Fine:
        def repaired(self, coefficients):
            broken = goal.value(coefficients) < values[-2] - 1e-9
            return None if broken else coefficients

    np.testing.assert_array_equal(_kept(goal, Fine(), best), best.earlier[-2])
