"""Sums over pairs of samples, against the pairs one by one."""

import numpy as np
import pytest

from pivident.signals.noise_models import lagged_products, lagged_sums


@pytest.mark.parametrize("length", [None, 128])
@pytest.mark.parametrize("lags", [0, 7, 39])
def test_products_are_those_of_all_pairs(lags, length):
    x = np.random.default_rng(1).normal(2.0, 1.0, 40)
    pairs = [x[: x.size - k] @ x[k:] for k in range(lags + 1)]
    assert lagged_products(x, lags, length) == pytest.approx(pairs, abs=1e-12)


def test_no_pair_reaches_over_a_gap_or_into_the_next_recording():
    rng = np.random.default_rng(2)
    pieces = [rng.normal(1.0, 1.0, 30), rng.normal(3.0, 1.0, 20)]
    pieces[0][10:13] = np.nan
    pieces[1][[3, 17]] = np.nan
    centred = [piece - np.nanmean(np.concatenate(pieces)) for piece in pieces]
    found = lagged_sums(pieces, 25)
    for k in range(26):
        products = np.concatenate([x[: max(x.size - k, 0)] * x[k:] for x in centred])
        products = products[np.isfinite(products)]
        assert found.pairs[k] == products.size
        assert found.products[k] == pytest.approx(products.sum(), abs=1e-11)
        assert found.squares[k] == pytest.approx(np.sum(products**2), abs=1e-11)
