"""Estimates of one's own: a function of Φ and τ as a method, and parameters that were found anyhow.

What is judged of an estimate, errors joint by joint, covariances, equations for tests, follows from
the problem and the parameters, whoever found them. A function takes the rows of all joints one
below the other, each divided by the standard deviation that least squares leaves of its joint:

    theta = estimator(Φ, τ)      or      theta, covariance = estimator(Φ, τ)

so that estimators of statsmodels, scikit-learn and the like fit in as they are, and held-out motion
is predicted by what the function makes of the other rows.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

import numpy as np

from pivident.dynamics.base_parameters import parameter_index
from pivident.dynamics.separation import weakest_direction
from pivident.estimation.answer import Covariances, answer
from pivident.estimation.covariance.sandwich import jackknife
from pivident.estimation.equation_record import accumulate
from pivident.estimation.full_rate import records_without_instruments
from pivident.estimation.identification import Identification, Iteration
from pivident.estimation.iteration import Estimate, Run
from pivident.estimation.kinematics import estimate_kinematics, settled_recipe
from pivident.estimation.literature.rows import (
    NormalEquations,
    Noticed,
    Regression,
    Rows,
    Solved,
    windows_covariance,
)
from pivident.estimation.method import Estimator
from pivident.estimation.noise_identification import Prefilters
from pivident.estimation.normal_equations import Solution, joint_variances, relative_residual, solve
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.errors import IdentificationError, RankDeficientRegressor
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding
from pivident.loop.motion.motion import with_inner

#: What every result says that nothing can estimate again.
_GIVEN = Finding(
    "note",
    "estimate",
    "given",
    "The parameters were given: errors on held-out motion are those of the same values, so nothing "
    "was held out if they come from this record.",
    next_step="Give the function that estimates them (estimator), or judge on a second recording.",
)


@dataclass(frozen=True, kw_only=True)
class OwnMethod(Regression):
    """An estimator of one's own.

    Attributes:
        estimator: the function; None: the parameters are given.
        name: name of its results; None: that of the function.
        weighted: whether rows are divided by the standard deviation of their joint's error, or
            are torques [N m or N].
        given: the parameters where there is no function, shape (parameters,).
        covariance_given: theirs, or None.
    """

    signals: RandomWalk = option(factory=RandomWalk, meaning="the smoother")
    estimator: Estimator | None = None
    name: str | None = None
    weighted: bool = option(True, "divide rows by the standard deviation of their joint's error")
    given: np.ndarray | None = field(default=None, repr=False, compare=False)
    covariance_given: np.ndarray | None = field(default=None, repr=False, compare=False)

    summary: ClassVar[str] = "an estimator of one's own"

    @property
    def label(self) -> str:  # type: ignore[override]
        """Its name, or that of the function."""
        own = getattr(self.estimator, "__name__", type(self.estimator).__name__)
        return self.name or (own if own.isidentifier() else "own estimator")

    @property
    def settings(self) -> dict[str, Any]:
        """What a file can hold of it."""
        kept = super().settings
        return {key: kept[key] for key in ("signals", "weighted")}

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """What the function makes of the rows; ``start`` is not used."""
        covariance = self.covariance_given
        if self.estimator is None:
            assert self.given is not None
            theta = self.given
        else:
            theta, covariance = self._estimated(*dense_rows(rows, self.weighted))
        sums = rows.sums()
        equations = NormalEquations.of(sums, rows.size)
        weak = weakest_direction(equations.gram, problem.names)
        formula = robust = covariance
        if covariance is None:
            formula = robust = np.full((theta.size, theta.size), np.nan)
            if weak is not None:
                formula, robust = equations.inverse, windows_covariance(sums, theta)
        assert formula is not None and robust is not None
        condition = np.inf if weak is None else weak[0]
        return Noticed(Solved(theta, formula, robust, condition, theta[None]))

    def _estimated(self, phi: np.ndarray, tau: np.ndarray) -> tuple[np.ndarray, np.ndarray | None]:
        """The function's estimate, checked."""
        assert self.estimator is not None
        made = self.estimator(phi, tau)
        theta, covariance = made if isinstance(made, tuple) and len(made) == 2 else (made, None)
        return checked(self.label, phi.shape[1], theta, covariance)


def checked(
    whose: str, size: int, theta: Any, covariance: Any = None
) -> tuple[np.ndarray, np.ndarray | None]:
    """Parameters and their covariance as arrays; refuses what is neither.

    Args:
        whose: what gave them.
        size: how many parameters there are.
        theta: the parameters.
        covariance: theirs, or None.
    """
    try:
        theta = np.asarray(theta, float)
        covariance = None if covariance is None else np.asarray(covariance, float)
    except (TypeError, ValueError) as error:
        raise IdentificationError(f"{whose} gives no numbers: {error}") from None
    for what, array, shape in (
        ("parameters", theta, (size,)),
        ("a covariance", covariance, (size, size)),
    ):
        if array is None:
            continue
        if array.shape != shape:
            raise IdentificationError(
                f"{whose} gives {what} of shape {array.shape}", advice=f"{shape} is needed"
            )
        if not np.isfinite(array).all():
            raise IdentificationError(f"{whose} gives {what} that are not all finite")
    if covariance is not None:
        std = np.sqrt(np.maximum(np.diag(covariance), 0.0))
        scale = np.outer(*(np.where(std > 0.0, std, 1.0),) * 2)
        if (
            np.abs(covariance - covariance.T).max() > 1e-6 * np.abs(covariance).max()
            or np.linalg.eigvalsh(covariance / scale)[0] < -1e-6
        ):
            raise IdentificationError(
                f"{whose} gives a covariance that is not symmetric and positive semidefinite"
            )
    return theta, covariance


def dense_rows(rows: Rows, weighted: bool = True) -> tuple[np.ndarray, np.ndarray]:
    """Φ and τ of all joints, one below the other, without the rows that are not used.

    Args:
        rows: the equations.
        weighted: whether they stay divided by √λ of their joint.

    Returns:
        Φ, shape (rows, parameters), and τ, shape (rows,).
    """
    used = [own.used.astype(bool) for own in rows.joints]
    phi = np.zeros((sum(map(np.count_nonzero, used)), rows.size))
    tau, first = np.empty(len(phi)), 0
    for own, kept, root in zip(rows.joints, used, rows.root, strict=True):
        part = slice(first, first + int(np.count_nonzero(kept)))
        scale = 1.0 if weighted else root
        phi[part, own.columns] = scale * own.phi[:, kept].T
        tau[part] = scale * own.tau[kept]
        first = part.stop
    return phi, tau


def own_estimate(
    problem: Problem,
    theta: Mapping[str, float] | Sequence[float] | np.ndarray,
    covariance: np.ndarray | None = None,
    *,
    name: str = "own estimate",
    estimator: Estimator | None = None,
) -> Identification:
    """The result that parameters are, see `Identification.of`."""
    size = len(problem.names)
    if isinstance(theta, Mapping):
        values = np.full(size, np.nan)
        places = {k: i for i, k in enumerate(problem.selection)}
        for key, value in theta.items():
            place = places.get(parameter_index(problem.base, key))
            if place is None:
                raise IdentificationError(
                    f"{key!r} is not among the parameters of the problem",
                    advice=f"these are {', '.join(problem.names)}",
                )
            values[place] = value
        theta = values
    found, spread = checked(name, size, theta, covariance)
    known = problem.restrictions
    off = known.matrix @ found - known.right
    if (np.abs(off) > 1e-6 * (np.abs(known.matrix) @ np.abs(found) + np.abs(known.right))).any():
        raise IdentificationError(
            f"{name} contradicts what is fixed in the problem",
            advice="leave fixed and constraints out of the problem",
        )
    given = None if estimator is not None else found
    method = OwnMethod(estimator=estimator, name=name, given=given, covariance_given=spread)
    signals = settled_recipe(method.signals, problem.recordings)
    kinematics = [estimate_kinematics(r, signals) for r in problem.recordings]
    limits = [problem.speed_limits(r) for r in problem.recordings]
    loaded = [with_inner(problem.regressor, k, found) for k in kinematics]
    records = records_without_instruments(loaded, limits)
    prefilters = Prefilters.none(problem)
    sums = accumulate(problem.regressor, records, prefilters.filters)
    variance = joint_variances(sums, found)
    freedom = known.freedom
    try:
        solution = replace(solve(sums, variance, known), theta=found)
        robust = jackknife(sums, found, variance, freedom=freedom).covariance
    except RankDeficientRegressor:  # other values fit as well: nothing is known of these
        robust = np.full((size, size), np.nan)
        solution = Solution(found, robust, np.inf)
    covariances = (
        Covariances(robust, solution.covariance) if spread is None else Covariances(spread, spread)
    )
    estimate = Estimate(1, found, None, records, prefilters, sums, solution, variance)
    run = Run((Iteration(found, 0.0, relative_residual(sums, found, variance)),), True)
    said = [_GIVEN] if estimator is None else []
    return answer(problem, method, estimate, run, said, covariances=covariances)
