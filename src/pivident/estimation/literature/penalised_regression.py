"""Regression with a normal prior (MAP): what is known beforehand, and what the record adds.

    θ = argmin ‖τ - Φθ‖² + (θ - θ₀)ᵀ Σ₀⁻¹ (θ - θ₀) = θ₀ + (ΦᵀΦ + Σ₀⁻¹)⁻¹ Φᵀ(τ - Φθ₀)

rows weighted by 1/√λ_j, with a prior θ ~ N(θ₀, Σ₀) from CAD or an earlier estimate. The posterior
is normal with covariance (ΦᵀΦ + Σ₀⁻¹)⁻¹: an interval that contains the truth as often as it says
where the prior is true. A flat prior gives least squares.

Ridge regression: what the motion hardly tells is shrunk towards zero.

    θ = argmin ‖τ - Φθ‖² + θᵀ K θ = (ΦᵀΦ + K)⁻¹ Φᵀτ,   K = k diag(ΦᵀΦ)/N

rows weighted by 1/√λ_j (Hoerl and Kennard 1970), with k from generalised cross-validation (Golub,
Heath and Wahba 1979),

    k = argmin N ‖τ - Φθ_k‖²/(N - tr Φ(ΦᵀΦ + K)⁻¹Φᵀ)²

Its standard errors do not contain the bias that it makes.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from pivident.estimation.covariance import inverse_gram
from pivident.estimation.covariance.sandwich import jackknife_of
from pivident.estimation.literature.rows import NormalEquations, Noticed, Regression, Rows, Solved
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.foundation.errors import ExperimentError
from pivident.foundation.options import option
from pivident.foundation.text.finding import Finding, Quantity
from pivident.robot.naming import nearest

#: Range of k that is searched, and how many values.
RANGE, VALUES = (1e-10, 1e2), 241


@dataclass(frozen=True, kw_only=True)
class Ridge(Regression):
    """Shrinks what the motion hardly tells towards zero.

    Attributes:
        penalty: k, in mean squares of the columns; None: by generalised cross-validation.
    """

    penalty: float | None = option(
        None,
        "in mean squares of the columns; not given: by generalised cross-validation",
        shown="see meaning", above=0.0,
    )  # fmt: skip

    label: ClassVar[str] = "IDIM-ridge"
    summary: ClassVar[str] = "shrinks what the motion hardly determines"

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The estimate, and that its intervals lack the bias."""
        solved, penalty = solve_ridge(rows, self.penalty)
        return Noticed(solved, (_shrunk(penalty),))


def solve_ridge(rows: Rows, penalty: float | None) -> tuple[Solved, float]:
    """The estimate by ridge regression, and k.

    ``penalty``: k; None: by generalised cross-validation.
    """
    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    values, vectors = np.linalg.eigh(equations.gram)
    moment = vectors.T @ equations.moment
    square = sum(own.tt for own in sums)

    def criterion(k: float) -> float:
        kept = values / (values + k)
        theta = moment / (values + k)
        error = square - 2.0 * theta @ moment + theta**2 @ values
        return error / (rows.count - kept.sum()) ** 2

    if penalty is None:
        grid = np.geomspace(*RANGE, VALUES)
        penalty = float(grid[np.argmin([criterion(k) for k in grid])])
    inverse = (vectors / (values + penalty)) @ vectors.T
    theta = inverse @ equations.moment / equations.scale
    covariance = inverse @ equations.gram @ inverse / np.outer(equations.scale, equations.scale)
    robust = penalised_windows(
        sums, theta, penalty * np.diag(equations.scale**2), np.zeros(rows.size)
    )
    condition = float(np.sqrt((values[-1] + penalty) / (values[0] + penalty)))
    return Solved(theta, covariance, robust, condition, theta[None]), penalty


def penalised_windows(
    sums: list[JointSums], theta: np.ndarray, precision: np.ndarray, mean: np.ndarray
) -> np.ndarray:
    """Covariance of the data's part from windows of time; the penalty belongs to none of them."""
    count, size = len(sums[0].window_zf), theta.size
    gram, scores = np.zeros((count, size, size)), np.zeros((count, size))
    for own in sums:
        gram[:, own.columns[:, None], own.columns] += own.window_zf
        scores[:, own.columns] += own.window_zt - own.window_zf @ theta[own.columns]
    # at the estimate the scores sum up to K (θ - θ₀), which is none of the noise
    shares = np.einsum("kii->k", gram) / np.einsum("kii->", gram)
    scores -= np.outer(shares, precision @ (theta - mean))
    return jackknife_of(gram, scores, gram.sum(axis=0) + precision).covariance


def _shrunk(penalty: float) -> Finding:
    """What the intervals of ridge regression lack."""
    text = (
        f"Ridge regression shrinks parameters towards zero (penalty {penalty:.3g}); its intervals "
        "do not contain the bias that this makes."
    )
    return Finding(
        "warning", "regression", "shrunk", text, evidence={"penalty": Quantity(penalty, "")}
    )


#: Standard deviations that prior and data may be apart.
CONTRADICTION = 4.0


@dataclass(frozen=True, kw_only=True)
class PriorRegression(Regression):
    """What the description, or anyone, knows beforehand, as a normal prior (MAP).

    The prior's mean are the problem's initial values: nominal ones of the description, or those
    given there. Of what has none (friction, unless given) nothing is known.

    Attributes:
        spread: standard deviation of each parameter over its initial value.
        deviation: standard deviation of single parameters by their names, in their own units; they
            win over ``spread``.
        names: parameters that ``prior_covariance`` is of, in its order.
        prior_covariance: covariance of these, rows of numbers in their own units.
    """

    spread: float = option(0.3, "standard deviation of the prior over the initial value", above=0.0)
    deviation: Mapping[str, float] = option(
        factory=dict,
        meaning="standard deviation by parameter name; wins over `spread`",
        unit="of the parameter",
    )
    names: tuple[str, ...] = option((), "parameters of `prior_covariance`")
    prior_covariance: tuple[tuple[float, ...], ...] = option(
        (), "covariance of the prior of `names`", unit="of the parameters", kind="list of lists"
    )

    label: ClassVar[str] = "IDIM-MAP"
    summary: ClassVar[str] = "with a normal prior from the description"

    def __post_init__(self) -> None:
        super().__post_init__()
        for name, value in self.deviation.items():
            if not value > 0.0:  # infinite: nothing is known
                raise ExperimentError(
                    f"the prior's deviation of {name} is {value}", advice="it has to be positive"
                ).about("deviation")
        object.__setattr__(self, "deviation", dict(self.deviation))
        object.__setattr__(self, "names", tuple(self.names))
        rows = tuple(tuple(float(x) for x in row) for row in self.prior_covariance)
        object.__setattr__(self, "prior_covariance", rows)
        count = len(self.names)
        if len(rows) != count or any(len(row) != count for row in rows):
            raise ExperimentError(
                f"prior_covariance needs {count} rows of {count} numbers, one for each of names"
            ).about("prior_covariance")
        if not count:
            return
        matrix = np.array(rows)
        least = float(np.linalg.eigvalsh(0.5 * (matrix + matrix.T)).min())
        if not np.allclose(matrix, matrix.T, rtol=1e-9) or not least > 0.0:
            raise ExperimentError(
                "prior_covariance is not symmetric and positive definite (smallest eigenvalue "
                f"{least:.3g})",
                advice="no normal distribution has it",
            ).about("prior_covariance")

    def solve(self, problem: Problem, rows: Rows, start: np.ndarray) -> Noticed:
        """The estimate, and whether the data contradict the prior."""
        mean = problem.initial_values()
        precision, deviation = prior_of(problem, self)
        solved = solve_with_prior(rows, mean, precision)
        apart = contradiction(rows, mean, deviation)
        worst = int(np.argmax(np.abs(apart)))
        if np.abs(apart[worst]) <= CONTRADICTION:
            return Noticed(solved)
        return Noticed(solved, (_contradicted(problem.names[worst], float(abs(apart[worst]))),))


def _contradicted(name: str, apart: float) -> Finding:
    """A parameter whose prior and data are ``apart``, in standard deviations."""
    text = (
        f"The record contradicts the prior of {name}: they are {apart:.3g} standard deviations "
        "apart. The estimate lies between, and its interval is right for neither."
    )
    step = "Widen the prior (spread, deviation) or look for what is wrong in the description."
    evidence = {"distance": Quantity(apart, "std", bound=CONTRADICTION)}
    return Finding("warning", "regression", "prior contradicted", text, name, step, evidence)


def prior_of(problem: Problem, method: PriorRegression) -> tuple[np.ndarray, np.ndarray]:
    """Σ₀⁻¹ and the deviations of single parameters, infinite where nothing is known.

    Raises:
        ExperimentError: a name that is no parameter of the problem.
    """
    for name in (*method.deviation, *method.names):
        if name not in problem.names:
            raise ExperimentError(
                f"the prior names {name!r}, which is no parameter here",
                advice=nearest(name, problem.names),
            ).about("deviation" if name in method.deviation else "names")
    mean = problem.initial_values()
    deviation = np.where(mean != 0.0, method.spread * np.abs(mean), np.inf)
    for name, value in method.deviation.items():
        deviation[problem.names.index(name)] = value
    precision = np.diag(1.0 / deviation**2)
    if method.names:
        own = [problem.names.index(name) for name in method.names]
        matrix = np.array(method.prior_covariance)
        deviation[own] = np.sqrt(np.diag(matrix))
        precision[own, :] = precision[:, own] = 0.0
        precision[np.ix_(own, own)] = np.linalg.inv(matrix)
    return precision, deviation


def solve_with_prior(rows: Rows, mean: np.ndarray, precision: np.ndarray) -> Solved:
    """The estimate with a normal prior.

    Args:
        rows: the equations.
        mean: θ₀, shape (parameters,).
        precision: Σ₀⁻¹, shape (parameters, parameters); zero where nothing is known.
    """
    sums = rows.sums()
    equations = NormalEquations.of(sums, rows.size)
    scale = equations.scale
    gram = equations.gram + precision / np.outer(scale, scale)
    inverse = inverse_gram(gram) / np.outer(scale, scale)
    theta = inverse @ (equations.moment * scale + precision @ mean)
    robust = penalised_windows(sums, theta, precision, mean)
    robust = robust + inverse @ precision @ inverse  # what the prior leaves open
    return Solved(theta, inverse, robust, float(np.sqrt(np.linalg.cond(gram))), theta[None])


def contradiction(rows: Rows, mean: np.ndarray, deviation: np.ndarray) -> np.ndarray:
    """How far data and prior are apart, in standard deviations of their difference, (parameters,).

    ``deviation``: of the prior; infinite where nothing is known, where the result is zero.
    """
    equations = NormalEquations.of(rows.sums(), rows.size)
    return (equations.solution - mean) / np.sqrt(np.diag(equations.inverse) + deviation**2)
