"""Sums over samples against the dense matrices they stand for."""

import numpy as np
import pytest

from pivident.estimation.normal_equations import JointSums, solve
from pivident.foundation.errors import IdentificationError, RankDeficientRegressor


def make_joint(rng, columns, rows, theta, noise):
    phi = rng.normal(size=(len(columns), rows))
    z = phi + 0.1 * rng.normal(size=phi.shape)
    tau = theta[columns] @ phi + noise * rng.normal(size=rows)
    return phi, z, tau


def two_joints(rng, noise=(0.1, 2.0)):
    theta = np.array([1.0, -2.0, 0.5])
    columns = [np.array([0, 1]), np.array([1, 2])]
    data = [make_joint(rng, c, 400, theta, s) for c, s in zip(columns, noise, strict=True)]
    return theta, columns, data


def test_blocks_add_up_to_the_dense_weighted_solution():
    rng = np.random.default_rng(1)
    _, columns, data = two_joints(rng)
    variance = np.array([0.01, 4.0])
    sums = []
    for c, (phi, z, tau) in zip(columns, data, strict=True):
        joint = JointSums.empty("a", c)
        for part in (slice(0, 130), slice(130, 400)):
            joint.add(phi[:, part], z[:, part], tau[part], None)
        sums.append(joint)
    solution = solve(sums, variance, ["a", "b", "c"])
    big_z, big_phi, big_tau, weight = [], [], [], []
    for c, (phi, z, tau), v in zip(columns, data, variance, strict=True):
        wide = np.zeros((2, 400, 3))
        wide[0][:, c], wide[1][:, c] = z.T, phi.T
        big_z.append(wide[0])
        big_phi.append(wide[1])
        big_tau.append(tau)
        weight.append(np.full(400, 1 / v))
    z, phi, tau, w = (np.concatenate(x) for x in (big_z, big_phi, big_tau, weight))
    expected = np.linalg.solve(z.T @ (w[:, None] * phi), z.T @ (w * tau))
    assert np.allclose(solution.theta, expected, rtol=1e-12)
    assert np.allclose(solution.covariance, np.linalg.inv(z.T @ (w[:, None] * z)), rtol=1e-10)


def test_samples_without_a_vote_change_nothing():
    rng = np.random.default_rng(2)
    phi, z, tau = make_joint(rng, np.array([0, 1]), 300, np.ones(2), 0.1)
    votes = rng.random(300) > 0.4
    masked, cut = JointSums.empty("a", np.arange(2)), JointSums.empty("a", np.arange(2))
    masked.add(phi, z, tau, votes)
    cut.add(phi[:, votes], z[:, votes], tau[votes], None)
    assert masked.rows == cut.rows == votes.sum()
    for field in ("zf", "zz", "ff", "zt", "ft", "tt"):
        assert np.allclose(getattr(masked, field), getattr(cut, field))


def test_the_residual_comes_out_of_the_sums():
    rng = np.random.default_rng(3)
    phi, _, tau = make_joint(rng, np.array([0, 1]), 300, np.array([1.0, 2.0]), 0.3)
    joint = JointSums.empty("a", np.arange(2))
    joint.add(phi, None, tau, None)
    theta = np.array([0.9, 2.2])
    assert joint.residual_sum(theta) == pytest.approx(np.sum((tau - theta @ phi) ** 2), rel=1e-10)


def test_parameters_that_move_together_are_named():
    rng = np.random.default_rng(4)
    phi = rng.normal(size=(3, 500))
    phi[2] = 2.0 * phi[0]
    joint = JointSums.empty("elbow", np.arange(3))
    joint.add(phi, None, phi[0], None)
    with pytest.raises(RankDeficientRegressor) as caught:
        solve([joint], np.ones(1), ["zz1r", "fv1", "ia1"])
    assert caught.value.rank == 2
    assert set(caught.value.groups[0]) == {"zz1r", "ia1"}
    assert "zz1r" in str(caught.value) and "fv1" not in str(caught.value)


def test_a_joint_without_rows_is_named():
    joint = JointSums.empty("elbow", np.arange(3))
    with pytest.raises(IdentificationError, match="elbow"):
        solve([joint], np.ones(1), ["a", "b", "c"])


def test_parameters_that_only_a_joint_without_weight_separates_are_named():
    rng = np.random.default_rng(5)
    phi = rng.normal(size=(1, 500))
    noise = 0.01 * rng.normal(size=(2, 500))
    both, alone = (
        JointSums.empty("shoulder", np.arange(2)),
        JointSums.empty("elbow", np.ones(1, int)),
    )
    both.add(np.vstack([phi, 2.0 * phi]), None, 3.0 * phi[0] + noise[0], None)
    other = rng.normal(size=(1, 500))
    alone.add(other, None, other[0] + noise[1], None)
    assert solve([both, alone], np.ones(2), ["ia1", "ia2"]).theta == pytest.approx(
        [1.0, 1.0], abs=0.01
    )
    with pytest.raises(RankDeficientRegressor, match=r"1 of 2 .* not separable: ia2, ia1"):
        solve([both, alone], np.array([1.0, 1e30]), ["ia1", "ia2"])


@pytest.mark.parametrize("apart", [1e-4, 1e-5, 3e-6])
def test_a_joints_own_variance_stands_columns_that_are_nearly_alike(apart):
    """A precise record of a joint that two others couple with: nothing of its noise is rounding."""
    rng = np.random.default_rng(3)
    phi = rng.normal(size=(12, 2000))
    phi[6:] = phi[:6] + apart * phi[6:]
    tau = rng.normal(size=12) @ phi + 1e-4 * rng.normal(size=2000)
    joint = JointSums.empty("a", np.arange(12))
    joint.add(phi, phi, tau, None)
    left = tau - np.linalg.lstsq(phi.T, tau, rcond=None)[0] @ phi
    assert joint.own_variance() == pytest.approx(left @ left / (2000 - 12), rel=0.02)
