"""The Durbin-Wu-Hausman test on data whose regressors do or do not carry noise."""

import numpy as np

from pivident.estimation.normal_equations import JointSums
from pivident.estimation.restrictions import Freedom
from pivident.estimation.solved_equations import durbin_wu_hausman


def outcome(rng, endogenous, rows=4000):
    z = rng.normal(size=(2, rows))
    noise = rng.normal(size=rows)
    phi = z + 0.3 * rng.normal(size=z.shape) + endogenous * noise
    tau = np.array([1.0, -2.0]) @ phi + noise
    joint = JointSums.empty("a", np.arange(2))
    joint.add(phi, z, tau, None)
    return durbin_wu_hausman([joint], np.ones(1), Freedom.whole(2))


def test_it_holds_its_level_where_regressors_are_exogenous():
    rng = np.random.default_rng(0)
    p_values = [outcome(rng, 0.0).p_value for _ in range(300)]
    assert 0.02 < np.mean(np.array(p_values) < 0.05) < 0.09
    assert np.mean(p_values) > 0.4


def test_it_notices_noise_in_the_regressors():
    rng = np.random.default_rng(1)
    found = outcome(rng, 0.2)
    assert found.p_value < 1e-6 and found.directions == 2
    assert "biased" in str(found)


def test_it_agrees_with_the_dense_augmented_regression():
    rng = np.random.default_rng(2)
    z = rng.normal(size=(2, 500))
    phi = z + 0.5 * rng.normal(size=z.shape)
    tau = phi[0] + rng.normal(size=500)
    joint = JointSums.empty("a", np.arange(2))
    joint.add(phi, z, tau, None)
    found = durbin_wu_hausman([joint], np.ones(1), Freedom.whole(2))
    rest = phi - (phi @ z.T) @ np.linalg.solve(z @ z.T, z)

    def rss(columns):
        return np.sum((tau - columns.T @ np.linalg.lstsq(columns.T, tau, rcond=None)[0]) ** 2)

    small, large = rss(phi), rss(np.vstack([phi, rest]))
    assert np.isclose(found.statistic, (small - large) / 2 / (large / (500 - 4)), rtol=1e-9)
