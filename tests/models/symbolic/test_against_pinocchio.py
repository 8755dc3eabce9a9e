"""Symbolic inverse models of random trees against Pinocchio."""

import sys

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.parameters import standard_parameters
from pivident.models.symbolic.newton_euler import inverse_model

if sys.platform == "win32":
    pytest.skip("there is no Pinocchio for Windows", allow_module_level=True)
from tests.dynamics.trees import RandomTree
from tests.models.symbolic.evaluation import evaluated


@settings(max_examples=15, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_inverse_model_is_rnea(seed):
    tree = RandomTree(seed, 6)
    tree.draw_inertias()
    parameters = [p for p in standard_parameters(tree.robot) if p.is_inertial]
    q, dq, ddq = tree.states(3)
    (tau,) = evaluated(inverse_model(tree.robot, parameters, tree.inertia.ravel()), q, dq, ddq)
    theirs = tree.rnea(q, dq, ddq)
    np.testing.assert_allclose(tau, theirs, rtol=0, atol=1e-11 * max(1.0, np.abs(theirs).max()))
