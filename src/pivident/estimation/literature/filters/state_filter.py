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
from typing import ClassVar, NamedTuple

import numpy as np

from pivident.estimation.answer import Covariances, answer
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Estimate, Run, solved_otherwise
from pivident.estimation.least_squares import least_squares_start
from pivident.estimation.literature.filters.filter_setup import (
    FilterOptions,
    FilterSetup,
    FilterStretch,
    encoder_noise,
    filter_setup,
    stretches_of,
)
from pivident.estimation.literature.filters.filter_state import FilterRun
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.estimation.method import Say
from pivident.estimation.problem import Problem
from pivident.foundation.errors import FilterDiverged
from pivident.foundation.text.finding import Finding, Quantity

#: Mean squares of innovations between which noises are as large as assumed …
AS_ASSUMED = (0.7, 1.4)

#: … and the correlation of neighbours from which on they are not white.
WHITE = 0.15

#: Windows of all records together, over the number of parameters.
WINDOWS = 2.0


class Prepared(NamedTuple):
    """What comes before a filter."""

    estimate: Estimate  # least squares
    setup: FilterSetup
    stretches: list[FilterStretch]


@dataclass(frozen=True, eq=False)
class Filtered:
    """What a filter found."""

    theta: np.ndarray  # after the last sample, (parameters,)
    covariance: np.ndarray  # (parameters, parameters)
    robust: np.ndarray  # from windows, likewise
    innovations: np.ndarray  # in standard deviations, of the last pass, (samples, joints)
    passes: np.ndarray  # estimates after each pass, (passes, parameters)


@dataclass(frozen=True, kw_only=True)
class StateFilter(FilterOptions):
    """A filter with the state (q, dq, θ), whose input is the torque and whose output is q."""

    def one_pass(
        self,
        problem: Problem,
        setup: FilterSetup,
        theta: np.ndarray,
        stretches: Sequence[FilterStretch],
        number: int,
    ) -> Filtered:
        """Go through all stretches once.

        Args:
            problem: what is estimated.
            setup: noises and first spread.
            theta: first parameters, shape (parameters,).
            stretches: samples of all recordings.
            number: how often they were gone through before.

        Raises:
            FilterDiverged: names the sample and the innovation.
        """
        raise NotImplementedError(f"{type(self).__name__} has no one_pass()")

    @property
    def assumption(self) -> str:
        """What its intervals rest on, a sentence."""
        return (
            "The filter's intervals hold for white noises of the assumed size only; errors of the "
            "model are neither."
        )

    def steps(self, samples: int) -> float:
        """What it goes through on so many samples, in steps of one filter."""
        return samples

    def prepare(self, problem: Problem, say: Say) -> Prepared:
        """Least squares, noises and the samples that are gone through."""
        robot_equations(problem.robot, problem.regressor.parameters)  # refused before long work
        kinematics, estimate = least_squares_start(problem, self, say)
        encoder = encoder_noise(problem, self)
        stretches = stretches_of(problem, kinematics, encoder)
        say(f"{self.label}: noise of the torques")
        return Prepared(
            estimate, filter_setup(problem, self, estimate, stretches, encoder), stretches
        )

    def run(
        self, problem: Problem, setup: FilterSetup, stretches: Sequence[FilterStretch]
    ) -> Filtered:
        """Go through all stretches as often as asked.

        Raises:
            FilterDiverged: names the sample and the innovation.
        """
        passes, last = [], setup.theta
        for number in range(self.passes):
            filtered = self.one_pass(problem, setup, last, stretches, number)
            last = filtered.theta
            passes.append(last)
        return replace(filtered, passes=np.array(passes))

    def estimate(self, problem: Problem, say: Say, *, test_gains: bool = True) -> Identification:
        """Along the record, from least squares."""
        start, setup, stretches = self.prepare(problem, say)
        say(f"{self.label}: {sum(len(s.q) for s in stretches)} samples")
        filtered = self.run(problem, setup, stretches)
        estimate, history = solved_otherwise(
            start, filtered.theta, filtered.covariance, start.solution.condition, filtered.passes
        )
        noises = Finding("note", "filter", "white noises", self.assumption)
        findings = (noises, *whiteness(problem, filtered))
        covariances = Covariances(filtered.robust, filtered.covariance)
        return answer(
            problem, self, estimate, Run(history, True), findings, covariances=covariances
        )


@dataclass(frozen=True, kw_only=True)
class KalmanMethod(StateFilter):
    """A filter whose knowledge is a mean and a covariance.

    Attributes:
        needs_points: whether its state holds sigma points.
        square_root: whether factors of the covariance are carried.
    """

    needs_points: ClassVar[bool] = False
    square_root: ClassVar[bool] = False

    def advance(self, run: FilterRun) -> tuple[int, int, int]:
        """Take samples.

        Args:
            run: the filter and its samples.

        Returns:
            Status, and joint and sample at which it ended.
        """
        raise NotImplementedError(f"{type(self).__name__} has no advance()")

    def one_pass(
        self,
        problem: Problem,
        setup: FilterSetup,
        theta: np.ndarray,
        stretches: Sequence[FilterStretch],
        number: int,
    ) -> Filtered:
        """Go through all stretches once; the covariance from windows holds for any colour."""
        kalman = replace(setup, theta=theta).kalman(problem, self)
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
                    raise in_record(error, problem, stretch) from error
                found.append(z)
                marks.append((kalman.theta, kalman.covariance))
        values, spread = marks[-1]
        robust = windows_covariance(marks) if not setup.drift.any() else spread
        return Filtered(values, spread, robust, np.concatenate(found), values[None])


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


def in_record(error: FilterDiverged, problem: Problem, stretch: FilterStretch) -> FilterDiverged:
    """The same error, with the number of the sample in its recording."""
    name = problem.recordings[stretch.recording].name
    cause = error.cause or f"recording {name!r}"
    return FilterDiverged(error.joint, stretch.first + error.sample, error.innovation, cause)
