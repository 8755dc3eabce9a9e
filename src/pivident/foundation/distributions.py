"""Tails and quantiles of the distributions that tests and intervals are made of.

Named as in ``scipy.stats``, whose import takes as long as that of everything else that a command
needs: ``sf`` is the upper tail P(X > x), ``cdf`` the lower one, ``ppf`` and ``isf`` are their
inverses. All take arrays, and are NaN where a number of degrees of freedom is not positive.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from scipy.special import (
    chdtr,
    chdtrc,
    chdtri,
    fdtrc,
    fdtri,
    gammaincinv,
    ndtr,
    ndtri,
    stdtr,
    stdtrit,
)

Numbers = Any  # a number or an array


class chi_square:
    """χ² distribution with some degrees of freedom."""

    @staticmethod
    def sf(x: Numbers, freedom: Numbers) -> Numbers:
        """Probability of more than x."""
        return chdtrc(_positive(freedom), np.maximum(x, 0.0))

    @staticmethod
    def cdf(x: Numbers, freedom: Numbers) -> Numbers:
        """Probability of at most x."""
        return chdtr(_positive(freedom), np.maximum(x, 0.0))

    @staticmethod
    def ppf(probability: Numbers, freedom: Numbers) -> Numbers:
        """Value that is exceeded with one minus the probability."""
        return 2.0 * gammaincinv(0.5 * _positive(freedom), probability)

    @staticmethod
    def isf(probability: Numbers, freedom: Numbers) -> Numbers:
        """Value that is exceeded with the probability."""
        return chdtri(_positive(freedom), probability)


class fisher:
    """F distribution with degrees of freedom of numerator and denominator."""

    @staticmethod
    def sf(x: Numbers, above: Numbers, below: Numbers) -> Numbers:
        """Probability of more than x."""
        return fdtrc(_positive(above), _positive(below), np.maximum(x, 0.0))

    @staticmethod
    def ppf(probability: Numbers, above: Numbers, below: Numbers) -> Numbers:
        """Value that is exceeded with one minus the probability."""
        return fdtri(_positive(above), _positive(below), probability)


class student:
    """Student's t distribution with some degrees of freedom."""

    @staticmethod
    def sf(x: Numbers, freedom: Numbers) -> Numbers:
        """Probability of more than x."""
        return stdtr(_positive(freedom), np.negative(x))

    @staticmethod
    def cdf(x: Numbers, freedom: Numbers) -> Numbers:
        """Probability of at most x."""
        return stdtr(_positive(freedom), x)

    @staticmethod
    def ppf(probability: Numbers, freedom: Numbers) -> Numbers:
        """Value that is exceeded with one minus the probability."""
        return stdtrit(_positive(freedom), probability)

    @staticmethod
    def isf(probability: Numbers, freedom: Numbers) -> Numbers:
        """Value that is exceeded with the probability."""
        return -stdtrit(_positive(freedom), probability)


class normal:
    """Standard normal distribution."""

    @staticmethod
    def sf(x: Numbers) -> Numbers:
        """Probability of more than x."""
        return ndtr(np.negative(x))

    @staticmethod
    def cdf(x: Numbers) -> Numbers:
        """Probability of at most x."""
        return ndtr(x)

    @staticmethod
    def ppf(probability: Numbers) -> Numbers:
        """Value that is exceeded with one minus the probability."""
        return ndtri(probability)


def _positive(freedom: Numbers) -> Numbers:
    """Degrees of freedom, NaN where they are not positive."""
    return np.where(np.greater(freedom, 0), freedom, np.nan)[()]
