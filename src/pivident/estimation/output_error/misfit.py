"""What a fitted simulation leaves: gains that the record contradicts, and model error.

Gains of law and drives, and the drives' delay, were declared, and the fit takes them as they are.
With g the derivative of the simulated motion along one of them, less what the unknowns explain of
it, the step

    δ = (g̃ᵀ L² g̃)⁻¹ g̃ᵀ L² e,   g̃ = g - J H⁻¹ Jᵀ L² g

says by how much another gain would fit better (a score test, with the standard error of the
windows of time). That is where the loop's bandwidth leaves its mark in the errors.

Positions give inertia and friction as multiples of the gains: with all gains declared too large by
the same share, all parameters come out too large by it, and the positions fit as well as ever. Only
a measured torque tells. With τ_s the simulated torque, which no noise is in, and e = τ - τ_s,

    δ = Σ τ_s e / Σ τ_s²,   var δ = Σ_w g_w² / (Σ τ_s²)²,   g_w = Σ_{t in w} τ_s (e - δ τ_s)

over windows w of time, for each joint.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.output_error.loop_unknowns import Unknown, loop_unknowns, values_of
from pivident.estimation.output_error.noise_weights import whitened_sums
from pivident.estimation.output_error.reduced_equations import (
    ReducedEquations,
    stretch_equations,
    undetermined,
)
from pivident.estimation.output_error.simulated_errors import JoinedColumns, simulated_errors
from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.estimation.output_error.thinning import TORQUES, means_at
from pivident.estimation.problem import Problem
from pivident.foundation.text.finding import Finding, Quantity

#: Standard errors from which on a declared gain, or a torque, counts as another one; there are many
#: joints.
SIGNIFICANT = 4.0

#: Relative error of a gain or torque that matters, in periods that of a delay, and the share of the
#: weighted errors that it explains.
MATTERS, DELAY_MATTERS, EXPLAINS = 0.01, 0.1, 0.1

#: Windows of each stretch.
WINDOWS = 20


@dataclass(frozen=True)
class TorqueShare:
    """By how much the measured torque of a joint is larger than the simulated one."""

    joint: int
    step: float  # δ
    std: float

    @property
    def contradicts(self) -> bool:
        """Whether it is another torque."""
        return abs(self.step) > max(SIGNIFICANT * self.std, MATTERS)


def torque_shares(fit: SimulationFit) -> list[TorqueShare]:
    """δ of each joint whose torque was measured in all stretches."""
    if any(stretch.tau is None for stretch in fit.stretches):
        return []
    squares, products = [], []
    made = simulated_errors(fit.stretches, (), (TORQUES,), fit.factors)
    for own, stretch in zip(made, fit.stretches, strict=True):
        assert stretch.tau is not None
        error = np.where(own.used[0], own.errors[0], 0.0)
        simulated = np.where(own.used[0], means_at(stretch.tau, own.factor).T - own.errors[0], 0.0)
        parts = [np.array_split(x, WINDOWS, axis=1) for x in (simulated**2, simulated * error)]
        squares += [part.sum(axis=1) for part in parts[0]]
        products += [part.sum(axis=1) for part in parts[1]]
    total = np.sum(squares, axis=0)
    step = np.divide(np.sum(products, axis=0), total, out=np.zeros_like(total), where=total > 0.0)
    scores = np.array(products) - step * np.array(squares)
    std = np.divide(
        np.sqrt((scores**2).sum(axis=0)), total, out=np.full_like(total, np.inf), where=total > 0.0
    )
    return [TorqueShare(j, float(step[j]), float(std[j])) for j in range(len(step))]


def torque_findings(problem: Problem, fit: SimulationFit) -> list[Finding]:
    """Joints whose measured torque is not that of the simulation."""
    wrong = [own for own in torque_shares(fit) if own.contradicts]
    if not wrong:
        return []
    names = problem.robot.joint_names
    worst = max(wrong, key=lambda own: abs(own.step) / own.std)
    listed = ", ".join(
        f"{names[own.joint]} {100.0 * own.step:+.2g} ± {200.0 * own.std:.1g} %" for own in wrong
    )
    text = (
        "Measured torques are not as large as those that the law commands in the simulation: "
        f"{listed}. Positions give parameters as multiples of the gains: they follow gains "
        "that are declared wrong, and so does every interval."
    )
    step = (
        "Correct the gains, drive_gain or the unit of the torque; or take piv, whose parameters "
        "have the scale of the measured torque."
    )
    percent, half = 100.0 * worst.step, 200.0 * worst.std
    evidence = {"torque": Quantity(percent, "%", interval=(percent - half, percent + half))}
    basis = f"slope over windows of time, {abs(worst.step) / worst.std:.1f} standard errors"
    name = names[worst.joint]
    return [Finding("warning", "law", "other torque", text, name, step, evidence, basis)]


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
    matters: float  # step that would matter

    @property
    def contradicts(self) -> bool:
        """Whether the record contradicts the declared value."""
        size = abs(self.step)
        return size > SIGNIFICANT * self.std and size > self.matters and self.explains > EXPLAINS


def misfit_findings(problem: Problem, fit: SimulationFit, test_gains: bool) -> list[Finding]:
    """Gains that the record contradicts, if asked, and joints whose errors are of the model.

    ``test_gains``: whether gains are asked for; an open loop has none.
    """
    wrong = []
    if test_gains:
        wrong = [_wrong_gain(own) for own in contradicted(problem, fit)]
        wrong = wrong or torque_findings(problem, fit)
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


def contradicted(problem: Problem, fit: SimulationFit) -> list[GainStep]:
    """Declared values that the record contradicts, the one that explains most first.

    Gains of one joint, and a delay, leave similar marks. Each further one has to explain what those
    before it do not.
    """
    test = _ScoreTest(problem, fit)
    found: list[GainStep] = []
    while True:
        steps = [own for own in test.steps(found) if own.contradicts]
        if not steps:
            return found
        found.append(max(steps, key=lambda own: own.explains))


class _ScoreTest:
    """Score tests of gains of law and drives, and of their delay, that were not sought."""

    def __init__(self, problem: Problem, fit: SimulationFit) -> None:
        loop = fit.stretches[0].loop
        sought = {u.name for u in fit.unknowns}
        names = [name for name, shared in loop.law_gains().items() if not shared]
        gains = loop_unknowns(problem, loop, [*names, "drive_gain", "delay"])
        self.gains = [
            u
            for u in gains
            if u.name not in sought and (u.name == "delay" or loop.value(u.direction) != 0.0)
        ]
        self.declared = values_of(loop, self.gains)
        self.period = 1.0 / float(loop.signals.rate)
        self.equations = _with_gains(fit, self.gains)
        self.unknowns = len(fit.unknowns)
        self.free = np.flatnonzero(~fit.held & ~fit.bound)
        self.squares = max(float(sum(np.nansum(own**2) for own in fit.white)), 1e-300)

    def steps(self, found: Sequence[GainStep]) -> list[GainStep]:
        """The step of each other gain beside the unknowns and those that were found before."""
        places = {u.name: self.unknowns + k for k, u in enumerate(self.gains)}
        with_found = np.append(self.free, [places[own.gain.name] for own in found]).astype(int)
        before = self._solved(with_found)[1]
        steps = []
        for gain, value in zip(self.gains, self.declared.tolist(), strict=True):
            if any(gain is own.gain for own in found):
                continue
            kept = np.append(with_found, places[gain.name])
            gram = self.equations.gram[np.ix_(kept, kept)]
            if undetermined(gram):  # it cannot be separated from the unknowns
                continue
            step, squares = self._solved(kept)
            std = float(np.sqrt(self.equations.scores_without(step, kept).covariance[-1, -1]))
            explains = (squares - before) / self.squares
            late = gain.name == "delay"
            matters = DELAY_MATTERS * self.period if late else MATTERS * abs(value)
            steps.append(GainStep(gain, value, float(step[kept[-1]]), std, explains, matters))
        return steps

    def _solved(self, kept: np.ndarray) -> tuple[np.ndarray, float]:
        """The step of some columns, and by how much it makes the squares smaller."""
        gram, moment = self.equations.gram[np.ix_(kept, kept)], self.equations.moment[kept]
        scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
        solved = np.linalg.solve(gram / np.outer(scale, scale), moment / scale) / scale
        step = np.zeros(len(self.equations.moment))
        step[kept] = solved
        return step, float(solved @ moment)


def _with_gains(fit: SimulationFit, gains: Sequence[Unknown]) -> ReducedEquations:
    """Equations of the unknowns, then of the gains, at the estimate."""
    # columns of the initial states are those of the fit
    without_starts = [replace(stretch, start_std=None) for stretch in fit.stretches]
    own = simulated_errors(without_starts, gains, fit.channels, fit.factors)
    count = len(fit.unknowns)
    joined = [
        replace(last, errors=errors, columns=JoinedColumns(last.columns, made.columns, count))
        for made, last, errors in zip(own, fit.made, fit.errors, strict=True)
    ]
    sums = whitened_sums(joined, fit.noise, robust=False)
    size = count + len(gains)
    return ReducedEquations.of(
        [
            stretch_equations(
                each, fit.noise.variance, size, stretch.start_std,
                np.zeros(0 if stretch.start_std is None else stretch.start_std.size),
            )
            for each, stretch in zip(sums, fit.stretches, strict=True)
        ]
    )  # fmt: skip


def _wrong_gain(own: GainStep) -> Finding:
    """The sentence about one of them."""
    name, unit, kind = own.gain.name, own.gain.unit, own.gain.direction.name
    basis = f"score test over windows of time, {abs(own.step) / own.std:.1f} standard errors"
    if name == "delay":
        late, half = own.declared + own.step, 2.0 * own.std
        text = (
            f"The simulation error contradicts drive_delay = {own.declared:.4g} s: "
            f"{late:.4g} ± {half:.1g} s fits better."
        )
        step = 'Correct drive_delay of the recording, or have it identified: free = ["delay"].'
        evidence = {"delay": Quantity(late, "s", interval=(late - half, late + half))}
        return Finding("warning", "law", "wrong delay", text, name, step, evidence, basis)
    percent, half = 100.0 * own.step / own.declared, 200.0 * own.std / abs(own.declared)
    text = (
        f"The simulation error contradicts {name} = {own.declared:.5g} {unit}: "
        f"{abs(percent):.3g} ± {half:.2g} % {'more' if percent > 0 else 'less'} fits better."
    )
    kind = kind or own.gain.direction.kind
    step = f'Correct the gain, or have it identified: free = ["{kind}"].'
    evidence = {
        "change": Quantity(percent, "%", interval=(percent - half, percent + half)),
        "declared": Quantity(own.declared, unit),
    }
    return Finding("warning", "law", "wrong gain", text, name, step, evidence, basis)
