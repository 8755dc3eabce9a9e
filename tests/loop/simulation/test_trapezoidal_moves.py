"""Moves with trapezoidal speeds: from posture to posture, within all limits, fast as they allow."""

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.reference import trapezoidal_moves
from pivident.studies.many.study.bench import Bench
from tests.studies.many.study.small import small

RATE = 2000.0
SPEEDS, ACCELERATIONS = np.array([2.0, 3.0]), np.array([8.0, 30.0])


def moved(postures, edge=0.25, samples=8000):
    return trapezoidal_moves(
        np.array(postures), SPEEDS, ACCELERATIONS, RATE, samples, dwell=0.1, edge=edge
    )


def duration(q):
    return np.flatnonzero(np.abs(np.diff(q, axis=0)).max(axis=1) > 1e-12)[-1] / RATE


@pytest.mark.parametrize("edge", [0.1, 0.25, 0.5])
def test_speed_and_acceleration_are_the_derivatives(edge):
    q, dq, ddq = moved([[0.0, 0.0], [1.5, -0.3], [-0.2, 0.4]], edge)
    assert np.abs(np.gradient(q, 1 / RATE, axis=0) - dq)[1:-1].max() < 2e-5
    assert np.abs(np.gradient(dq, 1 / RATE, axis=0) - ddq)[1:-1].max() < 0.1
    jerk = np.abs(np.diff(ddq, axis=0)).max() * RATE
    assert jerk < 40.0 * ACCELERATIONS.max() / edge


def test_postures_are_reached_and_held():
    q, dq, _ = moved([[0.0, 0.0], [1.0, 0.5]])
    assert np.allclose(q[-1], [1.0, 0.5], atol=1e-12) and not dq[-1].any()
    assert np.allclose(q[0], 0.0, atol=1e-12)


@pytest.mark.parametrize("way", [[0.05, 0.01], [4.0, 0.1], [0.1, 5.0], [0.02, 3.0]])
def test_one_limit_is_reached_and_none_exceeded(way):
    q, dq, ddq = moved([[0.0, 0.0], way])
    used = np.abs(dq).max(axis=0) / SPEEDS, np.abs(ddq).max(axis=0) / ACCELERATIONS
    assert np.max(used) < 1.0 + 1e-9
    assert np.max(used) > 0.99
    # the joint that is limited does it as fast as it can alone
    alone = []
    for j in range(2):
        own = np.zeros(2)
        own[j] = way[j]
        alone.append(duration(moved([[0.0, 0.0], own])[0]))
    assert duration(q) >= max(alone) - 2 / RATE


def test_a_short_move_has_no_cruise_and_a_long_one_the_largest_speed():
    _, short, _ = moved([[0.0, 0.0], [0.1, 0.0]])
    peak = short[:, 0].max()
    assert peak < 0.5 * SPEEDS[0] and np.mean(short[:, 0] > 0.999 * peak) < 0.01
    _, long, _ = moved([[0.0, 0.0], [4.0, 0.0]])
    assert np.mean(long[:, 0] > 0.999 * SPEEDS[0]) > 0.3


def test_a_scenario_moves_so():
    motion = {"type": "trapezoidal", "acceleration": 5.0, "duration": 4.0}
    bench = Bench(small(trajectory=motion))
    q, _, ddq = bench.reference
    assert np.abs(ddq).max() == pytest.approx(5.0, rel=0.01)
    assert len(q) == 2000 and np.ptp(q[:, 0]) > 0.5
    with pytest.raises(ExperimentError, match="needs its largest acceleration"):
        small(trajectory={"type": "trapezoidal"})
