"""Profile intervals: the estimate's own where nothing is near a limit, CVXPY's where it is."""

from dataclasses import replace

import numpy as np
import pytest

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds
from tests.synthetic_identification import synthetic_identification, true_parameters


def test_far_from_all_limits_they_are_those_of_the_estimate():
    free = synthetic_identification(relative_std=1e-3)
    found = make_consistent(free).intervals()
    assert found.names == free.names
    assert found.low == pytest.approx(free.theta - 1.959964 * free.method_std, rel=1e-4)
    assert found.high == pytest.approx(free.theta + 1.959964 * free.method_std, rel=1e-4)
    narrow = make_consistent(free).intervals(level=0.5)
    assert narrow.high - narrow.low == pytest.approx(2 * 0.67449 * free.method_std, rel=1e-4)


def test_the_truth_is_inside_as_often_as_promised():
    """Errors of the estimates are those of their covariance; the machine exists."""
    truth = np.array(list(true_parameters("staubli_tx40").values()))
    inside = []
    for seed in range(3):
        free = synthetic_identification(
            robot_name="staubli_tx40", relative_std=0.01, seed=seed, samples=200
        )
        own = make_consistent(replace(free, recordings=()), accept_far=True).intervals()
        inside.append((own.low <= truth + 1e-9) & (truth <= own.high + 1e-9))
        # consistency takes away what no machine has, never more than the estimate's own interval
        assert np.all(own.high - own.low <= 2.2 * 1.96 * free.method_std + 1e-9)
    assert 0.88 <= np.mean(inside) <= 1.0


def test_standard_parameters_against_cvxpy():
    cvxpy = pytest.importorskip("cvxpy")
    from pivident.models.consistency.pseudo_inertia import BASIS

    free = synthetic_identification(relative_std=0.02)
    model = make_consistent(free, bounds=Bounds(total_mass=(None, 20.0)))
    found = model.intervals(of="standard")
    base = base_parameters(free.robot)
    phi = cvxpy.Variable(len(base.standard))
    beta = phi[base.kept] + base.regrouping @ phi[base.dropped]
    conditions = [
        cvxpy.norm((beta - free.theta) / free.method_std)
        <= np.sqrt(model.least_distance**2 + 3.841459)
    ]
    masses = []
    for i in range(2):
        place = [k for k, p in enumerate(base.standard) if p.is_inertial and p.joint == i]
        masses.append(place[9])
        matrix = sum(phi[k] * BASIS[n] for n, k in enumerate(place))
        ball = 7850.0 * np.pi / 6.0 * 0.01**3  # steel, 10 mm
        conditions.append(matrix >> np.diag([ball * 0.01**2 / 20.0] * 3 + [0.0]))
        conditions.append(phi[place[9]] >= ball)
    conditions.append(cvxpy.sum(phi[masses]) <= 20.0)
    conditions.append(phi[[k for k, p in enumerate(base.standard) if p.is_dissipative]] >= 0)
    for name in ("m2", "zz2", "ia2", "mx1"):
        k = [p.name for p in base.standard].index(name)
        low = cvxpy.Problem(cvxpy.Minimize(phi[k]), conditions).solve(solver="CLARABEL")
        high = cvxpy.Problem(cvxpy.Maximize(phi[k]), conditions).solve(solver="CLARABEL")
        assert found.of(name) == pytest.approx((low, high), rel=2e-3, abs=2e-4)


def test_what_nothing_bounds_is_said():
    free = synthetic_identification(robot_name="staubli_tx40", relative_std=1e-3, samples=200)
    model = make_consistent(replace(free, recordings=()))
    found = model.intervals(of="standard")
    assert "m1" in found.unbounded
    assert "m6" not in found.unbounded
    assert "Nothing bounds" in str(found)
    truth = nominal_values(free.robot, model.parameters)
    assert np.mean((found.low <= truth + 1e-9) & (truth <= found.high + 1e-9)) > 0.9
    for p, low in zip(model.parameters, found.low, strict=True):
        if p.is_dissipative or p.stem == "m":
            assert low >= -1e-9


def test_refusals():
    model = make_consistent(synthetic_identification())
    with pytest.raises(IdentificationError, match="level"):
        model.intervals(level=1.0)
    with pytest.raises(ExperimentError, match="estimated, base or standard"):
        model.intervals(of="links")
    with pytest.raises(KeyError, match="did you mean"):
        model.intervals().of("zz9")
