"""Filters as methods: parameters along the record together with the motion.

    x = (q, dq, θ),     M(q) ddq = τ + w - h(q, dq) - f(q, dq),     y = q + v,     dθ = drift

The torque goes in as it was measured, so that noise of the positions that the control loop feeds
back is in it: nothing of it correlates with the innovations, and the loop makes no bias. What is
assumed is that w and v are white; a filter's own intervals hold for such noises only.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pivident.estimation.answer import Covariances, answer
from pivident.estimation.filter_methods import Particles, StateFilter
from pivident.estimation.filters.filter_run import Filtered, run_filter
from pivident.estimation.filters.filter_setup import (
    FilterSetup,
    FilterStretch,
    encoder_noise,
    filter_setup,
    stretches_of,
)
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
