"""Each part of the second implementation against a computation of another kind."""

import json

import numpy as np
import pytest

from tests.independent import arm, noise, random_walk
from tests.independent.loop import Record, simulated


@pytest.fixture(scope="module")
def stored(reference_dir):
    """The stored simulation with a controller without integral, and its parameters."""
    values = np.load(reference_dir / "tx40_simulated_record.npz")
    text = (reference_dir / "tx40_simulated_record.json").read_text("utf-8")
    theta = np.array([json.loads(text)["parameters"][name] for name in arm.NAMES])
    names = ("q_ref", "dq_ref", "q", "tau", "kp", "kd")
    return Record(5000.0, *(values[name] for name in names), 0 * values["kp"]), theta


@pytest.mark.record
def test_torques_are_those_of_another_program(reference_dir):
    dynamics = json.loads((reference_dir / "tx40_dynamics.json").read_text("utf-8"))
    base = {entry["name"]: entry["value"] for entry in dynamics["base_parameters"]}
    columns = np.array([[arm.KINDS.index(name[:-1]), int(name[-1]) - 1] for name in base])
    motion = (np.array(dynamics[name]) for name in ("q", "dq", "ddq"))
    phi = arm.observation_matrix(*motion, columns)
    tau = np.einsum("jps,p->sj", phi, np.array([*base.values()]))
    np.testing.assert_allclose(tau, dynamics["tau"], atol=1e-12)


@pytest.mark.record
def test_the_loop_gives_the_stored_record_but_for_its_noise(stored):
    record, theta = stored
    q, dq, ddq, tau = simulated(record, theta)
    assert np.all(np.abs(np.std(q - record.q_m, axis=0) / 2.02e-6 - 1) < 0.06)
    balance = np.einsum("jps,p->sj", arm.observed(q, dq, ddq), theta) - tau
    assert np.all(balance.std(axis=0) < 1e-3 * tau.std(axis=0))


def test_the_smoother_solves_its_least_squares_problem():
    """Squares of y - x and, in variances, of the steps of the slope: one dense system."""
    generator = np.random.default_rng(1)
    y, ratio = (
        np.cumsum(np.cumsum(0.1 * generator.normal(size=60))) + generator.normal(size=60),
        0.03,
    )
    level, slope = random_walk.smoothed(y, ratio)
    # x[i+1] = x[i] + v[i] without noise: the second differences of the level are the steps
    second = np.diff(np.eye(60), 2, axis=0)
    dense = np.linalg.solve(np.eye(60) + second.T @ second / ratio, y)
    np.testing.assert_allclose(level, dense, atol=1e-5)
    np.testing.assert_allclose(slope[:-1], np.diff(dense), atol=1e-5)


def test_the_likeliest_ratio_is_near_the_true_one():
    generator = np.random.default_rng(2)
    steps = 1e-2 * generator.normal(size=20_000)
    y = np.cumsum(np.cumsum(steps)) + generator.normal(size=20_000)
    assert np.log10(random_walk.likeliest_ratio(y)) == pytest.approx(-4, abs=0.1)


def test_the_autoregression_finds_order_and_coefficients():
    generator = np.random.default_rng(3)
    white = 0.3 * generator.normal(size=50_000)
    y = noise.settled(np.ones(1), np.array([1.0, -1.4, 0.7]), white)
    found = noise.autoregression(y, 20)
    assert 3 <= len(found.a) <= 6
    np.testing.assert_allclose(found.a[:3], [1, -1.4, 0.7], atol=0.02)
    assert found.variance == pytest.approx(0.09, rel=0.02)
    lattice = noise.burg(y, 20, order=len(found.a) - 1)
    np.testing.assert_allclose(lattice.a, found.a, atol=1e-3)


def test_the_controller_and_its_inverse_undo_one_another():
    """Sums and differences written out, against the transfer function."""
    generator = np.random.default_rng(4)
    step, error = 2e-4, generator.normal(size=500)
    error[:2] = 0.0
    speed, lag = np.zeros(500), 1e-3
    for i in range(1, 500):
        speed[i] = (lag * speed[i - 1] + error[i] - error[i - 1]) / (lag + step)
    written = 50 * error + 0.3 * speed + 900 * np.cumsum(error) * step
    numerator, denominator = noise.controller(50, 0.3, 900, lag, step)
    np.testing.assert_allclose(noise.settled(denominator, numerator, written), error, atol=1e-9)
