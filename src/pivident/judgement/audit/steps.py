"""Samples that are lost or repeated, and instants that tremble, as the motion itself shows them.

With d_k = q_{k+1} - q_k and v_k the median of the two steps before and the two after, all moving
joints step too far by the same share m of a period, d_k = (1 + m) v_k,

    m whole (-1: the sample is repeated):  lost samples
    m of any size at every step:           instants that tremble, unlike their stamps

and m is estimated by least squares over the joints, each weighted with the usual spread of
d_k - v_k. Where the instants tremble, some m are whole by chance: only what stands out counts.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import JITTER_TOLERANCE
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic, at_sample
from pivident.judgement.audit.standstill import still_joints

#: What the checks of a clock look at.
CLOCK = Topic("timing", "Clock")

LOST = FindingKind(CLOCK, "lost", reservation=True)
REPEATED_SAMPLE = FindingKind(CLOCK, "repeated", reservation=True)
HIDDEN_JITTER = FindingKind(CLOCK, "hidden jitter", reservation=True)

#: Distance of a lost or repeated step from all others, in their spread.
CLEAR_STEP = 10.0

#: … and in that of steps between instants that tremble.
ABOVE_TREMBLING = 5.0

#: Intervals that are shorter than this share of the usual one tell nothing of the speed.
SHORTEST = 0.1

#: Share of the roughness of a motion that is left without a sample that was repeated.
REPEATED = 0.25

#: How far from a whole number the samples lost at one place may seem to be.
WHOLE = 0.25

#: … and how far an m is from it that counts as whole.
NEARLY = 0.05

#: Share of the joints' d_k - v_k that one m may leave where it is common to all of them.
COMMON = 0.1

#: Share of the information about m that has to come from the joints beside the best one.
OTHERS = 0.1

#: Share of the steps below the fastest ones, by their information about m.
FASTEST = 0.75

#: Spread of m over that of instants that tremble independently, a normal distribution each.
OF_INSTANTS = 1.81

#: Fewest samples that are looked at.
FEWEST = 50

#: Fewest clear steps by which the trembling of the instants is judged.
MIN_STEPS = 50


@dataclass(frozen=True, eq=False)
class _Steps:
    """What was estimated at each step but the two outermost on either side."""

    share: np.ndarray  # m, in periods
    information: np.ndarray  # about m, in its noise
    misfit: np.ndarray  # weighted squares that one m for all joints leaves
    others: np.ndarray  # information from the joints beside the best one
    speed: np.ndarray  # of every step per period, shape (steps, joints)
    weight: np.ndarray  # of the joints

    def trembling(self, common: bool = False) -> float:
        """Usual size of m where one lost sample is far larger than the noise, in periods.

        Zero where most m are whole; if ``common``, also where no two joints show the same m.
        """
        clear = self.information > CLEAR_STEP**2
        if common:  # where trembling is large no step is clear: the fastest ones tell it
            clear = self.information > np.quantile(self.information, FASTEST)
            clear &= self.others > OTHERS * self.information
        if clear.sum() < MIN_STEPS:
            return 0.0
        m, misfit = self.share[clear], self.misfit[clear]
        alike = not common or np.mean(misfit < COMMON * self.information[clear] * m**2) > 0.5
        whole = np.mean(np.abs(m - np.round(m)) < NEARLY) > 0.5
        return 0.0 if whole or not alike else 1.4826 * float(np.median(np.abs(m)))


def unsteady_steps(
    q: np.ndarray, t: np.ndarray | None = None, even: _Steps | None = None
) -> np.ndarray:
    """Places at which all moving joints step too far, or not at all, at the same time.

    Steps that the stamps t explain, d_k as long as the interval, are none. Nor is one at which the
    arm comes to rest and moves on: without a sample that was repeated the speed is far smoother,
    without one that was not it is not. Returns (places, 2): the sample, and the samples lost behind
    it, -1 where it is repeated. ``even``: its `even_steps`, where they are at hand.
    """
    if len(q) < FEWEST:
        return np.empty((0, 2))
    step, equal = np.diff(q, axis=0), np.ones(len(q) - 1)
    length = equal if t is None or len(t) != len(q) else _lengths(t)
    steps = even or even_steps(q)
    if np.abs(length - 1.0).max() > JITTER_TOLERANCE:  # stamps that tremble explain its steps
        stamped = {tuple(place) for place in _unsteady(_fitted(step, length), 0.0)}
        found = [place for place in _unsteady(steps, 0.0) if tuple(place) in stamped]
        return np.array(found).reshape(-1, 2)
    trembling = steps.trembling()
    least = ABOVE_TREMBLING * trembling
    if least > 1.0 + WHOLE:  # single samples cannot be told, and v_k trembles as well
        least = 2.0 * CLEAR_STEP * trembling
    return _unsteady(steps, least)


def even_steps(q: np.ndarray) -> _Steps:
    """What is estimated at each step of positions, shape (samples, joints), at equal intervals."""
    return _fitted(np.diff(q, axis=0), np.ones(len(q) - 1))


def hidden_jitter(q: np.ndarray, even: _Steps | None = None) -> float:
    """Standard deviation of the instants about equal intervals, in sampling periods.

    Zero where it is below `JITTER_TOLERANCE`, or where no two joints show the same.
    """
    if len(q) < FEWEST:
        return 0.0
    tremble = (even or even_steps(q)).trembling(common=True) / OF_INSTANTS
    return tremble if tremble > JITTER_TOLERANCE else 0.0


def _lengths(t: np.ndarray) -> np.ndarray:
    """Lengths of the intervals in periods, one where the stamps tell nothing."""
    length, usual = np.diff(t), float(np.nanmedian(np.diff(t)))
    length = length / usual if usual > 0.0 else np.ones(len(length))
    return np.where(np.isfinite(length) & (length > SHORTEST), length, 1.0)


def _fitted(step: np.ndarray, length: np.ndarray) -> _Steps:
    """The shares m for steps (steps, joints) of some lengths of time, in periods."""
    speed, length = step / length[:, None], length[2:-2, None]
    around = length * np.median([speed[:-4], speed[1:-3], speed[3:-1], speed[4:]], axis=0)
    excess = step[2:-2] - around
    spread = np.array([_spread(*own) for own in zip(excess.T, around.T, strict=True)])
    with np.errstate(invalid="ignore"):
        weight = np.where(spread > 0, 1.0 / np.where(spread > 0, spread, 1.0) ** 2, 0.0)
        each = np.nan_to_num(weight * around**2)
        information = each.sum(axis=1)
        share = np.nansum(weight * around * excess, axis=1) / np.maximum(information, 1e-300)
        misfit = np.nansum(weight * (excess - share[:, None] * around) ** 2, axis=1)
    others = information - each.max(axis=1)
    return _Steps(share, information, misfit, others, speed, weight)


def _spread(excess: np.ndarray, around: np.ndarray) -> float:
    """Usual size of d_k - v_k of one joint where it moves: at rest there is less of it."""
    moving = np.isfinite(excess) & (around != 0.0)
    own = excess[moving if moving.sum() > MIN_STEPS else np.isfinite(excess)]
    if not own.size:
        return 0.0
    # the staircase of a coarse encoder has a median of zero, and a spread all the same
    return max(1.4826 * float(np.median(np.abs(own))), 0.5 * float(np.std(own)))


def _unsteady(steps: _Steps, least: float) -> np.ndarray:
    """Places (places, 2) of lost and repeated samples, with an m above the least."""
    share, information = steps.share, steps.information
    whole = np.round(share)
    found = (
        (np.abs(share) * np.sqrt(information) > CLEAR_STEP)
        & (np.abs(share) > least)
        & (np.abs(share - whole) < WHOLE)
        & ((whole >= 1) | (whole == -1))
        & (steps.misfit < COMMON * information * share**2)
    )
    found &= (whole >= 1) | _smoother_without(steps.speed, steps.weight)
    at = np.flatnonzero(found)
    return np.column_stack([at + 2, whole[at]])


def _smoother_without(speed: np.ndarray, weight: np.ndarray) -> np.ndarray:
    """Whether the speed is far smoother without a step, for each but the two outermost.

    Smooth is what has small second differences, summed over the joints with their weights.
    """
    before, last, here, following, after = (speed[i : len(speed) - 4 + i] for i in range(5))

    def roughness(*steps: np.ndarray) -> np.ndarray:
        return np.asarray(np.nansum(weight * np.diff(steps, n=2, axis=0) ** 2, axis=(0, 2)))

    without = roughness(before, last, following, after)
    return without < REPEATED * roughness(before, last, here, following, after)


def check_steps(log: Log, rate: float, stamped: bool) -> list[Finding]:
    """Lost and repeated samples, or instants that tremble, in words.

    Args:
        log: a log with positions.
        rate: its sampling rate [Hz].
        stamped: whether it has a regular clock.
    """
    q, clock = log.channels["q"], log.clock
    still = still_joints(q)
    if len(still) == q.shape[1]:  # where nothing moves, no sample is early or late
        return []
    q = np.delete(q, still, axis=1)
    even = even_steps(q) if len(q) >= FEWEST else None
    findings = list(_places(log, unsteady_steps(q, clock, even), stamped))
    tremble = hidden_jitter(q, even) if stamped or clock is None else 0.0
    if tremble:
        late = Quantity(1e3 * tremble / rate, "ms", bound=1e3 * JITTER_TOLERANCE / rate, digits=2)
        text = (
            f"All joints move as if the samples had been taken {late} (standard deviation) off "
            "equal intervals."
        )
        step = "Stamp each sample where it is taken; until then it is noise in all positions."
        findings.append(HIDDEN_JITTER.finding("warning", text, "q", step, {"jitter": late}))
    return findings


def _places(log: Log, steps: np.ndarray, stamped: bool) -> Iterator[Finding]:
    """Findings about lost and repeated samples; steps (places, 2)."""
    for chosen, kind, words, step in (
        (
            steps[:, 1] >= 1,
            LOST,
            "In {n} place(s) all joints skip {m} sample(s) that are missing from the log",
            "The logger dropped samples{s}; cut the recording there, or log with time stamps.",
        ),
        (
            steps[:, 1] == -1,
            REPEATED_SAMPLE,
            "In {n} place(s) a moving arm stands still for one sample: {m} repeated sample(s)",
            "The logger was faster than its source{s}; log at the rate of the control loop.",
        ),
    ):
        if not chosen.any():
            continue
        here = steps[chosen]
        number, first = int(np.abs(here[:, 1]).sum()), int(here[0, 0])
        share = len(here) / max(len(next(iter(log.channels.values()))), 1)
        text = words.format(n=len(here), m=number)
        yield kind.finding(
            "error" if len(here) > 1 or share > 1e-3 else "warning",
            f"{text}, first after sample {first}.",
            "q",
            step.format(s=" although its stamps are regular" if stamped else ""),
            evidence={
                "samples": Quantity(float(number), "samples"),
                **at_sample(first, log.time_of(first)),
            },
        )
