"""Smoothing of positions that come in visible counts, with standstill between the moves."""

import numpy as np
import pytest

from pivident.loop.simulation.reference import point_to_point
from pivident.signals.counted_positions import (
    counting_stretches,
    has_visible_counts,
    nvr_of_counts,
)
from pivident.signals.random_walk import irwsm

RATE = 2000.0
COUNT = 2 * np.pi / 3600


def moves(standstill: float) -> tuple[np.ndarray, np.ndarray]:
    """Two moves and so many seconds at rest behind them: position and acceleration."""
    postures = np.array([[0.0], [1.3], [-0.4]])
    q, _, ddq = point_to_point(postures, np.array([2.0]), RATE, int(2.2 * RATE))
    rest = int(standstill * RATE)
    end = np.flatnonzero(np.abs(ddq[:, 0]) > 0)[-1] + 1
    q, ddq = q[:end, 0], ddq[:end, 0]
    return np.append(q, np.full(rest, q[-1])), np.append(ddq, np.zeros(rest))


def counts(q: np.ndarray) -> np.ndarray:
    return COUNT * np.round(q / COUNT)


def test_standstill_does_not_change_the_ratio():
    short, long = (nvr_of_counts(counts(moves(rest)[0]), RATE) for rest in (0.5, 3.0))
    assert short == pytest.approx(long, rel=1e-6)


def test_standstill_spoils_the_ratio_of_the_whole_record():
    q, ddq = moves(3.0)
    y = counts(q)
    whole, own = irwsm(y, RATE), irwsm(y, RATE, nvr=nvr_of_counts(y, RATE))
    assert whole.f50 > 1.3 * own.f50
    moving = slice(100, int(1.5 * RATE))
    error = [np.sqrt(np.mean((s.ddq - ddq)[moving] ** 2)) for s in (whole, own)]
    assert error[1] < 0.6 * error[0]


def test_the_noise_found_is_that_of_rounding():
    y = counts(moves(0.1)[0])
    found = irwsm(y, RATE, nvr=nvr_of_counts(y, RATE)).noise_std
    assert found == pytest.approx(COUNT / np.sqrt(12), rel=0.15)


def test_stretches_are_where_counts_change():
    q, _ = moves(1.0)
    stretches = counting_stretches(counts(q), RATE)
    assert len(stretches) == 2
    for stretch in stretches:
        assert np.abs(np.diff(q[stretch])).max() * RATE > 1.0
        assert np.abs(np.diff(q[stretch])).min() * RATE > 0.1  # slower means longer pauses


def test_positions_without_visible_counts_are_left_to_the_whole_record():
    q, _ = moves(0.5)
    rng = np.random.default_rng(0)
    assert nvr_of_counts(q + 1e-6 * rng.standard_normal(q.size), RATE) is None
    assert not has_visible_counts(np.round(q, 6)[: int(0.5 * RATE)][100:])
    assert nvr_of_counts(np.full(1000, 0.3), RATE) is None  # at rest all the time
    assert nvr_of_counts(counts(1e-3 * np.arange(4000) / RATE), RATE) is None  # creeping


@pytest.mark.parametrize(("speed", "stretches"), [(0.25, 0), (0.4, 3)])
def test_the_steps_of_a_slow_joint_are_no_motion(speed, stretches):
    """Counts of a slow joint last as long as quick ones may, or longer; likelihood follows them."""
    rate = 5000.0
    postures = np.array([[0.0], [0.5], [0.1], [0.6]])
    q, _, ddq = (x[:, 0] for x in point_to_point(postures, np.array([speed]), rate, 30_000))
    y = counts(q)
    parts = counting_stretches(y, rate)
    assert len(parts) == stretches
    assert all(irwsm(y[part], rate).f50 > 200.0 for part in parts)
    found = irwsm(y, rate, nvr=nvr_of_counts(y, rate))
    assert found.f50 < 30.0
    assert np.std((found.ddq - ddq)[100:-100]) < 0.7 * np.std(ddq)
