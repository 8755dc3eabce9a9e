"""RIVC: coloured noise is modelled, and the covariance is true again."""

from __future__ import annotations

import numpy as np
import pytest

from pivident.foundation.errors import IdentificationError
from pivident.linear.sampled_data import continuous_response
from pivident.linear.srivc import rivc, srivc
from tests.linear import published_systems
from tests.linear.monte_carlo import check_against_bound, estimate


@pytest.mark.parametrize("noise_order", [None, (4, 0), (2, 1)])
@pytest.mark.parametrize(
    "system", [published_systems.RIVBJ, published_systems.COLOURED], ids=lambda system: system.name
)
def test_unbiased_and_efficient_under_coloured_noise(system, noise_order):
    check_against_bound(system, 6, rivc, noise_order=noise_order)


def test_noise_model_is_found():
    system = published_systems.RIVBJ
    model = estimate(system, 1, rivc, noise_order=(2, 1))
    truth = np.r_[system.ar[1:], system.ma[1:]]
    found = np.r_[model.noise.ar[1:], model.noise.ma[1:]]
    assert np.all(np.abs(found - truth) < 4 * np.sqrt(np.diag(model.noise.covariance)))
    assert np.sqrt(model.residual_variance) == pytest.approx(system._innovation_std(), rel=0.05)


def test_noise_model_sharpens_the_estimate():
    """Noise that nearly integrates: fifty times smaller deviations."""
    system = published_systems.COLOURED
    white, coloured = estimate(system, 0, srivc), estimate(system, 0, rivc)
    assert white.std[0] > 10 * coloured.std[0]


def test_white_noise_costs_nothing():
    system = published_systems.NON_MINIMUM_PHASE
    white, coloured = estimate(system, 2, srivc), estimate(system, 2, rivc)
    assert np.all(np.abs(white.theta - coloured.theta) < white.std)


def test_noise_free_data_need_no_noise_model():
    u = np.random.default_rng(0).normal(size=600)
    y = continuous_response(np.array([4.0]), np.array([1.0, 2.0]), u, 0.1, "zoh")
    model = rivc(u, y, 0.1, 0, 1)
    assert model.noise is None
    np.testing.assert_allclose(model.theta, [2.0, 4.0], rtol=1e-8)


def test_noise_order_beyond_the_record_is_refused():
    rng = np.random.default_rng(0)
    u = rng.normal(size=60)
    with pytest.raises(IdentificationError, match="order 50"):
        rivc(u, np.cumsum(u) * 0.1 + rng.normal(size=60), 0.1, 0, 1, noise_order=(50, 0))
