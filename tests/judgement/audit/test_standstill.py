"""An arm that rests before and behind its motion: for how long, and what to keep."""

import numpy as np
import pytest

from pivident.judgement.audit.standstill import check_rest_at_ends

RATE = 200.0


def motion(before: float, behind: float, moves: float = 10.0) -> tuple[np.ndarray, np.ndarray]:
    """Positions of two joints, with noise of an encoder, and times from 3 s on."""
    t = np.arange(0.0, before + moves + behind, 1.0 / RATE)
    inside = np.clip(t - before, 0.0, moves)
    q = np.column_stack([np.sin(3.0 * inside), 0.4 * np.sin(5.0 * inside)])
    return q + 1e-5 * np.random.default_rng(1).standard_normal(q.shape), 3.0 + t


@pytest.mark.parametrize(("before", "behind"), [(5.0, 5.0), (0.0, 4.0), (4.0, 0.0)])
def test_rest_at_the_ends_is_left_out(before, behind):
    (found,) = check_rest_at_ends(*motion(before, behind))
    (edit,) = found.repairs[0].edits
    assert edit.place[-1] == "part"
    np.testing.assert_allclose(edit.value, [3.0 + before, 13.0 + before], atol=0.15)
    assert ("the first" in found.message, "the last" in found.message) == (before > 0, behind > 0)


@pytest.mark.parametrize(("before", "behind"), [(0.0, 0.0), (0.3, 0.3)])
def test_a_short_rest_is_none(before, behind):
    assert check_rest_at_ends(*motion(before, behind)) == []


def test_a_pause_between_two_motions_is_none():
    q, _ = motion(0.0, 0.0)
    paused = np.vstack([q, np.repeat(q[-1:], 2000, axis=0), q[::-1]])
    assert check_rest_at_ends(paused, 0.005 * np.arange(len(paused))) == []


def test_an_arm_that_never_moves_is_another_fault():
    q, t = motion(0.0, 0.0)
    assert check_rest_at_ends(0.001 * q, t) == []
