"""One round of eliminations: the weakest parameters of an estimate go, one by one.

The tests are those of ``pivident.judgement.essential_parameters``. Everything is foretold from
one identification, its two covariances and the sums ΦᵀΦ, Φᵀτ; no parameter is estimated again.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.estimation.covariance.windows import degrees_of_freedom
from pivident.estimation.equation_record import accumulate
from pivident.estimation.identification import Identification, joint_weights
from pivident.estimation.normal_equations import JointSums
from pivident.foundation.distributions import fisher
from pivident.foundation.text.numbers import plus_minus
from pivident.signals.prefilter import Prefilter


@dataclass(frozen=True)
class Elimination:
    """One parameter that was left out."""

    name: str  # its name
    unit: str  # its unit
    round: int  # number of the round, counted from one; a new identification follows each
    value: float  # its estimate when it was left out [unit]
    std: float  # standard error of that by the sandwich [unit]
    statistic: float  # W = (value/std)²
    p_value: float  # probability of a larger W if the parameter is zero
    together: int  # number of parameters left out in this round so far
    joint_statistic: float  # W of all of them together
    joint_p_value: float  # probability of a larger one if all of them are zero
    error_before: float  # relative torque error before [%]
    error_after: float  # relative torque error after [%]

    @property
    def relative_std(self) -> float:
        """100 σ/|θ| [%]."""
        return 100.0 / np.sqrt(self.statistic) if self.statistic > 0 else np.inf


def design_effect(identification: Identification) -> float:
    """Sandwich over formula variance, geometric mean over the parameters.

    What sampling theory calls design effect: so many rows are worth one independent equation.
    """
    free = identification.formula_std > 0.0  # what was fixed has no variance
    ratio = (identification.robust_std[free] / identification.formula_std[free]) ** 2
    return float(np.exp(np.mean(np.log(ratio))))


def torque_sums(identification: Identification) -> list[JointSums]:
    """ΦᵀΦ, Φᵀτ and τᵀτ of each joint, not prefiltered, over the rows of an identification."""
    equations = identification.equations
    assert equations is not None
    plain = [Prefilter()] * identification.robot.size
    by_window = not equations.full_rate  # the sums of few rows are kept as the estimate had them
    return accumulate(equations.regressor, equations.records, plain, by_window)


def torque_error(sums: Sequence[JointSums], theta: np.ndarray, weights: np.ndarray) -> float:
    """Relative torque error over all joints [%].

    ``weights``: of the joints, shape (joints,).
    """
    error = sum(w * s.residual_sum(theta) for w, s in zip(weights, sums, strict=True))
    total = sum(w * s.tt for w, s in zip(weights, sums, strict=True))
    return 100.0 * float(np.sqrt(error / max(total, 1e-300)))


@dataclass(eq=False)
class EliminationRound:
    """One round of eliminations, foretold from one identification.

    Attributes:
        kept: indices of what stays.
        theta: its predicted values; ``std`` their standard errors by the sandwich.
    """

    found: Identification  # the identification
    full: Identification  # identification of all parameters, for weights
    number: int  # of the round
    alpha: float  # significance level of the tests
    most: int  # parameters that may go at most
    steps: list[Elimination] = field(default_factory=list)  # what went
    spared: tuple[str, ...] = ()  # names kept as the last friction of their joint
    stopped: str = ""  # why the round ended

    def __post_init__(self) -> None:
        self.kept = list(range(self.found.theta.size))
        self.theta, self.std = self.found.theta, self.found.robust_std
        self.freedom = degrees_of_freedom([r.t.size for r in self.found.recordings])
        self.sums, self.weights = torque_sums(self.found), joint_weights(self.full)
        self.effect = design_effect(self.found)
        self.worth = sum(j.rows for j in self.found.joints) / self.effect
        self._run()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of what stays."""
        return tuple(self.found.parameters[k].name for k in self.kept)

    def _run(self) -> None:
        """Leave out until a test rejects."""
        error = self._error()
        while len(self.steps) < self.most and len(self.kept) > 1:
            candidate = self._weakest()
            if candidate is None:
                self.stopped = "Only the last friction parameter of each joint could still go."
                return
            place, statistic, p_value = candidate
            name = self.found.names[self.kept[place]]
            if p_value < self.alpha:
                self.stopped = (
                    f"The search ended at {name}: "
                    f"{plus_minus(self.theta[place], 2 * self.std[place])} "
                    f"{self._parameter(place).unit} (2σ) differs significantly from "
                    f"zero (p = {p_value:.2g})."
                )
                return
            left = [k for k in self.kept if k != self.kept[place]]
            joint, joint_p = self._joint_test(left)
            if joint_p < self.alpha:
                self.stopped = (
                    f"The search ended at {name}: it could be left out alone (p = {p_value:.2g}), "
                    f"but not with the others of this round (p = {joint_p:.2g})."
                )
                return
            value, std = float(self.theta[place]), float(self.std[place])
            self._keep(left)
            after = self._error()
            unit = self.found.parameters[self.found.names.index(name)].unit
            self.steps.append(
                Elimination(
                    name, unit, self.number, value, std, statistic, p_value,
                    len(self.steps) + 1, joint, joint_p, error, after,
                )
            )  # fmt: skip
            error = after
        if len(self.kept) == 1:
            self.stopped = "Only one parameter is left."

    def _parameter(self, place: int) -> Parameter:
        return self.found.parameters[self.kept[place]]

    def _weakest(self) -> tuple[int, float, float] | None:
        """Place, W and p of the parameter with the largest relative standard error that may go."""
        free = self.std > 0.0  # what was fixed stays
        statistic = np.where(free, (self.theta / np.where(free, self.std, 1.0)) ** 2, np.inf)
        p_values = fisher.sf(statistic, 1, self.freedom)
        spared = []
        for place in np.argsort(statistic):
            if self._is_last_friction(int(place)):
                if p_values[place] >= self.alpha:
                    spared.append(self.found.names[self.kept[place]])
                continue
            self.spared = tuple(spared)
            return int(place), float(statistic[place]), float(p_values[place])
        self.spared = tuple(spared)
        return None

    def _is_last_friction(self, place: int) -> bool:
        """Whether a joint would be left without any friction."""
        own = self._parameter(place)
        if not _rubs(own):
            return False
        siblings = [
            k
            for k in self.kept
            if _rubs(self.found.parameters[k]) and self.found.parameters[k].joint == own.joint
        ]
        return len(siblings) == 1

    def _joint_test(self, kept: list[int]) -> tuple[float, float]:
        """W of all parameters not in ``kept``, and its p-value."""
        out = self._left_out(kept)
        values = self.found.theta[out]
        block = self.effect * self.found.formula_covariance[np.ix_(out, out)]
        statistic = float(values @ _solve(block, values)) / len(out)
        freedom = max(self.worth - self.found.theta.size, 1.0)
        return statistic, float(fisher.sf(statistic, len(out), freedom))

    def _left_out(self, kept: list[int]) -> list[int]:
        return [k for k in range(self.found.theta.size) if k not in set(kept)]

    def _keep(self, kept: list[int]) -> None:
        """Foretell estimate and sandwich of the smaller set."""
        out = self._left_out(kept)
        cross = self.found.formula_covariance[np.ix_(out, kept)]
        change = _solve(self.found.formula_covariance[np.ix_(out, out)], cross).T  # P12 P22⁻¹
        mapping = np.zeros((len(kept), self.found.theta.size))
        mapping[np.arange(len(kept)), kept] = 1.0
        mapping[:, out] = -change
        self.kept = kept
        self.theta = mapping @ self.found.theta
        self.std = np.sqrt(np.diag(mapping @ self.found.robust_covariance @ mapping.T))

    def _error(self) -> float:
        """Relative torque error of the foretold estimate [%]."""
        theta = np.zeros(self.found.theta.size)
        theta[self.kept] = self.theta
        return torque_error(self.sums, theta, self.weights)


def _rubs(p: Parameter) -> bool:
    """Whether it is friction proper: ripple and springs hold no joint back."""
    return p.friction is not None and not p.friction.depends_on_position


def _solve(block: np.ndarray, right: np.ndarray) -> np.ndarray:
    """block⁻¹ right, for a covariance whose entries differ by orders of magnitude."""
    scale = np.sqrt(np.diag(block))
    scaled = (right.T / scale).T
    return (np.linalg.solve(block / np.outer(scale, scale), scaled).T / scale).T
