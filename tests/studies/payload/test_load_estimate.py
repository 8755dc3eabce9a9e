"""Mass, centre of mass and inertia from ten parameters: closed forms, deviations, other frames."""

import numpy as np
import pytest

from pivident.robot.frames import Pose, rotation_from_rpy
from pivident.robot.inertia import elements, from_center_of_mass, tensor
from pivident.studies.payload.load_estimate import LoadEstimate, seen_from
from pivident.studies.payload.payload_identification import is_asymmetric, load_quantities

MASS, CENTRE = 1.3, np.array([0.03, -0.02, 0.10])
INERTIA = np.array([0.0012, 0.0001, -0.0002, 0.0015, 0.0001, 0.0009])
NONE = np.zeros((10, 0))
FACTOR = np.random.default_rng(3).normal(size=(10, 10))
SIZES = np.array([1e-4] * 6 + [1e-3] * 3 + [1e-2])
COVARIANCE = FACTOR @ FACTOR.T * np.outer(SIZES, SIZES)


def estimate(values=None, covariance=COVARIANCE, undetermined=NONE) -> LoadEstimate:
    if values is None:
        values = from_center_of_mass(MASS, CENTRE, tensor(INERTIA))
    return LoadEstimate(values, covariance, undetermined, "test")


def test_centre_and_inertia_are_those_the_body_was_made_of():
    load = estimate()
    assert load.mass == MASS and load.rank == 10 and load.is_possible
    np.testing.assert_allclose(load.center_of_mass, CENTRE, rtol=1e-12)
    np.testing.assert_allclose(load.inertia, INERTIA, rtol=1e-9)


def test_deviations_are_those_of_numerical_derivatives():
    load = estimate()
    steps = 1e-6 * np.diag(SIZES)

    def derivative(of):
        pairs = [(of(estimate(load.values + s)), of(estimate(load.values - s))) for s in steps]
        return np.array([(a - b) / (2e-6 * d) for (a, b), d in zip(pairs, SIZES, strict=True)]).T

    for name in ("center_of_mass", "inertia"):
        J = derivative(lambda one, name=name: getattr(one, name))
        expected = np.sqrt(np.diag(J @ COVARIANCE @ J.T))
        np.testing.assert_allclose(getattr(load, f"{name}_std"), expected, rtol=1e-5)


def test_fieller_is_the_set_of_centres_that_cannot_be_rejected():
    load = estimate(covariance=100.0 * COVARIANCE)
    low, high = load.fieller_interval(2.0)[0]
    grid = np.linspace(low - 0.05, high + 0.05, 20001)
    h, m = load.values[6], load.values[9]
    spread = load.covariance[np.ix_([6, 9], [6, 9])]
    variance = spread[0, 0] - 2 * grid * spread[0, 1] + grid**2 * spread[1, 1]
    kept = grid[(h - grid * m) ** 2 <= 4.0 * variance]
    assert kept[0] == pytest.approx(low, abs=2e-5) and kept[-1] == pytest.approx(high, abs=2e-5)
    # with a mass that is known well it is the delta method's
    sharp = estimate(covariance=1e-6 * COVARIANCE)
    middle, half = sharp.center_of_mass, 2.0 * sharp.center_of_mass_std
    np.testing.assert_allclose(
        sharp.fieller_interval(2.0), np.column_stack([middle - half, middle + half]), rtol=1e-4
    )


def test_without_a_mass_any_centre_is_possible():
    covariance = COVARIANCE.copy()
    covariance[9, 9] = MASS**2
    load = estimate(covariance=covariance)
    assert not load.is_seen and not np.isfinite(load.fieller_interval()).any()
    made = load_quantities(load)
    row = next(row for row in made.rows() if row["name"] == "cx")
    assert is_asymmetric(made)[1] and (row["lower"], row["upper"]) == (-np.inf, np.inf)


def test_another_frame_sees_the_same_body():
    R, p = rotation_from_rpy(0.3, -0.5, 1.1), np.array([0.1, 0.2, -0.3])
    load, seen = estimate(), estimate().seen_from(Pose(R, p), "tool")
    np.testing.assert_allclose(seen.center_of_mass, R.T @ (CENTRE - p), rtol=1e-10)
    np.testing.assert_allclose(seen.inertia, elements(R.T @ tensor(INERTIA) @ R), rtol=1e-8)
    assert seen.mass_std == pytest.approx(load.mass_std)
    # the deviation along an axis of the tool is that of the same direction in the link
    back = seen.seen_from(Pose(R.T, -R.T @ p), "link")
    np.testing.assert_allclose(back.values, load.values, atol=1e-13)
    np.testing.assert_allclose(back.std, load.std, rtol=1e-9)


def test_what_no_torque_tells_stays_untold_in_any_frame():
    lost = np.zeros((10, 1))
    lost[8, 0] = 0.1  # mz
    load = estimate(undetermined=lost)
    assert load.rank == 9
    assert np.flatnonzero(~load.determined).tolist() == [8]
    assert np.isinf(load.center_of_mass_std).tolist() == [False, False, True]
    # m c_z² is in xx and yy about the centre of mass, m c_x c_z in xz
    assert np.isinf(load.inertia_std).tolist() == [True, False, True, True, True, False]
    turned = load.seen_from(Pose(rotation_from_rpy(np.pi / 2, 0.0, 0.0), np.zeros(3)), "turned")
    assert np.isinf(turned.center_of_mass_std).tolist() == [False, True, False]
    shifted = seen_from(Pose(np.eye(3), np.array([0.0, 0.0, 1.0]))) @ lost
    assert np.count_nonzero(np.abs(shifted) > 1e-12) == 3  # xx and yy change with mz now
