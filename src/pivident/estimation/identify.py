"""One verb: ``identify(problem, method)``; and ``build_regression`` for estimators of your own."""

from __future__ import annotations

from dataclasses import replace
from time import perf_counter

import numpy as np

from pivident.dynamics.separation import KIND, separated
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.method import Estimator, Method
from pivident.estimation.methods import method_named
from pivident.estimation.problem import Problem, taken_as_zero
from pivident.estimation.signal_recipes import RandomWalk, SignalRecipe
from pivident.foundation.errors import IdentificationError, RankDeficientRegressor
from pivident.foundation.progress import LOGGER, Say, Stages
from pivident.foundation.threads import linear_algebra_in_one_thread


def identify(
    problem: Problem,
    method: Method | Estimator | str = "piv",
    progress: Say | None = None,
    *,
    test_gains: bool = True,
) -> Identification:
    """Estimate a problem's parameters.

    Args:
        problem: robot, recordings, loop, parameters, mask.
        method: a method object, one of the names in ``METHODS`` (``ls``, ``iv``, ``piv`` …), or an
            estimator of one's own: a function of Φ, shape (rows, parameters), and τ, shape (rows,),
            that returns the parameters, alone or with their covariance. The rows are those of all
            joints, each divided by the standard deviation of its joint's error.
        progress: called with one line at each stage; the logger ``pivident`` has the same with
            times.
        test_gains: whether a fitted simulation (``cloe``, ``clie``, ``ml``) is asked if other gains
            of law and drives than the declared ones would fit better, which takes one simulation
            more; studies of many runs leave it out.

    Returns:
        The identification.

    Raises:
        IdentificationError: unknown method, a loop that cannot be simulated (its children say
            which). Parameters that the motion does not separate are left out, and a warning says
            so; see `pivident.dynamics.separation`.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop)
        >>> for method in ("ls", "iv-full-rate", "piv"):  # the true value is 4 N m
        ...     result = pv.identify(problem, method)
        ...     print(f"{result.params['fc1']:.2f} ± {2.0 * result.bse['fc1']:.3f} N m, {method}")
        4.01 ± 0.087 N m, ls
        4.00 ± 0.009 N m, iv-full-rate
        4.00 ± 0.002 N m, piv
    """
    if not isinstance(problem, Problem):
        is_experiment = getattr(problem, "problem", None)
        advice = (
            "use experiment.problem()" if is_experiment else "make one from robot and recordings"
        )
        raise IdentificationError(
            f"identify takes a Problem, not an object of type {type(problem).__name__}",
            advice=advice,
        )
    method = method_named(method)
    if not isinstance(method, Method):
        raise IdentificationError(f"{method!r} is not a method", advice="use a name such as 'piv'")
    method.refuse(problem)
    begin = perf_counter()
    noticed = (*method.about_torques(problem.recordings), *taken_as_zero(problem))
    with linear_algebra_in_one_thread(), Stages.of(progress) as say:
        while True:
            try:
                result = method.settled(problem).estimate(problem, say, test_gains=test_gains)
                break
            except RankDeficientRegressor as error:
                if method.fits_simulation:  # holds what it cannot determine, or refuses
                    raise
                free = [problem.selection[k] for k in problem.restrictions.freedom.free]
                names, why = separated(problem.base, free, error)
                dependent = set(problem.names) - {problem.base.names[k] for k in free}
                problem = problem.estimating((*names, *dependent))
                say(f"{method.label}: {why.message}")
                noticed = (why, *noticed)
    state = "converged" if result.converged else "not converged"
    seconds = perf_counter() - begin
    LOGGER.info("%s: %s, %d passes; %.2f s", result.method, state, result.iterations, seconds)
    if problem.reads_counts:
        from pivident.estimation.didim import LABEL, NOT_SIMULATED

        # the torques that drive an open loop have shaken the robot, too
        driven = method.fits_simulation and not method.simulates_loop
        noticed = (*noticed, *([] if driven or result.method == LABEL else [NOT_SIMULATED]))
    return replace(result, warnings=(*result.warnings, *noticed)) if noticed else result


def narrowed(problem: Problem, found: Identification) -> Problem:
    """The problem of the parameters that a result has, which says why others were left out."""
    if found.names == problem.names:
        return problem
    why = [w for w in found.warnings if w.kind == KIND and w not in problem.findings]
    return problem.estimating(found.names, why)


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

    Example:
        >>> t = np.arange(0.0, 4.0, 0.01)[:, None]
        >>> q = np.sin(t * [2.0, 3.0])
        >>> record = pv.Recording.from_arrays(q, np.cos(t * [2.0, 3.0]), rate=100)
        >>> phi, tau = pv.build_regression(pv.Problem(pv.load_robot("planar_2r"), (record,)))
        >>> phi.shape[1:], tau.shape[1:]
        ((2, 13), (2,))
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
