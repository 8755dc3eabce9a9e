"""Splines against those of SciPy."""

import numpy as np
import pytest
import scipy.interpolate

from pivident.foundation.errors import RecordingTooShort
from pivident.signals.cubic_spline import cubic_spline


@pytest.mark.parametrize("shape", [(4,), (5, 2), (200,), (200, 6)])
@pytest.mark.parametrize("regular", [True, False])
def test_values_and_slopes_are_those_of_scipy_also_beyond_the_ends(shape, regular):
    rng = np.random.default_rng(5)
    y = rng.standard_normal(shape)
    x = np.arange(len(y)) if regular else np.cumsum(rng.random(len(y)) + 0.1)
    at = np.linspace(x[0] - 1.0, x[-1] + 1.0, 311)
    made, wanted = cubic_spline(x, y), scipy.interpolate.CubicSpline(x, y)
    np.testing.assert_allclose(made.c, wanted.c, rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(made(at), wanted(at), rtol=1e-12, atol=1e-12)
    np.testing.assert_allclose(made.derivative()(at), wanted(at, 1), rtol=1e-11, atol=1e-11)
    assert made(x[1]).shape == shape[1:]


def test_three_samples_are_too_few():
    with pytest.raises(RecordingTooShort, match="4"):
        cubic_spline(np.arange(3.0), np.arange(3.0))
