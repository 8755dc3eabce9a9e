"""Ratios of gains by what the joints' torques have in common, on rows of two joints."""

import numpy as np
import pytest

from pivident.judgement.audit.gain_ratios import gain_ratios, joint_sums

STRETCHES, ROWS = 8, 50


def sums(seen_in: int):
    """A shared and an own parameter; the own one acts in the first stretches alone."""
    rng = np.random.default_rng(1)
    made = []
    for j, (columns, gain) in enumerate(((np.array([0, 1]), 1.0), (np.array([1]), 0.5))):
        phi = rng.standard_normal((STRETCHES, ROWS, len(columns)))
        if j == 0:
            phi[seen_in:, :, 0] = 0.0
        y = phi @ np.array([2.0, 3.0])[columns] / gain
        y += 0.01 * rng.standard_normal(y.shape)
        grams, rights = np.swapaxes(phi, 1, 2) @ phi, np.einsum("kri,kr->ki", phi, y)
        made.append(joint_sums(f"joint {j}", columns, grams, rights, float((y**2).sum()), y.size))
    return made


def test_a_shared_parameter_ties_two_gains():
    found = gain_ratios(sums(STRETCHES), np.ones(2), np.array([1.0, np.nan]))
    assert found.connected.all()
    assert found.gains == pytest.approx([1.0, 0.5], rel=0.01)


def test_what_one_stretch_alone_shows_ties_none():
    """Without it the equations are singular, which is no error of the log."""
    found = gain_ratios(sums(1), np.ones(2), np.array([1.0, np.nan]))
    assert not found.connected.any() and found.gains[0] == 1.0
