"""Many tests at once: probabilities that keep their promise for all of them together.

Of 200 parameters that do not differ, ten differ "significantly" at 5 %. Holm (1979) orders the
probabilities p_(1) ≤ … ≤ p_(m) and takes

    p̃_(k) = max_{i ≤ k} min(1, (m - i + 1) p_(i))

The probability of one false finding or more among all p̃ ≤ α is then at most α, however the tests
depend on each other.
"""

from __future__ import annotations

import numpy as np


def holm(p: np.ndarray) -> np.ndarray:
    """Adjusted probabilities, same shape; NaN where there is no test."""
    p = np.asarray(p, dtype=float)
    adjusted = np.full(p.shape, np.nan)
    tested = np.flatnonzero(np.isfinite(p))
    order = tested[np.argsort(p[tested], kind="stable")]
    factors = np.arange(order.size, 0, -1)
    adjusted[order] = np.minimum(np.maximum.accumulate(factors * p[order]), 1.0)
    return adjusted
