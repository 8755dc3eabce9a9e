"""Cross-validation: how well does an estimate predict motion that it was not fitted to?

Two ways: a second recording, or k contiguous blocks of the motion, each predicted by the estimate
from all others. Two scores: the torque of the model on the measured motion, and the closed loop
simulated with the estimate. An error on the training data alone says little, and the result says
so.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from math import isnan, nan
from typing import Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.data.recording.repeated_motion import find_repetition
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify, narrowed
from pivident.estimation.method import Method
from pivident.estimation.problem import Problem
from pivident.foundation.document.table import Column, Table
from pivident.foundation.errors import (
    FailedFoldWarning,
    IdentificationError,
    MassMatrixNotPositiveDefinite as IndefiniteMass,
    SimulationDiverged,
)
from pivident.foundation.progress import Say, Stages
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import listed
from pivident.judgement.validation.given_warnings import warn, warn_of
from pivident.judgement.validation.held_out.fold_estimates import estimates_without
from pivident.judgement.validation.held_out.folds import (
    JudgedMotion,
    Piece,
    contiguous_folds,
    equal_blocks,
)
from pivident.judgement.validation.held_out.prediction import (
    Judge,
    PredictionError,
    ReplayError,
    SimulationError,
    pooled,
)

#: What has to be said where nothing was held out.
TRAINING_ONLY = (
    "Nothing was held out: these errors are on the data that were fitted, and a model that is too "
    "large or a wrong noise model can have small ones. Hold blocks out (folds), or record a second "
    "motion."
)

Kind = Literal["folds", "second recording", "training only"]


@dataclass(frozen=True, eq=False)
class HeldOut:
    """One stretch that was not fitted, and how it was predicted."""

    recording: str  # name of the recording
    start: float  # time at which the stretch begins [s]
    stop: float  # time at which it ends [s]
    #: The estimate that did not know it, see ``fold_estimates``; None where there is none.
    identification: Identification | None = None
    prediction: PredictionError | None = None  # torque errors, likewise
    #: Errors of the simulated loop; None without a loop, or where it failed.
    replay: ReplayError | None = None
    failure: str = ""  # what went wrong, empty if nothing did
    #: Errors of the simulated positions; None without a loop that says something about them.
    simulation: SimulationError | None = None

    def span(self, recording: Recording) -> slice:
        """Its samples in its recording."""
        seconds = np.array([self.start, self.stop]) - recording.start_time
        return slice(*np.rint(seconds * recording.rate).astype(int).tolist())


@dataclass(frozen=True, eq=False)
class CrossValidation(Displayed):
    """Errors of one method on motion that was not fitted.

    Attributes:
        method: name of the method.
        kind: ``folds``, ``second recording`` or ``training only``.
        identification: fit to everything.
        held_out: stretches with their scores; with ``training only`` they were fitted.
        training: torque errors of ``identification`` on what it was fitted to.
        gap: left out on either side of a block [s].
        notes: sentences.
        blocks: number of held-out blocks; one that runs over the end of a recording has two parts
            in ``held_out``.
    """

    method: str
    kind: Kind
    identification: Identification
    held_out: tuple[HeldOut, ...]
    training: PredictionError
    gap: float = 0.0
    notes: tuple[str, ...] = ()
    blocks: int = 0

    @property
    def where(self) -> str:
        """What was held out, in words: how many blocks, or a validation recording by its name."""
        return f"{self.blocks} held-out blocks" if self.kind == "folds" else self.motion

    @property
    def motion(self) -> str:
        """The motion that was judged on, in words; a validation recording by its name."""
        if self.kind != "second recording":
            return "held-out motion" if self.kind == "folds" else "the fitted motion"
        names = list(dict.fromkeys(h.recording for h in self.held_out))
        return f"the validation recording{'s' * (len(names) > 1)} {listed(names)}"

    @property
    def prediction(self) -> PredictionError:
        """Torque errors over all held-out stretches."""
        return pooled([h.prediction for h in self.held_out if h.prediction is not None])

    @property
    def replay(self) -> ReplayError | None:
        """Errors of the simulated loop over all held-out stretches, where there are any."""
        found = [h.replay for h in self.held_out if h.replay is not None]
        return pooled(found) if found else None

    @property
    def simulation(self) -> SimulationError | None:
        """Errors of the simulated positions over all held-out stretches, where there are any."""
        found = [h.simulation for h in self.held_out if h.simulation is not None]
        return pooled(found) if found else None

    @property
    def training_only(self) -> bool:
        """Whether nothing was held out."""
        return self.kind == "training only"

    @property
    def warning(self) -> str:
        """What has to be said where nothing was held out; empty otherwise."""
        return TRAINING_ONLY if self.training_only else ""

    @property
    def failures(self) -> tuple[str, ...]:
        """What went wrong, with the stretch where it did."""
        return tuple(
            f"{h.recording}, {h.start:.2f} to {h.stop:.2f} s: {h.failure}"
            for h in self.held_out
            if h.failure
        )

    def __str__(self) -> str:
        parts = [self.headline(), self.stretch_table().text(), self.joint_table().text()]
        return "\n\n".join([*parts, *self.sentences()])

    def headline(self) -> str:
        """What was done and what came out, in a sentence or two."""
        error, band = self.prediction, self.prediction.band
        what = self.where + (f", gaps of {self.gap:.2g} s" if self.kind == "folds" else "")
        text = (
            f"{self.method} on {what}: torque error {error.total_in_band:.2f} % below {band:g} Hz, "
            f"{error.total:.2f} % over all frequencies"
        )
        if self.kind != "training only":
            text += f" (on the fitted data {self.training.total_in_band:.2f} and "
            text += f"{self.training.total:.2f} %)"
        if self.replay is not None:
            text += f"; simulated loop: torque error {self.replay.total:.2f} %"
        return text + "."

    def stretch_table(self) -> Table:
        """One row for each stretch that was held out."""
        rows, band = self.held_out, self.prediction.band
        parts = [f"{h.start:.2f} … {h.stop:.2f}" for h in rows]
        columns = {
            "method": Column([self.method] * len(rows), shown="files"),
            "kind": Column([self.kind] * len(rows), shown="files"),
            "recording": Column([h.recording for h in rows]),
            "start_s": Column([float(h.start) for h in rows], "part [s]", cells=parts, align="<"),
            "stop_s": Column([float(h.stop) for h in rows], shown="files"),
            "error_in_band_percent": _percent(rows, "total_in_band", f"error % < {band:g} Hz"),
            "error_percent": _percent(rows, "total", "all"),
            "replay_percent": percent_column(
                [nan if h.replay is None else h.replay.total for h in rows], "replay %"
            ),
            "band_hz": Column(_percent(rows, "band", "").values, shown="files"),
            "failure": Column([h.failure for h in rows], shown="files"),
        }
        meanings = {
            "error_percent": "‖error‖/‖τ‖ over all joints, all frequencies",
            "error_in_band_percent": "the same below band_hz, the highest frequency of the motion",
        }
        return Table("folds", columns, meanings)

    def joint_table(self) -> Table:
        """One row for each joint, over all stretches."""
        e, replay = self.prediction, self.replay
        columns = {
            "joint": Column(e.joint_names),
            "rms_error_in_band": Column(e.rms_in_band, f"rms < {e.band:g} Hz", digits=3),
            "error_in_band_percent": Column(e.relative_in_band, "%", digits=3),
            "rms_error": Column(e.rms, "rms, all", digits=3),
            "error_percent": Column(e.relative, "%", digits=3),
            "torque_unit": Column(e.units, "unit"),
        }
        if replay is not None:
            columns |= {
                "replay_rms": Column(replay.torque, "replay: torque rms", digits=3),
                "replay_percent": Column(replay.relative, "%", digits=3),
                "position_rms": Column(replay.position, "position rms", digits=3),
                "position_unit": Column(replay.position_units, "unit"),
            }
        return Table("joints", columns, title="Errors on held-out motion joint by joint")

    def sentences(self) -> list[str]:
        """The warning, failures and notes."""
        failed = [f"Failed: {text}" for text in self.failures]
        return [text for text in (self.warning, *failed, *self.notes) if text]


def cross_validate(
    problem: Problem,
    method: Method | str = "piv",
    *,
    folds: int = 5,
    gap: float | None = None,
    recording: Recording | Sequence[Recording] | None = None,
    identification: Identification | None = None,
    progress: Say | None = None,
) -> CrossValidation:
    """Judge a method on motion that it was not fitted to.

    Standstill before and after the motion is neither fitted nor judged in folds. The estimates
    without a block share smoothing, noise models, weights and instruments with that of the whole
    record, see `pivident.judgement.validation.held_out.fold_estimates`.

    Args:
        problem: what is given.
        method: a method or its name.
        folds: number of contiguous blocks, or the nearest number that the motion has room for; 0:
            nothing is held out. The result says so. The motion of a second recording is scored in
            so many blocks.
        gap: left out on either side of a held-out block [s]; None: two periods of the highest
            frequency of the motion, 0.1 s for 20 Hz.
        recording: one or several recordings that are not in the problem; they are judged on
            instead of blocks.
        identification: fit of the method to all of the problem, if it is there already.
        progress: called with one line at each stage.

    Returns:
        Errors on the held-out motion, per block and together.

    Raises:
        ExperimentError: an impossible gap, or a second recording that is the fitted one.
        IdentificationError: the method fails on the whole record, or on every fold.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> recording = pv.simulate(robot, loop, duration=5.0, encoder=1e-5).recording
        >>> problem = pv.Problem(robot, (recording,), loop)
        >>> print(pv.cross_validate(problem, "piv", folds=3))
        IDIM-PIV on 3 held-out blocks, gaps of 0.1 s: torque error 0.23 % below 20 Hz, ...
    """
    with Stages.of(progress) as say:
        motion = JudgedMotion.of(problem, recording)
        judged = judged_on(motion, method, folds, gap, identification, say)
    if identification is None:
        warn_of(judged.identification)
    if any(held.prediction is None for held in judged.held_out):
        warn(f"{judged.method} failed without some of the blocks", FailedFoldWarning)
    return judged


def judged_on(
    motion: JudgedMotion,
    method: Method | str,
    folds: int,
    gap: float | None,
    identification: Identification | None,
    say: Say,
) -> CrossValidation:
    """The same on motion that is there already; arguments as for :func:`cross_validate`."""
    problem, moving = motion.problem, motion.moving
    found = identification or identify(problem, method, say)
    if (smaller := narrowed(problem, found)) is not problem:
        problem, motion = smaller, replace(motion, problem=smaller)
    fitted = [Piece(k, *part) for k, part in enumerate(moving)]
    training = pooled([motion.fitted[p.recording].score(found, [p.span])[0] for p in fitted])
    notes = _replay_notes(problem)
    if motion.unseen:
        unseen = [judge.recording.samples for judge in motion.unseen]
        pieces = [
            p for k, samples in enumerate(unseen) for p in equal_blocks(k, samples, max(folds, 1))
        ]
        held_out = _judged(motion, found, pieces)
        return _checked(
            CrossValidation(found.method, "second recording", found, held_out, training, 0.0, notes)
        )
    division = motion.division(folds, gap)
    if division.reason:
        notes = (*notes, division.line)
    if division.count == 0:
        held_out = _judged(motion, found, fitted)
        return _checked(
            CrossValidation(found.method, "training only", found, held_out, training, 0.0, notes)
        )
    gap = division.gap
    divided = contiguous_folds(problem.recordings, moving, division.count, gap)
    solved = found if found.equations is not None else identify(problem, method, say)
    stretches: list[HeldOut] = []
    refit = "sums" if solved.method_used is None else solved.method_used.refit
    if refit == "sums":
        estimates = estimates_without(solved, moving, divided)
    else:
        from pivident.judgement.validation.held_out.folds_from_rows import refitted_without

        estimates = refitted_without(refit, problem, solved, divided)
    for number, (fold, estimate) in enumerate(zip(divided, estimates, strict=True), start=1):
        say(f"fold {number} of {len(divided)}")
        stretches += _judged(motion, estimate, fold.held_out)
    notes += _repetition_notes(problem)
    return _checked(
        CrossValidation(
            found.method, "folds", found, tuple(stretches), training, gap, notes, len(divided)
        )
    )


def _judged(
    motion: JudgedMotion, found: Identification | IdentificationError, pieces: Sequence[Piece]
) -> tuple[HeldOut, ...]:
    """Score an estimate on pieces of recordings, by prediction and by replay.

    Where there is no estimate, the reason is kept.
    """
    stretches, judges = [], motion.unseen or motion.fitted
    if isinstance(found, IdentificationError):
        return tuple(_stretch(judges[p.recording], p, failure=str(found)) for p in pieces)
    for k in dict.fromkeys(piece.recording for piece in pieces):
        own, judge = [p for p in pieces if p.recording == k], judges[k]
        spans = [p.span for p in own]
        replays, simulations, failure = _simulated(motion, judge, found, spans)
        for piece, error, replay, simulation in zip(
            own, judge.score(found, spans), replays, simulations, strict=True
        ):
            made = _stretch(judge, piece, found, error, replay, failure)
            stretches.append(replace(made, simulation=simulation))
    return tuple(stretches)


def _simulated(
    motion: JudgedMotion, judge: Judge, found: Identification, spans: Sequence[slice]
) -> tuple[Sequence[ReplayError | None], Sequence[SimulationError | None], str]:
    """Errors of the replayed loop and of simulated positions on each span, and what failed."""
    none, used = [None] * len(spans), found.instruments
    replays: Sequence[ReplayError | None] = none
    if motion.replays and (used is None or used.kind == "loop"):
        try:
            replays = motion.replays[judge].score(found, spans)
        except (SimulationDiverged, IndefiniteMass) as reason:
            return none, none, f"the loop cannot be simulated with this estimate: {reason}"
    if found.simulation is not None and found.simulation.loop == "open":
        from pivident.judgement.validation.held_out.replay import OpenLoop

        try:
            return replays, OpenLoop(motion.problem, judge).score(found, spans), ""
        except (SimulationDiverged, IndefiniteMass) as reason:
            text = f"the open loop cannot be simulated with this estimate: {reason}"
            return replays, none, text
    loop = motion.problem.loop
    if loop is None or loop.reference == "smoothed":  # follows the measurement by itself
        return replays, none, ""
    return replays, [None if own is None else SimulationError.of(own) for own in replays], ""


def _stretch(
    judge: Judge,
    piece: Piece,
    found: Identification | None = None,
    error: PredictionError | None = None,
    replay: ReplayError | None = None,
    failure: str = "",
) -> HeldOut:
    r = judge.recording
    start, stop = (r.start_time + k / r.rate for k in (piece.start, piece.stop))
    return HeldOut(r.name, start, stop, found, error, replay, failure)


def _checked(result: CrossValidation) -> CrossValidation:
    """Refuse a result in which every fold failed."""
    if not any(h.prediction is not None for h in result.held_out):
        raise IdentificationError(
            f"{result.method} fails on every fold, the first time with: {result.failures[0]}",
            advice="ask for more folds, so that each leaves more to fit",
        )
    return result


def _replay_notes(problem: Problem) -> tuple[str, ...]:
    """What the replay of this loop means."""
    if problem.loop is not None and problem.loop.reference == "smoothed":
        return (
            "The replayed loop is virtual: its reference is the measured motion itself, so its "
            "position error says nothing about the estimate, and its torque error says little.",
        )
    return ()


def _repetition_notes(problem: Problem) -> tuple[str, ...]:
    """What folds of a repeated motion mean."""
    repeated = find_repetition(problem.recordings)
    if repeated is None:
        return ()
    return (
        f"The motion repeats ({repeated.description}): what a block leaves out is fitted "
        "elsewhere, so these are errors on a repetition, not on new motion. Judge on a different "
        "recording.",
    )


def percent_column(values: Sequence[float], title: str) -> Column:
    """Percentages with two decimals, – where there is none."""
    cells = ["–" if isnan(x) else f"{x:.2f}" for x in values]
    return Column(np.array(values, dtype=float), title, cells=cells)


def _percent(rows: Sequence[HeldOut], name: str, title: str) -> Column:
    """A torque error of each stretch."""
    errors = (h.prediction for h in rows)
    return percent_column([nan if e is None else getattr(e, name) for e in errors], title)
