"""What a fitted simulation leaves: gains that the record contradicts, and model error.

The gains of the law were declared, and the fit takes them as they are. With g the derivative of the
simulated motion along one of them, less what the unknowns explain of it, the step

    δ = (g̃ᵀ L² g̃)⁻¹ g̃ᵀ L² e,   g̃ = g - J H⁻¹ Jᵀ L² g

says by how much another gain would fit better (a score test, with the standard error of the
windows of time). That is where the loop's bandwidth leaves its mark in the errors.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.methods import OutputError
from pivident.estimation.output_error.fit import SimulationFit
from pivident.estimation.output_error.loop_unknowns import loop_unknowns
from pivident.estimation.output_error.noise_weights import whitened_sums
from pivident.estimation.output_error.reduced_equations import (
    ReducedEquations,
    stretch_equations,
)
from pivident.estimation.output_error.simulated_errors import simulated_errors
from pivident.estimation.output_error.unknowns import Unknown, values_of
from pivident.estimation.problem import Problem
from pivident.text.finding import Finding, Quantity

#: Standard errors from which on a declared gain counts as contradicted; there are many joints.
SIGNIFICANT = 4.0

#: Relative error of a gain that matters, and the share of the weighted errors that it explains.
MATTERS, EXPLAINS = 0.01, 0.1

#: Excess of the motion's band from which on errors are mostly of the model, as for IDIM-PIV.
MODEL_ERROR = 4.0


@dataclass(frozen=True)
class GainStep:
    """By how much another value of a declared gain would fit better."""

    gain: Unknown
    declared: float
    step: float
    std: float
    explains: float  # share of the weighted squares of the errors that it takes away

    @property
    def contradicts(self) -> bool:
        """Whether the record contradicts the declared value."""
        sure = abs(self.step) > SIGNIFICANT * self.std
        return sure and abs(self.step) > MATTERS * abs(self.declared) and self.explains > EXPLAINS


def misfit_findings(problem: Problem, method: OutputError, fit: SimulationFit) -> list[Finding]:
    """Gains that the record contradicts, and joints whose errors are of the model."""
    wrong = []
    if method.loop == "closed":
        contradicted = [own for own in gain_steps(problem, fit) if own.contradicts]
        wrong = [_wrong_gain(own) for own in contradicted]
    excess = np.nanmax(fit.noise.excess, axis=0, initial=0.0)
    names = [
        name
        for name, own in zip(problem.robot.joint_names, excess.tolist(), strict=True)
        if own > MODEL_ERROR
    ]
    if not names:
        return wrong
    text = (
        f"The simulation error of {', '.join(names)} is mostly in the motion's band, where the "
        "model makes it, not the noise."
    )
    step = "Compare with piv, which follows the measured motion, and see what the verdict names."
    evidence = {"excess": Quantity(float(excess.max()), "", bound=MODEL_ERROR)}
    model = Finding("warning", "simulation", "model error", text, next_step=step, evidence=evidence)
    return [*wrong, model]


def gain_steps(problem: Problem, fit: SimulationFit) -> list[GainStep]:
    """The score test of every gain of the law that was not sought."""
    loop = fit.stretches[0].loop
    sought = {u.name for u in fit.unknowns}
    names = [name for name, shared in loop.law_gains().items() if not shared]
    gains = [u for u in loop_unknowns(problem, loop, names) if u.name not in sought]
    gains = [u for u in gains if loop.value(u.direction) != 0.0]
    if not gains:
        return []
    equations = _with_gains(fit, gains)
    declared = values_of(loop, gains)
    free = np.flatnonzero(~fit.held & ~fit.bound)
    squares = float(sum(np.nansum(own**2) for own in fit.white))
    return [
        _gain_step(own, float(declared[k]), equations, free, len(fit.unknowns) + k, squares)
        for k, own in enumerate(gains)
    ]


def _with_gains(fit: SimulationFit, gains: Sequence[Unknown]) -> ReducedEquations:
    """Equations of the unknowns, then of the gains, at the estimate."""
    own = simulated_errors(fit.stretches, gains, fit.channels, fit.factors)
    joined = []
    for made, last, errors in zip(own, fit.made, fit.errors, strict=True):
        count, extra = len(fit.unknowns), len(gains)
        columns = np.concatenate(
            [last.columns[:, :, :count], made.columns[:, :, :extra], last.columns[:, :, count:]],
            axis=2,
        )
        joined.append(replace(last, errors=errors, columns=columns))
    sums = whitened_sums(joined, fit.noise, robust=False)
    size = len(fit.unknowns) + len(gains)
    return ReducedEquations.of(
        [
            stretch_equations(
                each, fit.noise.variance, size, stretch.start_std,
                np.zeros(0 if stretch.start_std is None else stretch.start_std.size),
            )
            for each, stretch in zip(sums, fit.stretches, strict=True)
        ]
    )  # fmt: skip


def _gain_step(
    gain: Unknown,
    declared: float,
    equations: ReducedEquations,
    free: np.ndarray,
    k: int,
    squares: float,
) -> GainStep:
    """One gain beside the unknowns that are free."""
    kept = np.append(free, k)
    gram = equations.gram[np.ix_(kept, kept)]
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    scaled = gram / np.outer(scale, scale)
    solved = np.linalg.lstsq(scaled, equations.moment[kept] / scale, rcond=1e-12)[0] / scale
    step = np.zeros(len(equations.moment))
    step[kept] = solved
    try:
        std = float(np.sqrt(equations.scores_without(step, kept).covariance[-1, -1]))
    except np.linalg.LinAlgError:  # the gain cannot be separated from the unknowns
        return GainStep(gain, declared, 0.0, np.inf, 0.0)
    explained = float(solved @ equations.moment[kept])
    return GainStep(gain, declared, float(solved[-1]), std, explained / max(squares, 1e-300))


def _wrong_gain(own: GainStep) -> Finding:
    """The sentence about one gain."""
    percent, half = 100.0 * own.step / own.declared, 200.0 * own.std / abs(own.declared)
    kind = own.gain.direction.name
    text = (
        f"The simulation error contradicts {own.gain.name} = {own.declared:.5g} {own.gain.unit}: "
        f"{abs(percent):.3g} ± {half:.2g} % {'more' if percent > 0 else 'less'} fits better."
    )
    step = f'Correct the gain, or have it identified: free = ["{kind}"].'
    evidence = {
        "change": Quantity(percent, "%", interval=(percent - half, percent + half)),
        "declared": Quantity(own.declared, own.gain.unit),
    }
    basis = f"score test over windows of time, {abs(own.step) / own.std:.1f} standard errors"
    return Finding("warning", "law", "wrong gain", text, own.gain.name, step, evidence, basis)
