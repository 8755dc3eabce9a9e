"""RIV: unbiased, and as precise as the Cramér-Rao bound allows."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.foundation.errors import IdentificationError
from pivident.linear.sriv import riv, sriv
from tests.linear.discrete_case import TRUTH, impulses, outputs
from tests.linear.two_impulses import TWO_IMPULSES


def test_two_impulses_of_table_c3():
    u, runs = impulses(), 150
    found = [riv(u, y, 1.0, 0, 1, noise_order=(2, 0)) for y in outputs(runs, 7)]
    theta = np.array([m.theta for m in found])
    ratio = theta.std(axis=0) / np.mean([m.std for m in found], axis=0)
    error = (theta.mean(axis=0) - TRUTH) / (theta.std(axis=0) / np.sqrt(runs))
    assert np.abs(error).max() < 4
    assert np.all((ratio > 0.75) & (ratio < 1.35))
    assert np.allclose(
        np.mean([m.noise.ar for m in found], axis=0), TWO_IMPULSES.noise_ar, atol=0.05
    )
    assert np.mean([m.residual_variance for m in found]) == pytest.approx(
        TWO_IMPULSES.noise_std**2, rel=0.1
    )


def test_bound_is_the_cramer_rao_bound():
    """(C4) against the sensitivity of the whitened output to the true parameters."""
    u = impulses()
    stated = np.mean([riv(u, y, 1.0, 0, 1, noise_order=(2, 0)).std for y in outputs(40, 3)], axis=0)
    assert np.allclose(stated, TWO_IMPULSES.bound(), rtol=0.1)


def test_noise_model_makes_the_estimate_more_precise():
    u, y = impulses(), outputs(100, 9)
    coloured = np.std([riv(u, row, 1.0, 0, 1).theta for row in y], axis=0)
    white = np.std([sriv(u, row, 1.0, 0, 1).theta for row in y], axis=0)
    assert np.all(coloured < 0.75 * white)


def test_two_inputs_with_arma_noise_and_a_gap():
    rng = np.random.default_rng(1)
    u = np.sign(rng.standard_normal((5000, 2)))
    a = [1, -1.5, 0.7]
    y = lfilter([1, 0.5], a, u[:, 0]) + lfilter([0, 0, 0, 0.3], a, u[:, 1])
    y += lfilter([1, 0.5], [1, -0.9], 0.3 * rng.standard_normal(5000))
    mask = np.zeros(5000, dtype=bool)
    mask[2000:2200] = True
    y[mask] = np.nan
    found = riv(u, y, 0.01, (1, 0), 2, delay=(0, 3), noise_order=(1, 1), mask=mask)
    assert found.converged and not found.warnings
    assert np.all(np.abs(found.theta - [-1.5, 0.7, 1, 0.5, 0.3]) < 4 * found.std)
    assert np.allclose([found.noise.ar[1], found.noise.ma[1]], [-0.9, 0.5], atol=0.05)


@pytest.mark.parametrize("order", [(1,), (-1, 0)])
def test_noise_orders_are_checked(order):
    with pytest.raises(IdentificationError, match="noise_order"):
        riv(impulses(), outputs(1, 0)[0], 1.0, 0, 1, noise_order=order)


def test_noise_free_data_give_the_system():
    u = np.random.default_rng(0).standard_normal(500)
    found = riv(u, lfilter([1.0, 0.5], [1, -0.9], u), 1.0, 1, 1)
    assert np.allclose(found.theta, [-0.9, 1.0, 0.5], atol=1e-9)


def test_many_short_gaps():
    rng = np.random.default_rng(2)
    u = rng.standard_normal(3000)
    y = lfilter([1.0], [1, -0.9], u) + lfilter([1.0], [1, -0.8], 0.1 * rng.standard_normal(3000))
    found = riv(u, y, 1.0, 0, 1, mask=rng.random(3000) < 0.05)
    assert np.all(np.abs(found.theta - [-0.9, 1.0]) < 4 * found.std)
