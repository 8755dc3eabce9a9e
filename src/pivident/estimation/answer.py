"""The answer of an estimator: residuals, scores, covariances, warnings, signals for plots."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import inf, nan
from typing import Any, NamedTuple

import numpy as np

from pivident.data.logs.torque_scale import marked_scales, scale_sentences
from pivident.dynamics.signs import sign_warnings
from pivident.estimation.covariance import rounded_away
from pivident.estimation.covariance.sandwich import jackknife
from pivident.estimation.covariance.stationary_noise import (
    covariance_by_test,
    stationary_covariance,
)
from pivident.estimation.identification import Identification, JointFit
from pivident.estimation.iteration import Estimate, Run
from pivident.estimation.method import Method
from pivident.estimation.normal_equations import relative_residual
from pivident.estimation.problem import Problem, position_units, torque_units
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.solved_equations import EquationNoise, Equations, durbin_wu_hausman
from pivident.foundation.errors import Attempts
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.version import __version__
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.loop.simulation.control_loop import Loop
from pivident.robot.description import Robot

#: Largest range of a joint without known limits that raises no doubt [rad]; `pivident init` takes
#: positions beyond it for degrees.
MAX_SPAN = 4.0 * np.pi


class Covariances(NamedTuple):
    """Covariances of an estimate, each (parameters, parameters)."""

    robust: np.ndarray  # holds for residuals that are correlated
    formula: np.ndarray  # holds for white ones


def answer(
    problem: Problem,
    method: Method,
    estimate: Estimate,
    run: Run,
    warnings: Sequence[Finding] = (),
    used: InstrumentsUsed | None = None,
    covariances: Covariances | None = None,
    simulation: SimulationResult | None = None,
) -> Identification:
    """Everything that comes with an estimate.

    ``used``: its instruments, None without any; ``covariances`` and ``simulation``: of an estimate
    that comes from a simulation, not from the equations.
    """
    regressor, theta, variance = problem.regressor, estimate.theta, estimate.variance
    records, filters = estimate.records, estimate.prefilters.filters
    residuals = [r.residual(regressor, theta) for r in records]
    whitened = [
        r.whitened(error, filters, variance) for r, error in zip(records, residuals, strict=True)
    ]
    joints = _joint_fits(problem, estimate, residuals)
    if records[0].full_rate:
        relative_error = _relative_error(estimate, residuals, joints)
    else:
        relative_error = relative_residual(estimate.sums, theta, variance)
    attempts = Attempts()
    if covariances is None:
        robust = attempts.of(
            "Standard errors are those of white errors",
            _robust_covariance, method, estimate, problem, whitened,
            otherwise=np.full_like(estimate.solution.covariance, np.nan),
        )  # fmt: skip
        covariances = Covariances(robust, estimate.solution.covariance)
    robust, formula = map(rounded_away, covariances)
    covariance = formula if method.covariance == "formula" or attempts.errors else robust
    fitted = tuple(
        record.fitted(regressor, theta, residual, white)
        for record, residual, white in zip(records, residuals, whitened, strict=True)
    )
    equations = Equations(regressor, tuple(records), tuple(filters), variance, method.weight_power)
    failed = "No next motion can be designed by this result"
    noise = attempts.of(failed, EquationNoise.of, problem, equations, fitted[0].whitened_rate)
    warnings = [*warnings, *_failed(attempts)]
    return Identification(
        method=method_label(problem, method, used),
        robot=problem.robot,
        parameters=regressor.parameters,
        names=problem.names,
        expressions=problem.expressions,
        theta=theta,
        covariance=covariance,
        robust_covariance=robust,
        formula_covariance=formula,
        converged=run.converged,
        history=run.history,
        joints=joints,
        relative_error=relative_error,
        condition=estimate.solution.condition,
        recordings=fitted,
        options=method.settings | {"mask": problem.mask},
        method_used=method,
        warnings=_warnings(problem, estimate, run, np.sqrt(np.diag(covariance)), warnings),
        sources={s.name: s.sha256 for r in problem.recordings for s in r.sources},
        version=__version__,
        readings=_readings(problem),
        loop=simulated_loop(problem, used),
        instruments=used,
        equations=equations,
        equation_noise=noise,
        simulation=simulation,
        known=problem.known,
    )


def _readings(problem: Problem) -> tuple[dict[str, Any], ...]:
    """How the logs were read, each way once."""
    found: list[dict[str, Any]] = []
    for recording in problem.recordings:
        if recording.reading and recording.reading not in found:
            found.append(recording.reading)
    return tuple(found)


def loop_warnings(problem: Problem, estimate: Estimate, used: InstrumentsUsed) -> list[Finding]:
    """Reservations about the instruments."""
    loop = simulated_loop(problem, used)
    if loop is None:
        return list(_without_loop(used))
    notes, warnings = law_findings(loop)
    known = [*notes]
    if loop.reconstructed or loop.reference == "smoothed":
        known += _tested(problem, estimate)
    known += warnings
    if loop.reference == "smoothed":
        text = (
            "The reference was not recorded: the smoothed measurement replaces it, with the "
            "declared control law as a virtual one. Instruments then share the noise that the "
            "smoother lets through."
        )
        known.append(Finding("warning", "reference", "smoothed", text))
    return known


def _without_loop(used: InstrumentsUsed) -> Iterator[Finding]:
    """Reservations about instruments from the record itself."""
    if used.instead_of:
        yield Finding("warning", "loop", "not simulated", used.instead_of)
    if used.shares_noise:
        text = f"The instruments may be biased: {used.shares_noise}."
        yield Finding("warning", "instruments", "share noise", text)


def _tested(problem: Problem, estimate: Estimate) -> list[Finding]:
    """The test of Durbin, Wu and Hausman on the last equations."""
    attempts = Attempts()
    test = attempts.of(
        "Whether least squares is biased could not be tested",
        durbin_wu_hausman, estimate.sums, estimate.variance, problem.restrictions.freedom,
    )  # fmt: skip
    tested = [] if test is None else [Finding("warning", "exogeneity", "tested", str(test))]
    return [*tested, *_failed(attempts)]


def _failed(attempts: Attempts) -> list[Finding]:
    """What could not be computed of an estimate that is there."""
    return [Finding("warning", "not tested", "failed", line) for line in attempts.lines]


def law_findings(loop: Loop | None) -> tuple[list[Finding], list[Finding]]:
    """Notes on the loop, and warnings about a law found from the record.

    ``loop``: the loop, or None.
    """
    if loop is None:
        return [], []
    if loop.identified is None:
        return [Finding("warning", "loop", "reconstructed", text) for text in loop.notes], []
    notes = [Finding("note", "law", "found", text) for text in loop.notes]
    return notes, [Finding("note", "law", "uncertain", x) for x in loop.identified.warnings]


def simulated_loop(problem: Problem, used: InstrumentsUsed | None) -> Loop | None:
    """The loop that was simulated for the instruments, None where none was."""
    return problem.loop if used is not None and used.kind == "loop" else None


def method_label(problem: Problem, method: Method, used: InstrumentsUsed | None) -> str:
    """Name of a method, with the kind of its instruments, or Ĉ for those of an identified law."""
    if used is not None and used.kind != "loop":
        return f"{method.label} ({used.kind})"
    loop = simulated_loop(problem, used)
    identified = loop is not None and (loop.identified is not None or loop.feedback)
    return f"{method.label} (Ĉ)" if identified else method.label


def _warnings(
    problem: Problem, estimate: Estimate, run: Run, std: np.ndarray, warnings: Sequence[Finding]
) -> tuple[Finding, ...]:
    """What the estimator noticed."""
    scales = marked_scales([s for r in problem.recordings for s in r.torque_scale])
    parameters, names = problem.regressor.parameters, problem.names
    own = np.flatnonzero(problem.varying)  # what was fixed is nobody's finding
    signs = sign_warnings(
        problem.robot,
        [parameters[k] for k in own], [names[k] for k in own], estimate.theta[own], std[own],
    )  # fmt: skip
    assumed = [Finding("warning", "torque scale", "assumed", s) for s in scale_sentences(scales)]
    decided = [*_link_torques(problem.robot), *problem.findings, *_many_turns(problem)]
    noticed = [*decided, *warnings, *signs, *assumed, *estimate.reservations]
    if not run.converged:
        change = 100 * float(run.history[-1].change)
        text = (
            f"Not converged after {len(run.history)} iterations; the last change was "
            f"{change:.2g} %."
        )
        step = "Look at the convergence plot before using it."
        evidence = {"last change": Quantity(change, "%")}
        noticed.insert(0, Finding("error", "iteration", "not converged", text, "", step, evidence))
    return tuple(noticed)


def _many_turns(problem: Problem) -> Iterator[Finding]:
    """Joints without limits that turn further than any arm would, as degrees taken for radians do.

    Positions beyond limits are refused when a recording is read.
    """
    for j, joint in enumerate(problem.robot.joints):
        span = max(float(np.ptp(recording.q[:, j])) for recording in problem.recordings)
        if joint.kind == "revolute" and joint.position_limits is None and span > MAX_SPAN:
            text = (
                f"q of {joint.name} covers {span:.4g} rad, {span / (2.0 * np.pi):.3g} turns, and "
                "the description has no limits of it."
            )
            step = (
                'Are they degrees? Set units = {q = "deg"} under [recording]; if it turns so far, '
                "give its position_limits (<limit> in a URDF)."
            )
            evidence = {"span": Quantity(span, "rad", bound=MAX_SPAN)}
            yield Finding("warning", "units", "many turns", text, joint.name, step, evidence)


def _link_torques(robot: Robot) -> list[Finding]:
    """What torques behind the gears leave out of the model."""
    if robot.torque_side == "motor":
        return []
    text = (
        'The torques are those of sensors behind the gears (torque_side = "link"). They contain '
        "neither rotor inertias nor friction of the drives, so the model has none; friction in it "
        "is that of bearings behind the sensors, offsets are those of the sensors."
    )
    return [Finding("note", "torque side", "link", text)]


def _joint_fits(
    problem: Problem, estimate: Estimate, residuals: Sequence[np.ndarray]
) -> tuple[JointFit, ...]:
    """How each joint was fitted; ``residuals``: τ - Φθ of each record, (joints, rows)."""
    records, prefilters = estimate.records, estimate.prefilters
    squares, torque = _squares(estimate, residuals), _squares(estimate, [r.tau for r in records])
    rows = [sum(int(r.used[j].sum()) for r in records) for j in range(problem.robot.size)]
    usable = sum(r.usable_rows for r in records)
    noise_std = np.sqrt(estimate.variance)
    f50 = np.mean([r.kinematics.f50 for r in records], axis=0)
    encoder_std = np.mean([r.kinematics.encoder_std for r in records], axis=0)
    units = torque_units(problem)
    noise_units = list(units)  # behind an inverse controller that of positions
    if prefilters.inverts_controller:
        driven = slice(problem.robot.base_joints, None)
        noise_units[driven] = position_units(problem)[driven]
    return tuple(
        JointFit(
            name=joint.name,
            torque_unit=units[j],
            relative_error=float(np.sqrt(squares[j] / max(torque[j], 1e-300))) if rows[j] else nan,
            rms_error=float(np.sqrt(squares[j] / rows[j])) if rows[j] else nan,
            noise_std=float(noise_std[j]),
            noise_unit=noise_units[j],
            ar_order=int(prefilters.orders[j]) if prefilters.models else 0,
            ar_at_bound=bool(prefilters.at_bound[j]) if prefilters.at_bound else False,
            rows=rows[j],
            masked=1.0 - rows[j] / max(usable, 1),
            f50=float(f50[j]),
            encoder_std=float(encoder_std[j]),
        )
        for j, joint in enumerate(problem.robot.joints)
    )


def _relative_error(
    estimate: Estimate, residuals: Sequence[np.ndarray], joints: Sequence[JointFit]
) -> float:
    """‖τ - Φθ‖/‖τ‖ over all joints, each weighted by its own unfiltered error."""
    spread = np.array([max(f.rms_error, 1e-300) ** 2 if f.rows else inf for f in joints])
    signals = residuals, [r.tau for r in estimate.records]
    error, total = (
        sum(
            _sum_of_squares(x, r.used) @ (1.0 / spread)
            for x, r in zip(own, estimate.records, strict=True)
        )
        for own in signals
    )
    return float(np.sqrt(error / total))


def _squares(estimate: Estimate, signals: Sequence[np.ndarray]) -> np.ndarray:
    """Sum of squares over the rows in use of all records, shape (joints,)."""
    parts = zip(signals, estimate.records, strict=True)
    return np.sum([_sum_of_squares(x, r.used) for x, r in parts], axis=0)


def _sum_of_squares(signal: np.ndarray, used: np.ndarray) -> np.ndarray:
    """Σ x² over the samples in use, shape (joints,)."""
    return np.array([np.sum(own[part] ** 2) for own, part in zip(signal, used, strict=True)])


def _robust_covariance(
    method: Method, estimate: Estimate, problem: Problem, whitened: Sequence[np.ndarray]
) -> np.ndarray:
    """Covariance that holds for coloured residuals; ``whitened``: those of unit variance."""
    records, variance = estimate.records, estimate.variance
    freedom = problem.restrictions.freedom
    windows = jackknife(estimate.sums, estimate.theta, variance, method.weight_power, freedom)
    only_windows = method.covariance == "sandwich" or method.weight_power != 1.0
    if only_windows or not records[0].full_rate:
        return windows.covariance
    filters = estimate.prefilters.filters
    stationary = stationary_covariance(
        problem.regressor, records, filters, estimate.sums, variance, whitened, freedom
    )
    if method.covariance == "stationary":
        return stationary
    return covariance_by_test(stationary, windows)
