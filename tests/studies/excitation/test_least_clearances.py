"""Distances between samples: a corner that a coarse grid passes over."""

import numpy as np
import pytest

from pivident.robot.gallery import load_robot
from pivident.studies import Body, Clearances, outline_of
from pivident.studies.collision.bodies import Obstacle
from pivident.studies.excitation.checked_motion import TOLERANCE, least_clearances


def room(robot):
    needle = Obstacle(
        "needle", "box", np.eye(3), np.array([0.55, 0.0, 0.0]), np.array([0.2, 0.002, 0.4])
    )
    ball = Body("fingertip", robot.size - 1, np.array([0.3, 0, 0]), np.array([0.3, 0, 0]), 0.02)
    bodies = [b for b in outline_of(robot).bodies if b.link < robot.size - 1]
    return Clearances.of(robot, [*bodies, ball], [needle], clearance=0.0)


def test_a_needle_between_two_samples_is_found():
    """The fingertip passes 0.65 m from the shoulder, past a thin plate, at 2 rad/s."""
    robot = load_robot("planar_2r")
    clearances = room(robot)
    row = clearances.names.index("fingertip and needle")

    def motion(t):
        q = np.column_stack([2.0 * t - 1.003, 0.3 + 0.0 * t])
        return np.stack([q, np.tile([2.0, 0.0], (t.size, 1)), np.zeros_like(q)])

    t = np.linspace(0.0, 1.0, 11)  # 0.2 rad, 0.13 m from sample to sample
    least, instant = least_clearances(clearances, motion, t)
    fine = np.linspace(0.0, 1.0, 200_001)
    true = clearances.distances(motion(fine)[0])
    at_samples = clearances.distances(motion(t)[0])[row].min()
    assert true[row].min() < at_samples - 0.01
    assert least[row] == pytest.approx(true[row].min(), abs=2 * TOLERANCE)
    assert instant[row] == pytest.approx(fine[true[row].argmin()], abs=1e-3)


@pytest.mark.parametrize("seed", range(5))
def test_the_least_distances_of_random_motions(seed):
    """Random swings of the TX40 among obstacles, sampled coarsely and very finely."""
    rng = np.random.default_rng(seed)
    robot = load_robot("staubli_tx40")
    boxes = [
        Obstacle(f"box {k}", "box", np.eye(3), rng.uniform(-0.6, 0.6, 3), rng.uniform(0.02, 0.3, 3))
        for k in range(3)
    ]
    clearances = Clearances.of(robot, outline_of(robot).bodies, boxes)
    size, pulse, phase = rng.uniform(0.2, 1.2, 6), rng.uniform(1, 6, 6), rng.uniform(0, 6, 6)

    def motion(t):
        angle = np.outer(t, pulse) + phase
        return np.stack(
            [size * np.sin(angle), size * pulse * np.cos(angle), -size * pulse**2 * np.sin(angle)]
        )

    least, _ = least_clearances(clearances, motion, np.linspace(0.0, 2.0, 101))
    true = clearances.distances(motion(np.linspace(0.0, 2.0, 20_001))[0]).min(axis=1)
    near = least < clearances.needed + 0.03
    assert near.any()
    assert (least[near] <= true[near] + TOLERANCE).all()
    assert (least[near] >= true[near] - TOLERANCE).all()
