"""Known parts of a load as linear equations, and the nearest load that a body can be."""

import numpy as np
import pytest

from pivident.consistency.pseudo_inertia import ball, pseudo_inertia
from pivident.errors import ExperimentError
from pivident.payload.known_parts import KnownParts
from pivident.payload.load_estimate import NATURAL, LoadEstimate
from pivident.payload.possible_load import SMALLEST, possible_load
from pivident.robot.inertia import from_center_of_mass, tensor

CENTRE, INERTIA = (0.03, -0.02, 0.10), (0.0012, 0.0001, -0.0002, 0.0015, 0.0001, 0.0009)
TRUE = from_center_of_mass(1.0, np.array(CENTRE), tensor(np.array(INERTIA)))
NONE = np.zeros((10, 0))


def test_known_parts_hold_for_the_body_they_describe():
    rows, right, std = KnownParts(1.0, 0.01, CENTRE, 0.001, INERTIA, 1e-5).equations()
    assert rows.shape == (10, 10)
    np.testing.assert_allclose(rows @ TRUE, right, atol=1e-15)
    assert std[0] == 0.01 and std[1] == 0.001 and std[4] == 1e-5
    # a drawing's centre of mass holds whatever the mass is
    rows, right, _ = KnownParts(center_of_mass=CENTRE).equations()
    np.testing.assert_allclose(rows @ (3.0 * TRUE), right, atol=1e-15)
    assert KnownParts().equations()[0].shape == (0, 10)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mass": -1.0}, "positive"),
        ({"mass": float("nan")}, "positive"),
        ({"mass_std": 0.1}, "without mass"),
        ({"mass": 1.0, "mass_std": -0.1}, "negative"),
        ({"center_of_mass": [0.0, 1.0]}, "3 numbers"),
        ({"inertia": INERTIA}, "center_of_mass"),
        ({"center_of_mass": CENTRE, "inertia": [-1.0, 0, 0, 1, 0, 1]}, "negative principal"),
    ],
)
def test_impossible_knowledge_is_refused(given, said):
    with pytest.raises(ExperimentError, match=said):
        KnownParts(**given)


def noisy(seed: int, scale: float = 1.0) -> LoadEstimate:
    rng = np.random.default_rng(seed)
    factor = rng.normal(size=(10, 10)) * NATURAL[:, None] * 0.02
    covariance = factor @ factor.T
    return LoadEstimate(TRUE + scale * factor @ rng.normal(size=10), covariance, NONE, "test")


def test_a_possible_estimate_stays_as_it_is():
    load = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), NONE, "test")
    nearest = possible_load(load)
    assert nearest.was_possible and nearest.distance < 0.03
    np.testing.assert_allclose(nearest.values, TRUE, atol=1e-4 * NATURAL.max())
    half = 1.959964e-3 * NATURAL
    assert (nearest.intervals[:, 0] >= TRUE - 1.01 * half).all()
    assert (nearest.intervals[:, 1] <= TRUE + 1.01 * half).all()


def test_the_nearest_possible_load_is_that_of_an_independent_solver():
    cvxpy = pytest.importorskip("cvxpy")
    load = next(one for one in map(noisy, range(20)) if not one.is_possible)
    nearest = possible_load(load)
    assert not nearest.was_possible
    u = cvxpy.Variable(10)
    units = [pseudo_inertia(unit * NATURAL) for unit in np.eye(10)]
    body = sum(u[k] * units[k] for k in range(10)) - ball(SMALLEST)
    size = np.array([10.0, 10.0, 10.0, 1.0])
    root = np.linalg.inv(np.linalg.cholesky(load.covariance / np.outer(NATURAL, NATURAL)))
    away = root @ (u - load.values / NATURAL)
    scaled = np.diag(size) @ body @ np.diag(size)
    program = cvxpy.Problem(cvxpy.Minimize(cvxpy.sum_squares(away)), [scaled >> 0])
    program.solve(solver="CLARABEL")
    assert nearest.distance == pytest.approx(np.sqrt(program.value), rel=1e-4)
    np.testing.assert_allclose(nearest.values / NATURAL, u.value, atol=1e-4)
    smallest = np.linalg.eigvalsh(np.diag(size) @ pseudo_inertia(nearest.values) @ np.diag(size))[0]
    assert smallest > -1e-9


def test_intervals_over_bodies_hold_the_truth_and_bound_what_no_torque_tells():
    inside = 0
    for seed in range(12):
        low, high = possible_load(noisy(seed)).intervals.T
        inside += np.sum((low <= TRUE) & (high >= TRUE))
    assert inside >= 0.9 * 120
    lost = np.zeros((10, 1))
    lost[1, 0] = NATURAL[1]  # the product xy
    load = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), lost, "test")
    low, high = possible_load(load).intervals[1]
    assert np.isinf(load.std[1]) and low <= TRUE[1] <= high and high - low < 0.01
