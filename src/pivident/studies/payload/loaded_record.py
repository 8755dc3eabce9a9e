"""Equations of the loaded records: what must match, the sums, and the unknowns from them.

The same three estimators as without load, at the full sampling rate: least squares; instruments
from the loop simulated with the loaded arm, or from the record where there is none; the same after
prefilters from the identified noise.

Checks that arms, mountings, links and recordings match.

The unknowns of a loaded record, from its normal equations and prior information.

    J x = Σ_j M₂ᵀ Zᵀτ/λ_j + Λ x₀,      J = Σ_j M₂ᵀ ZᵀΦ M₂/λ_j + Λ

Λ is the prior information. The covariance consists of the loaded record's noise and of the known
arm, whose reported covariance P₁ need not be the inverse of the weight Λ₁ from its normal
equations:

    P = C_noise + R Λ₁ P₁ Λ₁ Rᵀ + (known parts),      R = J⁻¹ restricted to the arm.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.covariance.sandwich import Jackknife, jackknife_of
from pivident.estimation.covariance.stationary_noise import score_variance
from pivident.estimation.equation_record import accumulate
from pivident.estimation.full_rate import (
    FullRateRecord,
    filtered,
    records_without_instruments,
)
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Pass, Signals, Simulated
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.normal_equations import JointSums, joint_variances
from pivident.estimation.prefiltered_iv import PrefilteredSteps
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError
from pivident.loop.motion.motion import torque_of
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.signals.prefilter import Prefilter
from pivident.studies.payload.arm_and_load import ArmAndLoad, reduced


class LoadedRecords:
    """The loaded recordings of a problem with their instruments and prefilters."""

    def __init__(self, signals: Signals, steps: Any = None) -> None:
        """``steps``: those of a method with instruments; None: least squares."""
        self.signals = signals if steps is None else steps.signals
        self.steps = steps
        self.problem = signals.problem
        self.prefilters = (
            steps.whitening.initial()
            if isinstance(steps, PrefilteredSteps)
            else Prefilters.none(self.problem)
        )
        self.records: Sequence[FullRateRecord] = []

    @property
    def filters(self) -> Sequence[Prefilter]:
        """Prefilter of each joint."""
        return self.prefilters.filters

    def least_squares(self, theta: np.ndarray) -> list[JointSums]:
        """Normal equations with Z = Φ: those of least squares, and the start of the others."""
        known = self.signals.measured(theta)
        self.records = records_without_instruments(known, self.signals.limits)
        return accumulate(self.problem.regressor, self.records, self.filters)

    def with_instruments(
        self, number: int, last: np.ndarray, theta: np.ndarray
    ) -> tuple[list[JointSums], np.ndarray]:
        """Normal equations with instruments, and the parameters that were simulated for them.

        ``last`` are the parameters of the previous estimate, which could be simulated.
        """
        assert self.steps is not None
        before = Pass(number, theta, last, self.records, self.prefilters)
        self.prefilters = self.steps.noise_models(before, theta)
        simulated = Simulated(*self.steps.auxiliary.simulate_or_halve(last, theta))
        self.records, _ = self.steps.equations(before, simulated, self.prefilters)
        return accumulate(self.problem.regressor, self.records, self.filters), simulated.theta

    def residuals(self, theta: np.ndarray) -> list[np.ndarray]:
        """τ - Φθ of each recording [N m or N], shape (joints, samples)."""
        regressor = self.problem.regressor
        return [r.kinematics.tau - torque_of(regressor, r.kinematics, theta) for r in self.records]

    def errors(self, theta: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        """‖τ - Φθ‖/‖τ‖ and the rms of τ - Φθ [N m or N] of each joint over the samples in use."""
        left, total, rows = np.zeros((3, self.problem.robot.size))
        for record, residual in zip(self.records, self.residuals(theta), strict=True):
            left += np.sum(np.where(record.used, residual, 0.0) ** 2, axis=1)
            total += np.sum(np.where(record.used, record.kinematics.tau, 0.0) ** 2, axis=1)
            rows += record.used.sum(axis=1)
        return np.sqrt(left / np.maximum(total, 1e-300)), np.sqrt(left / np.maximum(rows, 1.0))

    def score_variance(
        self, theta: np.ndarray, sums: Sequence[JointSums], variance: np.ndarray, metric: np.ndarray
    ) -> np.ndarray:
        """V = Var Σ Zᵀε/λ for a residual that is stationary noise of any colour.

        ``metric``, the covariance of θ_loaded by the weights, gives the share of the noise that the
        estimate absorbed.
        """
        filters, root = self.filters, np.sqrt(variance)[:, None]
        residuals = zip(self.records, self.residuals(theta), strict=True)
        white = [filtered(residual, filters, r.seen) / root for r, residual in residuals]
        return score_variance(
            self.problem.regressor, self.records, filters, sums, variance, white, metric
        )


def check_recordings(empty: Problem, loaded: Problem | Sequence[Recording]) -> None:
    """Refuse a recording that is given for both states, and an empty list."""
    runs = loaded.recordings if isinstance(loaded, Problem) else tuple(loaded)
    if not runs:
        raise ExperimentError(
            "no recording with the load is given", advice="at least one is needed"
        )
    for run in runs:
        if any(run.q is other.q for other in empty.recordings):
            raise ExperimentError(
                f"recording {run.name!r} is given both without and with the load",
                advice="give two runs",
            )


def check_same_arm(arm: Identification, loaded: Problem) -> None:
    """Refuse an arm with other joints, geometry, friction law or mounting."""
    base = loaded.base
    groups = dict(zip((p.name for p in base.parameters), base.expressions, strict=True))
    laws = {p.name: p.friction for p in base.parameters}
    if (arm.robot.size, arm.robot.joint_names) != (loaded.robot.size, loaded.robot.joint_names):
        raise ExperimentError(
            f"the empty arm has the joints {', '.join(arm.robot.joint_names)}, the loaded one "
            f"{', '.join(loaded.robot.joint_names)}",
            advice="give records of the same robot",
        )
    if not np.allclose(arm.robot.gravity, loaded.robot.gravity, atol=0.05):
        raise ExperimentError(
            f"the empty arm was identified with gravity {_vector(arm.robot.gravity)} m/s² in its "
            f"base frame, the loaded one has {_vector(loaded.robot.gravity)} m/s²: another "
            "mounting has other identifiable parameters. Use a record without load in the mounting "
            "of the loaded one, or correct gravity under [robot]"
        )
    for parameter, expression in zip(arm.parameters, arm.expressions, strict=True):
        if not _is_same_group(groups.get(parameter.name, ""), expression):
            raise ExperimentError(
                f"the arm was identified with {expression!r}, but the robot of the loaded record "
                f"has {groups.get(parameter.name, 'no such parameter')!r}: geometry or friction "
                "law differ. Identify the arm again with the robot of the loaded record"
            )
        if laws[parameter.name] != parameter.friction:
            raise ExperimentError(
                f"the friction term {parameter.name!r} of the arm is {parameter.friction}, that "
                f"of the loaded record's robot {laws[parameter.name]}. Identify the arm again with "
                "the same friction law"
            )


def tool_frame(robot: Robot, carrier: int, link: str | None, frame: Pose | None) -> str:
    """The frame of a load as text: a tool's pose in the frame of its link, or that link's own."""
    own = repr(robot.links[carrier].name)
    if link is not None:
        own = f"{link!r}, fixed to {own}"
    if frame is None:
        return f"link {own}"
    rotation = np.array2string(frame.rotation, precision=4, suppress_small=True, separator=", ")
    return (
        f"tool with origin {_vector(frame.translation)} m and axes {' '.join(rotation.split())} "
        f"(columns) in the frame of link {own}"
    )


def _is_same_group(one: str, other: str) -> bool:
    """Whether two groups of parameters are the same but for the last digit of their factors."""
    words, others = one.split(), other.split()
    if len(words) != len(others):
        return False
    return all(a == b or _is_same_factor(a, b) for a, b in zip(words, others, strict=True))


def _is_same_factor(one: str, other: str) -> bool:
    numbers = all(re.fullmatch(r"[-+]?[0-9.]+(e[-+]?[0-9]+)?", word) for word in (one, other))
    return numbers and math.isclose(float(one), float(other), rel_tol=1e-4)


def _vector(values: np.ndarray) -> str:
    return "(" + ", ".join(f"{v:.4g}" for v in values) + ")"


@dataclass(frozen=True, eq=False)
class RestrictedSolution:
    """Solved equations."""

    x: np.ndarray  # the unknowns (θ, ΔF, ξ), shape (unknowns,)
    theta: np.ndarray  # θ_loaded = M₂ x, shape (parameters,)
    variance: np.ndarray  # λ of each joint at the estimate, shape (joints,)
    inverse: np.ndarray  # J⁻¹, shape (unknowns, unknowns)


def solve_restricted(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, start: np.ndarray
) -> RestrictedSolution:
    """Solve with weights from the residual, three times, so that weights and estimate agree."""
    theta, own = start, reduced(sums, unknowns)
    for _ in range(3):
        variance = joint_variances(sums, theta)
        gradient, right = unknowns.information.copy(), unknowns.right.copy()
        for joint, lam in zip(own, variance, strict=True):
            gradient += joint.zf / lam
            right += joint.zt / lam
        inverse = _inverse(gradient)
        x = inverse @ right
        theta = unknowns.loaded_map @ x
    return RestrictedSolution(x, theta, joint_variances(sums, theta), inverse)


def noise_by_windows(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, solution: RestrictedSolution
) -> Jackknife:
    """C_noise by the jackknife over windows of time, see `pivident.estimation.covariance.sandwich`.

    The known parameters belong to no window.
    """
    count, size = len(sums[0].window_zf), solution.x.size
    shares, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for joint, lam in zip(reduced(sums, unknowns), solution.variance, strict=True):
        shares += joint.window_zf / lam
        scores += (joint.window_zt - joint.window_zf @ solution.x) / lam
    return jackknife_of(shares, scores, shares.sum(axis=0) + unknowns.information)


def noise_by_scores(
    scores: np.ndarray, unknowns: ArmAndLoad, solution: RestrictedSolution
) -> np.ndarray:
    """C_noise = J⁻¹ M₂ᵀ V M₂ J⁻ᵀ from the variance V of the scores Σ Zᵀε/λ."""
    gain = solution.inverse @ unknowns.loaded_map.T
    return gain @ scores @ gain.T


def with_known(
    noise: np.ndarray, unknowns: ArmAndLoad, solution: RestrictedSolution
) -> tuple[np.ndarray, np.ndarray]:
    """Covariance of x, and of θ - θ̂₁: arm of both records minus arm of the first one."""
    arm = unknowns.arm_part
    gain = solution.inverse[:, arm] @ unknowns.arm_information
    others = unknowns.information.copy()
    others[arm, arm] = 0.0
    given = solution.inverse @ others @ solution.inverse.T
    covariance = noise + given + gain @ unknowns.arm_covariance @ gain.T
    away = gain[arm] - np.eye(unknowns.arm_theta.size)
    moved = noise[arm, arm] + given[arm, arm] + away @ unknowns.arm_covariance @ away.T
    return 0.5 * (covariance + covariance.T), moved


def _inverse(matrix: np.ndarray) -> np.ndarray:
    """Inverse with rows and columns of unit length."""
    scale = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
