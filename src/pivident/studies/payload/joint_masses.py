"""The mass by the equations of each joint: do their torque scales agree?

A drive gain that is off by a factor s_j scales all torques of its joint, the load's among them. So
every joint gets an arm of its own, which the record without load determines, and a scale,

    without load:  τ_j = Φ_j θ_j,        with load:  τ_j = Φ_j (θ_j + ΔF_j) + s_j Φ_j B π,

and they have the shape of the load in common. With the mass in π held at its estimate m̂ all s_j
can be estimated, and s_j m̂ is the mass by the equations of joint j. If the joints agree,
Q = (s - s̄)ᵀ P⁻¹ (s - s̄) is that of Hotelling's T², with P by the jackknife over windows of time of
both records. If they do not, the scales have a spread σ_s (DerSimonian and Laird 1986), which no
window sees, and the load gets the variance σ_s² Σ_j g_j g_jᵀ, g_j its sensitivities to the scales.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.estimation.covariance.windows import OVERLAP
from pivident.estimation.equation_record import accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.distributions import fisher
from pivident.foundation.text.numbers import plus_minus
from pivident.studies.payload.arm_and_load import EXACT, ArmAndLoad
from pivident.studies.payload.loaded_record import RestrictedSolution

#: Joints whose own mass is known to worse than this share of it do not count.
VAGUE = 0.3

#: Joints disagree where chance is this improbable and the spread of their scales is this large.
IMPROBABLE, NOTABLE = 0.01, 0.02

#: Standard errors from the mean at which a joint's own mass is another one.
CLEAR = 4.0

#: Standard deviation of a scale about one before there is an estimate, and steps of its solution.
WEAK_SCALE, ROUNDS = 10.0, 6


@dataclass(frozen=True, eq=False)
class JointMasses:
    """The mass by each joint that determines one."""

    joints: tuple[str, ...]  # their names
    mass: np.ndarray  # mass by their own equations [kg], shape (joints,)
    std: np.ndarray  # standard errors [kg], likewise
    statistic: float  # F of the test that all are the same; NaN with fewer than two joints
    p_value: float  # its probability
    spread: float  # σ_s, standard deviation of the scales between joints, zero where they agree
    #: covariance that this spread adds to the ten parameters of the load, shape (10, 10)
    added: np.ndarray

    @property
    def disagree(self) -> bool:
        """Whether the joints' masses differ significantly and notably."""
        return self.p_value < IMPROBABLE and max(self.spread, self.farthest) > NOTABLE

    @property
    def farthest(self) -> float:
        """Largest relative distance of a joint's mass from the mean that is no chance.

        A single joint that is off by much, and known less well than others, hardly widens their
        spread.
        """
        weight = self.std**-2.0
        mean = float(np.sum(weight * self.mass) / np.sum(weight))
        apart = np.abs(self.mass - mean)
        return float(np.max(np.where(apart > CLEAR * self.std, apart, 0.0)) / abs(mean))

    @property
    def listed(self) -> str:
        """Joint by joint with ±2σ."""
        rows = zip(self.joints, self.mass, 2 * self.std, strict=True)
        return ", ".join(f"{name} {plus_minus(m, spread)} kg" for name, m, spread in rows)

    def stored(self) -> dict[str, Any]:
        """The masses, and whether they agree, by key."""
        rows = zip(self.joints, self.mass, self.std, strict=True)
        return {
            "joints": [{"joint": name, "mass": m, "std": std} for name, m, std in rows],
            "statistic": self.statistic,
            "p_value": self.p_value,
            "spread": self.spread,
            "disagree": self.disagree,
        }


def joint_masses(
    arm: Identification,
    sums: Sequence[JointSums],
    unknowns: ArmAndLoad,
    solution: RestrictedSolution,
) -> JointMasses | None:
    """The mass by each joint's equations, from the last normal equations of an estimate.

    None where the equations of the arm without load are not there: it was read from a file.
    """
    if arm.equations is None:
        return None
    mass = float(unknowns.basis[9] @ solution.x[unknowns.load_part])
    empty = accumulate(arm.equations.regressor, arm.equations.records, arm.equations.filters)
    load, scale = solution.x[unknowns.load_part], np.ones(len(sums))
    for _ in range(ROUNDS):  # Gauss-Newton: the torque is bilinear in scales and load
        joints = [
            _JointEquations.of(own, with_load, unknowns, scale[j], load)
            for j, (own, with_load) in enumerate(zip(empty, sums, strict=True))
        ]
        weights = [
            (1.0 / a, 1.0 / b)
            for a, b in zip(arm.equations.variance, solution.variance, strict=True)
        ]
        found = _common(joints, weights, unknowns, mass)
        load, scale = found[: load.size], scale + found[load.size :]
    left_out = [
        _common(joints, weights, unknowns, mass, (record, window)) - found
        for record, own in enumerate((empty, sums))
        for window in range(len(own[0].window_zf))
    ]
    P = np.transpose(left_out)[load.size :]
    P = P @ P.T / OVERLAP
    std = np.sqrt(np.diag(P))  # zero where the load moves no joint's torque: behind its link
    clear = np.flatnonzero((std > EXACT * np.abs(scale)) & (std < VAGUE * np.abs(scale)))
    statistic, p_value, spread = _agreement(scale[clear], P[np.ix_(clear, clear)], len(left_out))
    sensitivity = unknowns.basis @ _steps(sums, unknowns, solution)[unknowns.load_part]
    return JointMasses(
        tuple(sums[int(k)].name for k in clear),
        mass * scale[clear],
        mass * std[clear],
        statistic,
        p_value,
        spread,
        spread**2 * sensitivity @ sensitivity.T,
    )


@dataclass(frozen=True, eq=False)
class _JointEquations:
    """Equations of one joint in both records: first (θ_j, ΔF_j), then load and step of scale."""

    own: int  # number of the joint's own unknowns
    prior: np.ndarray  # weak information of these, a diagonal
    known: np.ndarray  # their values before an estimate
    records: tuple[tuple[JointSums, np.ndarray], ...]  # sums, and its parameters per unknown

    @classmethod
    def of(
        cls, empty: JointSums, loaded: JointSums, unknowns: ArmAndLoad, scale: float,
        load: np.ndarray,
    ) -> _JointEquations:  # fmt: skip
        """With the load in the rows of the joint times a scale."""
        arm = empty.columns
        friction = np.flatnonzero(np.isin(unknowns.friction, arm))
        own = arm.size + friction.size
        columns = unknowns.loaded_map[loaded.columns]
        carried = columns[:, unknowns.load_part]
        with_load = np.hstack(
            [
                columns[:, arm],
                columns[:, unknowns.friction_part][:, friction],
                scale * carried,
                (carried @ load)[:, None],
            ]
        )
        sizes = np.abs(unknowns.arm_theta[arm]) + np.sqrt(np.diag(unknowns.arm_covariance)[arm])
        weak = np.diag(unknowns.information)[unknowns.friction_part][friction]
        prior = np.concatenate([np.maximum(sizes, 1e-9) ** -2, weak])
        known = np.concatenate([unknowns.arm_theta[arm], np.zeros(friction.size)])
        without = np.eye(arm.size, with_load.shape[1])
        return cls(own, prior, known, ((empty, without), (loaded, with_load)))

    def left(
        self, weights: tuple[float, float], without: tuple[int, int]
    ) -> tuple[np.ndarray, np.ndarray]:
        """What they say of load and scale once the own unknowns are eliminated.

        ``without``: record and window that are left out.
        """
        size = self.records[1][1].shape[1]
        matrix, right = np.zeros((size, size)), np.zeros(size)
        matrix[: self.own, : self.own] = np.diag(self.prior)
        right[: self.own] = self.prior * self.known
        for number, ((sums, M), weight) in enumerate(zip(self.records, weights, strict=True)):
            zf, zt = sums.zf, sums.zt
            if number == without[0]:
                zf, zt = zf - sums.window_zf[without[1]], zt - sums.window_zt[without[1]]
            matrix += weight * (M.T @ zf @ M)
            right += weight * (M.T @ zt)
        k = self.own
        gain = np.linalg.solve(matrix[:k, :k].T, matrix[k:, :k].T).T
        return matrix[k:, k:] - gain @ matrix[:k, k:], right[k:] - gain @ right[:k]


def _common(
    joints: Sequence[_JointEquations],
    weights: Sequence[tuple[float, float]],
    unknowns: ArmAndLoad,
    mass: float,
    without: tuple[int, int] = (-1, 0),
) -> np.ndarray:
    """The load with this mass, and the step of each joint's scale."""
    part, row = unknowns.load_part, unknowns.basis[9]
    r, size = row.size, len(joints)
    matrix, right = np.zeros((r + size, r + size)), np.zeros(r + size)
    matrix[:r, :r] = unknowns.information[part, part] + np.outer(row, row) / (EXACT * mass) ** 2
    right[:r] = unknowns.right[part] + row * mass / (EXACT * mass) ** 2
    matrix[r:, r:] = np.eye(size) / WEAK_SCALE**2
    for j, (joint, weight) in enumerate(zip(joints, weights, strict=True)):
        place = np.r_[:r, r + j]
        found, moment = joint.left(weight, without)
        matrix[np.ix_(place, place)] += found
        right[place] += moment
    length = np.sqrt(np.maximum(np.abs(np.diag(matrix)), 1e-300))
    return np.linalg.solve(matrix / np.outer(length, length), right / length) / length


def _steps(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, solution: RestrictedSolution
) -> np.ndarray:
    """Change of the estimate per change of each joint's scale, shape (unknowns, joints)."""
    load = unknowns.loaded_map[:, unknowns.load_part] @ solution.x[unknowns.load_part]
    moved = [
        unknowns.loaded_map[own.columns].T @ (own.zf @ load[own.columns]) / lam
        for own, lam in zip(sums, solution.variance, strict=True)
    ]
    return solution.inverse @ np.column_stack(moved)


def _agreement(scale: np.ndarray, P: np.ndarray, windows: int) -> tuple[float, float, float]:
    """F that all scales are the same, its probability, and σ_s by the method of moments."""
    count = scale.size
    if count < 2 or windows <= count + 1:
        return np.nan, 1.0, 0.0
    weight = np.linalg.pinv(P, hermitian=True)  # joints may share all of their errors
    pull = weight.sum(axis=1)
    about_mean = weight - np.outer(pull, pull) / pull.sum()
    Q = float(scale @ about_mean @ scale)
    spread = np.sqrt(max(Q - (count - 1), 0.0) / np.trace(about_mean))
    freedom = windows - count + 1  # those of the covariance, less the contrasts
    statistic = Q * freedom / ((windows - 1) * (count - 1))
    return statistic, float(fisher.sf(statistic, count - 1, freedom)), float(spread)
