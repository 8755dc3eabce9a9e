"""Total least squares against its definition, closed forms and Monte Carlo."""

import numpy as np
import pytest

from pivident.estimation.literature.rows import JointRows, NormalEquations, Rows
from pivident.estimation.literature.total_least_squares import solve_total
from pivident.foundation.errors import IdentificationError
from tests.estimation.literature.made_rows import made, rows_of, stacked


def test_it_is_the_smallest_singular_vector_in_columns_of_unit_length():
    phi, tau, noise, _ = made(noise=0.5, count=300)
    rows = rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])
    dense, torque = stacked(rows)
    whole = np.c_[dense, torque]
    length = np.linalg.norm(whole, axis=0)
    last = np.linalg.svd(whole / length)[2][-1]
    expected = -last[:-1] / last[-1] * length[-1] / length[:-1]
    np.testing.assert_allclose(solve_total(rows).theta, expected, rtol=1e-9)


def one_joint(x, y):
    own = JointRows("slide", np.array([0]), x[None], y, np.ones(x.size, bool))
    return Rows((own,), 1, np.ones(1), (x.size,))


def test_one_parameter_is_demings_line_and_unbiased_with_true_intervals():
    # errors of both in proportion to their sizes: what the method assumes
    errors, std, least = [], [], []
    for seed in range(300):
        rng = np.random.default_rng(seed)
        x = rng.normal(size=400) * 2.0
        noisy = x + 0.4 * rng.normal(size=400)
        y = 1.5 * x + 0.6 * rng.normal(size=400)
        found = solve_total(one_joint(noisy, y))
        sxx, syy, sxy = noisy @ noisy, y @ y, noisy @ y
        ratio = syy / sxx  # of the columns of unit length
        slope = (syy - ratio * sxx + np.sqrt((syy - ratio * sxx) ** 2 + 4 * ratio * sxy**2)) / (
            2 * sxy
        )
        assert found.theta[0] == pytest.approx(slope, rel=1e-9)
        errors.append(found.theta[0] - 1.5)
        std.append(np.sqrt(found.covariance[0, 0]))
        least.append(NormalEquations.of(one_joint(noisy, y).sums(), 1).solution[0] - 1.5)
    assert abs(np.mean(errors)) < 3.0 * np.std(errors) / np.sqrt(300)
    assert np.mean(least) < -10.0 * np.std(least) / np.sqrt(300)  # least squares is biased
    assert np.mean(std) == pytest.approx(np.std(errors), rel=0.12)


def test_torque_that_has_no_part_in_the_relation_is_refused():
    rng = np.random.default_rng(0)
    x = rng.normal(size=100)
    own = JointRows("slide", np.array([0, 1]), np.stack([x, 2 * x]), rng.normal(size=100),
                    np.ones(100, bool))  # fmt: skip
    with pytest.raises(IdentificationError, match="depend on each other"):
        solve_total(Rows((own,), 2, np.ones(1), (100,)))
