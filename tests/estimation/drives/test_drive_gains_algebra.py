"""The sums of the drive equations against dense matrices: every estimator has an oracle."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares as nonlinear_least_squares

from pivident.data.recording.recording import Recording
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.drives import gain_equations as bilinear
from pivident.estimation.drives.drive_equations import DriveRecord, drive_sums, gain_unknowns
from pivident.estimation.drives.drive_gains import _equations
from pivident.estimation.drives.gain_equations import gains_by
from pivident.estimation.drives.known_payload import Payload
from pivident.estimation.drives.log_units import gain_groups
from pivident.estimation.problem import Problem
from pivident.loop.motion.motion import Kinematics, SpeedLimits
from pivident.robot.gallery import load_robot

GAINS = np.array([8.0, 3.0])
PAYLOAD = Payload(1.5, (0.2, 0.05, 0.0))


def motion(samples: int, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of sines with exact derivatives, time last."""
    rng, t = np.random.default_rng(seed), np.arange(samples) / 200.0
    q, dq, ddq = np.zeros((3, 2, samples))
    for k in range(1, 6):
        w, amplitude, phase = 2.0 * k, 0.8 / k, rng.uniform(0, 6.3, (2, 1))
        q += amplitude * np.sin(w * t + phase)
        dq += amplitude * w * np.cos(w * t + phase)
        ddq -= amplitude * w**2 * np.sin(w * t + phase)
    return q, dq, ddq


def problem_and_records(noise: float, payload: Payload | None, robot=None, seed=0, samples=1500):
    """Commands τ/κ with white noise, on motion that is known exactly."""
    robot = robot or load_robot("planar_2r")
    rng, made, records = np.random.default_rng(seed), [], []
    for load in range(1 if payload is None else 2):
        q, dq, ddq = motion(samples, 10 + load)
        problem = Problem(robot, (_recording(robot, q, q),))
        base = problem.base
        theta = base.values(nominal_values(robot, base.standard))
        if load and payload is not None:
            theta = theta + payload.base_columns(base) @ payload.known()
        tau = problem.regressor.torque(q.T, dq.T, ddq.T, theta).T
        commands = tau / GAINS[:, None] + noise * rng.standard_normal(tau.shape)
        recording = _recording(robot, q, commands)
        unknown = np.full(2, np.nan)
        kinematics = Kinematics(recording, q, dq, ddq, commands, 0, samples, unknown, unknown)
        made.append(recording)
        records.append(DriveRecord(kinematics, SpeedLimits(np.zeros(2)), load))
    return Problem(robot, (made[0],)), made[1:], records


def _recording(robot, q, tau) -> Recording:
    return Recording("run", robot.joint_names, q.T.copy(), tau.T.copy(), 200.0)


def equations_of(problem, loaded, records, payload):
    setting = gain_unknowns(problem, payload, loaded, {}, {}, False)
    sums = drive_sums(problem.robot, setting.wide.regressor, records)
    return setting, _equations(setting, setting.wide.regressor, sums)


def dense_rows(setting, records):
    """For each load and motor: command, Φ M and Φ b."""
    rows = []
    for record in records:
        k = record.kinematics
        phi = setting.wide.regressor.matrix(k.q.T, k.dq.T, k.ddq.T)
        for m in range(2):
            M, b = setting.maps[record.load], setting.offsets[record.load]
            rows.append((record.load, m, k.tau[m], phi[:, m] @ M, phi[:, m] @ b))
    return rows


@pytest.fixture(scope="module")
def noisy():
    problem, loaded, records = problem_and_records(0.05, PAYLOAD)
    setting, equations = equations_of(problem, loaded, records, PAYLOAD)
    return setting, equations, dense_rows(setting, records)


def weighted(equations, rows, kappa):
    """The literature's [diag(c), -ΦM | Φb], rows weighted."""
    left, right = [], []
    for g, m, command, phi, known in rows:
        weight = 1.0 / (kappa[m] * np.sqrt(equations.variances[g, m]))
        columns = np.zeros((command.size, 2))
        columns[:, m] = command
        left.append(weight * np.hstack([columns, -phi]))
        right.append(weight * known)
    return np.vstack(left), np.concatenate(right)


def test_wls_is_that_of_the_dense_matrix(noisy):
    _, equations, rows = noisy
    A, y = weighted(equations, rows, GAINS)
    wanted, *_ = np.linalg.lstsq(A, y, rcond=None)
    gains, std = gains_by("wls", equations, GAINS)
    np.testing.assert_allclose(gains, wanted[:2], rtol=1e-7)
    variance = np.sum((y - A @ wanted) ** 2) / (y.size - wanted.size)
    np.testing.assert_allclose(
        std, np.sqrt(variance * np.diag(np.linalg.inv(A.T @ A))[:2]), rtol=1e-5
    )


def test_tls_is_the_last_singular_vector_of_the_dense_matrix(noisy):
    _, equations, rows = noisy
    A, y = weighted(equations, rows, GAINS)
    _, _, vectors = np.linalg.svd(np.column_stack([A, y]), full_matrices=False)
    wanted = -vectors[-1, :2] / vectors[-1, -1]
    np.testing.assert_allclose(gains_by("tls", equations, GAINS)[0], wanted, rtol=1e-6)


def test_mixed_tls_minimises_its_quotient(noisy):
    _, equations, rows = noisy
    A, y = weighted(equations, rows, GAINS)
    counts = [sum(r[2].size for r in rows if r[1] == m) / GAINS[m] ** 2 for m in range(2)]

    def quotient(kappa):
        rest = y - A[:, :2] @ kappa
        rest = rest - A[:, 2:] @ np.linalg.lstsq(A[:, 2:], rest, rcond=None)[0]
        return rest @ rest / (np.array(counts) @ kappa**2)

    gains = gains_by("mixed-tls", equations, GAINS)[0]
    least = quotient(gains)
    for m in range(2):
        for factor in (0.998, 1.002):
            moved = gains.copy()
            moved[m] *= factor
            assert quotient(moved) > least


def test_least_squares_is_the_minimum_of_a_general_search(noisy):
    _, equations, rows = noisy

    def residuals(y):
        parts = []
        for g, m, command, phi, known in rows:
            explained = np.exp(-y[m]) * (phi @ y[2:] + known)
            parts.append((command - explained) / np.sqrt(equations.variances[g, m]))
        return np.concatenate(parts)

    ell, x = bilinear.least_squares(equations, np.zeros(2))
    start = np.concatenate([np.log(GAINS), x])
    wanted = nonlinear_least_squares(residuals, start, x_scale="jac", xtol=1e-14, ftol=1e-14)
    np.testing.assert_allclose(np.exp(ell), np.exp(wanted.x[:2]), rtol=1e-5)
    # and the formula for white residuals is the inverse of JᵀJ; the sandwich agrees with it
    formula = np.sqrt(np.diag(np.linalg.inv(wanted.jac.T @ wanted.jac))[:2])
    robust = np.sqrt(np.diag(bilinear.covariance(equations, ell, x))[:2])
    np.testing.assert_allclose(robust, formula, rtol=0.4)


def test_newton_with_phi_as_instruments_stays_at_least_squares(noisy):
    _, equations, _ = noisy
    ell, x = bilinear.least_squares(equations, np.zeros(2))
    moved, _ = bilinear.instrumental_variables(equations, ell + 0.01, x)
    np.testing.assert_allclose(moved, ell, atol=1e-5)


def test_without_noise_everything_is_exact():
    problem, loaded, records = problem_and_records(0.0, PAYLOAD)
    _, equations = equations_of(problem, loaded, records, PAYLOAD)
    equations = replace(equations, variances=np.full((2, 2), 1e-6))
    ell, _ = bilinear.least_squares(equations, np.zeros(2))
    np.testing.assert_allclose(np.exp(ell), GAINS, rtol=1e-5)
    np.testing.assert_allclose(gains_by("wls", equations, GAINS)[0], GAINS, rtol=1e-5)


def test_intervals_hold_under_white_noise():
    errors = []
    for seed in range(60):
        problem, loaded, records = problem_and_records(0.05, PAYLOAD, seed=seed, samples=600)
        _, equations = equations_of(problem, loaded, records, PAYLOAD)
        ell, x = bilinear.least_squares(equations, np.log(GAINS))
        std = np.sqrt(np.diag(bilinear.covariance(equations, ell, x))[:2])
        errors.append((ell - np.log(GAINS)) / std)
    inside = np.mean(np.abs(errors) < 2.0)
    assert 0.90 <= inside <= 0.99


def test_no_ratio_is_claimed_where_no_parameter_is_shared():
    # a forearm that weighs nothing: the rows share parameters, and all of them are zero
    robot = load_robot("planar_2r")
    links = (robot.links[0], replace(robot.links[1], inertia=np.zeros(10)))
    robot = replace(robot, links=links)
    claimed = 0
    for seed in range(20):
        problem, loaded, records = problem_and_records(0.05, None, robot, seed, 600)
        _, equations = equations_of(problem, loaded, records, None)
        ell, x = bilinear.least_squares(equations, np.zeros(2))
        spread = bilinear.covariance(equations, ell, x)[:2, :2]
        claimed += len(gain_groups(spread)) == 1
    assert claimed <= 1


def test_the_ratio_is_claimed_where_a_heavy_forearm_is_shared():
    problem, loaded, records = problem_and_records(0.05, None)
    _, equations = equations_of(problem, loaded, records, None)
    ell, x = bilinear.least_squares(equations, np.zeros(2))
    spread = bilinear.covariance(equations, ell, x)[:2, :2]
    (group,) = gain_groups(spread)
    assert not group.anchored
    ratio = ell[0] - ell[1] - np.log(GAINS[0] / GAINS[1])
    std = np.sqrt(spread[0, 0] + spread[1, 1] - 2 * spread[0, 1])
    assert abs(ratio) < 4 * std < 0.2
