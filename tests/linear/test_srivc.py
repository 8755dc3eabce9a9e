"""SRIVC: benchmark systems, several inputs, closed loop, and what it refuses."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from scipy.signal import lfilter

from pivident.foundation.errors import (
    DelayTooLong,
    IdentificationError,
    OrdersNotSupported,
    UnstableFit,
    UnusableSignal,
)
from pivident.linear.sampled_data import continuous_response, delayed
from pivident.linear.srivc import srivc
from tests.linear import published_systems
from tests.linear.monte_carlo import check_against_bound, estimate


@pytest.mark.parametrize(
    "system",
    [
        published_systems.RAO_GARNIER,
        published_systems.DELAYED_LAG,
        published_systems.NON_MINIMUM_PHASE,
        published_systems.CLOSED_LOOP,
    ],
    ids=lambda system: system.name,
)
def test_unbiased_and_efficient(system):
    check_against_bound(system, 8, srivc)


@pytest.mark.parametrize("hold", ["zoh", "foh"])
def test_noise_free_data_give_the_truth(hold):
    system = published_systems.RAO_GARNIER
    u = np.random.default_rng(0).normal(size=2000)
    b, a = np.array(system.numerator), np.array(system.denominator)
    x = continuous_response(b, a, u, system.dt, hold)
    model = srivc(u, x, system.dt, 1, 4, hold=hold)
    np.testing.assert_allclose(model.theta, system.theta, rtol=1e-7)
    assert model.fit.r2 == pytest.approx(1.0)
    np.testing.assert_allclose(model.simulate(u), x, atol=1e-6 * np.ptp(x))


def test_biproper_models_are_found():
    u = np.random.default_rng(1).normal(size=1500)
    y = continuous_response(np.array([2.0, 1.0, 3.0]), np.array([1.0, 2.0, 9.0]), u, 0.05, "zoh")
    model = srivc(u, y, 0.05, 2, 2)
    np.testing.assert_allclose(model.theta, [2.0, 9.0, 2.0, 1.0, 3.0], rtol=1e-6)
    assert model.names == ("a1", "a2", "b0", "b1", "b2")


@pytest.mark.parametrize("seed", range(4))
def test_time_scale_does_not_matter(seed):
    """The same record in microseconds gives the same model in 1/µs."""
    system, scale = published_systems.NON_MINIMUM_PHASE, 1e-6
    record = system.record(seed)
    slow = srivc(record.u, record.y, system.dt, 1, 2, delay=system.delay)
    fast = srivc(record.u, record.y, system.dt * scale, 1, 2, delay=system.delay)
    np.testing.assert_allclose(fast.poles[0] * scale, slow.poles[0], rtol=1e-3)


A1, A2 = np.array([1.0, 2.0, 16.0]), np.array([1.0, 5.0])
B1, B2 = np.array([1.0, 8.0]), np.array([10.0])


def two_inputs(seed, common):
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], size=(400, 2)), 10, axis=0)
    second = (np.array([3.0, 20.0]), A1) if common else (B2, A2)
    x = continuous_response(B1, A1, delayed(u[:, 0], 5), 0.02, "zoh")
    x = x + continuous_response(*second, u[:, 1], 0.02, "zoh")
    return u, x + 0.2 * np.std(x) * rng.normal(size=x.size)


def test_several_inputs_with_a_common_denominator():
    found = [srivc(*two_inputs(s, True), 0.02, 1, 2, delay=(5, 0)) for s in range(6)]
    truth = np.array([2.0, 16.0, 1.0, 8.0, 3.0, 20.0])
    z = np.array([(m.theta - truth) / m.std for m in found])
    assert all(m.converged for m in found)
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    assert found[0].names == ("a1", "a2", "b0_u1", "b1_u1", "b0_u2", "b1_u2")


def test_several_inputs_with_denominators_of_their_own():
    found = [
        srivc(*two_inputs(s, False), 0.02, (1, 0), (2, 1), delay=(5, 0), common=False)
        for s in range(6)
    ]
    truth = np.array([2.0, 16.0, 5.0, 1.0, 8.0, 10.0])
    z = np.array([(m.theta - truth) / m.std for m in found])
    assert all(m.converged for m in found)
    assert 0.6 < np.sqrt(np.mean(z**2)) < 1.4
    assert found[0].names == ("a1_u1", "a2_u1", "a1_u2", "b0_u1", "b1_u1", "b0_u2")


def test_in_a_loop_the_external_signal_removes_the_bias():
    """Noise with memory reaches the input through the controller and the instruments with it."""
    system = replace(published_systems.CLOSED_LOOP, ar=(1.0, -0.98))
    runs = 8
    records = [system.record(seed) for seed in range(runs)]
    means = {}
    for loop in (False, True):
        found = [
            srivc(r.u, r.y, system.dt, 1, 2, external=r.external if loop else None) for r in records
        ]
        assert {model.method for model in found} == {"CLSRIVC" if loop else "SRIVC"}
        means[loop] = np.mean([model.theta for model in found], axis=0)
    error = {loop: np.abs(mean - system.theta) / system.bound() for loop, mean in means.items()}
    assert error[True].max() < 4 / np.sqrt(runs)
    assert error[False].max() > 8 / np.sqrt(runs)


def test_given_filter_pole_and_chosen_one_end_in_the_same_model():
    system = published_systems.RAO_GARNIER
    chosen = estimate(system, 3, srivc)
    given = estimate(system, 3, srivc, svf_pole=25.0)
    np.testing.assert_allclose(given.theta, chosen.theta, atol=0.01 * chosen.std.min())


U = np.repeat(np.random.default_rng(0).choice([-1.0, 1.0], 60), 5)
#: Answer of 4/(s + 2), by its own recursion: `continuous_response` would be compiled in each worker
#: that only looks which tests there are.
Y = lfilter([0.0, 2.0 * (1.0 - np.exp(-0.2))], [1.0, -np.exp(-0.2)], U)


def with_nan(signal):
    signal = signal.copy()
    signal[7] = np.nan
    return signal


@pytest.mark.parametrize(
    ("error", "message", "arguments", "options"),
    [
        (UnusableSignal, "u is 3 at every sample", (np.full(300, 3.0), Y, 0.1, 0, 1), {}),
        (UnusableSignal, "y has 1 sample", (U, with_nan(Y), 0.1, 0, 1), {}),
        (UnusableSignal, "y has 299 samples, but u has 300", (U, Y[1:], 0.1, 0, 1), {}),
        (UnusableSignal, "y has 2 columns", (U, np.c_[Y, Y], 0.1, 0, 1), {}),
        (UnusableSignal, "has shape", (np.zeros((2, 2, 2)), Y, 0.1, 0, 1), {}),
        (UnusableSignal, "dt is 0", (U, Y, 0, 0, 1), {}),
        (DelayTooLong, "400 samples", (U, Y, 0.1, 0, 1), {"delay": 400}),
        (OrdersNotSupported, "at least", (U[:20], Y[:20], 0.1, 3, 6), {}),
        (IdentificationError, "degree 2, above", (U, Y, 0.1, 2, 1), {}),
        (IdentificationError, "numerator_order is 1.5", (U, Y, 0.1, 1.5, 2), {}),
        (IdentificationError, "hold is 'tustin'", (U, Y, 0.1, 0, 1), {"hold": "tustin"}),
        (OrdersNotSupported, "rank", (np.c_[U, U], Y, 0.1, 0, 1), {}),
    ],
)
def test_errors_name_cause_and_value(error, message, arguments, options):
    with pytest.raises(error, match=message):
        srivc(*arguments, **options)


def test_unstable_systems_are_refused():
    y = lfilter([0.0, 0.1], [1.0, -1.02], U)
    with pytest.raises(UnstableFit, match="unstable poles"):
        srivc(U, y, 0.1, 0, 1)


def test_integrators_are_kept_with_a_warning():
    rng = np.random.default_rng(0)
    y = lfilter([0.0, 0.1], [1.0, -1.0], U)
    found = [srivc(U, y + 0.02 * rng.normal(size=y.size), 0.1, 0, 1) for _ in range(6)]
    assert all(abs(m.theta[0]) < 1 / 30 and abs(m.theta[1] - 1) < 0.05 for m in found)


def test_offsets_are_named():
    rng = np.random.default_rng(0)
    model = srivc(U, Y + 3.0 + 0.1 * rng.normal(size=Y.size), 0.1, 0, 1)
    assert any("operating point" in sentence for sentence in model.warnings)
