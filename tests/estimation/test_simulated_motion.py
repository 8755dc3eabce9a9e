"""Differences of a simulated motion, made stretch by stretch."""

import numpy as np
import pytest

from pivident.loop.motion.motion import SimulatedMotion, central_differences
from pivident.signals.instants import derivatives_at_instants


@pytest.mark.parametrize(
    "span", [(0, 500), (0, 1), (0, 2), (1, 2), (2, 30), (400, 500), (498, 499), (499, 500)]
)
def test_a_stretch_has_the_derivatives_of_the_whole_record(span):
    q = np.random.default_rng(0).standard_normal((3, 500)).cumsum(axis=1)
    whole = [derivatives_at_instants(*central_differences(x, 997.3)) for x in q]
    _, dq, ddq = SimulatedMotion(q, 997.3).stretch(slice(*span))
    np.testing.assert_array_equal(dq, np.array([w[0] for w in whole])[:, slice(*span)])
    np.testing.assert_array_equal(ddq, np.array([w[1] for w in whole])[:, slice(*span)])
