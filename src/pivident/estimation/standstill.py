"""Standstill, and what a prefilter remembers of it: used where they are worth it.

At standstill dry friction takes any value up to its level, and the residual may be many times that
of the motion; noise that the smoothed speed has left is multiplied by Coulomb's term. A prefilter
that inverts a controller carries that into the samples after it. The residual decides, joint by
joint: of c + m samples, m have r times the mean square of the other c at low frequencies. An
estimate from all of them, weighted alike, has the variance (c + r m)/(c + m)² of one sample's, and
one from the c alone 1/c: the m are left out where

    r > 2 + m/c

The c are in motion with no standstill in the prefilter's memory. Without enough of them nothing is
known, and standstill is left out. That of the legs of a floating base is left out in any case: no
simulated loop makes the instruments, and those from the record do not cure what noise of a speed
makes of a sign that bends there, which the residual does not show.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pivident.estimation.equation_record import EquationRecord
from pivident.estimation.problem import Problem
from pivident.foundation.threads import run_in_threads
from pivident.loop.motion.motion import (
    MOTION_BAND,
    Kinematics,
    measured_samples,
    usable_samples,
)
from pivident.signals.filters import butterworth_sections, forwards_and_backwards
from pivident.signals.prefilter import Prefilter

#: Band of the comparison [Hz]: the half of the motion's band that holds nearly all of the motion.
BAND = 0.5 * MOTION_BAND

#: Samples without standstill in memory that the comparison needs.
MIN_ROWS = 200


class Worth(NamedTuple):
    """What is worth using, by joint, each of shape (joints,)."""

    standstill: np.ndarray  # samples at standstill
    memory: np.ndarray  # samples in motion that a prefilter has filtered with standstill in memory


def worth_using(
    problem: Problem,
    filters: Sequence[Prefilter],
    records: Sequence[EquationRecord],
    residuals: Sequence[np.ndarray],
) -> Worth:
    """What the residual says about standstill and the samples after it.

    ``residuals``: τ - Φθ of each recording, shape (joints, samples).
    """
    rows, squares = np.zeros((2, 3, len(filters)))
    for record, residual in zip(records, residuals, strict=True):
        moving, valid = moving_samples(problem, record), valid_samples(record)
        rate = record.kinematics.recording.rate

        def add(j: int, record=record, residual=residual, moving=moving, rate=rate, valid=valid):
            transient = filters[j].transient()
            late = np.arange(valid.shape[1]) >= record.kinematics.start + transient
            usable = valid[j] & late & reached_by_measured(record.kinematics, j, transient)
            settled = without_recent(moving[j], transient)
            white = filters[j].stream(1).process(residual[j : j + 1])[0]
            # without standstill, whose squares would spread to the samples beside it
            motion = _squares_in_band(np.where(usable & moving[j], white, 0.0), rate)
            whole = _squares_in_band(np.where(usable, white, 0.0), rate)
            groups = (moving[j] & settled, motion), (moving[j] & ~settled, motion)
            for i, (group, own) in enumerate((*groups, (~moving[j], whole))):
                rows[i, j] += np.sum(usable & group)
                squares[i, j] += own[usable & group].sum()

        run_in_threads(add, range(len(filters)))
    settled, others = rows[0], rows[1:]
    ratio = squares[1:] * settled / np.maximum(squares[0] * others, 1e-300)
    worth = ratio <= 2.0 + others / np.maximum(settled, 1.0)
    enough = settled > MIN_ROWS
    standstill = enough & worth[1] & (problem.mask == "auto")
    if problem.robot.base_motion == "measured":
        standstill[problem.robot.base_joints :] = False
    return Worth(standstill, ~enough | worth[0] | standstill)


def moving_samples(problem: Problem, record: EquationRecord) -> np.ndarray:
    """Samples that the mask keeps, shape (joints, samples); motions of a record ask both speeds."""
    kin, motion = record.kinematics, record.motion
    limits = problem.speed_limits(kin.recording)
    moving = limits.moving(kin.dq if motion is None else motion.dq)
    if motion is not None and motion.from_record:
        moving &= limits.moving(kin.dq)
    return moving


def valid_samples(record: EquationRecord) -> np.ndarray:
    """Samples that may be used whatever the speed, shape (joints, samples)."""
    valid, motion = usable_samples(record.kinematics), record.motion
    return valid if motion is None or motion.valid is None else valid & motion.valid


def reached_by_measured(kinematics: Kinematics, joint: int, transient: int) -> np.ndarray:
    """Samples of a joint that a filter reaches over measured ones alone, shape (samples,)."""
    measured = np.broadcast_to(measured_samples(kinematics)[joint], kinematics.q.shape[1:])
    return measured if measured.all() else without_recent(measured, transient)


def without_recent(used: np.ndarray, length: int) -> np.ndarray:
    """Samples in use that have none but such among the ``length`` samples before them.

    ``used``: shape (samples,); before the first sample none is.
    """
    index = np.arange(used.size)
    return index - np.maximum.accumulate(np.where(used, -1, index)) > length


def _squares_in_band(signal: np.ndarray, rate: float) -> np.ndarray:
    """Squares of a signal at low frequencies, shape (samples,)."""
    low_pass = butterworth_sections(2, min(BAND, rate / 16.0), rate)
    return forwards_and_backwards(low_pass, signal, 9) ** 2
