"""Rows on which causes are compared: below the highest frequency of the motion.

Columns and torque pass the same low-pass without phase, weighted by what the estimate holds for
noise, and are thinned out to what the band needs. Samples that the estimate leaves out are left out
with those that the low-pass mixes with them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.identification import Identification
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.methods import RandomWalk
from pivident.estimation.problem import Problem
from pivident.estimation.standstill import without_recent
from pivident.model_errors.cause import Cause
from pivident.model_errors.cause_sums import CauseSums, JointRows, cause_sums
from pivident.model_errors.record_motion import RecordMotion, stride_of
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import Motion
from pivident.signals.bandpass import butterworth
from pivident.threads import run_in_threads
from pivident.validation.held_out.prediction import motion_band

#: Rows that are kept for each period of the highest frequency.
ROWS_PER_PERIOD = 5.0

#: Blocks of the motion that are held out in turn, all recordings together.
BLOCKS = 10

#: Places of the joints in which the rows are sorted, all recordings together.
PLACES = 16

#: Fewest of them in each recording.
FEWEST_PLACES = 4

#: Time over which the low-pass mixes rest and motion, in periods of the highest frequency.
MIXED = 1.0

#: Share of the samples in use that has to be left without those that it mixes.
FEWEST = 0.25

#: Size below which a number is zero; products of such would be denormal, and slow.
VANISHING = 1e-150

#: Cut-off before samples are left out, over the rate of those that stay.
PASSED = 0.4

#: Time over which a filter remembers to either side [s].
MEMORY = 0.5

#: Periods of the highest frequency that are left out at the ends of a record.
ENDS = 3.0


#: Packed columns of the model, shape (entries, samples), and those of all causes, each (joints,
#: samples).
Columns = tuple[np.ndarray, list[np.ndarray]]


class CauseRows:
    """Rows of all joints and records for some causes.

    ``motions``: the motion that makes the instruments of each record; None: the measured one.
    """

    def __init__(
        self,
        problem: Problem,
        found: Identification,
        causes: Sequence[Cause],
        kinematics: Sequence[Kinematics],
        motions: Sequence[Motion | None],
    ) -> None:
        self.problem, self.found, self.causes = problem, found, causes
        self.band = min(motion_band(r) for r in problem.recordings)
        counts = [cause.count for cause in causes]
        self.first = len(found.theta) + np.concatenate([[0], np.cumsum(counts)]).astype(int)
        self.joints: list[list[JointRows]] = []
        began = 0.0
        for number, (kin, motion) in enumerate(zip(kinematics, motions, strict=True)):
            self.joints.append(self._rows(number, kin, motion, began))
            began += kin.recording.duration

    def _rows(
        self, number: int, kin: Kinematics, motion: Motion | None, began: float
    ) -> list[JointRows]:
        """Rows of one record."""
        from scipy.signal import oaconvolve

        rate = kin.recording.rate
        stride = stride_of(rate, self.band)
        working = rate / stride
        step = max(1, int(working / (ROWS_PER_PERIOD * self.band)))
        margin = int(np.ceil(max(ENDS / self.band, MEMORY) * working))
        first, last = -(-kin.start // stride) + margin, kin.stop // stride - margin
        rows = np.arange(first, max(last, first), step)
        count = max(PLACES // len(self.problem.recordings), FEWEST_PLACES)
        place = number * count + places(kin.q[:, ::stride][:, rows], count)
        measured = self._columns(kin, rate, stride, number, began)
        made = measured if motion is None else self._columns(motion, rate, stride, number, began)
        valid = getattr(motion, "valid", None)
        allowed = np.ones(rows.size, bool) if valid is None else valid[::stride][rows]
        used = self._used(number, kin)[:, ::stride]
        reach = int(np.ceil(MIXED * working / self.band))
        regressor = self.regressor
        out: list[JointRows | None] = [None] * self.problem.robot.size

        def thin(j: int) -> None:
            alive = [c for c, column in enumerate(measured[1]) if column[j].any()]
            own = slice(regressor.offsets[j], regressor.offsets[j + 1])
            counts = allowed & without_neighbours(used[j], reach)[rows]
            tau = _passed(kin.tau[j][None], rate, stride)

            weight = self._weight(j, rate, working)

            def low(signals: np.ndarray) -> np.ndarray:
                passed = butterworth(signals.T, working, self.band)
                if weight is not None:
                    passed = oaconvolve(passed, weight[:, None], mode="same", axes=0)
                thin = np.ascontiguousarray(passed[rows].T * counts)
                thin[np.abs(thin) < VANISHING] = 0.0
                return thin

            def both(columns: Columns) -> np.ndarray:
                return low(np.vstack([columns[0][own], *(columns[1][c][j] for c in alive)]))

            x = both(measured)
            y = x if motion is None else both(made)
            index = np.concatenate(
                [regressor.columns_of(j), len(self.found.theta) + np.array(alive, int)]
            )
            out[j] = JointRows(index, x, y, low(tau)[0], place)

        run_in_threads(thin, range(len(out)))
        return [r for r in out if r is not None]

    def _used(self, number: int, kin: Kinematics) -> np.ndarray:
        """Samples at which the model is asked, shape (joints, samples): those of the estimate."""
        equations = self.found.equations
        if equations is not None and equations.full_rate:
            return equations.records[number].used
        return np.abs(kin.dq) > self.problem.low_speeds(kin.recording)[:, None]

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

    def _columns(
        self, motion: Motion, rate: float, stride: int, number: int, began: float
    ) -> Columns:
        """Columns of the model and of the causes, on every so many samples."""
        theta, regressor = self.found.theta, self.regressor
        q, dq, ddq = (_passed(x, rate, stride) for x in motion.stretch(slice(None)))
        own = RecordMotion(regressor, theta, q, dq, ddq, rate / stride, number, began)
        packed = regressor.packed(q, dq, ddq, inner=regressor.inner(q, dq, ddq, theta))
        made = [np.zeros((0, *q.shape))] * len(self.causes)
        own.torque, own.load  # noqa: B018 - made once, before several threads ask for them

        def make(k: int) -> None:
            made[k] = self.causes[k].columns(own)

        run_in_threads(make, range(len(made)))
        return packed, [column for own in made for column in own]

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
                squares[j] += np.sum((r.tau - theta[r.columns] @ r.x) ** 2)
                rows[j] += np.count_nonzero(r.tau)
        return np.maximum(squares / np.maximum(rows, 1.0), 1e-300)

    def sums(self, variance: np.ndarray) -> CauseSums:
        """All sums, with weights 1/λ_j."""
        return cause_sums(self.joints, variance, len(self.found.theta), int(self.first[-1]), BLOCKS)


def places(q: np.ndarray, count: int) -> np.ndarray:
    """Number of the place at which each row is: the nearest of positions equally far apart in time.

    ``q``: shape (joints, rows); distances are over the spread of each joint.
    """
    spread = np.std(q, axis=1, keepdims=True)
    scaled = q / np.where(spread > 0.0, spread, 1.0)
    centres = scaled[:, np.linspace(0, q.shape[1] - 1, count + 2)[1:-1].astype(int)]
    squares = [np.sum((scaled - centre[:, None]) ** 2, axis=0) for centre in centres.T]
    return np.argmin(squares, axis=0)


def without_neighbours(used: np.ndarray, reach: int) -> np.ndarray:
    """Samples in use that have none but such within ``reach`` to either side; shape (samples,).

    All of them where that would leave less than `FEWEST`.
    """
    alone = without_recent(used, reach) & without_recent(used[::-1], reach)[::-1]
    return alone if alone.sum() > FEWEST * used.sum() else used


def instrument_motions(
    problem: Problem, found: Identification, kinematics: Sequence[Kinematics]
) -> list[Motion | None]:
    """What made the instruments of each record, at its full rate; None: the record itself.

    Those of decimated equations are not kept; a loop is simulated once more.
    """
    from pivident.estimation.auxiliary_model import AuxiliaryModel

    if found.equations is not None and found.equations.full_rate:
        return [r.motion for r in found.equations.records]
    used = found.instruments
    if problem.loop is None or used is None or used.kind != "loop":
        return [None] * len(kinematics)
    return list(AuxiliaryModel(problem, False, kinematics, torque=False).simulate(found.theta))


def smoothed(problem: Problem, found: Identification) -> list[Kinematics]:
    """The smoothed motion of each record: that of the estimate where it has one at full rate."""
    if found.equations is not None and found.equations.full_rate:
        return [r.kinematics for r in found.equations.records]
    return [estimate_kinematics(r, RandomWalk()) for r in problem.recordings]


def _passed(x: np.ndarray, rate: float, stride: int) -> np.ndarray:
    """Every so many samples behind a low-pass that leaves the band alone; time last."""
    if stride > 1:  # accelerations are noisy where a motion has long ended
        x = butterworth(x.T, rate, PASSED * rate / stride)[::stride].T
    return np.ascontiguousarray(x)
