"""The semidefinite programs against CVXPY, which formulates and scales them in its own way."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest

from pivident.models.consistency.consistent_model import make_consistent
from pivident.models.consistency.constraints import Bounds
from pivident.models.consistency.pseudo_inertia import BASIS, pseudo_inertia
from pivident.models.consistency.reference import make_reference
from tests.synthetic_identification import synthetic_identification

cvxpy = pytest.importorskip("cvxpy")


#: Without it the least distance would be approached by ever heavier links [kg].
HEAVIEST = 30.0
LIGHT = Bounds(total_mass=(None, HEAVIEST))

#: Growth of d² that is left to the prior: that of a 95 % interval.
ROOM = 1.96**2

#: A steel ball of 10 mm: mass [kg] and second moment ∫ x² dm about its centre [kg m²].
BALL_MASS = 7850.0 * 4.0 / 3.0 * np.pi * 0.005**3
BALL_MOMENT = BALL_MASS * 0.005**2 / 5.0


@cache
def inconsistent(robot="planar_2r"):
    """An estimate with such errors that it is not consistent; without torque sums.

    The made-up covariance is not that of the record, so errors of the torque tell nothing here.
    """
    spread = {"planar_2r": 0.5, "staubli_tx40": 0.15}[robot]
    free = synthetic_identification(robot_name=robot, relative_std=spread, seed=2)
    return replace(free, recordings=())


def oracle(free, reference, prior=None, near=None):
    """Least d² and its θ, or least ½ d² + prior near those: φ in plain units."""
    from pivident.dynamics.base_parameters import base_parameters

    base = base_parameters(free.robot)
    phi = cvxpy.Variable(len(base.standard))
    beta = phi[base.kept] + base.regrouping @ phi[base.dropped]
    half = np.linalg.inv(np.linalg.cholesky(free.covariance))
    squared = cvxpy.sum_squares(half @ (beta - free.theta))
    conditions, bodies = [], []
    masses = [k for k, p in enumerate(base.standard) if p.stem == "m"]
    conditions.append(cvxpy.sum(phi[masses]) <= HEAVIEST)
    for i in range(free.robot.size):
        place = [k for k, p in enumerate(base.standard) if p.is_inertial and p.joint == i]
        matrix = sum(phi[k] * BASIS[n] for n, k in enumerate(place))
        scaled = reference.roots[i] @ matrix @ reference.roots[i]
        bodies.append(scaled)
        # Σ about the centre of mass ≥ e 1 and m ≥ m_b, of a steel ball of 10 mm
        least = np.diag([BALL_MOMENT] * 3 + [0.0])
        conditions.append(scaled >> reference.roots[i] @ least @ reference.roots[i])
        conditions.append(phi[place[9]] >= BALL_MASS)
    signs = [k for k, p in enumerate(base.standard) if p.is_dissipative]
    conditions.append(phi[signs] >= 0)
    name = {p.name: k for k, p in enumerate(base.standard)}
    for c in free.robot.couplings:
        ia, other = name[f"ia{c.motor + 1}"], name[f"ia{c.joint + 1}"]
        cross = c.ratio * phi[name[f"iam{c.motor + 1}"]]
        conditions.append(cvxpy.bmat([[phi[other], cross], [cross, phi[ia]]]) >> 0)
        fv, own = name[f"fv{c.motor + 1}"], name[f"fv{c.joint + 1}"]
        cross = c.ratio * phi[name[f"fvm{c.motor + 1}"]]
        conditions.append(cvxpy.bmat([[phi[own], cross], [cross, phi[fv]]]) >> 0)
    if prior is None:
        objective = squared
    else:
        least, at = near
        conditions.append(squared <= least * (1 + 1e-4) + ROOM)
        relative = np.clip(free.method_std / np.abs(free.theta), 0.1, 1.0)
        conditions.append(cvxpy.abs(beta - at) <= relative * free.method_std)
        rest = pulled(base)
        error = cvxpy.multiply(phi[rest] - reference.values[rest], 1 / reference.scales[rest])
        objective = 0.5 * squared + 0.5 * cvxpy.sum_squares(error)
        for b in bodies:
            if prior == "entropic":
                objective += cvxpy.trace(b) - cvxpy.log_det(b)
            else:
                objective += 0.5 * cvxpy.sum_squares(b - np.eye(4))
    problem = cvxpy.Problem(cvxpy.Minimize(objective), conditions)
    problem.solve(solver="CLARABEL")
    return problem.value, beta.value


def pulled(base):
    """Rotor inertias and friction among the dropped parameters, or grouped with some of these."""
    members = set(base.dropped) | set(base.kept[np.abs(base.regrouping).max(axis=1) > 1e-12])
    return [k for k in sorted(members) if not base.standard[k].is_inertial]


def prior_value(prior, model, reference):
    """½ d² and the prior at a model, from their definitions."""
    total = 0.5 * model.distance**2
    for i, place in enumerate(model._space.links):
        scaled = reference.scaled(i, pseudo_inertia(model.values[place]))
        if prior == "entropic":
            total += np.trace(scaled) - np.linalg.slogdet(scaled)[1]
        else:
            total += 0.5 * np.sum((scaled - np.eye(4)) ** 2)
    for k in pulled(model._base):
        total += 0.5 * ((model.values[k] - reference.values[k]) / reference.scales[k]) ** 2
    return total


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
def test_the_least_distance(robot):
    free = inconsistent(robot)
    model = make_consistent(free, bounds=LIGHT)
    reference = make_reference(free.robot, model.parameters, 0.01)
    squared, _ = oracle(free, reference)
    assert model.least_distance > 0.1
    assert model.least_distance == pytest.approx(np.sqrt(squared), rel=1e-4)
    half = np.linalg.inv(np.linalg.cholesky(free.covariance))
    own = np.linalg.norm(half @ (model.theta - free.theta))
    assert model.distance == pytest.approx(own, rel=1e-6)
    assert squared - 1e-3 <= own**2 <= squared * (1 + 1e-4) + ROOM + 1e-3
    np.testing.assert_allclose(model.moved, (model.theta - free.theta) / free.std)


@pytest.mark.parametrize("prior", ["entropic", "euclidean"])
def test_the_prior_chooses_among_the_near_ones(prior):
    free = inconsistent()
    model = make_consistent(free, prior=prior, bounds=LIGHT)
    reference = make_reference(free.robot, model.parameters, 0.01)
    near = oracle(free, reference)
    best, _ = oracle(free, reference, prior, near)
    assert prior_value(prior, model, reference) == pytest.approx(best, rel=1e-3, abs=1e-3)
    half = np.linalg.inv(np.linalg.cholesky(free.covariance))
    squared = np.sum((half @ (model.theta - free.theta)) ** 2)
    assert squared <= near[0] * (1 + 1e-4) + ROOM + 1e-3


def test_no_prior_goes_inside():
    free = inconsistent("staubli_tx40")
    smallest = {}
    for prior in ("none", "euclidean", "entropic"):
        model = make_consistent(free, prior=prior)
        reference = make_reference(free.robot, model.parameters, 0.01)
        smallest[prior] = min(
            np.linalg.eigvalsh(reference.scaled(i, pseudo_inertia(model.values[place])))[0]
            for i, place in enumerate(model._space.links)
        )
    assert smallest["none"] >= max(smallest.values()) * (1 - 1e-3)


def test_active_constraints_share_the_distance():
    model = make_consistent(inconsistent("staubli_tx40"))
    assert model.active
    assert sum(a.share for a in model.active) == pytest.approx(1.0, abs=1e-3)
    names = {link.name for link in model.robot.links} | set(model.robot.joint_names)
    for a in model.active:
        assert set(a.subject.split(" and ")) <= names
        assert a.multiplier > 0.0


def test_what_is_consistent_stays():
    model = make_consistent(inconsistent("staubli_tx40"))
    for place in model._space.links:
        body = pseudo_inertia(model.values[place])
        assert np.linalg.eigvalsh(body)[0] > 0.0
        assert body[3, 3] >= BALL_MASS * (1 - 1e-3)
        central = body[:3, :3] - np.outer(body[:3, 3], body[:3, 3]) / body[3, 3]
        assert np.linalg.eigvalsh(central)[0] >= BALL_MOMENT * (1 - 1e-3)
    for p, value in zip(model.parameters, model.values, strict=True):
        if p.is_dissipative:
            assert value > -1e-9
    assert model.value("ia5") * model.value("ia6") >= model.value("iam6") ** 2 - 1e-12


def test_bounds_hold():
    free = inconsistent("staubli_tx40")
    bounds = Bounds(
        mass={"link_3": (5.0, 6.0)},
        total_mass=(None, 20.0),
        center_of_mass={"link_4": ((-0.01, 0.01), (None, None), (None, -0.2))},
        ellipsoid={"link_2": ((0.1, 0.0, 0.05), (0.1, 0.05, 0.05))},
    )
    model = make_consistent(free, bounds=bounds)
    assert 5.0 - 1e-6 <= model.link("link_3").mass <= 6.0 + 1e-6
    assert sum(b.mass for b in model.links) <= 20.0 + 1e-5
    center = model.link("link_4").center_of_mass
    assert abs(center[0]) <= 0.01 + 1e-6
    assert center[2] <= -0.2 + 1e-6
    inside = (model.link("link_2").center_of_mass - [0.1, 0.0, 0.05]) / [0.1, 0.05, 0.05]
    assert np.linalg.norm(inside) <= 1.0 + 1e-5
