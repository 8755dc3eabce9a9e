"""Filters on positions, speeds and parameters: time, accuracy over seeds, friction that drifts.

Run ``python -m benchmarks.filters [time accuracy drift particles]`` on one core. Figures of this
code stand on the page `docs/theory/filters.md`.

*time*: one update of a TX40 with 34 parameters (28 essential ones and six offsets), called from
Python. *accuracy*: median relative error and share of 95 % intervals that hold the truth, planar
arm (1 kHz, 10 s, encoder 2e-6 rad, torque 0.05 N m) and TX40 in the scenario *fine*. *drift*:
friction of the planar arm grows by 10 % in 100 s; lag and standard deviation of the estimates.
*particles*: the particle filter on the planar arm.
"""

from __future__ import annotations

import sys
import time

import numpy as np
from numba import njit
from tests.estimation.literature.filters.scenes import RATE, planar_problem
from tests.planar_arm import LAW, nominal_parameters, planar_motion

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.literature.filters import KalmanFilter, RecursiveLeastSquares
from pivident.estimation.literature.filters.kalman_filters import (
    CentralDifferenceKalman,
    ExtendedKalman,
    UnscentedKalman,
)
from pivident.estimation.literature.filters.midpoint_step import midpoint_step, step_work
from pivident.estimation.literature.filters.particle_filter import Particles
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.experiment.simulated_tx40 import TX40_ESSENTIAL, tx40_fine

KALMAN = {"ekf": ExtendedKalman(), "ukf": UnscentedKalman(), "cdkf": CentralDifferenceKalman()}
ROOTED = {
    "ukf, square root": UnscentedKalman(square_root=True),
    "cdkf, square root": CentralDifferenceKalman(square_root=True),
}


def update_times(samples: int = 1000) -> None:
    """Microseconds of an update, and how often it fits into a millisecond."""
    problem, truth = tx40_fine()
    names = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    problem = Problem(problem.robot, problem.recordings, problem.loop, names)
    theta = np.array([truth.get(p.name, 0.0) for p in problem.regressor.parameters])
    recording, std = problem.recordings[0], 1e-3 * np.abs(theta) + 1e-4
    for name, method in (KALMAN | ROOTED).items():
        kalman = KalmanFilter(
            problem.robot, problem.regressor.parameters, theta, np.diag(std**2), method=method,
            rate=recording.rate, encoder_std=2e-6, torque_std=0.05, standstill=0.03, still_std=2.0,
        )  # fmt: skip
        for k in range(20):
            kalman.update(recording.q[k], recording.tau[max(k - 1, 0)])
        start = time.perf_counter()
        for k in range(20, 20 + samples):
            kalman.update(recording.q[k], recording.tau[k - 1])
        taken = 1e6 * (time.perf_counter() - start) / samples
        print(
            f"{name:18s} {len(theta)} parameters: {taken:7.1f} us, 1 ms is {1e3 / taken:.1f} times"
        )
    least = RecursiveLeastSquares.of_robot(problem.robot, problem.regressor.parameters)
    start = time.perf_counter()
    for k in range(samples):
        least.update_motion(recording.q[k], recording.q[k], recording.q[k], recording.tau[k])
    print(f"recursive ls: {1e6 * (time.perf_counter() - start) / samples:.1f} us")


def accuracy(seeds: int = 8) -> None:
    """Median error and coverage."""
    for scene, methods, count in (
        (lambda s: planar_problem(s, samples=10_000), ("ls", "piv", "ekf", "ukf", "cdkf"), seeds),
        (_tx40, ("ls", "piv", "ekf"), seeds),
        (_tx40, ("ukf", "cdkf"), 2),
    ):
        for name in methods:
            errors, inside, wide, taken = [], [], [], 0.0
            for seed in range(count):
                problem, theta = scene(seed)
                start = time.perf_counter()
                found = identify(problem, name)
                taken += (time.perf_counter() - start) / count
                apart = np.abs(found.theta - theta)
                errors.append(apart[theta != 0.0] / np.abs(theta[theta != 0.0]))
                for own, out in (
                    (found.covariance, inside), (found.robust_covariance, wide)
                ):  # fmt: skip
                    out.append(apart < 1.96 * np.sqrt(np.diag(own)))
            print(
                f"{problem.robot.name} {name:5s} {count} seeds: median error "
                f"{np.median(errors):.2e}, 95 % intervals hold {100 * np.mean(inside):.0f} %, from "
                f"windows {100 * np.mean(wide):.0f} %, {taken:.1f} s",
                flush=True,
            )


def _tx40(seed: int) -> tuple[Problem, np.ndarray]:
    problem, truth = tx40_fine(seed)
    return problem, np.array(list(truth.values()))


def particles(seeds: int = 5) -> None:
    """The particle filter against the extended one."""
    for count in (200, 500, 1000):
        errors, apart, inside = [], [], []
        start = time.perf_counter()
        for seed in range(seeds):
            problem, theta = planar_problem(seed, samples=3000)
            found = identify(problem, Particles(particles=count))
            kalman = identify(problem, "ekf")
            error = np.abs(found.theta - theta)
            errors.append(error[theta != 0.0] / np.abs(theta[theta != 0.0]))
            apart.append((found.theta - kalman.theta) / np.sqrt(np.diag(kalman.covariance)))
            inside.append(error < 1.96 * np.sqrt(np.diag(found.covariance)))
        print(
            f"{count} particles: median error {np.median(errors):.2e}, from ekf "
            f"{np.sqrt(np.mean(np.square(apart))):.1f} of its standard errors (rms; median "
            f"{np.median(np.abs(apart)):.1f}), 95 % intervals hold {100 * np.mean(inside):.0f} %, "
            f"{(time.perf_counter() - start) / seeds:.0f} s a record",
            flush=True,
        )


@njit
def _loop(equations, work, thetas, q_ref, kp, kd, h, noise, torque_noise, q, tau):
    """A PD loop on the arm with parameters that change, one row of ``thetas`` a second."""
    n = q.shape[1]
    x, v, ahead, last = q_ref[0].copy(), np.zeros(n), np.zeros((2, n)), q_ref[0].copy()
    for k in range(q.shape[0]):
        q[k] = x + noise[k]
        act = kp * (q_ref[k] - q[k]) - kd * (q[k] - last) / h
        last = q[k].copy()
        tau[k] = act + torque_noise[k]
        midpoint_step(equations, work, thetas[k], x, v, act, h, ahead[0], ahead[1])
        x, v = ahead[0].copy(), ahead[1].copy()


def drift(seconds: float = 100.0) -> None:
    """Lag and standard deviation of the estimates of friction that grows by 10 %."""
    base, theta = nominal_parameters()
    rng, samples = np.random.default_rng(0), int(seconds * RATE)
    dry = np.array([p.stem in ("fv", "fc") for p in base.parameters])
    growth = 1.0 + 0.1 * np.arange(samples)[:, None] / samples * dry
    q_ref = planar_motion(rng, RATE, samples, postures=400)
    q, tau = np.zeros((2, samples, 2))
    equations = robot_equations(base.robot, base.parameters)
    noises = 2e-6 * rng.standard_normal(q.shape), 0.05 * rng.standard_normal(q.shape)
    _loop(
        equations, step_work(equations), theta * growth, q_ref, LAW.kp, 0.1 * LAW.kd, 1.0 / RATE,
        *noises, q, tau,
    )  # fmt: skip
    second = int(RATE)
    for share in (0.003, 0.01, 0.03):
        kalman = KalmanFilter(
            base.robot, base.parameters, theta, np.diag((1e-3 * np.abs(theta) + 1e-4) ** 2),
            rate=RATE, encoder_std=2e-6, torque_std=0.05, standstill=0.03, still_std=2.0,
            drift=share * np.abs(theta) * dry,
        )  # fmt: skip
        kalman.start(q[0])
        found = []
        for k in range(1, samples, second):
            kalman.run(q[k : k + second], tau[k - 1 : k - 1 + len(q[k : k + second])])
            found.append(kalman.theta)
        _report(f"ekf, drift {100 * share:g} % a root second", np.array(found), theta, dry)
    recording = Recording("drift", base.robot.joint_names, q, tau, RATE)
    known = estimate_kinematics(recording, RandomWalk())
    moving = np.abs(known.dq).min(axis=0) > 0.04
    for memory in (2.0, 5.0, 10.0):
        least = RecursiveLeastSquares.of_robot(
            base.robot, base.parameters, torque_std=[0.3, 0.1], forgetting=1.0 - 1.0 / memory / RATE
        )
        found = []
        for k in range(known.start, known.stop):
            if moving[k]:
                least.update_motion(known.q[:, k], known.dq[:, k], known.ddq[:, k], known.tau[:, k])
            if k % second == second - 1:
                found.append(least.theta)
        _report(f"recursive ls, memory {memory:g} s", np.array(found), theta, dry)


def _report(name: str, found: np.ndarray, theta: np.ndarray, dry: np.ndarray) -> None:
    """Lag [s] and deviation around it [%], of the last 70 s, friction parameters."""
    at = np.arange(len(found))[:, None] + 1.0
    part = slice(30, len(found) - 1)
    behind = (1.0 + 0.1 * at / 100.0 - found[:, dry] / theta[dry])[part]
    lag, spread = behind.mean(axis=0) / 1e-3, 100.0 * behind.std(axis=0)
    print(f"{name}: lag {np.round(lag, 1)} s, deviation {np.round(spread, 2)} % (fv1 fc1 fv2 fc2)")


if __name__ == "__main__":
    wanted = sys.argv[1:] or ["time", "accuracy", "drift", "particles"]
    for part in wanted:
        {"time": update_times, "accuracy": accuracy, "drift": drift, "particles": particles}[part]()
