"""Rows, their triangle and their sums."""

import numpy as np

from pivident.estimation.literature.rows import NormalEquations, windows_covariance
from tests.estimation.literature.made_rows import made, rows_of, stacked


def test_triangle_and_sums_are_those_of_all_rows():
    phi, tau, noise, rng = made()
    used = rng.random((2, tau[0].size)) < 0.8
    rows = rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)], used)
    dense, torque = stacked(rows)
    whole = np.c_[dense, torque]
    triangle = rows.triangle()
    np.testing.assert_allclose(triangle.T @ triangle, whole.T @ whole, rtol=1e-10, atol=1e-8)
    equations = NormalEquations.of(rows.sums(), rows.size)
    expected = np.linalg.lstsq(dense, torque, rcond=None)[0]
    np.testing.assert_allclose(equations.solution, expected, rtol=1e-9)
    np.testing.assert_allclose(equations.inverse, np.linalg.inv(dense.T @ dense), rtol=1e-9)
    assert rows.count == used.sum() == len(torque)


def test_windows_give_the_covariance_of_white_errors():
    deviations = []
    for seed in range(30):
        phi, tau, noise, _ = made(seed, noise=1.0)
        rows = rows_of(phi, [t + e for t, e in zip(tau, noise, strict=True)])
        equations = NormalEquations.of(rows.sums(), rows.size)
        found = windows_covariance(rows.sums(), equations.solution)
        deviations.append(np.sqrt(np.diag(found) / np.diag(equations.inverse)))
    np.testing.assert_allclose(np.mean(deviations, axis=0), 1.0, atol=0.1)
