"""Regressions: the equations of weighted least squares, solved otherwise.

Filters, mask, weights 1/λ_j and the load of friction are those of least squares, whose estimate is
where the methods begin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.errors import ExperimentError
from pivident.estimation.answer import Covariances, answer
from pivident.estimation.identification import Identification
from pivident.estimation.iteration import Run, Say, solved_otherwise
from pivident.estimation.least_squares import least_squares_start
from pivident.estimation.methods import (
    Adaline,
    CorrelatedJoints,
    Hopfield,
    PriorRegression,
    Regression,
    Ridge,
    RobustRegression,
    SetMembership,
    TotalLeastSquares,
)
from pivident.estimation.problem import Problem
from pivident.estimation.regression.correlated_joints import joint_covariance, solve_correlated
from pivident.estimation.regression.networks import solve_adaline, solve_hopfield
from pivident.estimation.regression.penalised import (
    contradiction,
    solve_ridge,
    solve_with_prior,
)
from pivident.estimation.regression.robust import scales, solve_robust
from pivident.estimation.regression.rows import NormalEquations, Rows, Solved
from pivident.estimation.regression.set_membership import parameter_box
from pivident.estimation.regression.total import solve_total
from pivident.estimation.solved_equations import Equations
from pivident.robot.naming import nearest
from pivident.text.finding import Finding, Quantity

#: Smallest eigenvalue of the errors' correlation that noise of torques may have.
DEGENERATE = 0.02

#: Standard deviations that prior and data may be apart.
CONTRADICTION = 4.0


@dataclass(frozen=True, eq=False)
class Noticed:
    """A solution with what there is to say of it."""

    solved: Solved
    findings: tuple[Finding, ...] = ()


def identify_regression(problem: Problem, method: Regression, say: Say) -> Identification:
    """Estimate by one of the regressions."""
    _, estimate = least_squares_start(problem, method, say)
    filters = estimate.prefilters.filters
    equations = Equations(
        problem.regressor, tuple(estimate.records), tuple(filters), estimate.variance
    )
    say(f"{method.label}: solving")
    found = solved_rows(problem, method, Rows.of(equations), estimate.theta)
    made = found.solved
    result, history = solved_otherwise(
        estimate, made.theta, made.covariance, made.condition, made.iterations
    )
    run = Run(history, made.converged)
    covariances = Covariances(made.robust, made.covariance)
    return answer(problem, method, result, run, found.findings, covariances=covariances)


def solved_rows(problem: Problem, method: Regression, rows: Rows, start: np.ndarray) -> Noticed:
    """What a method makes of rows; ``start``: least squares, shape (parameters,).

    Raises:
        IdentificationError: the method finds nothing; says why.
        ExperimentError: an option names what is not there.
    """
    if isinstance(method, TotalLeastSquares):
        return Noticed(solve_total(rows), (_EQUAL_ERRORS,))
    if isinstance(method, RobustRegression):
        made = solve_robust(rows, start, method.loss, method.tolerance, method.max_iterations)
        return Noticed(made, _outliers(rows, made.theta))
    if isinstance(method, Ridge):
        made, penalty = solve_ridge(rows, method.penalty)
        return Noticed(made, (_shrunk(penalty),))
    if isinstance(method, PriorRegression):
        return _with_prior(problem, method, rows)
    if isinstance(method, CorrelatedJoints):
        made = solve_correlated(rows, start, method.tolerance, method.max_iterations)
        return Noticed(made, _degenerate(rows, made))
    if isinstance(method, SetMembership):
        return _members(problem, method, rows, start)
    if isinstance(method, Adaline):
        made = solve_adaline(rows, problem.initial_values(), method.rate, method.epochs)
        return Noticed(made, (_NETWORK,))
    assert isinstance(method, Hopfield)
    made = solve_hopfield(rows, problem.initial_values(), method.reach, method.time)
    return Noticed(made, (_NETWORK,))


_EQUAL_ERRORS = Finding(
    "note", "regression", "equal errors",
    "Total least squares takes errors as equally large in all columns, relative to their size; "
    "those of derivatives of measured positions are not, so that its bias may be smaller or larger "
    "than that of least squares.",
)  # fmt: skip

_NETWORK = Finding(
    "note", "regression", "network",
    "The network solves least squares by steps; it cannot be nearer to the truth than that, and "
    "shares its bias.",
)  # fmt: skip


def _outliers(rows: Rows, theta: np.ndarray) -> tuple[Finding, ...]:
    """How many rows lie beyond four scales: one in 16,000 of normal errors."""
    used = np.stack([own.used for own in rows.joints])
    residuals = rows.residuals(theta)
    beyond = (np.abs(residuals) > 4.0 * scales(residuals, used)[:, None]) & used
    share = float(100.0 * beyond.sum() / max(used.sum(), 1))
    if share < 0.1:
        return ()
    worst = int(np.argmax(beyond.sum(axis=1) / np.maximum(used.sum(axis=1), 1)))
    text = (
        f"{share:.2g} % of the rows have errors beyond four scales, most at joint "
        f"{rows.joints[worst].name}; they count less."
    )
    step = "Look at them in the residual plot: spikes are outliers, a pattern is a wrong model."
    evidence = {"rows beyond": Quantity(share, "%", bound=0.1)}
    where = rows.joints[worst].name
    return (Finding("note", "regression", "outliers", text, where, step, evidence),)


def _degenerate(rows: Rows, made: Solved) -> tuple[Finding, ...]:
    """Whether some combination of joints is explained almost without error."""
    used = np.stack([own.used for own in rows.joints])
    noise = joint_covariance(rows.residuals(made.theta), used, rows.size)
    size = np.sqrt(np.diag(noise))
    least = float(np.linalg.eigvalsh(noise / np.outer(size, size))[0])
    if least >= DEGENERATE:
        return ()
    text = (
        "A combination of the joints' torques is explained almost without error (share "
        f"{least:.2g} of theirs): the errors are not noise of the torques, and what is gained by "
        "their correlation is not precision."
    )
    step = "Take ls, or piv against noise of the positions."
    evidence = {"share": Quantity(least, "", bound=DEGENERATE)}
    return (Finding("warning", "regression", "degenerate", text, "", step, evidence),)


def _shrunk(penalty: float) -> Finding:
    """What the intervals of ridge regression lack."""
    text = (
        f"Ridge regression shrinks parameters towards zero (penalty {penalty:.3g}); its intervals "
        "do not contain the bias that this makes."
    )
    return Finding(
        "warning", "regression", "shrunk", text, evidence={"penalty": Quantity(penalty, "")}
    )


def _with_prior(problem: Problem, method: PriorRegression, rows: Rows) -> Noticed:
    """MAP, and whether the data contradict the prior."""
    mean = problem.initial_values()
    precision, deviation = prior_of(problem, method)
    made = solve_with_prior(rows, mean, precision)
    apart = contradiction(rows, mean, deviation)
    worst = int(np.argmax(np.abs(apart)))
    if np.abs(apart[worst]) <= CONTRADICTION:
        return Noticed(made)
    name = problem.names[worst]
    text = (
        f"The record contradicts the prior of {name}: they are {abs(apart[worst]):.3g} standard "
        "deviations apart. The estimate lies between, and its interval is right for neither."
    )
    step = "Widen the prior (spread, deviation) or look for what is wrong in the description."
    evidence = {"distance": Quantity(float(abs(apart[worst])), "std", bound=CONTRADICTION)}
    finding = Finding("warning", "regression", "prior contradicted", text, name, step, evidence)
    return Noticed(made, (finding,))


def prior_of(problem: Problem, method: PriorRegression) -> tuple[np.ndarray, np.ndarray]:
    """Σ₀⁻¹ and the deviations of single parameters, infinite where nothing is known.

    Raises:
        ExperimentError: a name that is no parameter of the problem.
    """
    for name in (*method.deviation, *method.names):
        if name not in problem.names:
            raise ExperimentError(
                f"the prior names {name!r}, which is no parameter here; "
                f"{nearest(name, problem.names)}"
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


def _members(problem: Problem, method: SetMembership, rows: Rows, start: np.ndarray) -> Noticed:
    """Intervals by bounded errors; two standard deviations to each side of the middle are they."""
    bound = None
    if method.bound is not None:
        given = np.atleast_1d(np.asarray(method.bound, float))
        if len(given) not in (1, len(rows.joints)):
            raise ExperimentError(
                f"bound has {len(given)} numbers for {len(rows.joints)} joints; give one for all "
                "or one for each"
            ).about("bound")
        bound = np.broadcast_to(given, len(rows.joints)).astype(float)
    box = parameter_box(rows, bound, start)
    theta, half = 0.5 * (box.low + box.high), 0.5 * (box.high - box.low)
    covariance = np.diag((0.5 * half) ** 2)
    condition = NormalEquations.of(rows.sums(), rows.size).condition
    made = Solved(theta, covariance, covariance, condition, theta[None])
    if bound is not None:
        text = (
            "The intervals, two standard deviations to each side, contain the truth for certain if "
            "the model is right and no error of a filtered row is beyond its bound."
        )
        return Noticed(made, (Finding("note", "regression", "bounded errors", text),))
    text = (
        "No bound of the torque's error was given: the largest error that least squares leaves was "
        "taken, and a tenth more. Its intervals are no guarantee."
    )
    step = "Give bound, the largest error that sensor and model can make."
    evidence = {
        f"bound of {own.name}": Quantity(float(value), "N m or N")
        for own, value in zip(rows.joints, box.bound, strict=True)
    }
    return Noticed(
        made, (Finding("warning", "regression", "bound from record", text, "", step, evidence),)
    )
