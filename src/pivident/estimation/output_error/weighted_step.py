"""The step of a fit, and the weights of the errors that it comes from.

    δ = H⁻¹ g,   λ and A of each channel and joint from the errors that δ leaves, e - J δ

Weights and step are made in turns until they agree. Which unknowns are held since nothing
determines them is decided here, too; what was held once stays so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance import inverse_gram
from pivident.estimation.output_error.loop_unknowns import Unknown
from pivident.estimation.output_error.noise_weights import (
    HUBER_MEAN,
    NoiseWeights,
    fitted_noise,
    loss,
    whitened_errors,
    whitened_sums,
)
from pivident.estimation.output_error.record_stretches import Stretch
from pivident.estimation.output_error.reduced_equations import (
    BoundedStep,
    ReducedEquations,
    bounded_step,
    error_variances,
    stretch_equations,
    to_hold,
    undetermined,
)
from pivident.estimation.output_error.simulated_errors import SimulatedErrors
from pivident.estimation.output_error.simulation_fit import FitOptions
from pivident.foundation.errors import RankDeficientRegressor

#: Rounds of weights and step in a pass that makes noise models.
ROUNDS = 2

#: Relative error of a simulated signal that is rounding.
ROUNDING = 1e-12


@dataclass(frozen=True, eq=False)
class Point:
    """Where the search stands: values, initial states, errors, derivatives."""

    values: np.ndarray  # of the unknowns
    starts: tuple[np.ndarray, ...]  # how far each stretch's initial state is from what was given
    made: tuple[SimulatedErrors, ...]


@dataclass(frozen=True, eq=False)
class WeightedStep:
    """A step from a point, with the weights that it was solved with."""

    noise: NoiseWeights
    equations: ReducedEquations
    step: np.ndarray
    bound: np.ndarray
    held: np.ndarray
    cost: float  # weighted squares of the errors at the point

    @property
    def gain(self) -> float:
        """By how much the step, with those of the initial states, makes the squares smaller."""
        return self.equations.gain(self.step)


class WeightedSteps:
    """What makes the steps of one fit."""

    def __init__(
        self, stretches: tuple[Stretch, ...], unknowns: tuple[Unknown, ...], options: FitOptions
    ) -> None:
        self.stretches, self.unknowns, self.options = stretches, unknowns, options
        self.low = np.array([u.low for u in unknowns])
        self.high = np.array([u.high for u in unknowns])
        self.held = np.array([u.held for u in unknowns], bool)
        #: What was declared, the loop, is held rather than a parameter of the model.
        self.declared = np.array([u.direction.kind != "parameter" for u in unknowns])

    def solved(self, point: Point, before: NoiseWeights | None, models: bool) -> WeightedStep:
        """(b) and (c): the step, with weights from what it leaves.

        ``before``: noise models of the last pass; ``models``: whether to make new ones.
        """
        channels, joints = point.made[0].errors.shape[:2]
        noise = before or replace(
            NoiseWeights.white(channels, joints), variance=self._first_variances(point)
        )
        solved = self._step(point, noise)
        if not models or self.options.noise is None:
            return solved
        for _ in range(ROUNDS):
            left = self.left(point, solved)
            noise = fitted_noise(
                left,
                [own.used for own in point.made],
                point.made[0].rate,
                point.made[0].factor,
                self.options.noise,
                self.options.motion_band,
            )
            solved = self._step(point, noise)
        return solved

    def _first_variances(self, point: Point) -> np.ndarray:
        """λ before anything is known: mean squares of the errors, shape (channels, joints)."""
        squares = sum(
            np.einsum("cjr,cjr->cj", own.errors * own.used, own.errors) for own in point.made
        )
        rows = sum(own.used.sum(axis=2) for own in point.made)
        return np.maximum(squares / np.maximum(rows, 1), 1e-300)

    def _step(self, point: Point, noise: NoiseWeights) -> WeightedStep:
        """Solve, with λ from the errors that the step leaves, twice."""
        sums = whitened_sums(point.made, noise, self.options.robust)
        variance = noise.variance
        consistent = HUBER_MEAN if self.options.robust else 1.0
        for _ in range(3):
            equations = self._equations(point, sums, variance)
            held = self._held(equations)
            found = self.bounded(point, equations, held)
            whole = [np.concatenate([found.step, own.start_step(found.step)])
                     for own in equations.stretches]  # fmt: skip
            variance = error_variances(sums, whole, float(np.count_nonzero(~held)))
            variance = np.maximum(variance / consistent, self._rounding(point, noise))
        equations = self._equations(point, sums, variance)
        settled = replace(noise, variance=variance)
        cost = self.cost(point, settled)
        return WeightedStep(settled, equations, found.step, found.bound, held, cost)

    def _equations(self, point: Point, sums: Sequence, variance: np.ndarray) -> ReducedEquations:
        """Normal equations of all stretches."""
        return ReducedEquations.of(
            [
                stretch_equations(own, variance, len(self.unknowns), stretch.start_std, moved)
                for own, stretch, moved in zip(sums, self.stretches, point.starts, strict=True)
            ]
        )

    def _held(self, equations: ReducedEquations) -> np.ndarray:
        """Unknowns to hold, or the refusal of them; what was held once stays so."""
        free = np.flatnonzero(~self.held)
        groups = undetermined(equations.gram[np.ix_(free, free)])
        if not groups:
            return self.held
        if self.options.undetermined == "refuse":
            names = [tuple(self.unknowns[int(free[i])].name for i in group) for group in groups]
            raise RankDeficientRegressor(
                len(self.unknowns) - len(groups), len(self.unknowns), names
            )
        self.held = to_hold(equations.gram, self.held, self.declared)
        return self.held

    def _rounding(self, point: Point, noise: NoiseWeights) -> np.ndarray:
        """Variance of rounding errors behind the filters, shape (channels, joints)."""
        size = np.max([own.size for own in point.made], axis=0)
        gain = np.array([[np.sum(np.square(f.fir)) for f in own] for own in noise.filters])
        return gain * (ROUNDING * size) ** 2 + 1e-300

    def bounded(self, point: Point, equations: ReducedEquations, held: np.ndarray) -> BoundedStep:
        """The step that solves equations within the bounds."""
        low, high = self.low - point.values, self.high - point.values
        return bounded_step(equations.gram, equations.moment, low, high, held)

    def cost(self, point: Point, noise: NoiseWeights) -> float:
        """Weighted squares of the errors, with that of the initial states' prior."""
        total = sum(
            float(np.sum((own / s.start_std) ** 2))
            for own, s in zip(point.starts, self.stretches, strict=True)
            if s.start_std is not None
        )
        for made in point.made:
            total += loss(whitened_errors(made, noise), noise.variance, self.options.robust)
        return total

    def left(self, point: Point, solved: WeightedStep) -> list[np.ndarray]:
        """Errors that a step leaves, by the derivatives: e - J δ."""
        left = []
        for made, own in zip(point.made, solved.equations.stretches, strict=True):
            whole = np.concatenate([solved.step, own.start_step(solved.step)])
            errors = made.errors.copy()
            for c, j in np.ndindex(*errors.shape[:2]):
                for rows, columns in made.columns.blocks(c, j):
                    errors[c, j, rows] -= whole @ columns
            left.append(errors)
        return left


def inverse_of_free(gram: np.ndarray, free: np.ndarray) -> np.ndarray:
    """H⁻¹ of the free unknowns, zero for the others, shape of ``gram``."""
    out, kept = np.zeros_like(gram), np.flatnonzero(free)
    own = gram[np.ix_(kept, kept)]
    scale = np.sqrt(np.maximum(np.diag(own), 1e-300))
    out[np.ix_(kept, kept)] = inverse_gram(own / np.outer(scale, scale)) / np.outer(scale, scale)
    return out
