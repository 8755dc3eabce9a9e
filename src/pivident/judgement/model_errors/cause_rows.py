"""Rows on which causes are compared: below the highest frequency of the motion.

The residual of the estimate, on the measured motion, and the columns of model and causes, on the
motion that makes the instruments, pass the same low-pass without phase, weighted by what the
estimate holds for noise, and are thinned out to what the band needs. Samples that the estimate
leaves out are left out with those that the low-pass mixes with them.

Signals of a record behind a low-pass without phase, at the few rows that its band needs.

A filter without phase is a gain by frequency. Of the spectrum of a record only what lies below half
the rate of the rows is kept, and turned back at that rate: filter and thinning in one. Signals that
hold nothing far above the band may come at a fraction of the rate. The record is taken for periodic
on the way, so rows near its ends are to be left out.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.estimation.standstill import without_recent
from pivident.foundation.threads import run_in_threads
from pivident.judgement.model_errors.cause import (
    SMOOTH_SAMPLES_PER_PERIOD,
    Cause,
    RecordMotion,
    stride_of,
    thinned,
)
from pivident.judgement.model_errors.cause_sums import CauseSums, JointRows
from pivident.judgement.validation.held_out.prediction import motion_band
from pivident.loop.motion.motion import Kinematics, Motion, measured_samples
from pivident.signals.bandpass import bandpass_response
from pivident.signals.filters import fast_length

#: Rows that are kept for each period of the highest frequency, at least.
ROWS_PER_PERIOD = 4.0
#: Blocks of the motion that are held out in turn, all recordings together.
BLOCKS = 10
#: Time over which the low-pass mixes rest and motion, in periods of the highest frequency …
MIXED = 1.0
#: … and over which weight and low-pass may still show what static friction holds at rest.
SHOWN = 4.0
#: Share of the samples in use that has to be left without those that are mixed.
FEWEST = 0.25
#: Time over which a filter remembers to either side [s].
MEMORY = 0.5
#: Periods of the highest frequency that are left out at the ends of a record.
ENDS = 3.0
#: Size below which a number is zero; products of such would be denormal, and slow.
VANISHING = 1e-150
#: Every so many samples of a signal are asked first whether it is zero.
PROBED = 16
#: Signals that are filtered together, as many as stay in the cache of a processor on the way.
TOGETHER = 8


@dataclass(frozen=True)
class Grid:
    """Which samples of a record are looked at.

    Attributes:
        rate: of the samples that columns are made on [Hz].
        stride: of these samples, in those of the record.
        fraction: stride of smooth columns, in these samples.
        step: that of the rows, likewise.
    """

    rate: float
    stride: int
    fraction: int
    step: int

    @classmethod
    def of(cls, kinematics: Kinematics, band: float) -> Grid:
        """As few as a band needs [Hz]."""
        stride = stride_of(kinematics.recording.rate, band)
        rate = kinematics.recording.rate / stride
        fraction = max(1, int(rate / (SMOOTH_SAMPLES_PER_PERIOD * band)))
        step = fraction * max(1, int(rate / (ROWS_PER_PERIOD * band * fraction)))
        return cls(rate, stride, fraction, step)


@dataclass(frozen=True)
class BandRows:
    """Every so many samples of a record, as far as they are not near its ends.

    Attributes:
        rate: of the samples [Hz].
        band: highest frequency that is kept [Hz].
        step: samples from one row to the next.
        count: rows of the whole record, its ends and a few beyond them included.
        kept: those that are used.
    """

    rate: float
    band: float
    step: int
    count: int
    kept: slice

    @classmethod
    def of(cls, samples: int, rate: float, band: float, step: int, span: slice) -> BandRows:
        """Rows of a record of so many samples; ``span``: samples at which rows may be."""
        count = fast_length(-(-samples // step))
        first, last = -(-span.start // step), -(-span.stop // step)
        return cls(rate, band, step, count, slice(first, max(first, last)))

    @property
    def at(self) -> np.ndarray:
        """Samples at which the rows are, shape (rows,)."""
        return np.arange(self.kept.start, self.kept.stop) * self.step

    @property
    def samples(self) -> int:
        """Samples that the rows of the whole record span."""
        return self.count * self.step

    @property
    def frequencies(self) -> np.ndarray:
        """Of the spectrum that is kept [Hz], shape (count // 2 + 1,)."""
        return np.fft.rfftfreq(self.count, self.step / self.rate)

    def gain(self, weight: np.ndarray | None) -> np.ndarray:
        """Gain of the low-pass at these frequencies.

        ``weight``: taps of a further filter, symmetric about the middle one; None: no filter.
        """
        gain = np.abs(bandpass_response(self.frequencies, self.rate, self.band))
        if weight is None:
            return gain
        circle = np.zeros(self.samples)
        half = weight.size // 2
        np.add.at(circle, np.arange(-half, half + 1) % self.samples, weight)
        return gain * np.fft.rfft(circle).real[: gain.size]

    def passed(
        self, signals: Sequence[np.ndarray] | np.ndarray, gain: np.ndarray, fraction: int = 1
    ) -> np.ndarray:
        """Rows of some signals behind a filter, shape (signals, rows).

        Args:
            signals: one sample for every ``fraction`` of the record's, shape (signals, samples).
            gain: of the filter, or of that of each signal, shape (signals, frequencies).
            fraction: a divisor of ``step``.
        """
        length = self.samples // fraction
        gain = np.broadcast_to(gain * fraction / self.step, (len(signals), gain.shape[-1]))
        rows = np.empty((len(signals), self.at.size))
        for first in range(0, len(signals), TOGETHER):
            some = slice(first, first + TOGETHER)
            spectrum = np.fft.rfft(np.asarray(signals[some])[:, :length], length, axis=1)[
                :, : gain.shape[1]
            ]
            spectrum *= gain[some]
            kept = np.fft.irfft(spectrum, self.count, axis=1)[:, self.kept]
            kept[np.abs(kept) < VANISHING] = 0.0
            rows[some] = kept
        return rows


class CauseRows:
    """Rows of all joints and records for some causes.

    ``motions``: the motion that makes the instruments of each record; None: the measured one.
    ``measured``: whether columns are those of the measured motion all the same, but for rough ones.
    ``known``: rows of the same estimate, from which those of the causes they have are taken over.
    """

    def __init__(
        self,
        problem: Problem,
        found: Identification,
        causes: Sequence[Cause],
        kinematics: Sequence[Kinematics],
        motions: Sequence[Motion | None],
        measured: bool = False,
        known: CauseRows | None = None,
    ) -> None:
        self.problem, self.found, self.causes = problem, found, causes
        self.kinematics, self.motions = kinematics, motions
        self.measured, self.known = measured, known
        self.band = min(motion_band(r) for r in problem.recordings)
        counts = [cause.count for cause in causes]
        self.first = len(found.theta) + np.concatenate([[0], np.cumsum(counts)]).astype(int)
        self.joints: list[list[JointRows]] = []
        began = 0.0
        for number, (kin, motion) in enumerate(zip(kinematics, motions, strict=True)):
            self.joints.append(self._rows(number, kin, motion, began))
            began += kin.recording.duration
        self.known = None  # its rows are not kept beside these

    def with_causes(self, causes: Sequence[Cause]) -> CauseRows:
        """The same for other causes, some of which may be the same."""
        return CauseRows(
            self.problem, self.found, causes, self.kinematics, self.motions, self.measured, self
        )

    def _of(self, k: int, number: int) -> tuple[np.ndarray, ...]:
        """Number of the column and joint of each signal of a cause in a record, and the rows."""
        parts = []
        for j, record in enumerate(self.joints[number]):
            own = slice(*np.searchsorted(record.columns, self.first[k : k + 2]))
            columns = record.columns[own] - self.first[k]
            parts.append((columns, np.full(columns.size, j), record.x[own]))
        return tuple(map(np.concatenate, zip(*parts, strict=True)))

    def _rows(
        self, number: int, kin: Kinematics, motion: Motion | None, began: float
    ) -> list[JointRows]:
        """Rows of one record."""
        rate, regressor, theta = kin.recording.rate, self.regressor, self.found.theta
        grid = Grid.of(kin, self.band)
        rows = self._band_rows(kin, grid)
        measured = self._at(kin, rate, grid, number, began)
        made = measured if motion is None else self._at(motion, rate, grid, number, began)
        residual = thinned(kin.tau, rate, grid.stride) - measured.torque
        gains = [rows.gain(self._weight(j, rate, grid.rate)) for j in range(len(residual))]
        own = measured if self.measured else made
        model = regressor.packed(
            own.q, own.dq, own.ddq, inner=regressor.inner(own.q, own.dq, own.ddq, theta)
        )
        causes = self._columns(own, made, grid, rows, np.array(gains))
        valid = getattr(motion, "valid", None)
        allowed = np.ones(rows.at.size, bool) if valid is None else valid[:: grid.stride][rows.at]
        used = self._used(number, kin)[:, :: grid.stride]
        known = np.broadcast_to(measured_samples(kin), kin.q.shape)[:, :: grid.stride]
        reaches = [int(np.ceil(periods * grid.rate / self.band)) for periods in (MIXED, SHOWN)]
        out: list[JointRows | None] = [None] * self.problem.robot.size

        def thin(j: int) -> None:
            columns = regressor.columns_of(j)
            here = [(numbers[joint == j], x[joint == j]) for numbers, joint, x in causes]
            near, far = (without_neighbours(used[j], reach)[rows.at] for reach in reaches)
            free = allowed & known[j][rows.at]
            phi = rows.passed(model[regressor.offsets[j] : regressor.offsets[j + 1]], gains[j])
            left, rest = rows.passed(
                np.vstack([residual[j], np.where(used[j], 0.0, residual[j])]), gains[j]
            )
            tau = left + theta[columns] @ phi
            counts = rows_worth_using(left, rest, free & near, free & far)
            x = np.concatenate([phi, *(own for _, own in here)])
            for values in (x, tau):
                values *= counts
            out[j] = JointRows(np.concatenate([columns, *(own for own, _ in here)]), x, tau)

        run_in_threads(thin, range(len(out)))
        return [r for r in out if r is not None]

    def _band_rows(self, kin: Kinematics, grid: Grid) -> BandRows:
        """Rows of one record without its ends, which the low-pass and the weight spoil."""
        margin = int(np.ceil(max(ENDS / self.band, MEMORY) * grid.rate))
        span = slice(-(-kin.start // grid.stride) + margin, kin.stop // grid.stride - margin)
        samples = -(-kin.q.shape[1] // grid.stride)
        return BandRows.of(samples, grid.rate, self.band, grid.step, span)

    def _used(self, number: int, kin: Kinematics) -> np.ndarray:
        """Samples at which the model is asked, shape (joints, samples): those of the estimate."""
        equations = self.found.equations
        if equations is not None and equations.full_rate:
            return equations.records[number].used
        moving = np.abs(kin.dq) > self.problem.low_speeds(kin.recording)[:, None]
        return moving & measured_samples(kin)

    def _weight(self, j: int, rate: float, working: float) -> np.ndarray | None:
        """|L_j| below the highest frequency of the motion as a filter without phase.

        What the estimate holds for noise decides which of these frequencies say most. Shape
        (taps,); None: all say the same.
        """
        equations = self.found.equations
        if equations is None or not equations.full_rate or not equations.filters:
            return None
        half = int(MEMORY * working)
        frequency = np.fft.rfftfreq(2 * half, 1.0 / working)
        gain = np.abs(equations.filters[j].response(np.minimum(frequency, self.band), rate))
        taps = np.fft.fftshift(np.fft.irfft(gain / gain.max(), 2 * half))
        return np.append(taps, taps[0]) * np.hanning(2 * half + 1)

    def _at(
        self, motion: Motion, rate: float, grid: Grid, number: int, began: float
    ) -> RecordMotion:
        """A motion on every so many samples."""
        q, dq, ddq = (thinned(x, rate, grid.stride) for x in motion.stretch(slice(None)))
        theta = self.found.theta
        return RecordMotion(self.regressor, theta, q, dq, ddq, grid.rate, number, began)

    def _columns(
        self, own: RecordMotion, clean: RecordMotion, grid: Grid, rows: BandRows, gains: np.ndarray
    ) -> list[tuple[np.ndarray, np.ndarray, np.ndarray]]:
        """Rows of each cause on a motion, of rough ones on a clean one, without those all zero.

        ``gains``: of each joint's filter. Number of the column and joint of each, shape (signals,),
        and the rows, shape (signals, rows).
        """
        smooth = own.every(grid.fraction)
        none = np.zeros(0, int), np.zeros(0, int), np.zeros((0, rows.at.size))
        made = [none] * len(self.causes)
        before = self.known
        place = {} if before is None else {cause: k for k, cause in enumerate(before.causes)}
        for asked in {own, clean}:
            asked.torque, asked.load, asked.transmitted  # noqa: B018 - before several threads ask
        smooth.torque  # noqa: B018

        def make(k: int) -> None:
            cause = self.causes[k]
            if before is not None and cause in place:
                number, joint, passed = before._of(place[cause], own.number)
                made[k] = self.first[k] + number, joint, passed
                return
            motion, fraction = clean if cause.is_rough else own, 1
            if cause.is_smooth:
                motion, fraction = smooth, grid.fraction
            columns = cause.columns(motion)
            number, joint = np.nonzero(_is_alive(columns))
            passed = rows.passed(columns[number, joint], gains[joint], fraction)
            made[k] = self.first[k] + number, joint, passed

        run_in_threads(make, range(len(made)))
        return made

    @property
    def regressor(self) -> Regressor:
        """The model that was estimated."""
        equations = self.found.equations
        return self.problem.regressor if equations is None else equations.regressor

    def variances(self, theta: np.ndarray) -> np.ndarray:
        """Mean square of each joint's residual τ - Xθ in the band, shape (joints,)."""
        squares, rows = np.zeros((2, self.problem.robot.size))
        for record in self.joints:
            for j, r in enumerate(record):
                squares[j] += np.sum(r.residual(theta) ** 2)
                rows[j] += np.count_nonzero(r.tau)
        return np.maximum(squares / np.maximum(rows, 1.0), 1e-300)

    def sums(self, variance: np.ndarray) -> CauseSums:
        """All sums, with weights 1/λ_j."""
        return CauseSums(self.joints, variance, self.first, BLOCKS)


def _is_alive(columns: np.ndarray) -> np.ndarray:
    """Which signals are not zero throughout, shape (…); signals have time last."""
    alive = np.asarray(columns[..., ::PROBED].any(axis=-1))
    alive[~alive] = columns[~alive].any(axis=-1)
    return alive


def without_neighbours(used: np.ndarray, reach: int) -> np.ndarray:
    """Samples in use that have none but such within ``reach`` to either side; shape (samples,).

    All of them where that would leave less than `FEWEST`.
    """
    alone = without_recent(used, reach) & without_recent(used[::-1], reach)[::-1]
    return alone if alone.sum() > FEWEST * used.sum() else used


def rows_worth_using(
    residual: np.ndarray, rest: np.ndarray, near: np.ndarray, far: np.ndarray
) -> np.ndarray:
    """Which of the rows ``near`` to a standstill are used beside those that are ``far`` from it.

    All or none. With r the mean square of what the filters show of standstill in the m rows that
    are nearer, over that of the residual of the c others, they are left out where r > 1 + m/c: they
    then make the variance of an estimate larger (see `pivident.estimation.standstill`).

    ``rest``: the residual of standstill alone, filtered likewise; all of shape (rows,).
    """
    between = near & ~far
    c, m = int(far.sum()), int(between.sum())
    if c == 0 or m == 0:
        return near
    ratio = float(np.mean(rest[between] ** 2) / max(np.mean(residual[far] ** 2), 1e-300))
    return near & far if ratio > 1.0 + m / c else near


def instrument_motions(
    problem: Problem, found: Identification, kinematics: Sequence[Kinematics]
) -> list[Motion | None]:
    """What made the instruments of each record, at its full rate; None: the record itself.

    Those of decimated equations are not kept; a loop is simulated once more.
    """
    if found.equations is not None and found.equations.full_rate:
        return [r.motion for r in found.equations.records]
    used = found.instruments
    if problem.loop is None or used is None or used.kind != "loop":
        return [None] * len(kinematics)
    from pivident.estimation.auxiliary_model import AuxiliaryModel

    return list(AuxiliaryModel(problem, False, kinematics, torque=False).simulate(found.theta))


def smoothed(problem: Problem, found: Identification) -> list[Kinematics]:
    """The smoothed motion of each record: that of the estimate where it has one at full rate."""
    if found.equations is not None and found.equations.full_rate:
        return [r.kinematics for r in found.equations.records]
    return [estimate_kinematics(r, RandomWalk()) for r in problem.recordings]
