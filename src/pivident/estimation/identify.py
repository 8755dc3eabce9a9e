"""One verb: ``identify(problem, method)``; and ``build_regression`` for estimators of your own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np

from pivident.dynamics.separation import KIND, separated
from pivident.errors import IdentificationError, RankDeficientRegressor
from pivident.estimation.counted_loop import (
    LABEL,
    NOT_SIMULATED,
    identify_counted,
    reads_counts,
)
from pivident.estimation.didim import identify_didim
from pivident.estimation.filters.identify_filter import identify_filter
from pivident.estimation.frequency.identify_frequency import identify_frequency
from pivident.estimation.identification import Identification
from pivident.estimation.instrumental_variables import identify_iv
from pivident.estimation.kinematics import estimate_kinematics, settled_recipe
from pivident.estimation.least_squares import identify_ls
from pivident.estimation.methods import (
    FrequencyDomain,
    InstrumentalVariables,
    LeastSquares,
    Method,
    OutputError,
    PrefilteredIV,
    RandomWalk,
    Regression,
    SignalRecipe,
    StateFilter,
    method_named,
)
from pivident.estimation.output_error.output_error import identify_output_error
from pivident.estimation.prefiltered_iv import identify_piv
from pivident.estimation.problem import Problem
from pivident.estimation.regression.identify_regression import identify_regression
from pivident.estimation.without_torque import check_method, equation_error
from pivident.threads import linear_algebra_in_one_thread

Progress = Callable[[str], None]


def identify(
    problem: Problem,
    method: Method | str = "piv",
    progress: Progress | None = None,
    *,
    test_gains: bool = True,
) -> Identification:
    """Estimate a problem's parameters.

    Args:
        problem: robot, recordings, loop, parameters, mask.
        method: a method object, or one of the names in ``METHODS`` (``ls``, ``iv``, ``piv`` …).
        progress: called with one line at each stage.
        test_gains: whether a fitted simulation (``cloe``, ``clie``, ``ml``) is asked if other gains
            of law and drives than the declared ones would fit better, which takes one simulation
            more; studies of many runs leave it out.

    Returns:
        The identification.

    Raises:
        IdentificationError: unknown method, a loop that cannot be simulated (its children say
            which). Parameters that the motion does not separate are left out, and a warning says
            so; see `pivident.dynamics.separation`.
    """
    if not isinstance(problem, Problem):
        made = getattr(problem, "problem", None)
        advice = "use experiment.problem()" if made else "make one from robot and recordings"
        raise IdentificationError(
            f"identify takes a Problem, not an object of type {type(problem).__name__}; {advice}"
        )
    method = method_named(method)
    check_method(method, problem.recordings)
    lines = isinstance(method, FrequencyDomain)  # settles its own
    if isinstance(method, (Regression, StateFilter, InstrumentalVariables)) and not lines:
        method = replace(method, signals=settled_recipe(method.signals, problem.recordings))
    say = progress or (lambda line: None)
    noticed = equation_error(method, problem.recordings)
    with linear_algebra_in_one_thread():
        while True:
            try:
                found = _estimate(problem, method, say, test_gains)
                break
            except RankDeficientRegressor as error:
                if isinstance(method, OutputError):  # holds what it cannot determine, or refuses
                    raise
                names, why = separated(problem.base, problem.selection, error)
                problem = replace(problem, parameters=names)
                say(f"{method.label}: {why.message}")
                noticed = (why, *noticed)
    if reads_counts(problem) and found.method != LABEL:
        noticed = (*noticed, NOT_SIMULATED)
    return replace(found, warnings=(*found.warnings, *noticed)) if noticed else found


def narrowed(problem: Problem, found: Identification) -> Problem:
    """The problem of the parameters that a result has, which says why others were left out."""
    if found.names == problem.names:
        return problem
    why = [w for w in found.warnings if w.kind == KIND and w not in problem.findings]
    return replace(problem, parameters=found.names, findings=(*problem.findings, *why))


def _estimate(problem: Problem, method: Method, say: Progress, test_gains: bool) -> Identification:
    """By the method's own function."""
    if isinstance(method, LeastSquares):
        return identify_ls(problem, method, say)
    if isinstance(method, FrequencyDomain):
        return identify_frequency(problem, method, say)
    if isinstance(method, Regression):
        return identify_regression(problem, method, say)
    if isinstance(method, StateFilter):
        return identify_filter(problem, method, say)
    if isinstance(method, InstrumentalVariables):
        return identify_iv(problem, method, say)
    if isinstance(method, PrefilteredIV) and method.regressor == "simulated":
        return (identify_counted if reads_counts(problem) else identify_didim)(problem, method, say)
    if isinstance(method, OutputError):
        return identify_output_error(problem, method, say, test_gains)
    if isinstance(method, PrefilteredIV):
        return identify_piv(problem, method, say)
    raise IdentificationError(f"{method!r} is not a method; use a name such as 'piv'")


def build_regression(
    problem: Problem, signals: SignalRecipe | None = None
) -> tuple[np.ndarray, np.ndarray]:
    """Observation matrix and torque of all recordings, dense, at the full rate.

    Args:
        problem: robot, recordings, parameters.
        signals: recipe; default: random walk smoother with aligned torque.

    Returns:
        Φ, shape (samples, joints, parameters), and τ, shape (samples, joints) [N m or N], over
        the usable samples of all recordings. Friction that grows with the load has the load of the
        problem's initial values.
    """
    blocks = []
    for recording in problem.recordings:
        k = estimate_kinematics(recording, signals or RandomWalk())
        part = slice(k.start, k.stop)
        inner = problem.regressor.inner(k.q, k.dq, k.ddq, problem.initial_values())[:, part]
        phi = problem.regressor.matrix(
            k.q[:, part].T, k.dq[:, part].T, k.ddq[:, part].T, inner=inner
        )
        blocks.append((phi, k.tau[:, part].T))
    return np.concatenate([b[0] for b in blocks]), np.concatenate([b[1] for b in blocks])
