"""Particle filter on positions, speeds and parameters, see `particles` for its kernels.

Particle filter: many parameter vectors, each with its own motion, weighted by what is measured.

    w_i ← w_i N(y - q_i; P_qq + R)

Given θ_i the motion is as good as linear, so that a particle carries the mean of its own extended
Kalman filter, and all share the covariance of the mean's (marginalised particles: Schön, Gustafsson
and Nordlund 2005); sampled are the parameters alone. Before fewer than half of the
particles count, 1/Σ w² < N/2, they are drawn anew, systematically (Kitagawa 1996), with as much of
the likelihood as that leaves (tempering; Neal 2001), and moved by the kernel of Liu and West
(2001), which keeps mean m and covariance V of parameters, motion and innovation:

    z_i ← m + a (z_i - m) + √(1 - a²) L ε,     L Lᵀ = V,   a = (3δ - 1)/(2δ)

It is importance sampling in as many dimensions as there are parameters: what it adds to a Kalman
filter is a distribution of any shape, what it costs is chance, in estimates and intervals.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.literature.filters.filter_setup import FilterSetup, FilterStretch
from pivident.estimation.literature.filters.filter_state import (
    DONE,
    FAR,
    INDEFINITE,
    MAX_INNOVATION,
    FilterNoise,
    refused,
    torque_variance,
)
from pivident.estimation.literature.filters.midpoint_step import (
    midpoint_step,
    step_tangent,
    step_work,
)
from pivident.estimation.literature.filters.online import CAUSES
from pivident.estimation.literature.filters.robot_equations import robot_equations
from pivident.estimation.literature.filters.state_filter import Filtered, StateFilter
from pivident.estimation.method import Cost
from pivident.estimation.problem import Problem
from pivident.foundation.compiled import allocating
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


#: Share of the particles that has to count.
ENOUGH = 0.5

#: What a cloud is widened by at a drawing, over dimensions by particles that count: clouds of few
#: particles lose their tails.
WIDER = 0.5

#: Halvings in the search for the share of a likelihood.
BISECTIONS = 20


@allocating
def _mean(weights, particles, out):
    for a in range(particles.shape[1]):
        out[a] = 0.0
    for i in range(particles.shape[0]):
        for a in range(particles.shape[1]):
            out[a] += weights[i] * particles[i, a]


@allocating
def cloud_covariance(weights, particles, mean):
    """Σ w (z - m)(z - m)ᵀ, shape (dimensions, dimensions)."""
    size = particles.shape[1]
    total = np.zeros((size, size))
    apart = np.zeros(size)
    for i in range(particles.shape[0]):
        for a in range(size):
            apart[a] = particles[i, a] - mean[a]
        for a in range(size):
            share = weights[i] * apart[a]
            for b in range(a + 1):
                total[a, b] += share * apart[b]
    for a in range(size):
        for b in range(a):
            total[b, a] = total[a, b]
    return total


@allocating
def _root(covariance):
    """Lower factor of a covariance that may be of lower rank: columns without a pivot are zero."""
    size = covariance.shape[0]
    factor = np.zeros((size, size))
    for j in range(size):
        pivot = covariance[j, j]
        for k in range(j):
            pivot -= factor[j, k] ** 2
        if not pivot > 1e-14 * covariance[j, j]:
            continue
        factor[j, j] = np.sqrt(pivot)
        for i in range(j + 1, size):
            total = covariance[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            factor[i, j] = total / factor[j, j]
    return factor


@allocating
def systematic(weights, start):
    """Particles to keep: those at (start + i)/N of the cumulated weights, start in [0, 1)."""
    count = weights.size
    chosen = np.empty(count, np.int64)
    total, j = weights[0], 0
    for i in range(count):
        while total < (start + i) / count and j < count - 1:
            j += 1
            total += weights[j]
        chosen[i] = j
    return chosen


@allocating
def _draw_anew(weights, particles, mean, shrinkage, rng):
    """Systematic resampling, then the kernel."""
    count, size = particles.shape
    factor = _root(cloud_covariance(weights, particles, mean))
    factor *= np.sqrt(1.0 - shrinkage * shrinkage)
    wider = np.sqrt(1.0 + WIDER * size * np.sum(weights * weights))
    kept = particles[systematic(weights, rng.random())]
    normal = np.empty(size)
    for i in range(count):
        for a in range(size):
            normal[a] = rng.standard_normal()
        for a in range(size):
            apart = shrinkage * (kept[i, a] - mean[a])
            for b in range(a + 1):
                apart += factor[a, b] * normal[b]
            particles[i, a] = mean[a] + wider * apart
        weights[i] = 1.0 / count


@allocating
def _transition(solved, noise_torque, h):
    """F and G C Gᵀ of the motion (q, dq)."""
    n = noise_torque.size
    last = solved.shape[1] - n
    tangent = np.zeros((n, 2 * n))
    for i in range(n):
        for j in range(n):
            tangent[i, j] = -solved[i, j]
            tangent[i, n + j] = -solved[i, n + j] - 0.5 * h * solved[i, j]
    forward = np.eye(2 * n)
    gain = np.zeros((2 * n, n))
    for i in range(n):
        forward[i, n + i] += h
        for b in range(2 * n):
            forward[i, b] += 0.5 * h * h * tangent[i, b]
            forward[n + i, b] += h * tangent[i, b]
        for j in range(n):
            gain[i, j] = 0.5 * h * h * solved[i, last + j] * np.sqrt(noise_torque[j])
            gain[n + i, j] = h * solved[i, last + j] * np.sqrt(noise_torque[j])
    return forward, gain @ gain.T


@allocating
def _temper(weights, logs, share):
    """Effective number of particles, 1/Σ w², for weights w L^share."""
    best = logs.max()
    total, square = 0.0, 0.0
    for i in range(logs.size):
        w = weights[i] * np.exp(share * (logs[i] - best))
        total += w
        square += w * w
    return total * total / square


@allocating
def _reweigh(particles, weights, inverse, mean, logs, shrinkage, rng):
    """Weights by the innovations in the last columns; anew, as often as too few would count."""
    n, count = inverse.shape[0], weights.size
    first, remaining = particles.shape[1] - n, 1.0
    while remaining > 0.0:
        for i in range(count):
            logs[i] = 0.0
            for a in range(n):
                for b in range(n):
                    logs[i] -= (
                        0.5 * particles[i, first + a] * inverse[a, b] * particles[i, first + b]
                    )
        share = remaining
        if _temper(weights, logs, share) < ENOUGH * count:
            low, high = 0.0, remaining
            for _ in range(BISECTIONS):
                share = 0.5 * (low + high)
                if _temper(weights, logs, share) < ENOUGH * count:
                    high = share
                else:
                    low = share
        best = logs.max()
        for i in range(count):
            weights[i] *= np.exp(share * (logs[i] - best))
        weights /= weights.sum()
        remaining -= share
        if remaining > 0.0:
            _mean(weights, particles, mean)
            _draw_anew(weights, particles, mean, shrinkage, rng)


@allocating
def particle_samples(
    equations, work, noise, h, tau, y, innovations, particles, weights, covariance, shrinkage, rng
):
    """Advance over samples, with the torques before them: status, joint and sample.

    ``tau`` and ``y``: (samples, joints); ``innovations``: z and √s, (2, samples, joints);
    ``particles``: q, dq, θ and innovations of each, (particles, N + joints); ``weights``:
    (particles,); ``covariance``: of (q, dq) given θ, (2 joints, 2 joints).
    """
    n, count, size = y.shape[1], weights.size, particles.shape[1] - y.shape[1]
    mean, motion = np.zeros(size + n), np.zeros((2, n))
    logs, noise_torque = np.zeros(count), np.zeros(n)
    for k in range(y.shape[0]):
        _mean(weights, particles, mean)
        joint = midpoint_step(
            equations, work, mean[2 * n : size], mean[:n], mean[n : 2 * n], tau[k], h, motion[0],
            motion[1],
        )  # fmt: skip
        if joint >= 0 or not step_tangent(equations, work, h):
            status, joint = refused(joint, n)
            return status, joint, k
        torque_variance(equations.couplings, noise, mean[n : 2 * n], motion[1], noise_torque)
        forward, added = _transition(work.solved, noise_torque, h)
        covariance[:] = forward @ covariance @ forward.T + added
        total = covariance[:n, :n].copy()
        for j in range(n):
            total[j, j] += noise.encoder[j]
        inverse = np.linalg.inv(total)
        gain = np.ascontiguousarray(covariance[:, :n]) @ inverse
        covariance -= gain @ np.ascontiguousarray(covariance[:n])
        alive = 0
        for i in range(count):
            own = particles[i]
            joint = midpoint_step(
                equations, work, own[2 * n : size], own[:n], own[n : 2 * n], tau[k], h, motion[0],
                motion[1],
            )  # fmt: skip
            if joint >= 0:  # the values of no machine
                weights[i] = 0.0
                continue
            alive += 1
            for j in range(n):
                own[j], own[n + j] = motion[0, j], motion[1, j]
                own[size + j] = y[k, j] - own[j]
        if not (alive > 0 and weights.sum() > 0.0):
            return INDEFINITE, 0, k
        weights /= weights.sum()
        _mean(weights, particles, mean)
        for j in range(n):
            innovations[1, k, j] = np.sqrt(total[j, j])
            innovations[0, k, j] = mean[size + j] / innovations[1, k, j]
            if not abs(innovations[0, k, j]) <= MAX_INNOVATION:
                return FAR, j, k
        _reweigh(particles, weights, inverse, mean, logs, shrinkage, rng)
        for i in range(count):
            own = particles[i]
            for a in range(2 * n):
                for b in range(n):
                    own[a] += gain[a, b] * own[size + b]
            for a in range(2 * n, size):
                variance = h * noise.drift[a - 2 * n]
                if variance > 0.0:
                    own[a] += np.sqrt(variance) * rng.standard_normal()
    return DONE, -1, -1
