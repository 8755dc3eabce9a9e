"""The line with the law of friction, where the log shows how dry friction reaches its full level.

Without a word about it Coulomb friction passes through zero as (2/π) atan(γ dq), with a γ from the
rated speed. Its slow approach to the full level, of which 8 % are missing at a hundredth of the
rated speed, lends viscous friction some of it: where the real level is reached at once, both come
out wrong by far more than their standard errors. tanh(γ dq) is complete there. Both laws have the
same unknowns, so that the one is taken whose least squares leave less, on the same rows.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.methods import Method
from pivident.estimation.problem import Problem
from pivident.init.assumption import Assumption
from pivident.robot.description import Robot
from pivident.robot.friction import FrictionLaw
from pivident.robot.friction_toml import law_toml
from pivident.text.numbers import plus_minus
from pivident.text.toml import parse_toml

#: Consecutive parts of each recording, whose gains tell the standard error of their sum.
PARTS = 20


def complete_friction(
    problem: Problem, method: Method, smooth: Identification, say: Callable[[str], None]
) -> Assumption | None:
    """The line with tanh for the sign; None where the arctangent fits the log better.

    Args:
        problem: the draft's.
        method: least squares.
        smooth: its result with the law as it is.
        say: called with one line at each stage.
    """
    law = _complete_law(problem.robot)
    if law is None:
        return None
    complete = identify(replace(problem, robot=problem.robot.with_friction(law)), method, say)
    gains, deviations = _gains(smooth, complete)
    if np.sum(gains / deviations) <= 0.0:  # joints count by how clear their gains are
        return None
    own = ", ".join(
        f"{name} {plus_minus(100.0 * gain, 200.0 * deviation)} %"
        for name, gain, deviation in zip(problem.robot.joint_names, gains, deviations, strict=True)
    )
    seen = (
        "dry friction that is complete at a hundredth of the rated speed (tanh) fits better than "
        f"the arctangent: the mean square error of a first least squares falls by {own} (± 2σ); "
        "`pivident laws` compares other laws"
    )
    return Assumption("robot", "friction", parse_toml(f"x = {law_toml(law)}")["x"], "likely", seen)


def _complete_law(robot: Robot) -> FrictionLaw | None:
    """The joints' law with tanh for the sign; None where somebody gave one, or they differ."""
    laws = {str(joint.friction): joint.friction for joint in robot.joints}
    (law, *others) = laws.values()
    signs = [term for term in law.terms if term.has_sign]
    given = any(
        term.smoothing != "atan" or term.gamma != joint.default_gamma
        for joint in robot.joints
        for term in joint.friction.terms
        if term.has_sign
    )
    if others or given or not signs:
        return None
    return FrictionLaw(
        tuple(
            replace(term, smoothing="tanh", gamma=None) if term.has_sign else term
            for term in law.terms
        )
    )


def _gains(smooth: Identification, complete: Identification) -> tuple[np.ndarray, np.ndarray]:
    """Shares by which the joints' squares fall, and their standard errors over the parts."""
    before, after = _squares(smooth), _squares(complete)
    shares = (before - after) / np.maximum(before.sum(axis=0), 1e-300)
    deviations = np.sqrt(len(shares) * shares.var(axis=0, ddof=1))
    return shares.sum(axis=0), np.maximum(deviations, 1e-12)


def _squares(found: Identification) -> np.ndarray:
    """Σ (τ - Φθ)² of each part of each recording, shape (parts, joints)."""
    assert found.equations is not None
    parts = []
    for record in found.equations.records:
        left = record.residual(found.equations.regressor, found.theta) ** 2 * record.used
        parts += [own.sum(axis=1) for own in np.array_split(left, PARTS, axis=1)]
    return np.array(parts)
