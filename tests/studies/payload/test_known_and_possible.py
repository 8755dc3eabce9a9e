"""Known parts of a load as linear equations, and the nearest load that a body can be."""

import numpy as np
import pytest

from pivident.foundation.errors import ExperimentError
from pivident.models.consistency.cone_program import Solved
from pivident.models.consistency.pseudo_inertia import pseudo_inertia
from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.inertia import from_center_of_mass, tensor
from pivident.studies.payload import possible_load as module
from pivident.studies.payload.arm_and_load import KnownParts
from pivident.studies.payload.doubts import contradicted
from pivident.studies.payload.load_estimate import NATURAL, LoadEstimate
from pivident.studies.payload.payload_identification import load_sentences
from pivident.studies.payload.possible_load import possible_load

CENTRE, INERTIA = (0.03, -0.02, 0.10), (0.0012, 0.0001, -0.0002, 0.0015, 0.0001, 0.0009)
TRUE = from_center_of_mass(1.0, np.array(CENTRE), tensor(np.array(INERTIA)))
NONE = np.zeros((10, 0))


def test_known_parts_hold_for_the_body_they_describe():
    rows, right, std = KnownParts(1.0, 0.01, CENTRE, 0.001, INERTIA, 1e-5).equations()
    assert rows.shape == (10, 10)
    np.testing.assert_allclose(rows @ TRUE, right, atol=1e-15)
    assert std[0] == 0.01 and std[1] == pytest.approx(0.001, rel=1e-3)
    assert std[4] == pytest.approx(np.hypot(1e-5, np.sqrt(8.0) * 0.001**2), rel=1e-3)
    # a drawing's centre of mass holds whatever the mass is
    rows, right, _ = KnownParts(center_of_mass=CENTRE).equations()
    np.testing.assert_allclose(rows @ (3.0 * TRUE), right, atol=1e-15)
    assert KnownParts().equations()[0].shape == (0, 10)


@pytest.mark.parametrize("mass", [0.1, 1.0, 10.0])
@pytest.mark.parametrize("mass_known", [True, False])
@pytest.mark.parametrize("inertia_std", [0.0, 1e-4])
def test_deviations_of_the_equations_are_those_of_bodies_with_another_centre(
    mass, mass_known, inertia_std
):
    """Bodies whose centre and inertia are off by what was said, each inertia about its own."""
    centre_std, rng = 0.005, np.random.default_rng(1)
    known = KnownParts(mass if mass_known else None, 0.0, CENTRE, centre_std, INERTIA, inertia_std)
    rows, right, std = known.equations(mass)
    off = []
    for _ in range(4000):
        centre = np.array(CENTRE) + centre_std * rng.normal(size=3)
        inertia = np.array(INERTIA) + inertia_std * rng.normal(size=6)
        body = from_center_of_mass(mass, centre, tensor(inertia))
        off.append((rows @ body - right)[-9:] / std[-9:])
    np.testing.assert_allclose(np.sqrt(np.mean(np.square(off), axis=0)), 1.0, atol=0.1)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        ({"mass": -1.0}, "positive"),
        ({"mass": float("nan")}, "positive"),
        ({"mass_std": 0.1}, "without mass"),
        ({"mass": 1.0, "mass_std": -0.1}, "negative"),
        ({"center_of_mass": [0.0, 1.0]}, "3 numbers"),
        ({"center_of_mass": [0.0, 1.0, float("nan")]}, "3 numbers"),
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


@pytest.mark.parametrize(
    ("known", "kinds"),
    [
        (KnownParts(), []),
        (KnownParts(1.0, 0.005), []),
        (KnownParts(1.25, 0.005), ["other mass"]),
        (KnownParts(1.25), ["other mass"]),
        (KnownParts(1.25, 0.1), []),  # nobody claimed to know it better
        (KnownParts(1.015), []),  # significant, and less than drive gains are known to
        (KnownParts(1.0, 0.0, CENTRE, 1e-3), []),
        (KnownParts(1.0, 0.0, (0.05, -0.02, 0.10), 1e-3), ["other centre"]),
        (KnownParts(1.25, 0.0, (0.05, -0.02, 0.10), 0.1), ["other mass"]),
    ],
)
def test_torques_that_contradict_what_was_declared_say_so(known, kinds):
    by_torques = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), NONE, "test")
    found = list(contradicted(known, by_torques))
    assert [f.kind for f in found] == kinds
    assert all("standard errors" in f.message or "x 30" in f.message for f in found)


def test_a_possible_estimate_stays_as_it_is():
    load = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), NONE, "test")
    nearest = possible_load(load)
    assert nearest.was_possible and nearest.distance < 0.03
    np.testing.assert_allclose(nearest.values, TRUE, atol=1e-4 * NATURAL.max())
    half = 1.959964e-3 * NATURAL
    assert (nearest.intervals[:, 0] >= TRUE - 1.01 * half).all()
    assert (nearest.intervals[:, 1] <= TRUE + 1.01 * half).all()


def plate(centre) -> np.ndarray:
    """A plate of 0.4 kg, 0.2 m by 0.2 m by 3 mm."""
    along, across = 0.4 * (0.2**2 + 0.003**2) / 12.0, 0.4 * 0.2**2 / 6.0
    return from_center_of_mass(0.4, np.array(centre), np.diag([along, along, across]))


@pytest.mark.parametrize("distance", [0.0, 0.1, 0.3, 2.0])
def test_a_real_plate_is_possible_wherever_it_is(distance):
    load = LoadEstimate(plate([0, 0, distance]), np.diag((1e-4 * NATURAL) ** 2), NONE, "test")
    nearest = possible_load(load)
    assert nearest.was_possible and nearest.distance < 0.01
    assert np.isfinite(nearest.intervals).all() and not nearest.not_found


@pytest.mark.parametrize(("diameter", "possible"), [(0.0055, True), (0.0045, False)])
def test_the_smallest_load_is_a_ball_of_steel_anywhere(diameter, possible):
    mass = 7850.0 * np.pi / 6.0 * diameter**3
    inertia = mass * diameter**2 / 10.0 * np.eye(3)
    values = from_center_of_mass(mass, np.array([0.1, -0.2, 0.3]), inertia)
    known = np.diag((1e-8 * NATURAL) ** 2)
    assert possible_load(LoadEstimate(values, known, NONE, "test")).was_possible is possible


@pytest.mark.parametrize("seed", range(6))
def test_whether_a_body_can_be_like_this_does_not_depend_on_the_frame(seed):
    rng = np.random.default_rng(seed)
    load = noisy(seed) if seed < 3 else LoadEstimate(
        plate([0.0, 0.05, 0.1]) - [0, 0, 0, 0, 0, 1e-3 * (seed - 3), 0, 0, 0, 0],
        np.diag((5e-3 * NATURAL) ** 2), NONE, "test",
    )  # fmt: skip
    pose = Pose(rotation_from_rpy(*rng.uniform(-3, 3, 3)), rng.uniform(-1.5, 1.5, 3))
    here, there = possible_load(load), possible_load(load.seen_from(pose, "elsewhere"))
    assert there.was_possible == here.was_possible
    assert there.distance == pytest.approx(here.distance, rel=1e-3, abs=1e-3)
    np.testing.assert_allclose(there.intervals[9], here.intervals[9], rtol=1e-3)
    carried = LoadEstimate(here.values, load.covariance, NONE, "").seen_from(pose, "").values
    np.testing.assert_allclose(there.values, carried, atol=1e-4)


def test_the_nearest_possible_load_is_that_of_an_independent_solver():
    """Second moments are those of a smallest ball and of points of the same mass."""
    cvxpy = pytest.importorskip("cvxpy")
    load = next(one for one in map(noisy, range(20)) if not one.is_possible)
    nearest = possible_load(load)
    assert not nearest.was_possible
    scales = np.diag(NATURAL)
    w = cvxpy.Variable(10)
    ten = scales @ w
    J = cvxpy.bmat([[ten[0], ten[1], ten[2]], [ten[1], ten[3], ten[4]], [ten[2], ten[4], ten[5]]])
    second = cvxpy.trace(J) / 2.0 * np.eye(3) - J
    points = cvxpy.Variable((4, 4), PSD=True)  # of 0.1 m: ∫ (10 r, 1)(10 r, 1)ᵀ dm
    ball = 7850.0 * np.pi / 6.0 * 0.005**3
    moment = ball * 0.005**2 / 20.0
    conditions = [
        100.0 * (second - moment * np.eye(3)) == points[:3, :3],
        10.0 * ten[6:9] == points[:3, 3],
        ten[9] == points[3, 3],
        ten[9] >= ball,
    ]
    root = np.linalg.inv(np.linalg.cholesky(load.covariance / np.outer(NATURAL, NATURAL)))
    away = cvxpy.sum_squares(root @ (w - load.values / NATURAL))
    program = cvxpy.Problem(cvxpy.Minimize(away), conditions)
    program.solve(solver="CLARABEL")
    assert nearest.distance == pytest.approx(np.sqrt(program.value), rel=1e-4)
    np.testing.assert_allclose(nearest.values / NATURAL, w.value, atol=1e-4)
    size = np.array([10.0, 10.0, 10.0, 1.0])
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


def test_what_nothing_bounds_has_no_end():
    """With xx and xy free, xy² < Σ_xx Σ_yy grows as the root of xx, and xx as yy + zz at most."""
    lost = np.zeros((10, 3))
    lost[[0, 1, 3], range(3)] = NATURAL[[0, 1, 3]]  # xx, xy, yy
    load = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), lost, "test")
    low, high = possible_load(load).intervals.T
    assert np.isposinf(high[[0, 3]]).all() and np.isfinite(low[[0, 3]]).all()
    assert np.isfinite(low[[2, 4, 5, 9]]).all() and np.isfinite(high[[2, 4, 5, 9]]).all()
    # Σ_xx + Σ_yy = zz bounds the product
    assert np.isfinite([low[1], high[1]]).all() and high[1] - low[1] < 1.1 * TRUE[5]


def test_a_solver_that_fails_is_no_bound_and_no_missing_bound(monkeypatch):
    load = LoadEstimate(TRUE, np.diag((1e-3 * NATURAL) ** 2), NONE, "test")
    solve, gaps = module.solve_cone_program, []

    def stuck(quadratic, linear, requirements, gap):
        solved = solve(quadratic, linear, requirements, gap)
        if linear.any():
            gaps.append(gap)
            return Solved(solved.u, solved.multipliers, "NumericalError", solved.value)
        return solved

    monkeypatch.setattr(module, "solve_cone_program", stuck)
    nearest = possible_load(load)
    assert nearest.was_possible and np.isnan(nearest.intervals).all()
    assert gaps[:2] == sorted(gaps[:2]) and gaps[0] < gaps[1]  # a poorer one is tried
    assert "did not find the range over real bodies of xx, " in load_sentences(load, nearest)[-1]
    assert "did not find the nearest real body" in load_sentences(load, None)[-1]
