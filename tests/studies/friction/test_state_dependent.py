"""State-dependent parameters with known truth: recovered, inside honest bands."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.studies.friction.back_fitting import StateDependence, WalkColumns, joint_posterior
from pivident.studies.friction.random_walk_regression import smooth_parameter
from pivident.studies.friction.state_dependent import correlation_length, fit_state_dependent
from tests.studies.friction.made_up import coloured, motion

SAMPLES = 6000
RUNS = 12


def g(v):
    return 4 + 1.5 * v + 2 * np.exp(-((v / 0.5) ** 2))


def ripple(q):
    return 0.6 * np.sin(5 * q)


def loaded(load):
    return 0.3 * np.abs(load)


def case(seed, memory=15.0):
    """Observation, terms, samples in use, and the truth of each function."""
    rng = np.random.default_rng(seed)
    _, q, dq, _ = motion(rng, SAMPLES)
    load = 3 * np.cos(1.3 * q + 1.0)
    s, v = np.sign(dq), np.abs(dq)
    y = s * (g(v) + loaded(load)) + 0.5 + ripple(q) + coloured(rng, SAMPLES, 0.6, memory)
    used = v > 0.03
    terms = [
        StateDependence("positive", v, (s > 0) * 1.0),
        StateDependence("negative", v, (s < 0) * 1.0),
        StateDependence("position", q, np.ones(SAMPLES), centred=True),
        StateDependence("load", load, s, centred=True),
    ]
    at_p, at_l = ripple(q[used]).mean(), loaded(load[used]).mean()
    truth = {
        "positive": lambda x: g(x) + 0.5 + at_p + at_l,
        "negative": lambda x: -g(x) + 0.5 + at_p - at_l,
        "position": lambda x: ripple(x) - at_p,
        "load": lambda x: loaded(x) - at_l,
    }
    return y, terms, used, truth


@pytest.fixture(scope="module")
def runs():
    found = []
    for seed in range(RUNS):
        y, terms, used, truth = case(seed)
        found.append((fit_state_dependent(y, terms, used=used), truth))
    return found


def test_bands_cover_the_truth(runs):
    covered = {name: [] for name in runs[0][1]}
    for fit, truth in runs:
        for p in fit.parameters:
            covered[p.name].append(np.abs(p.value - truth[p.name](p.state)) < 2 * p.std)
    shares = {name: np.mean(np.concatenate(inside)) for name, inside in covered.items()}
    assert 0.90 <= np.mean(list(shares.values())) <= 0.99, shares
    assert min(shares.values()) > 0.84, shares


def test_functions_are_found(runs):
    for fit, truth in runs:
        assert fit.converged
        assert 12 < fit.correlation < 60  # (1 + a)/(1 - a) = 30 for a memory of 15 samples
        for p in fit.parameters:
            middle = slice(p.state.size // 10, -p.state.size // 10)
            error = (p.value - truth[p.name](p.state))[middle]
            assert np.sqrt(np.mean(error**2)) < 0.3, p.name


def test_bands_that_ignore_correlation_do_not_cover(runs):
    inside = []
    for seed, (right, truth) in enumerate(runs[:4]):
        y, terms, used, _ = case(seed)
        given = [replace(term, nvr=right[term.name].nvr) for term in terms]
        fit = fit_state_dependent(y, given, used=used, correlation=1.0)
        for p in fit.parameters:
            inside.append(np.mean(np.abs(p.value - truth[p.name](p.state)) < 2 * p.std))
    assert np.mean(inside) < 0.75


def test_back_fitting_ends_where_the_joint_solution_is():
    rng = np.random.default_rng(5)
    n = 600
    x1, x2, z2 = rng.uniform(0, 1, n), rng.uniform(0, 1, n), rng.uniform(-1, 1, n)
    x1[:2] = x2[:2] = 0.0, 1.0
    y = np.sin(4 * x1) + np.cos(3 * x2) * z2 + 0.1 * rng.standard_normal(n)
    terms = [
        StateDependence("a", x1, np.ones(n), nvr=50.0, points=101),
        StateDependence("b", x2, z2, nvr=50.0, points=101),
    ]
    fit = fit_state_dependent(y, terms, correlation=1.0, tolerance=1e-8)
    # states step at random in time, so no samples are averaged
    joint = joint_posterior(
        y,
        [
            WalkColumns(x1, np.ones(n), 50.0, 2, False, 101),
            WalkColumns(x2, z2, 50.0, 2, False, 101),
        ],
    )
    stacked = np.concatenate([p.value for p in fit.parameters])
    np.testing.assert_allclose(stacked, joint.value, atol=3e-3)


def test_joint_variance_of_one_function_is_the_smoothers():
    rng = np.random.default_rng(6)
    u = np.sort(rng.uniform(0, 1, 300))
    z = rng.uniform(0.5, 2, 300)
    joint = joint_posterior(np.zeros(300), [WalkColumns(u, z, 200.0, 2, False, 201)])
    knots = np.linspace(0, 1, 201)
    order = np.argsort(np.concatenate([u, knots]), kind="stable")
    smoothed = smooth_parameter(
        np.concatenate([u, knots])[order], np.concatenate([z, 0 * knots])[order],
        np.zeros(501), 200.0,
    )  # fmt: skip
    at_knots = np.empty(501)
    at_knots[order] = smoothed.variance
    np.testing.assert_allclose(np.diag(joint.covariance), at_knots[300:], rtol=0.02)


def test_correlation_length_of_known_noise():
    rng = np.random.default_rng(7)
    assert correlation_length([rng.standard_normal(20000)]) < 1.5
    slow = coloured(rng, 60000, 1.0, 25.0)
    assert correlation_length([slow]) == pytest.approx(50.0, rel=0.35)
    # a slow error under loud white noise is not overlooked
    hidden = 5.0 * rng.standard_normal(60000) + coloured(rng, 60000, 1.0, 200.0)
    assert correlation_length([hidden]) > 8.0


def test_contrast_has_the_band_of_its_point():
    y, terms, used, _ = case(1)
    fit = fit_state_dependent(y, terms, used=used)
    p = fit["load"]
    weights = np.zeros(p.state.size)
    weights[20] = 1.0
    value, std = fit.contrast({"load": weights})
    assert value == p.value[20] and std == pytest.approx(p.std[20])
    assert "load" in fit and "none" not in fit


def test_states_that_do_not_vary_are_refused():
    y, terms, used, _ = case(0)
    still = StateDependence("still", np.zeros(SAMPLES), np.ones(SAMPLES))
    with pytest.raises(IdentificationError, match="'still' does not vary"):
        fit_state_dependent(y, [*terms, still], used=used)
    with pytest.raises(IdentificationError, match="longer record"):
        fit_state_dependent(y, terms, used=used, correlation=1e4)
