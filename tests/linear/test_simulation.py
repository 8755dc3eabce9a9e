"""Simulation and filtered derivatives against scipy and closed forms."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.linalg import expm
from scipy.signal import cont2discrete, lfilter, lsim

from pivident.foundation.errors import UnusableSignal
from pivident.linear.estimate import LinearEstimate
from pivident.linear.model import Fit
from pivident.linear.sampled_data import continuous_response, delayed, simulate
from pivident.linear.state_variable_filter import (
    discretised_chain,
    filtered_derivatives,
    small_exponential,
)

NUMERATOR = np.array([-6400.0, 1600.0])
DENOMINATOR = np.array([1.0, 5.0, 408.0, 416.0, 1600.0])


def model_of(numerators, denominators, delays=(0,), continuous=True, dt=0.01) -> LinearEstimate:
    size = sum(len(a) - 1 for a in denominators) + sum(len(b) for b in numerators)
    return LinearEstimate(
        method="given",
        numerators=tuple(np.asarray(b, float) for b in numerators),
        denominators=tuple(np.asarray(a, float) for a in denominators),
        dt=dt,
        continuous=continuous,
        delays=tuple(delays),
        hold="zoh",
        common=False,
        names=("",) * size,
        theta=np.zeros(size),
        covariance=np.zeros((size, size)),
        noise=None,
        residual_variance=0.0,
        fit=Fit(1.0, 0.0, 0.0, 0.0, 0),
    )


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_response_is_exact_for_the_hold(hold):
    u = np.random.default_rng(1).normal(size=500)
    ours = continuous_response(NUMERATOR, DENOMINATOR, u, 0.01, hold)
    if hold == "zoh":
        b, a, _ = cont2discrete((NUMERATOR, DENOMINATOR), 0.01, "zoh")
        reference = lfilter(b.ravel(), a, u)
    else:
        reference = lsim((NUMERATOR, DENOMINATOR), u, 0.01 * np.arange(500))[1]
    np.testing.assert_allclose(ours, reference, atol=1e-9 * np.abs(reference).max())


def test_filtered_derivatives_add_up_to_the_signal():
    v = np.random.default_rng(2).normal(size=300)
    rows = filtered_derivatives(v, DENOMINATOR, 0.01, "foh")
    np.testing.assert_allclose(DENOMINATOR @ rows, v, atol=1e-9)


@pytest.mark.parametrize("order", [1, 2, 5, 7])
def test_repeated_pole_has_its_closed_form_step_response(order):
    """1/(p + λ)^n answers a step with the incomplete gamma function."""
    from scipy.special import gammainc

    pole, dt = 3.0, 1e-3
    a = np.poly(np.full(order, -pole))
    x = filtered_derivatives(np.ones(2000), a, dt, "zoh")[-1]
    expected = gammainc(order, pole * dt * np.arange(2000)) / pole**order
    np.testing.assert_allclose(x, expected, atol=1e-11 * expected.max())


def test_fast_sampling_keeps_its_accuracy():
    """The states keep 10 digits where the direct form of order 6 has lost most of them."""
    a, dt = np.poly(np.full(6, -1.0)), 2e-4
    from scipy.special import gammainc

    samples = np.arange(20000)
    expected = gammainc(6, dt * samples)
    x = filtered_derivatives(np.ones(samples.size), a, dt, "zoh")[-1]
    np.testing.assert_allclose(x[1000:], expected[1000:], rtol=1e-6, atol=1e-13)


@pytest.mark.parametrize("norm", [1e-6, 1.0, 40.0])
def test_exponential_is_scipys(norm):
    matrix = norm * np.random.default_rng(4).normal(size=(6, 6)) / 6
    expected = expm(matrix)
    np.testing.assert_allclose(
        small_exponential(matrix), expected, atol=1e-11 * np.abs(expected).max()
    )


def test_chain_of_an_integrator_is_finite():
    phi, *_ = discretised_chain(np.array([1.0, 0.0]), 0.1, "zoh")
    np.testing.assert_allclose(phi, 1.0)


def test_inputs_are_delayed_and_summed():
    u = np.random.default_rng(3).normal(size=(200, 2))
    model = model_of(([1.0], [2.0, 1.0]), ([1.0, 3.0], [1.0, 1.0, 5.0]), delays=(4, 0))
    apart = continuous_response(
        np.array([1.0]), np.array([1.0, 3.0]), delayed(u[:, 0], 4), 0.01, "zoh"
    ) + continuous_response(np.array([2.0, 1.0]), np.array([1.0, 1.0, 5.0]), u[:, 1], 0.01, "zoh")
    np.testing.assert_allclose(simulate(model, u), apart)
    with pytest.raises(UnusableSignal, match=r"\(samples, 2\)"):
        simulate(model, u[:, 0])


def test_discrete_models_are_their_own_recursion():
    u = np.random.default_rng(5).normal(size=100)
    model = model_of(([0.0, 2.0],), ([1.0, -0.8],), delays=(3,), continuous=False)
    expected = np.zeros(100)
    for k in range(1, 100):
        expected[k] = 0.8 * expected[k - 1] + (2 * u[k - 4] if k >= 4 else 0)
    np.testing.assert_allclose(simulate(model, u), expected)


def test_gain_alone_needs_no_state():
    np.testing.assert_allclose(
        continuous_response(np.array([2.5]), np.array([1.0]), np.arange(4.0), 0.1, "zoh"),
        2.5 * np.arange(4.0),
    )
