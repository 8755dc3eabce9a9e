"""Filters as methods: parameters along the record together with the motion.

    x = (q, dq, θ),     M(q) ddq = τ + w - h(q, dq) - f(q, dq),     y = q + v,     dθ = drift

The torque goes in as it was measured, so that noise of the positions that the control loop feeds
back is in it: nothing of it correlates with the innovations, and the loop makes no bias. What is
assumed is that w and v are white; a filter's own intervals hold for such noises only.

Beside the filter's own covariance P stands one that holds for noises of any colour, from windows of
the record. The information of the parameters grows by what a window says; with the estimate θ of
the end, the score of the window from sample a to b is

    g = P_b⁻¹ (θ_b - θ) - P_a⁻¹ (θ_a - θ),     H = (P_b⁻¹ - P_a⁻¹) P,     V = P Σ ḡ ḡᵀ P

with ḡ = (1 - H)⁻¹ g, what is missing if the window is left out (jackknife; exact for linear
systems).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from pivident.errors import FilterDiverged
from pivident.estimation.answer import Covariances, answer
from pivident.estimation.filter_methods import Particles, StateFilter
from pivident.estimation.filters.filter_setup import (
    FilterSetup,
    FilterStretch,
    encoder_noise,
    filter_setup,
    stretches_of,
)
from pivident.estimation.filters.filter_state import DONE, FilterNoise
from pivident.estimation.filters.midpoint_step import step_work
from pivident.estimation.filters.online import CAUSES
from pivident.estimation.filters.particles import cloud_covariance, particle_samples
from pivident.estimation.filters.robot_equations import robot_equations
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Estimate, Run, Say, solved_otherwise
from pivident.estimation.least_squares import least_squares_start
from pivident.estimation.problem import Problem
from pivident.robot.refusals import without_wrenches
from pivident.text.finding import Finding, Quantity

#: Mean squares of innovations between which noises are as large as assumed …
AS_ASSUMED = (0.7, 1.4)

#: … and the correlation of neighbours from which on they are not white.
WHITE = 0.15


def identify_filter(problem: Problem, method: StateFilter, say: Say) -> Identification:
    """Estimate by one of the filters."""
    estimate, setup, stretches = prepared(problem, method, say)
    say(f"{method.label}: {sum(len(s.q) for s in stretches)} samples")
    made = run_filter(problem, method, setup, stretches)
    result, history = solved_otherwise(
        estimate, made.theta, made.covariance, estimate.solution.condition, made.passes
    )
    findings = (assumption(problem, method, made), *whiteness(problem, made))
    covariances = Covariances(made.robust, made.covariance)
    run = Run(history, True)
    return answer(problem, method, result, run, findings, covariances=covariances)


class Prepared(NamedTuple):
    """What comes before a filter."""

    estimate: Estimate  # least squares
    setup: FilterSetup
    stretches: list[FilterStretch]


def prepared(problem: Problem, method: StateFilter, say: Say) -> Prepared:
    """Least squares, noises and the samples that are gone through."""
    without_wrenches(problem.robot, f"the method {method.label}")
    robot_equations(problem.robot, problem.regressor.parameters)  # refused before minutes of work
    kinematics, estimate = least_squares_start(problem, method, say)
    encoder = encoder_noise(problem, method)
    stretches = stretches_of(problem, kinematics, encoder)
    say(f"{method.label}: noise of the torques")
    return Prepared(
        estimate, filter_setup(problem, method, estimate, stretches, encoder), stretches
    )


def assumption(problem: Problem, method: StateFilter, made: Filtered) -> Finding:
    """What the intervals of a filter rest on."""
    if isinstance(method, Particles):
        text = (
            f"The intervals are those of {method.particles} particles, which are drawn by chance, "
            "and hold for white noises of the assumed size only."
        )
    else:
        text = (
            "The filter's intervals hold for white noises of the assumed size only; errors of the "
            "model are neither."
        )
    return Finding("note", "filter", "white noises", text)


def whiteness(problem: Problem, made: Filtered) -> Sequence[Finding]:
    """Whether the innovations are as a filter that is right has them."""
    z = made.innovations
    square = np.mean(z**2, axis=0)
    centred = z - z.mean(axis=0)
    next_to = np.sum(centred[1:] * centred[:-1], axis=0) / np.maximum(
        np.sum(centred**2, axis=0), 1e-300
    )
    wrong = (square < AS_ASSUMED[0]) | (square > AS_ASSUMED[1]) | (np.abs(next_to) > WHITE)
    if not wrong.any():
        return ()
    apart = np.abs(np.log(np.maximum(square, 1e-300))) + np.abs(next_to)
    worst = int(np.argmax(np.where(wrong, apart, -1.0)))
    name = problem.robot.joint_names[worst]
    text = (
        f"The innovations of {name} are not white of unit variance (mean square "
        f"{square[worst]:.3g}, correlation of neighbours {next_to[worst]:.2g}): noises are not as "
        "assumed, or the model is wrong, and the intervals do not hold."
    )
    step = "Compare with piv, whose intervals account for coloured noise."
    evidence = {
        "mean square": Quantity(float(square[worst]), "", bound=AS_ASSUMED[1]),
        "correlation": Quantity(float(next_to[worst]), "", bound=WHITE),
    }
    return (Finding("warning", "filter", "innovations", text, name, step, evidence),)


#: Windows of all records together, over the number of parameters.
WINDOWS = 2.0


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter found."""

    theta: np.ndarray  # after the last sample, (parameters,)
    covariance: np.ndarray  # (parameters, parameters)
    robust: np.ndarray  # from windows, likewise
    innovations: np.ndarray  # in standard deviations, of the last pass, (samples, joints)
    passes: np.ndarray  # estimates after each pass, (passes, parameters)


def run_filter(
    problem: Problem,
    method: StateFilter,
    setup: FilterSetup,
    stretches: Sequence[FilterStretch],
) -> Filtered:
    """Go through all stretches.

    Raises:
        FilterDiverged: names the sample and the innovation.
    """
    passes, last = [], setup.theta
    for number in range(method.passes):
        if isinstance(method, Particles):
            made = _particles(problem, method, setup, last, stretches, number)
        else:
            made = _kalman(problem, method, setup, last, stretches)
        passes.append(made.theta)
        last = made.theta
    return Filtered(made.theta, made.covariance, made.robust, made.innovations, np.array(passes))


def _kalman(
    problem: Problem,
    method: StateFilter,
    setup: FilterSetup,
    theta: np.ndarray,
    stretches: Sequence[FilterStretch],
) -> Filtered:
    """One pass of a Kalman filter."""
    kalman = replace(setup, theta=theta).kalman(problem, method)
    total = sum(len(s.q) for s in stretches)
    length = max(round(total / (WINDOWS * theta.size)), 10)
    found, marks = [], [(kalman.theta, kalman.covariance)]
    for stretch in stretches:
        kalman.samples = 0
        kalman.start(stretch.q[0], stretch.dq[0], stretch.dq_std)
        count = max(round((len(stretch.q) - 1) / length), 1)
        for part in np.array_split(np.arange(1, len(stretch.q)), count):
            try:
                z, _ = kalman.run(*stretch.part(part[0], part[-1] + 1))
            except FilterDiverged as error:
                raise _in_record(error, problem, stretch) from error
            found.append(z)
            marks.append((kalman.theta, kalman.covariance))
    values, spread = marks[-1]
    robust = windows_covariance(marks) if not setup.drift.any() else spread
    return Filtered(values, spread, robust, np.concatenate(found), values[None])


def windows_covariance(marks: Sequence[tuple[np.ndarray, np.ndarray]]) -> np.ndarray:
    """V from estimates and covariances at the ends of windows; see above."""
    theta, covariance = marks[-1]
    scale = np.sqrt(np.diag(covariance))
    inverses = [np.linalg.inv(p / np.outer(scale, scale)) for _, p in marks]
    scores = [
        inverse @ ((values - theta) / scale)
        for inverse, (values, _) in zip(inverses, marks, strict=True)
    ]
    own = covariance / np.outer(scale, scale)
    total = np.zeros_like(own)
    for a in range(len(marks) - 1):
        share = (inverses[a + 1] - inverses[a]) @ own
        moved = own @ np.linalg.solve(np.eye(len(own)) - share, scores[a + 1] - scores[a])
        total += np.outer(moved, moved)
    return total * np.outer(scale, scale)


def _particles(
    problem: Problem,
    method: Particles,
    setup: FilterSetup,
    theta: np.ndarray,
    stretches: Sequence[FilterStretch],
    number: int,
) -> Filtered:
    """One pass of the particle filter."""
    n, count = problem.robot.size, method.particles
    equations = robot_equations(problem.robot, problem.regressor.parameters)
    noise = FilterNoise(
        setup.encoder**2, setup.torque**2, setup.still**2, setup.limits, setup.drift**2
    )
    rng = np.random.default_rng([method.seed, number])
    cloud = np.zeros((count, 3 * n + theta.size))
    root = np.linalg.cholesky(setup.covariance)
    cloud[:, 2 * n : -n] = theta + rng.standard_normal((count, theta.size)) @ root.T
    weights = np.full(count, 1.0 / count)
    shrinkage = (3.0 * method.discount - 1.0) / (2.0 * method.discount)
    found = []
    for stretch in stretches:
        work = step_work(equations, stretch.q[0], problem.robot.joint_names)
        cloud[:, :n], cloud[:, n : 2 * n] = stretch.q[0], stretch.dq[0]
        motion = np.diag(np.concatenate([setup.encoder**2, stretch.dq_std**2]))
        q, tau = (np.ascontiguousarray(x) for x in stretch.part(1, len(stretch.q)))
        innovations = np.zeros((2, *q.shape))
        status, joint, sample = particle_samples(
            equations, work, noise, 1.0 / setup.rate, tau, q, innovations, cloud, weights, motion,
            shrinkage, rng,
        )  # fmt: skip
        if status != DONE:
            own = float(innovations[0, sample, joint])
            name = problem.robot.joint_names[joint]
            raise FilterDiverged(name, stretch.first + sample + 1, own, CAUSES.get(status, ""))
        found.append(innovations[0])
    mean = weights @ cloud
    covariance = cloud_covariance(weights, cloud, mean)[2 * n : -n, 2 * n : -n]
    values = mean[2 * n : -n]
    return Filtered(values, covariance, covariance, np.concatenate(found), values[None])


def _in_record(error: FilterDiverged, problem: Problem, stretch: FilterStretch) -> FilterDiverged:
    """The same error, with the number of the sample in its recording."""
    name = problem.recordings[stretch.recording].name
    cause = error.cause or f"recording {name!r}"
    return FilterDiverged(error.joint, stretch.first + error.sample, error.innovation, cause)
