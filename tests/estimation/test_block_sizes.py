"""Records are walked through in blocks; where a block ends makes no difference."""

import numpy as np
import pytest

from pivident.estimation import full_rate
from pivident.estimation.identify import identify
from pivident.experiment import simulated_tx40 as scenarios


@pytest.fixture(scope="module")
def problem():
    return scenarios.tx40_fine(seed=3, samples=12_000)[0]


@pytest.mark.parametrize("method", ["ls", "iv", "iv-full-rate", "piv"])
@pytest.mark.parametrize("block", [511, 2048, 100_000])
def test_the_estimate_does_not_depend_on_the_size_of_the_blocks(
    problem, method, block, monkeypatch
):
    usual = identify(problem, method)
    monkeypatch.setattr(full_rate, "BLOCK", block)
    other = identify(problem, method)
    std = np.sqrt(np.diag(usual.covariance))
    # convergence stops at the same iteration, so only the order of sums differs
    assert other.iterations == usual.iterations
    np.testing.assert_allclose(other.theta, usual.theta, rtol=0, atol=1e-6 * std.min() + 1e-9)
    np.testing.assert_allclose(other.covariance, usual.covariance, rtol=1e-6, atol=1e-12)
