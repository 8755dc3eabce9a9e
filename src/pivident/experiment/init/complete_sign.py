"""How dry friction reaches its full level: as the default arctangent, or as tanh.

Where nobody has said otherwise Coulomb friction passes through zero as (2/π) atan(γ dq), with a γ
from the rated speed. Its slow approach to the full level, of which 8 % are missing at a hundredth
of the rated speed, lends viscous friction some of it: where the real level is reached at once, both
come out wrong by far more than their standard errors. tanh(γ dq) is complete there. Both laws have
the same unknowns, so that the one is taken whose least squares leave less, on the same rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.foundation.errors import IdentificationError
from pivident.foundation.text.numbers import plus_minus
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw

#: Consecutive parts of each recording, whose gains tell the standard error of their sum.
PARTS = 20


@dataclass(frozen=True, eq=False)
class CompleteSign:
    """Least squares with tanh for the sign of dry friction, which leave less.

    Attributes:
        law: of every joint.
        problem: with that law.
        identification: its least squares.
        gains: shares by which the joints' squares fall, shape (joints,).
        deviations: their standard errors, likewise.
    """

    law: FrictionLaw
    problem: Problem
    identification: Identification
    gains: np.ndarray
    deviations: np.ndarray

    def __str__(self) -> str:
        names = self.problem.robot.joint_names
        own = ", ".join(
            f"{name} {plus_minus(100.0 * gain, 200.0 * deviation)} %"
            for name, gain, deviation in zip(names, self.gains, self.deviations, strict=True)
        )
        return (
            "dry friction that is complete at a hundredth of the rated speed (tanh) fits better "
            f"than the arctangent: the mean square error of least squares falls by {own} (± 2σ)"
        )


def complete_sign(
    problem: Problem,
    method: Method,
    smooth: Identification,
    progress: Callable[[str], None] | None = None,
) -> CompleteSign | None:
    """Least squares with tanh for the sign, where they leave less than with the arctangent.

    Joints count by how clear their gains are.

    Args:
        problem: with the default law on every joint.
        method: least squares.
        smooth: its result with that law.
        progress: called with one line at each stage.

    Returns:
        The better law, or None where the arctangent fits better, somebody gave another law, or the
        motion does not separate the parameters of the other one.
    """
    law = _complete_law(problem.robot)
    if law is None:
        return None
    other = replace(problem, robot=problem.robot.with_friction(law))
    try:
        found = identify(other, method, progress)
    except IdentificationError:
        return None
    before, after = _squares(smooth), _squares(found)
    shares = (before - after) / np.maximum(before.sum(axis=0), 1e-300)
    deviations = np.maximum(np.sqrt(len(shares) * shares.var(axis=0, ddof=1)), 1e-12)
    gains = shares.sum(axis=0)
    if np.sum(gains / deviations) <= 0.0:
        return None
    return CompleteSign(law, other, found, gains, deviations)


def _complete_law(robot: Robot) -> FrictionLaw | None:
    """The joints' law with tanh for the sign; None where somebody gave one, or they differ."""
    laws = {str(joint.friction): joint.friction for joint in robot.joints}
    (law, *others) = laws.values()
    signs = [(joint, t) for joint in robot.joints for t in joint.friction.terms if t.has_sign]
    given = any(t.smoothing != "atan" or t.gamma != joint.default_gamma for joint, t in signs)
    if others or given or not signs:
        return None
    return FrictionLaw(
        tuple(
            replace(term, smoothing="tanh", gamma=None) if term.has_sign else term
            for term in law.terms
        )
    )


def _squares(found: Identification) -> np.ndarray:
    """Σ (τ - Φθ)² of each part of each recording, shape (parts, joints)."""
    assert found.equations is not None
    parts = []
    for record in found.equations.records:
        left = record.residual(found.equations.regressor, found.theta) ** 2 * record.used
        parts += [own.sum(axis=1) for own in np.array_split(left, PARTS, axis=1)]
    return np.array(parts)
