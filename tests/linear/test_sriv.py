"""SRIV where least squares is biased; inputs, gaps, loops and integrators."""

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.linear.arx import arx
from pivident.linear.sriv import sriv
from tests.linear.discrete_case import TRUTH, impulses, outputs


def test_noise_free_data_give_the_system():
    rng = np.random.default_rng(0)
    u = rng.standard_normal((500, 2))
    a = [1, -1.5, 0.7]
    y = lfilter([0, 1, 0.5], a, u[:, 0]) + lfilter([0, 0, 0, 0.3], a, u[:, 1])
    found = sriv(u, y, 0.01, (2, 0), 2, delay=(0, 3))
    assert np.allclose(found.theta, [-1.5, 0.7, 0, 1, 0.5, 0.3], atol=1e-9)
    assert np.allclose(found.simulate(u), y, atol=1e-9)


def test_unbiased_where_least_squares_is_biased():
    u, runs = impulses(), 150
    found = np.array(
        [[method(u, y, 1.0, 0, 1).theta for method in (sriv, arx)] for y in outputs(runs, 1)]
    )
    error = (found.mean(axis=0) - TRUTH) / (found.std(axis=0) / np.sqrt(runs))
    assert np.abs(error[0]).max() < 4


def test_white_noise_on_the_output_biases_least_squares_only():
    rng = np.random.default_rng(2)
    u = rng.standard_normal(5000)
    y = lfilter([1.0], [1, -0.9], u) + rng.standard_normal(5000)
    refined, plain = sriv(u, y, 1.0, 0, 1), arx(u, y, 1.0, 0, 1)
    assert abs(refined.theta[0] + 0.9) < 4 * refined.std[0]
    assert plain.theta[0] + 0.9 > 20 * plain.std[0]
    assert refined.residual_variance == pytest.approx(1.0, abs=0.08)


def test_stated_deviations_are_those_of_repetition():
    rng = np.random.default_rng(3)
    u = np.sign(rng.standard_normal(400))
    clean = lfilter([1.0, 0.5], [1, -1.5, 0.7], u)
    found = [sriv(u, clean + rng.standard_normal(400), 1.0, 1, 2) for _ in range(150)]
    spread = np.std([m.theta for m in found], axis=0)
    stated = np.mean([m.std for m in found], axis=0)
    assert np.all((0.75 < spread / stated) & (spread / stated < 1.35))


def test_masked_outputs_have_no_vote():
    rng = np.random.default_rng(4)
    u = rng.standard_normal(3000)
    y = lfilter([1.0], [1, -0.9], u) + 0.5 * rng.standard_normal(3000)
    mask = np.zeros(3000, dtype=bool)
    mask[1000:1100] = True
    y[mask] = np.nan
    found = sriv(u, y, 1.0, 0, 1, mask=mask)
    assert np.all(np.abs(found.theta - [-0.9, 1.0]) < 4 * found.std)


def test_known_integrator():
    rng = np.random.default_rng(5)
    u = rng.standard_normal(4000)
    y = lfilter([0.1], np.poly([1.0, 0.8]), u) + 0.2 * rng.standard_normal(4000)
    found = sriv(u, y, 1.0, 0, 2, fixed_poles=(1.0,))
    free = sorted(found.poles[0].real)
    assert free[1] == pytest.approx(1.0, abs=1e-9)
    assert free[0] == pytest.approx(0.8, abs=0.01)


def test_in_a_loop_the_external_signal_removes_the_bias():
    rng = np.random.default_rng(6)
    samples = 20_000
    reference = np.sign(rng.standard_normal(samples))
    noise = lfilter([1.0], [1, -0.9], 0.5 * rng.standard_normal(samples))
    u, y, x = np.zeros(samples), np.zeros(samples), 0.0
    for k in range(samples):
        x = 0.8 * x + (u[k - 1] if k else 0.0)
        y[k] = x + noise[k]
        u[k] = reference[k] - 0.5 * y[k]
    closed = sriv(u, y, 1.0, 0, 1, delay=1, external=reference)
    assert np.allclose(closed.theta, [-0.8, 1.0], atol=0.02)
    opened = sriv(u, y, 1.0, 0, 1, delay=1)
    assert np.abs(opened.theta - [-0.8, 1.0]).max() > 3 * np.abs(closed.theta - [-0.8, 1.0]).max()
