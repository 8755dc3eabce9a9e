"""Estimates of a benchmark system over seeds, against truth and bound."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from pivident.linear.estimate import LinearEstimate
from tests.linear.published_systems import Benchmark

Estimator = Callable[..., LinearEstimate]


def estimate(system: Benchmark, seed: int, estimator: Estimator, **options) -> LinearEstimate:
    record = system.record(seed)
    numerator, denominator = system.orders
    return estimator(
        record.u,
        record.y,
        system.dt,
        numerator,
        denominator,
        delay=system.delay,
        external=record.external,
        **options,
    )


def check_against_bound(system: Benchmark, runs: int, estimator: Estimator, **options) -> None:
    """Unbiased within 4 deviations of the mean, and as spread as the bound says.

    With few runs the spread itself is only known to 1/√(2 runs), so it is judged over all
    parameters at once.
    """
    found = [estimate(system, seed, estimator, **options) for seed in range(runs)]
    assert all(model.converged for model in found)
    theta = np.array([model.theta for model in found])
    bound = system.bound()
    assert np.all(np.abs(theta.mean(axis=0) - system.theta) < 4 * bound / np.sqrt(runs))
    ratio = np.sqrt(np.mean(((theta - system.theta) / bound) ** 2))
    assert 0.6 < ratio < 1.5
    reported = np.mean([model.std for model in found], axis=0)
    np.testing.assert_allclose(reported, bound, rtol=0.35)
