import numpy as np
from hypothesis import given, strategies as st

from pivident.robot.frames import rotation_from_rpy
from pivident.robot.inertia import elements, from_center_of_mass, moved, tensor

seeds = st.integers(0, 2**32 - 1)


def point_masses(rng):
    return rng.uniform(0.1, 3.0, 6), rng.normal(size=(6, 3))


def ten_parameters(masses, points):
    """Sums over point masses, straight from the definitions."""
    inertia = sum(
        m * (p @ p * np.eye(3) - np.outer(p, p)) for m, p in zip(masses, points, strict=True)
    )
    return np.concatenate([inertia[np.triu_indices(3)], masses @ points, [masses.sum()]])


@given(seeds)
def test_data_at_the_centre_of_mass_give_the_parameters_at_the_origin(seed):
    masses, points = point_masses(np.random.default_rng(seed))
    center = masses @ points / masses.sum()
    at_center = tensor(ten_parameters(masses, points - center)[:6])
    np.testing.assert_allclose(
        from_center_of_mass(masses.sum(), center, at_center),
        ten_parameters(masses, points),
        atol=1e-10,
    )


@given(seeds)
def test_a_moved_body_has_the_parameters_of_its_moved_points(seed):
    rng = np.random.default_rng(seed)
    masses, points = point_masses(rng)
    rotation, translation = rotation_from_rpy(*rng.uniform(-3, 3, 3)), rng.normal(size=3)
    np.testing.assert_allclose(
        moved(ten_parameters(masses, points), rotation, translation),
        ten_parameters(masses, points @ rotation.T + translation),
        atol=1e-9,
    )


def test_a_body_without_mass_may_still_have_inertia():
    inertia = np.array([0.1, 0, 0, 0.2, 0, 0.3, 0, 0, 0, 0])
    np.testing.assert_allclose(moved(inertia, np.eye(3), np.array([5.0, 0, 0])), inertia)


def test_the_six_elements_and_the_tensor_are_the_same_thing():
    six = np.arange(6.0)
    np.testing.assert_array_equal(elements(tensor(six)), six)
