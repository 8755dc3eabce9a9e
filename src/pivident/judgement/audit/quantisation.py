"""The grid on which values were rounded: counts of an encoder, digits of a text file.

Torques that keep a value for a while though their joint moves, in words.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.data.logs.bad_samples import frozen_samples
from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import runs_of
from pivident.data.recording.checks import TOLERATED_CLIPPING
from pivident.estimation.kinematics import ABOVE_HALF_POWER
from pivident.estimation.signal_recipes import SAMPLES_OF_A_PERIOD
from pivident.foundation.text.finding import (
    Finding,
    FindingKind,
    Quantity,
    Severity,
    Topic,
    at_sample,
)
from pivident.judgement.audit.spoilt_checks import COMPARISONS
from pivident.judgement.audit.timing import Timing, at_equal_intervals
from pivident.loop.motion.motion import MOTION_BAND
from pivident.signals.bandpass import bandpass
from pivident.signals.random_walk import half_power_frequencies

#: What this check looks at.
QUANTISATION = Topic("quantisation", "Quantisation")

DIGITS = FindingKind(QUANTISATION, "digits")
STEP = FindingKind(QUANTISATION, "step")

#: Values examined of a channel.
MAX_VALUES = 20_000

#: Share of the gaps between values that must be whole steps.
ON_GRID = 0.97

#: Fewer levels than this over the motion of a joint: the derivatives are made of steps.
MIN_LEVELS = {"q": 5000, "q_ref": 0, "tau": 200}

#: Share of rounding noise in the accelerations of a joint from which on it matters: inertias then
#: come out too small by its square.
ROUNDED = 0.2

#: Counts that a joint passes in a period of the cut-off, on average, below which rounding is no
#: white noise but a staircase; a count that lasts longer than this is a standstill [s].
WHITE, MAX_COUNT = 20.0, 0.1

#: Digits beyond which a text file does not limit a log.
ENOUGH_DIGITS = 7


@dataclass(frozen=True)
class Grid:
    """Rounding of one signal."""

    name: str  # name of the signal
    step: float  # distance of neighbouring values, in the unit of the file, NaN where there is none
    levels: float  # range of the signal in steps
    digits: int | None  # significant ones that all values have at most, None for more


@dataclass(frozen=True, eq=False)
class Quantisation:
    """Grids of all signals."""

    findings: tuple[Finding, ...]
    grids: tuple[Grid, ...]  # of each signal


def check_quantisation(log: Log, timing: Timing) -> Quantisation:
    """Find the grid of every signal and say what it means."""
    findings, grids = [], []
    for name, values in log.signals().items():
        finite = values[np.isfinite(values)]
        if finite.size < 20 or np.ptp(finite) == 0:
            continue
        grid = find_grid(name, finite)
        grids.append(grid)
        rounded = math.nan
        if name.startswith("q of ") and timing.rate and grid.levels < MIN_LEVELS["q"]:
            uniform = at_equal_intervals(values[:, None], log.clock, timing)[:, 0]
            cutoff, moving = _cutoff(uniform, timing.rate), _moving_share(finite, timing.rate)
            passed = float(np.abs(np.diff(finite)).sum()) / grid.step
            if passed * timing.rate > WHITE * cutoff * moving * finite.size:
                rounded = _rounded_share(grid, uniform, timing.rate, cutoff, moving)
        findings += _findings(log, name, grid, finite, rounded)
    return Quantisation(tuple(findings), tuple(grids))


def find_grid(name: str, values: np.ndarray) -> Grid:
    """The step of a signal and the digits it was written with."""
    digits = significant_digits(values)
    step = _step(values)
    if digits is not None:
        # Small values are written on a finer decimal grid, on which the encoder's own shows.
        step, decade = math.nan, 10.0 ** math.ceil(math.log10(np.abs(values).max()))
        for power in range(5):
            small = values[np.abs(values) < decade / 10**power]
            decimal = decade / 10 ** (power + digits)
            found = _step(small) if small.size > 100 else math.nan
            if found > 3.0 * decimal:
                step = found
    reach = float(np.ptp(values)) / step if math.isfinite(step) else math.nan
    return Grid(name, step, reach, digits)


def _step(values: np.ndarray) -> float:
    """Distance of values Σ gap·n / Σ n² with n = round(gap / step), NaN where there is no grid."""
    middle = len(values) // 2
    levels = np.unique(values[max(0, middle - MAX_VALUES // 2) : middle + MAX_VALUES // 2])
    if levels.size < 4:
        return math.nan
    gaps = np.diff(levels)
    gaps = np.sort(gaps[gaps > 64 * np.spacing(np.abs(levels).max())])
    if gaps.size < 3:
        return math.nan
    return _refined(gaps, float(np.median(gaps[: max(3, gaps.size // 10)])))


def _refined(gaps: np.ndarray, step: float) -> float:
    """The step of which nearly all gaps are multiples, NaN where there is none."""
    for most in (4, 64, 1024):
        used = gaps[gaps < (most + 0.5) * step]
        if not used.size:
            return math.nan
        n = np.maximum(np.round(used / step), 1)
        step = float(np.dot(used, n) / np.dot(n, n))
    used = gaps[gaps < 100.5 * step]
    off = np.abs(used / step - np.round(used / step))
    return step if np.mean(off < 0.1) >= ON_GRID and used.size >= 0.5 * gaps.size else math.nan


def significant_digits(values: np.ndarray) -> int | None:
    """Fewest significant digits that write every value, up to `ENOUGH_DIGITS`."""
    # no decimal of a subnormal number is exact
    some = values[np.abs(values) >= np.finfo(float).tiny][:MAX_VALUES]
    if some.size < 20 or np.all(some == np.round(some)):
        return None  # counts are whole numbers, whatever their digits
    mantissa = some / 10.0 ** np.floor(np.log10(np.abs(some)))
    for digits in range(1, ENOUGH_DIGITS + 1):
        shift = 10.0 ** (digits - 1)
        if np.all(np.abs(mantissa * shift - np.round(mantissa * shift)) < 1e-9 * shift):
            return digits
    return None


def _moving_share(values: np.ndarray, rate: float) -> float:
    """Share of the samples in which a joint moves: no count lasts for long."""
    lasting = np.diff(np.r_[0, np.flatnonzero(np.diff(values)) + 1, values.size])
    return int(lasting[lasting < max(MAX_COUNT * rate, 3)].sum()) / values.size


def _cutoff(values: np.ndarray, rate: float) -> float:
    """Where least squares cuts the accelerations of a joint off [Hz]."""
    cutoff = ABOVE_HALF_POWER * float(half_power_frequencies(values[:, None], rate)[0])
    return min(cutoff, MOTION_BAND, rate / SAMPLES_OF_A_PERIOD)


def _rounded_share(
    grid: Grid, values: np.ndarray, rate: float, cutoff: float, moving: float
) -> float:
    """Rms of rounding noise in the accelerations over theirs, below their cut-off.

    White noise of variance Δ²/12 makes accelerations of variance (Δ²/12)(2/f_s)(2π)⁴ f_c⁵/5 below
    f_c, for the share of the time in which the joint moves. Rounding is as good as white below f_c
    as long as the counts change much faster, however many samples each lasts.
    """
    x = values[:, None] - values.mean()
    motion = float(np.std(bandpass(x, rate, cutoff, at_instants=True).ddq))
    noise = moving * grid.step**2 / 12.0 * 2.0 / rate * (2.0 * math.pi) ** 4 * cutoff**5 / 5.0
    return math.sqrt(noise) / motion if motion > 0 else math.inf


def _findings(log: Log, name: str, grid: Grid, values: np.ndarray, rounded: float) -> list[Finding]:
    """What the grid of one signal means for it; ``rounded``: share in its accelerations."""
    kind, _, joint = name.partition(" of ")
    findings = []
    largest = float(np.abs(values).max())
    if grid.digits is not None:
        coarse = 10.0 ** (math.floor(math.log10(largest)) - grid.digits + 1)
        levels = float(np.ptp(values)) / coarse
        limits = levels < MIN_LEVELS.get(kind, 0) or (kind == "q" and coarse > 3 * grid.step)
        text = (
            f"{name} is written with {grid.digits} significant digits: the largest values are "
            f"rounded to {coarse:.3g}, {levels:.3g} levels over the range."
        )
        step = "Write the log with more digits (%.12g), or as .npz or .parquet." if limits else ""
        findings.append(
            DIGITS.finding(
                "warning" if limits else "ok",
                text,
                name,
                step,
                {"digits": Quantity(float(grid.digits), "digits")},
            )
        )
    if not math.isfinite(grid.step):
        return findings
    few = grid.levels < MIN_LEVELS.get(kind, 0) and not rounded < ROUNDED
    text = f"{name} moves in steps of {grid.step:.4g}, {grid.levels:.4g} of them over its range."
    j = log.joint_names.index(joint) if joint in log.joint_names else None
    if kind == "q" and j is not None:
        text += _counts(log, j, grid.step)
        if math.isfinite(rounded):
            text += f" Rounding makes up {100 * rounded:.2g} % of its accelerations."
    step = ""
    if few:
        step = (
            "Log the position at the encoder's own resolution; speeds and the sign of slow motion "
            "are wrong otherwise."
            if kind == "q"
            else "Log the torque with a finer resolution, or identify over a longer record."
        )
    evidence = {
        "step": Quantity(
            grid.step,
            "unit of the file",
            bound=float(np.ptp(values)) / MIN_LEVELS[kind] if MIN_LEVELS.get(kind) else None,
        )
    }
    findings.append(STEP.finding("warning" if few else "ok", text, name, step, evidence))
    return findings


def _counts(log: Log, joint: int, step: float) -> str:
    """The counts per turn that a step suggests."""
    logged, channel = log.logged["q"][:, joint], log.channels["q"][:, joint]
    kind = log.robot.joints[joint].kind if log.robot else "revolute"
    if kind == "prismatic" or np.nanstd(logged) == 0:
        return ""
    axis = "joint"
    if log.side == "motor" and log.robot is not None:
        positions = log.robot.transmission.motor_positions(log.channels["q"])
        channel, axis = positions[:, joint], "motor"
    scale = float(np.nanstd(logged) / np.nanstd(channel))  # units of the file per radian
    return f" That is {_number(2 * math.pi * scale / step)} counts per turn of the {axis}."


def _number(counts: float) -> str:
    """A whole number, and the power of two that it may be."""
    power = round(math.log2(counts)) if counts > 0 else 0
    near = power >= 8 and abs(counts / 2**power - 1.0) < 0.005
    return f"about {counts:,.0f}" + (f" (2^{power} = {2**power:,})" if near else "")


#: What the checks of single channels look at.
CHANNELS = Topic("channels", "Channels")

FROZEN = FindingKind(
    CHANNELS, "frozen", ("recording", "part"), reservation=True, spoils=COMPARISONS
)


def check_frozen(
    log: Log, name: str, x: np.ndarray, q: np.ndarray, place: np.ndarray
) -> list[Finding]:
    """What there is to say about a channel; ``place``: numbers of its samples in the log."""
    if not np.isfinite(q).all():
        return []
    frozen = frozen_samples(x, q)
    if not frozen.any():
        return []
    parts = runs_of(frozen)
    first, stop = parts[np.argmax(parts[:, 1] - parts[:, 0])].tolist()
    begin, end = int(place[first]), int(place[stop - 1])
    share = float(frozen.mean())
    severity: Severity = "error" if share > TOLERATED_CLIPPING else "warning"
    others = f", the longest of {len(parts)} such stretches" if len(parts) > 1 else ""
    text = (
        f"{name} is exactly {x[first]:.6g} (unit of the log) from sample {begin} to {end}"
        f"{_times(log, begin, end)} while its joint moves{others}. Elsewhere it never stays the "
        "same for so long."
    )
    step = "Use a part without it (part = [start, stop] in s), or log the motion again."
    evidence = {
        "share": Quantity(100 * share, "%", bound=100 * TOLERATED_CLIPPING),
        **at_sample(begin, log.time_of(begin)),
    }
    return [FROZEN.finding(severity, text, name, step, evidence)]


def _times(log: Log, begin: int, end: int) -> str:
    """The same in seconds, where the log has a clock."""
    start, stop = log.time_of(begin), log.time_of(end)
    if start is None or stop is None:
        return ""
    return f" ({start:.4g} to {stop:.4g} s)"
