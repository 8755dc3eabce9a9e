"""Whether measured torques are as large as those of the fitted simulation.

Positions give inertia and friction as multiples of the gains: with all gains declared too large by
the same share, all parameters come out too large by it, and the positions fit as well as ever. Only
a measured torque tells. With τ_s the simulated torque, which no noise is in, and e = τ - τ_s,

    δ = Σ τ_s e / Σ τ_s²,   var δ = Σ_w g_w² / (Σ τ_s²)²,   g_w = Σ_{t in w} τ_s (e - δ τ_s)

over windows w of time, for each joint.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.estimation.output_error.simulated_errors import TORQUES, simulated_errors
from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.estimation.output_error.thinning import means_at
from pivident.estimation.problem import Problem
from pivident.text.finding import Finding, Quantity

#: Standard errors and relative error from which on a torque counts as another one.
SIGNIFICANT, MATTERS = 4.0, 0.01

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
