"""One delay of all branches, against least squares of everything together."""

import numpy as np

from pivident.studies.simulators.branches import BranchEstimate, with_shared_delay


def test_it_is_least_squares_of_all_branches_together():
    rng = np.random.default_rng(4)
    sizes, delay = (3, 4, 2), 1
    estimates, blocks = [], []
    for size in sizes:
        root = rng.normal(size=(size + 3, size))
        blocks.append(root.T @ root)  # information
        estimates.append(BranchEstimate(rng.normal(size=size), np.linalg.inv(blocks[-1]), delay))
    # unknowns: the delay, then all others; each branch measures its own values
    total = 1 + sum(size - 1 for size in sizes)
    gram, moment, at, places = np.zeros((total, total)), np.zeros(total), 1, []
    for own, information in zip(estimates, blocks, strict=True):
        size = len(own.values)
        place = np.zeros(size, int)
        place[np.arange(size) != delay] = np.arange(at, at + size - 1)
        at += size - 1
        gram[np.ix_(place, place)] += information
        moment[place] += information @ own.values
        places.append(place)
    values, covariance = np.linalg.solve(gram, moment), np.linalg.inv(gram)
    found = with_shared_delay(estimates)
    for own, place in zip(found.branches, places, strict=True):
        np.testing.assert_allclose(own.values, values[place], atol=1e-12)
        np.testing.assert_allclose(own.covariance, covariance[np.ix_(place, place)], atol=1e-12)


def test_delays_that_differ_are_unlikely_to_be_one():
    rng, variance = np.random.default_rng(0), np.diag([0.01])
    same = [BranchEstimate(rng.normal(3.0, 0.1, 1), variance, 0) for _ in range(4)]
    other = [BranchEstimate(np.array([3.0 + k]), variance, 0) for k in range(4)]
    assert with_shared_delay(same).p_value > 0.01 > with_shared_delay(other).p_value
    assert np.isnan(with_shared_delay(same[:1]).p_value)
