"""Friction behind torque sensors: kept for the joints whose record shows it.

Torques that are measured behind the gears contain no friction of the drives; bearings and seals
behind the sensor may rub a little. For each joint the hypothesis fv = fc = 0 is tested by

    F = (ν - k + 1)/(ν k) θᵀ P⁻¹ θ    against F(k, ν - k + 1)

with least squares, the sandwich P over windows of time, and ν its degrees of freedom. Where it
stands, these terms leave the joint's law. The offset stays: sensors have one. Before that, the
record decides how dry friction reaches its full level (`complete_sign`).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.covariance.windows import degrees_of_freedom
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.experiment.init.trial import complete_sign
from pivident.foundation.distributions import fisher
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.foundation.text.sentences import listed
from pivident.robot.friction import FrictionLaw

#: Probability with which friction that is zero stays in a joint's law.
LEVEL = 0.01


@dataclass(frozen=True)
class BearingTest:
    """The test of one joint."""

    joint: str  # its name
    stems: tuple[str, ...]  # of the terms that were tested
    estimates: tuple[str, ...]  # with their intervals (2σ) and units
    p_value: float  # probability of a larger F without friction

    @property
    def is_significant(self) -> bool:
        """Whether the friction stays."""
        return self.p_value < LEVEL


def bearing_friction(
    problem: Problem,
    method: Method | None = None,
    progress: Callable[[str], None] | None = None,
) -> Problem:
    """Leave out the friction of bearings that is not significant.

    Args:
        problem: with torques behind the gears; its laws hold everything that is tested.
        method: what estimates the friction; None: least squares with its default signals.
        progress: called with one line at each stage.

    Returns:
        The problem with the laws that are left, and a finding that says what was decided. Where
        torques are those of motors, or parameters were chosen by name, the problem itself.

    Raises:
        IdentificationError: what ``identify`` raises.
    """
    if problem.robot.torque_side == "motor" or problem.parameters is not None:
        return problem
    say = progress or (lambda line: None)
    say("testing the friction of the bearings")
    method = method or LeastSquares()
    found = identify(problem, method, say)
    if (better := complete_sign(problem, method, found, say)) is not None:
        problem, found = better.problem, better.identification
    tests = [t for j in range(problem.robot.size) if (t := _tested(found, j)) is not None]
    laws = {
        test.joint: FrictionLaw(
            tuple(t for t in problem.robot.joints[j].friction.terms if t.stem not in test.stems)
        )
        for test in tests
        if not test.is_significant
        for j in [problem.robot.joint_names.index(test.joint)]
    }
    robot = problem.robot.with_friction(laws)
    return replace(problem, robot=robot, findings=(*problem.findings, *_findings(tests)))


def _tested(found: Identification, joint: int) -> BearingTest | None:
    """The test of one joint's dissipative terms; None where it has none."""
    place = found.robot.places[joint]
    own = [
        k
        for k, p in enumerate(found.parameters)
        if p.joint == place and p.friction is not None and p.friction.is_dissipative
    ]
    if not own:
        return None
    theta, block = found.theta[own], found.robust_covariance[np.ix_(own, own)]
    scale = np.sqrt(np.diag(block))
    scaled = block / np.outer(scale, scale)
    statistic = float(theta / scale @ np.linalg.solve(scaled, theta / scale))
    freedom = degrees_of_freedom([r.t.size for r in found.recordings])
    k, rest = len(own), max(freedom - len(own) + 1.0, 1.0)
    p_value = float(fisher.sf(rest / (freedom * k) * statistic, k, rest))
    return BearingTest(
        found.robot.joint_names[joint],
        tuple(found.parameters[i].stem for i in own),
        tuple(
            f"{found.names[i]} {plus_minus(found.theta[i], 2 * s)} {found.parameters[i].unit}"
            for i, s in zip(own, scale, strict=True)
        ),
        p_value,
    )


def _findings(tests: list[BearingTest]) -> list[Finding]:
    """What was decided, with the numbers."""
    kept = [t for t in tests if t.is_significant]
    gone = [t for t in tests if not t.is_significant]
    sentences = []
    if kept:
        each = "; ".join(f"{t.joint}: {', '.join(t.estimates)}" for t in kept)
        sentences.append(
            f"Friction of the bearings is significant and stays in the model ({each})."
        )
    if gone:
        smallest = min(t.p_value for t in gone)
        sentences.append(
            f"Of {listed([t.joint for t in gone])} it is not significantly different from zero "
            f"(p ≥ {format_significant(smallest, 2)}) and was left out."
        )
    evidence = {t.joint: Quantity(t.p_value, digits=2) for t in tests}
    basis = (
        f"F test of viscous and Coulomb friction of each joint by least squares, level {LEVEL:g}"
    )
    text = " ".join(sentences)
    return [Finding("note", "torque side", "bearings", text, evidence=evidence, basis=basis)]
