"""Particle filter on positions, speeds and parameters, see `particles` for its kernels."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.literature.filters.filter_setup import FilterSetup, FilterStretch
from pivident.estimation.literature.filters.filter_state import DONE, FilterNoise
from pivident.estimation.literature.filters.midpoint_step import step_work
from pivident.estimation.literature.filters.online import CAUSES
from pivident.estimation.literature.filters.particles import cloud_covariance, particle_samples
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.estimation.literature.filters.state_filter import Filtered, StateFilter
from pivident.estimation.method import Cost
from pivident.estimation.problem import Problem
from pivident.foundation.errors import FilterDiverged
from pivident.foundation.options import option


@dataclass(frozen=True, kw_only=True)
class Particles(StateFilter):
    """Sequential importance resampling with the kernel of Liu and West.

    Attributes:
        particles: how many.
        discount: δ of the kernel, below 1: what an older sample counts at a resampling.
        seed: of the random numbers.
    """

    particles: int = option(500, "how many", at_least=10)
    discount: float = option(
        0.9, "what an older sample counts at a resampling", above=0.5, below=1.0
    )
    seed: int = option(0, "of the random numbers", at_least=0)

    label: ClassVar[str] = "particle filter"
    summary: ClassVar[str] = "particle filter, slow"
    cost: ClassVar[Cost] = Cost(1.0, 4e-4)
    correlated_start: ClassVar[bool] = True

    @property
    def assumption(self) -> str:
        """What its intervals rest on, a sentence."""
        return (
            f"The intervals are those of {self.particles} particles, which are drawn by chance, "
            "and hold for white noises of the assumed size only."
        )

    def steps(self, samples: int) -> float:
        """What it goes through on so many samples, in steps of one filter."""
        return self.particles * samples

    def one_pass(
        self,
        problem: Problem,
        setup: FilterSetup,
        theta: np.ndarray,
        stretches: Sequence[FilterStretch],
        number: int,
    ) -> Filtered:
        """Go through all stretches once, with random numbers of their own in each pass."""
        n, count = problem.robot.size, self.particles
        equations = robot_equations(problem.robot, problem.regressor.parameters)
        noise = FilterNoise(
            setup.encoder**2, setup.torque**2, setup.still**2, setup.limits, setup.drift**2
        )
        rng = np.random.default_rng([self.seed, number])
        cloud = np.zeros((count, 3 * n + theta.size))
        root = np.linalg.cholesky(setup.covariance)
        cloud[:, 2 * n : -n] = theta + rng.standard_normal((count, theta.size)) @ root.T
        weights = np.full(count, 1.0 / count)
        shrinkage = (3.0 * self.discount - 1.0) / (2.0 * self.discount)
        found = []
        for stretch in stretches:
            work = step_work(equations, stretch.q[0], problem.robot.joint_names)
            cloud[:, :n], cloud[:, n : 2 * n] = stretch.q[0], stretch.dq[0]
            motion = np.diag(np.concatenate([setup.encoder**2, stretch.dq_std**2]))
            q, tau = (np.ascontiguousarray(x) for x in stretch.part(1, len(stretch.q)))
            innovations = np.zeros((2, *q.shape))
            status, joint, sample = particle_samples(
                equations, work, noise, 1.0 / setup.rate, tau, q, innovations, cloud, weights,
                motion, shrinkage, rng,
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
