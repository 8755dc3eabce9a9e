"""Torques of a new recording by a result: how large the errors are, where and in which band.

The error of a predicted torque: its interval from the scatter over blocks, and its bands.

Errors of neighbouring samples are alike, and parts of a motion are easier or harder to predict.
The blocks of a log are left out in turn: with ℓ = ln(‖e‖/‖τ‖) of all blocks and its standard
deviation σ by `jackknife_spread` the interval is exp(ℓ ± t σ), with the quantile t of Student's
distribution of B - 1 degrees of freedom. It holds for motion like that of the log.

The bands are slower than the motion, in its band, and faster. The cosine transform (DCT-II) of a
stretch keeps the sum of squares, and its even continuation has no jump at the ends. So the mean
squares of the bands add up to that of the error.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Any

import numpy as np

from pivident.data.recording.joint_order import in_order_of
from pivident.data.recording.recording import Recording
from pivident.dynamics.friction import FrictionWarming
from pivident.estimation.equation_record import MotionRange
from pivident.estimation.identification import Identification
from pivident.estimation.problem import Problem
from pivident.foundation.distributions import student
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.sentences import listed
from pivident.judgement.diagnostics.prediction_statements import WORSE
from pivident.judgement.model_errors.time_errors import WARMTH, temperature_text
from pivident.judgement.validation.held_out.cross_validation import CrossValidation
from pivident.judgement.validation.held_out.folds import moving_part
from pivident.judgement.validation.held_out.held_out_errors import (
    HeldOutErrors,
    LogError,
    jackknife_spread,
    log_errors,
)
from pivident.judgement.validation.held_out.prediction import Judge, PredictionError, total_error
from pivident.loop.motion.motion import measured_samples
from pivident.models.runnable_model import RunnableModel
from pivident.robot.description import Robot
from pivident.studies.prediction.beside_held_out import error_ratios, finding_of
from pivident.studies.prediction.prediction import (
    COMPARED,
    ErrorOnLog,
    Prediction,
    exit_findings,
    interval_text,
    range_exits,
)

#: From this error on the model predicts less than nothing [%].
WITHOUT_USE = 100.0
#: Fewest and most blocks, and the length that they should have [s].
MIN_BLOCKS, MAX_BLOCKS, BLOCK = 5, 20, 1.0


def predict(
    result: Any,
    recording: Recording,
    *,
    compare: bool = True,
    held_out: CrossValidation | HeldOutErrors | None = None,
    fitted: MotionRange | None = None,
    band: float | None = None,
    warming: Sequence[FrictionWarming] = (),
) -> Prediction:
    """Torques of a new recording by a result, and their errors.

    Positions are smoothed and differentiated as for the held-out motion of `cross_validate`, so
    that errors can be compared with its.

    Args:
        result: what predicts: an `Identification`, a `ConsistentModel` or a `RunnableModel`.
        recording: of the same robot, SI, joint side; it may be one that was fitted.
        compare: whether its torque is compared; one that was not measured never is.
        held_out: errors of the result on held-out motion, to compare with.
        fitted: range of the fitted motion; None: that of the result, where it is known.
        band: highest frequency of the motion, below which errors are compared [Hz]; None: from the
            recording.
        warming: how friction changes with the temperature of the recording; none: as of the result.

    Returns:
        Torques, errors by joint and by frequency, and where the motion leaves the fitted range.

    Raises:
        ExperimentError: the recording has other joints than the result, or no result is given.
        RecordingError: the recording is too short to be differentiated.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> runs = [pv.simulate(robot, loop, encoder=1e-5, seed=seed).recording for seed in (1, 2)]
        >>> result = pv.identify(pv.Problem(robot, runs[:1], loop), "piv")
        >>> print(pv.predict(result, runs[1]).findings[0])
        · prediction: The torque error below 20 Hz is 0.2... % (95 %: ... %); ...
    """
    torque = getattr(result, "torque" if isinstance(result, RunnableModel) else "predict", None)
    if torque is None:
        raise ExperimentError(
            f"an object of type {type(result).__name__} predicts no torques",
            advice="give an Identification, or what make_consistent or stored_model returns",
        )
    robot = result.robot
    recording = in_order_of(robot, recording)
    if band is not None and not 0.0 < band < 0.5 * recording.rate:
        raise ExperimentError(
            f"a band of {band:g} Hz is not below {0.5 * recording.rate:g} Hz, half the rate of "
            f"{recording.name!r}",
            advice="leave it out, and it follows from the motion",
        )
    judge = Judge(recording, band)
    k = judge.kinematics
    compare = compare and recording.has_torque
    # a motion alone needs no control law that its torque would follow from
    moved = replace(recording, torque_source="law", allow_constant=True, saturation="allow")
    problem = Problem(robot, (recording if recording.has_torque else moved,))
    start, stop = moving_part(problem, k)
    model, free = torque(k.q.T, k.dq.T, k.ddq.T), _free(result)
    warming = warming or getattr(free, "friction_warming", ())
    if recording.temperature is not None:
        for own in warming:
            j = robot.joint_names.index(own.joint)
            model[:, j] += own.torque(result.parameters, k.dq[j], recording.temperature[:, j])
    measured = measured_samples(k).T
    residual = np.where(measured, k.tau.T - model, 0.0)
    error = _error(judge, robot, residual, slice(start, stop)) if compare else None
    known = fitted or (free.fitted_range if isinstance(free, Identification) else None)
    exits = () if known is None else tuple(range_exits(robot, known, k, slice(start, stop)))
    earlier = HeldOutErrors.of(held_out) if isinstance(held_out, CrossValidation) else held_out
    if earlier is not None and band is not None and band != earlier.band:
        earlier = None  # of another band
    findings = [] if error is None else _error_findings(error, earlier)
    if compare:
        still = np.abs(k.dq.T[start:stop]) < problem.low_speeds(recording)
        findings += _at_rest(robot, still, residual[start:stop])
    findings += [_warmth(own, recording.temperature is not None) for own in warming]
    if isinstance(result, RunnableModel):
        findings += _without_drives(result)
    if known is not None:
        findings += exit_findings(robot, known, exits, residual[start:stop] if compare else None)
    whole = slice(k.start, k.stop)
    return Prediction(
        method=_method(result),
        robot=robot,
        recording=recording.name,
        t=recording.t[whole],
        q=k.q.T[whole],
        dq=k.dq.T[whole],
        ddq=k.ddq.T[whole],
        tau=np.where(measured, k.tau.T, np.nan)[whole] if compare else None,
        tau_model=model[whole],
        moving=slice(start - k.start, stop - k.start),
        error=error,
        exits=exits,
        held_out=earlier,
        findings=tuple(findings),
    )


def block_squares(x: np.ndarray, rate: float) -> np.ndarray:
    """Σ x² in contiguous blocks of equal length, shape (blocks, joints).

    ``x``: shape (samples, joints); ``rate``: of the samples [Hz].
    """
    count = int(np.clip(len(x) / rate / BLOCK, MIN_BLOCKS, MAX_BLOCKS))
    borders = np.linspace(0, len(x), count + 1).astype(int)[:-1]
    return np.add.reduceat(x**2, borders, axis=0)


def joint_intervals(error: np.ndarray, torque: np.ndarray) -> np.ndarray:
    """95 % intervals of 100 ‖e‖/‖τ‖ of each joint [%], shape (joints, 2).

    ``error`` and ``torque``: sums of squares of each block, shape (blocks, joints).
    """
    left_out = np.sqrt(_without_each(error) / np.maximum(_without_each(torque), 1e-300))
    every = np.sqrt(error.sum(axis=0) / np.maximum(torque.sum(axis=0), 1e-300))
    return 100.0 * np.column_stack(_interval(every, left_out))


def total_interval(error: np.ndarray, torque: np.ndarray, units: Sequence[str]) -> np.ndarray:
    """95 % interval of the error over all joints, see `total_error` [%], shape (2,).

    Arguments as of `joint_intervals`; ``units``: of the joints' torques.
    """
    parts = zip(_without_each(error), _without_each(torque), strict=True)
    left_out = np.array([total_error(np.sqrt(e), np.sqrt(t), units) for e, t in parts])
    every = total_error(np.sqrt(error.sum(axis=0)), np.sqrt(torque.sum(axis=0)), units)
    return np.array(_interval(np.array(every), left_out))


def _without_each(squares: np.ndarray) -> np.ndarray:
    """Sums over all blocks but one; rounding cannot make them negative."""
    return np.maximum(squares.sum(axis=0) - squares, 0.0)


def _interval(every: np.ndarray, left_out: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Ends from the value of all blocks, and those with each left out (blocks first)."""
    factor = np.exp(student.ppf(0.975, len(left_out) - 1) * jackknife_spread(left_out))
    return every / factor, every * factor


#: Share of the joints' squared speeds that lies below the band of the motion.
SLOWER = 0.05


def motion_band_start(dq: np.ndarray, rate: float, stop: float) -> float:
    """Frequency below which 5 % of the squared speeds lie, each joint with the same weight [Hz].

    ``dq``: shape (samples, joints) [rad/s or m/s]; ``stop``: end of the band [Hz].
    """
    power = _spectrum(dq)
    share = (power / np.maximum(power.sum(axis=0), 1e-300)).sum(axis=1).cumsum()
    k = int(np.searchsorted(share, SLOWER * share[-1]))
    return min(float(f"{frequencies(len(dq), rate)[k]:.1g}"), stop)


def rms_by_band(x: np.ndarray, rate: float, edges: tuple[float, float]) -> np.ndarray:
    """Rms below, between and above two frequencies, shape (3, joints).

    ``x``: shape (samples, joints); ``edges``: [Hz].
    """
    power = _spectrum(x)
    band = np.searchsorted(np.asarray(edges), frequencies(len(x), rate), side="right")
    return np.sqrt([power[band == k].sum(axis=0) for k in range(3)])


def frequencies(samples: int, rate: float) -> np.ndarray:
    """Frequency of each coefficient [Hz], shape (samples,)."""
    return 0.5 * rate * np.arange(samples) / samples


def _spectrum(x: np.ndarray) -> np.ndarray:
    """Mean square of each coefficient of the cosine transform; they sum up to the signal's.

    Made of the transform of the signal and its mirror image.
    """
    transformed = np.fft.rfft(np.concatenate([x, x[::-1]]), axis=0)[: len(x)]
    power = 0.5 * np.abs(transformed) ** 2 / len(x) ** 2
    power[0] /= 2.0
    return np.asarray(power)


def _error(judge: Judge, robot: Robot, residual: np.ndarray, span: slice) -> ErrorOnLog:
    """Errors on some samples by joint and band, with intervals."""
    rate, low = judge.recording.rate, judge.in_band(residual)
    errors = judge.error(robot, residual, low, span)
    torque = block_squares(judge.kinematics.tau.T[span], rate)
    low_squares, torque_low = (block_squares(x[span], rate) for x in (low, judge.torque_in_band))
    in_motion = np.where(judge.resting(robot, span), 0.0, low[span])
    begin = motion_band_start(judge.kinematics.dq.T[span], rate, judge.band)
    edges = begin, judge.band
    return ErrorOnLog(
        errors,
        joint_intervals(block_squares(residual[span], rate), torque),
        joint_intervals(low_squares, torque_low),
        total_interval(low_squares, torque_low, errors.units),
        len(torque),
        edges,
        rms_by_band(residual[span], rate, edges),
        _moving_errors(errors, block_squares(in_motion, rate), torque_low),
    )


def _moving_errors(
    errors: PredictionError, squares: np.ndarray, torque: np.ndarray
) -> dict[str, LogError]:
    """Errors in motion with their scatter; arguments as of `joint_intervals`, in the band."""
    left_out, sizes = (np.sqrt(_without_each(x)) for x in (squares, torque))
    totals = [total_error(e, t, errors.units) for e, t in zip(left_out, sizes, strict=True)]
    spreads = jackknife_spread(np.column_stack([totals, left_out / np.maximum(sizes, 1e-300)]))
    every = np.array([errors.total_moving_in_band, *errors.moving_in_band])
    return log_errors(errors.joint_names, every, spreads, len(squares))


def _error_findings(error: ErrorOnLog, held_out: HeldOutErrors | None) -> list[Finding]:
    """The error beside that of held-out motion, its largest joint, joints without any use."""
    e, j = error.errors, error.worst
    text = (
        f"The torque error below {e.band:g} Hz is {percent(e.total_in_band)} (95 %: "
        f"{interval_text(error.total_interval)} %)"
    )
    if len(e.joint_names) > 1:
        text += f"; the largest of a joint is {percent(e.relative_in_band[j])}, {e.joint_names[j]}"
    ends = float(error.total_interval[0]), float(error.total_interval[1])
    evidence = {"torque error": Quantity(e.total_in_band, "%", interval=ends)}
    findings = [Finding("note", "prediction", "error", f"{text}.", evidence=evidence)]
    if held_out is not None:
        beside = finding_of(error_ratios(error.moving, held_out, e.joint_names), held_out)
        findings += [] if beside is None else [beside]
    useless = [
        name
        for name, share in zip(e.joint_names, e.relative_in_band, strict=True)
        if share > WITHOUT_USE
    ]
    if useless:
        text = f"The error is larger than the torque itself on {listed(useless)}."
        step = "Check that the log is of this robot, and its units, signs, side and joint order."
        findings.append(Finding("error", "prediction", "without use", text, next_step=step))
    return findings


def _without_drives(model: RunnableModel) -> list[Finding]:
    """What a model lacks of the drives, whose torques it then leaves out."""
    if model.robot.torque_side == "link":
        return []
    of_drives = {
        "rotor inertias": [p.stem == "ia" for p in model.parameters],
        "friction": [p.friction is not None for p in model.parameters],
    }
    lacking = [words for words, own in of_drives.items() if not model.values[own].any()]
    if not lacking:
        return []
    text = f"The model has no {' and no '.join(lacking)}: the torque of the drives is left out."
    if "rotor inertias" in lacking:
        text += " A URDF cannot hold rotor inertias."
    step = "Predict with the folder of results, or with an export to JSON or TOML."
    return [Finding("warning", "prediction", "without drives", text, next_step=step)]


def _at_rest(robot: Robot, still: np.ndarray, residual: np.ndarray) -> list[Finding]:
    """Joints whose error is larger at rest, where a law of the speed knows no friction.

    ``still``: samples at rest, shape (samples, joints); ``residual``: τ - Φθ, likewise.
    """
    named = []
    for j, joint in enumerate(robot.joints):
        rest, share = still[:, j], float(still[:, j].mean())
        if not COMPARED <= share <= 1.0 - COMPARED:
            continue
        there, moving = (float(np.sqrt(np.mean(residual[own, j] ** 2))) for own in (rest, ~rest))
        if there > WORSE * moving:
            named.append(
                f"{joint.name} {format_significant(there)} {joint.torque_unit} in "
                f"{percent(100 * share)} of the samples, "
                f"{format_significant(moving)} {joint.torque_unit} in motion"
            )
    if not named:
        return []
    text = (
        "At rest (below 1 % of the rated speed) dry friction can have any value up to its level, "
        f"which no law of the speed predicts. Rms error at rest: {'; '.join(named)}."
    )
    return [Finding("note", "standstill", "friction", text)]


def _warmth(own: FrictionWarming, is_known: bool) -> Finding:
    """At which temperature the friction of a joint is predicted."""
    text = f"Friction of {own.joint} is that at {temperature_text(own.reference)}"
    if is_known:
        return Finding("note", WARMTH, "at the log's", f"{text}, changed to that of the log.")
    return Finding(
        "note", WARMTH, "at the reference",
        f"{text}, since the temperature of the log is not known.", own.joint,
        "Name its columns: [identify] temperature in an experiment file with --experiment.",
    )  # fmt: skip


def _free(result: Any) -> Any:
    """The identification behind a result, or the result."""
    return getattr(result, "free", None) or getattr(result, "estimate", None) or result


def _method(result: Any) -> str:
    if not isinstance(result, RunnableModel):
        return str(result.method)
    return "nominal values" if result.origin.method == "nominal" else result.origin.method
