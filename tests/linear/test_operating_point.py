"""Offsets of the signals and a start that is not at rest, estimated or named."""

from __future__ import annotations

from functools import cache

import numpy as np
import pytest
from scipy.optimize import least_squares
from scipy.signal import cont2discrete, lfilter

from pivident.foundation.errors import IdentificationError, UnstableFit
from pivident.linear import order_selection
from pivident.linear.order_selection import OrderCandidate, OrderTable, select_orders
from pivident.linear.srivc import rivc, srivc

#: y = 4/(p² + 0.8 p + 4) u, sampled with period [s].
NUMERATOR, DENOMINATOR, PERIOD = [4.0], [1.0, 0.8, 4.0], 0.05

#: Offsets of u and y, so that y keeps 5 - 1 · 3 while u is zero.
U_0, Y_0, KEPT = 3.0, 5.0, 2.0


def record(seed, samples=1500, *, noise=0.05, ar=0.0, start=1.0):
    """Input and output with offsets, from a state that is not zero."""
    rng = np.random.default_rng(seed)
    u = np.repeat(rng.choice([-1.0, 1.0], samples // 10), 10)
    b, a, _ = cont2discrete((NUMERATOR, DENOMINATOR), PERIOD)
    y, _ = lfilter(b.ravel(), a, u, zi=np.full(2, start))
    error = lfilter([1.0], [1.0, -ar], noise * rng.standard_normal(samples))
    return u + U_0, y + Y_0 + error


@cache
def fitted_simulation(seed):
    """The same unknowns by a fitted simulation: a1, a2, b0, offset, two initial values."""
    u, y = record(seed)

    def residual(x):
        b, a, _ = cont2discrete(([x[2]], [1.0, x[0], x[1]]), PERIOD)
        forced = lfilter(b.ravel(), a, u)
        free, _ = lfilter([0.0], a, np.zeros(y.size), zi=x[4:])
        return (forced + free + x[3] - y)[1:]

    return least_squares(residual, [1.0, 5.0, 5.0, 1.0, 0.0, 0.0], x_scale="jac", xtol=1e-14).x


def test_the_estimate_is_that_of_a_fitted_simulation():
    model = srivc(*record(0), PERIOD, 0, 2, offset=True, tolerance=1e-10)
    oracle = fitted_simulation(0)
    assert np.abs(model.theta - oracle[:3]).max() < 1e-3 * model.std.min()
    assert abs(model.offset[0] - oracle[3]) < 1e-3 * model.offset[1]


@pytest.mark.parametrize(("method", "ar"), [(srivc, 0.0), (rivc, 0.7)])
def test_intervals_hold_the_truth(method, ar):
    runs = [method(*record(seed, ar=ar), PERIOD, 0, 2, offset=True) for seed in range(24)]
    errors = np.array([(m.theta - [0.8, 4.0, 4.0]) / m.std for m in runs])
    offsets = np.array([(m.offset[0] - KEPT) / m.offset[1] for m in runs])
    for found in (errors, offsets):
        assert np.abs(found).max() < 4.5 and 0.85 < np.mean(np.abs(found) < 2.0)
        assert 0.6 < np.sqrt(np.mean(found**2)) < 1.5


def test_offsets_much_larger_than_what_moves():
    """At a period of five time constants, with a response seven thousandths of a millesimal."""
    rng = np.random.default_rng(3)
    u = np.repeat(rng.choice([-1.0, 1.0], 200), 10)
    b, a, _ = cont2discrete(([0.001, 0.001], [1.0, 1e6]), 5e-6)
    y = lfilter(b.ravel(), a, u) + 2e-5 * rng.standard_normal(u.size)
    model = srivc(u + 3.0, y + 5.0, 5e-6, 1, 1, offset=True)
    assert np.all(np.abs(model.theta[:2] - [1e6, 0.001]) < 4 * model.std[:2])
    assert abs(model.theta[0] / 1e6 - 1) < 0.02
    assert any(
        "5 of its time constants" in w or "of its time constants" in w for w in model.warnings
    )
    assert any("cannot tell b1 from zero" in w for w in model.warnings)


@pytest.mark.parametrize("scale", [1.0, 0.01])
def test_where_it_lacks_it_is_named(scale):
    """With a large offset the fit is bad, with a small one it is good and the residual is not."""
    u, y = record(0, noise=1e-4, start=scale)
    model = srivc(u - (1 - scale) * U_0, y - (1 - scale) * Y_0, PERIOD, 0, 2)
    assert any("offset=True" in warning for warning in model.warnings)
    assert not any("offset" in w for w in srivc(*record(0), PERIOD, 0, 2, offset=True).warnings)
    chosen = select_orders(u - (1 - scale) * U_0, y - (1 - scale) * Y_0, PERIOD, [0], [1, 2]).rows[
        0
    ]
    assert chosen.rejected or any("offset=True" in w for w in chosen.estimate.warnings)


def test_among_orders_the_chosen_one_alone_is_asked_for_an_offset(monkeypatch):
    asked = []

    def estimator(*given, offset=False, **options):
        asked.append(offset)
        return srivc(*given, offset=offset, **options)

    monkeypatch.setitem(order_selection._ESTIMATORS, "srivc", estimator)
    u, y = record(0, noise=0.5)  # of which a model explains less than nine tenths
    table = select_orders(u - U_0, y - KEPT - U_0, PERIOD, [0], [1, 2])
    assert table.rows[0].score("r2") < 0.9
    assert asked == [None, None, False]


def test_nothing_is_named_at_rest():
    u, y = record(1, start=0.0)
    model = srivc(u - U_0, y - Y_0, PERIOD, 0, 2)
    assert model.offset is None and model.warnings == ()
    both = srivc(u - U_0, y - Y_0, PERIOD, 0, 2, offset=True)
    assert np.all(np.abs(both.theta - model.theta) < 0.5 * model.std)
    assert abs(both.offset[0]) < 3 * both.offset[1] and "offset" in str(both)


def test_an_unstable_fit_names_an_offset_only_where_there_is_one():
    rng = np.random.default_rng(1)
    u, slow = np.repeat(rng.choice([-1.0, 1.0], 100), 10), np.exp(-0.01)
    y = lfilter([0.0, 1.0 - slow], [1.0, -slow], u) + 0.001 * rng.standard_normal(1000)
    with pytest.raises(UnstableFit, match="signals have an offset"):
        srivc(u, y + 1.0, 0.01, 0, 1)
    with pytest.raises(UnstableFit, match="check the sign of u"):
        srivc(u, lfilter([0.0, 0.1], [1.0, -1.05], u), 0.1, 0, 1)


def test_denominators_of_their_own_are_refused():
    u, y = record(0)
    with pytest.raises(IdentificationError, match="one denominator for all inputs"):
        srivc(np.c_[u, u[::-1]], y, PERIOD, 0, 2, common=False, offset=True)


def test_a_pole_that_the_hold_determines_is_no_reason_to_reject():
    rng = np.random.default_rng(0)
    u = rng.choice([-1.0, 1.0], 2000)
    b, a, _ = cont2discrete(([0.001, 0.001], [1.0, 1e6]), 5e-6)
    y = lfilter(b.ravel(), a, u) + 1e-5 * rng.standard_normal(u.size)
    table = select_orders(u, y, 5e-6, (0, 1), (1, 2, 3))
    first = table.rows[0]
    assert (first.numerator_order, first.denominator_order) == (1, 1)
    assert first.score("r2") > 0.999 and abs(table.best.theta[0] / 1e6 - 1) < 0.02


def test_a_far_better_model_that_was_rejected_is_named():
    u, y = record(2, noise=1e-3, start=0.0)
    low, high = (srivc(u - U_0, y - Y_0, PERIOD, 0, order) for order in (1, 2))
    rows = OrderCandidate(0, 1, 0, low, ""), OrderCandidate(0, 2, 0, high, "did not converge")
    assert str(OrderTable(rows, "yic")).endswith(
        "A rejected model of orders 0 and 2 leaves 8.9e-07 of the output's variance, the first one "
        "0.55: did not converge."
    )
    assert "A rejected model" not in str(OrderTable((rows[1], rows[0]), "yic"))
