"""The load on a link, from the arm identified without it and recordings taken with it.

    θ_loaded = θ + ΔF + B π

(Khalil, Gautier and Lemoine 2007). With recordings of both states, the arm is identified first, and
then arm, friction and load together from the loaded record and the first estimate of the arm; this
equals the estimate from both records at once. An arm identified earlier can be used instead.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Any, NamedTuple

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.answer import method_label
from pivident.estimation.covariance.stationary_noise import covariance_by_test
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.instrument_choice import Chosen
from pivident.estimation.iteration import Signals
from pivident.estimation.method import Method
from pivident.estimation.methods import method_named
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.prefiltered_iv import with_instruments
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Decimated, RandomWalk
from pivident.foundation.errors import ExperimentError
from pivident.foundation.version import __version__
from pivident.loop.instruments.given_motion import InstrumentsUsed
from pivident.robot.description import Robot
from pivident.robot.frames import Pose
from pivident.robot.mounted import carrier_of
from pivident.robot.refusals import without_loops, without_wrenches
from pivident.studies.payload.arm_and_load import ArmAndLoad, KnownParts, arm_and_load, widened
from pivident.studies.payload.doubts import (
    contradicted,
    disagreement,
    refuse_negative,
    scale_sentence,
    warnings_about,
    worse_explained,
)
from pivident.studies.payload.joint_masses import joint_masses
from pivident.studies.payload.load_estimate import NATURAL, LoadEstimate
from pivident.studies.payload.loaded_record import (
    LoadedRecords,
    RestrictedSolution,
    check_recordings,
    check_same_arm,
    noise_by_scores,
    noise_by_windows,
    solve_restricted,
    tool_frame,
    with_known,
)
from pivident.studies.payload.payload_identification import PayloadIdentification

#: Standard error, in natural sizes (1 kg, 0.1 m), above which a direction of the load counts as
#: undetermined.
UNDETERMINED = 100.0

#: Smallest number of estimates of an iterative method; see `pivident.estimation.prefiltered_iv`.
MIN_ESTIMATES = 3

#: Relative change of the mass that scales the standard errors of the known parts below which it is
#: kept, and the maximum number of updates. Two are usual, more if only a known centre of mass
#: determines it.
SAME_MASS, MASS_ROUNDS = 0.01, 20


def identify_payload(
    empty: Problem | Identification,
    loaded: Problem | Sequence[Recording],
    method: Method | str = "piv",
    *,
    link: str | None = None,
    known: KnownParts | None = None,
    frame: Pose | None = None,
    friction_under_load: bool = True,
    progress: Callable[[str], None] | None = None,
) -> PayloadIdentification:
    """Mass, centre of mass and inertia of a load.

    Args:
        empty: robot and recordings without load, or the arm identified from them earlier.
        loaded: recordings with the load, in the same control loop as those without; with an arm
            identified earlier, a problem with robot, loaded recordings and loop.
        method: ``ls``, ``iv-full-rate``, ``piv`` or a method object; band-pass and decimation of
            ``ls`` and ``iv`` are replaced by the smoother at full rate.
        link: link, or joint that moves it, or a link of the URDF that is fixed to it, such as a
            flange; None: the last one that moves.
        known: known parts of the load, in ``frame``.
        frame: frame of a tool, its pose in the frame of the link; None: the link's frame.
        friction_under_load: whether friction may change with the load.
        progress: called with one line at each stage.

    Returns:
        The load with covariance, in ``frame``.

    Raises:
        ExperimentError: arms that do not match, a link that does not exist, a method without a
            payload variant.
        NegativePayload: the mass is negative: the records are swapped.
        IdentificationError: the arm cannot be identified, or the loaded loop cannot be simulated.
        RobotDescriptionError: a robot with closed loops.
    """
    without_wrenches(empty.robot, "the identification of a payload")
    without_loops(empty.robot, "the identification of a payload")
    say = progress or (lambda line: None)
    chosen, known = _full_rate(method), known or KnownParts()
    if isinstance(empty, Problem):
        carrier, fixed = carrier_of(empty.robot, link)
        check_recordings(empty, loaded)
        with_load = loaded if isinstance(loaded, Problem) else _loaded_problem(empty, loaded)
        arm = identify(empty, chosen, lambda line: say(f"without load: {line}"))
    else:
        if not isinstance(loaded, Problem):
            raise ExperimentError(
                "with an arm identified earlier, give the loaded recordings as a Problem: robot, "
                "recordings and loop"
            )
        carrier, fixed = carrier_of(loaded.robot, link)
        arm, with_load = empty, loaded
    check_same_arm(arm, with_load)
    said = tool_frame(with_load.robot, carrier, None if fixed is None else link, frame)
    if fixed is not None:
        frame = fixed if frame is None else fixed @ frame
    problem = replace(with_load, parameters=widened(arm, with_load.base, carrier), initial={})
    unknowns = arm_and_load(
        arm, problem, carrier, known, frame or Pose.identity(), friction_under_load
    )
    say("with load: smoothing the records")
    found, used = _estimate(problem, unknowns, chosen, say)
    records, unknowns, sums, solution, iterations, converged = found
    noise = _noise(records, sums, solution, unknowns, chosen)
    covariance, moved = with_known(noise, unknowns, solution)
    load = _load(problem.robot, carrier, unknowns, solution, covariance)
    masses = None
    if load.is_seen and load.determined[9]:
        masses = joint_masses(arm, sums, unknowns, solution)
        if masses is not None and masses.disagree:
            load = replace(load, covariance=load.covariance + masses.added)
    if frame is not None:
        load = load.seen_from(frame, said)
    refuse_negative(load)
    own = unknowns.friction_part
    change = _arm_change(unknowns, solution, moved)
    relative_errors, rms_errors = records.errors(solution.theta)
    warnings = [
        *warnings_about(load, arm, change, converged, iterations),
        *disagreement(masses),
    ]
    if known.mass is not None or known.center_of_mass is not None:
        bare = arm_and_load(
            arm, problem, carrier, KnownParts(), frame or Pose.identity(), friction_under_load
        )
        by_torques = _by_torques(sums, bare, solution.theta, problem.robot, carrier)
        if frame is not None:
            by_torques = by_torques.seen_from(frame, said)
        warnings += contradicted(known, by_torques)
    if isinstance(empty, Problem):  # another method's error would refer to other samples
        warnings += worse_explained(arm, rms_errors)

    return PayloadIdentification(
        load=load,
        link=problem.robot.links[carrier].name,
        joint=problem.robot.joint_names[carrier],
        method=method_label(problem, chosen, used),
        arm=arm,
        arm_change=change,
        friction_names=tuple(arm.names[k] for k in unknowns.friction),
        friction_change=solution.x[own],
        friction_std=np.sqrt(np.diag(covariance)[own]),
        joints=problem.robot.joint_names,
        relative_errors=relative_errors,
        rms_errors=rms_errors,
        recordings=tuple(r.name for r in problem.recordings),
        converged=converged and arm.converged,
        iterations=iterations,
        known=known,
        masses=masses,
        scale=scale_sentence(problem.recordings),
        warnings=tuple(warnings),
        sources={s.name: s.sha256 for r in problem.recordings for s in r.sources},
        version=__version__,
    )


def _full_rate(
    method: Method | str,
) -> Method:
    """The method with signals at the full sampling rate."""
    made = method_named(method)
    if not made.handles.payload:
        raise ExperimentError(
            f"{made.label} has no payload variant",
            advice="use piv, iv-full-rate or ls for the load",
        )
    return replace(made, signals=RandomWalk()) if isinstance(made.signals, Decimated) else made


def _loaded_problem(empty: Problem, loaded: Sequence[Recording]) -> Problem:
    """The same robot and loop with the loaded recordings."""
    return replace(
        empty,
        recordings=tuple(loaded),
        loop=None if empty.loop is None else replace(empty.loop, reconstructed=()),
    )


class Estimate(NamedTuple):
    """What the loaded records come to."""

    records: LoadedRecords
    unknowns: ArmAndLoad  # with the standard errors of the known parts at the mass found
    sums: Sequence[JointSums]
    solution: RestrictedSolution
    iterations: int
    converged: bool


def _estimate(
    problem: Problem, unknowns: ArmAndLoad, method: Any, say: Callable[[str], None]
) -> tuple[Estimate, InstrumentsUsed | None]:
    """Least squares, or an iteration with instruments of the kind that identification takes."""
    signals = Signals.of(problem, method)
    if not method.has_instruments:
        return _least_squares(LoadedRecords(signals), unknowns), None

    def iterated(chosen: Chosen) -> Estimate:
        records = LoadedRecords(signals, method.steps(signals, chosen))
        return _with_instruments(_least_squares(records, unknowns), method, say)

    return with_instruments(signals, method, iterated, say)


def _least_squares(records: LoadedRecords, unknowns: ArmAndLoad) -> Estimate:
    """Without instruments: an answer by itself, and the start of the others."""
    theta = unknowns.empty_theta
    sums = records.least_squares(theta)
    unknowns, solution = _solved(sums, unknowns, theta)
    if records.steps is None and unknowns.problem.regressor.depends_on_load:
        sums = records.least_squares(solution.theta)
        unknowns, solution = _solved(sums, unknowns, solution.theta)
    return Estimate(records, unknowns, sums, solution, 1, True)


def _with_instruments(start: Estimate, method: Any, say: Callable[[str], None]) -> Estimate:
    """Instruments, noise models and estimate in turn until the estimate stands still."""
    records, unknowns, _, solution, _, _ = start
    simulated = unknowns.empty_theta
    for k in range(1, method.max_iterations + 1):
        before = solution
        sums, simulated = records.with_instruments(k, simulated, solution.theta)
        unknowns, solution = _solved(sums, unknowns, solution.theta)
        std = np.sqrt(np.abs(np.diag(solution.inverse)))
        change = float((np.abs(solution.x - before.x) / std).max())
        say(f"with load: estimate {k + 1}, changes by {change:.2g} standard errors")
        settled = k + 1 >= MIN_ESTIMATES and change < max(0.05, method.tolerance)
        if settled:
            break
    return Estimate(records, unknowns, sums, solution, k + 1, settled)


def _solved(
    sums: Sequence[JointSums], unknowns: ArmAndLoad, start: np.ndarray
) -> tuple[ArmAndLoad, RestrictedSolution]:
    """The solution, with the standard errors of the known parts at its mass."""
    solution = solve_restricted(sums, unknowns, start)
    if not unknowns.known.needs_mass:
        return unknowns, solution
    before = np.inf
    for _ in range(MASS_ROUNDS):
        mass = unknowns.mass_size(solution.x, solution.inverse)
        unknowns = unknowns.at_mass(mass)
        solution = solve_restricted(sums, unknowns, solution.theta)
        if abs(mass - before) < SAME_MASS * mass:
            break
        before = mass
    return unknowns, solution


def _noise(
    records: LoadedRecords,
    sums: Sequence[JointSums],
    solution: RestrictedSolution,
    unknowns: ArmAndLoad,
    method: Method,
) -> np.ndarray:
    """Covariance from the loaded record's noise, of the kind that the method names."""
    asked = method.covariance if method.whitens else "auto"
    windows = noise_by_windows(sums, unknowns, solution)
    if asked == "sandwich":
        return windows.covariance
    M = unknowns.loaded_map
    if asked == "formula":
        scores = np.zeros((len(M), len(M)))
        for own, lam in zip(sums, solution.variance, strict=True):
            scores[np.ix_(own.columns, own.columns)] += own.zz / lam
    else:
        metric = M @ solution.inverse @ M.T
        scores = records.score_variance(solution.theta, sums, solution.variance, metric)
    noise = noise_by_scores(scores, unknowns, solution)
    return covariance_by_test(noise, windows) if asked == "auto" else noise


def _load(
    robot: Robot,
    link: int,
    unknowns: ArmAndLoad,
    solution: RestrictedSolution,
    covariance: np.ndarray,
) -> LoadEstimate:
    """π = V ξ with its covariance and the directions that are not determined."""
    own = unknowns.load_part
    spread = unknowns.basis @ covariance[own, own] @ unknowns.basis.T
    variances, directions = np.linalg.eigh(spread / np.outer(NATURAL, NATURAL))
    vague = directions[:, variances > UNDETERMINED**2] * NATURAL[:, None]
    joint = robot.joints[link]
    kind = "turns about" if joint.kind == "revolute" else "slides along"
    return LoadEstimate(
        unknowns.basis @ solution.x[own],
        spread,
        np.hstack([unknowns.structural, vague]),
        f"link {robot.links[link].name!r}; its origin is on joint {joint.name!r}, which {kind} z",
    )


def _by_torques(
    sums: Sequence[JointSums], bare: ArmAndLoad, start: np.ndarray, robot: Robot, link: int
) -> LoadEstimate:
    """The load by the torques alone; ``bare``: the unknowns without known parts."""
    alone = solve_restricted(sums, bare, start)
    spread, _ = with_known(noise_by_windows(sums, bare, alone).covariance, bare, alone)
    return _load(robot, link, bare, alone, spread)


def _arm_change(
    unknowns: ArmAndLoad, solution: RestrictedSolution, moved: np.ndarray
) -> np.ndarray:
    """(θ - θ̂₁) over its standard error; zero for parameters the loaded data do not support."""
    step = solution.x[unknowns.arm_part] - unknowns.arm_theta
    variance, own = np.diag(moved), np.diag(unknowns.arm_covariance)
    informed = variance > 1e-4 * own
    return np.where(informed, step / np.sqrt(np.where(informed, variance, 1.0)), 0.0)
