"""The clock of a log: jitter, gaps, repeated and lost samples, drift against another clock."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.timestamps import (
    EVEN,
    GAP,
    JITTER_TOLERANCE,
    LIKELY_RATES,
    MIN_SAMPLES,
    bridged_interval,
    lacking,
    likely_time_units,
    mean_rate,
    resample_smooth,
    stamp_error,
    stretches,
    usual_interval,
)
from pivident.data.logs.units import factor_to_si
from pivident.foundation.errors import IrregularSampling, MissingSamples
from pivident.foundation.errors.recordings import Stretches, written
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, at_sample
from pivident.foundation.text.repair import Repair, setting
from pivident.foundation.text.sentences import capital
from pivident.judgement.audit.spoilt_checks import GEOMETRY
from pivident.judgement.audit.steps import CLOCK, check_steps

#: Tables and keys of the stamps, and of the stretch that is used.
STAMPS, PART = ("recording", "columns", "t"), ("recording", "part")

NO_CLOCK = FindingKind(CLOCK, "no clock", STAMPS, reports=(IrregularSampling,))
NO_STAMP = FindingKind(CLOCK, "no stamp", STAMPS)
RATE = FindingKind(CLOCK, "rate", ("recording", "units", "t"), spoils=GEOMETRY)
DRIFT = FindingKind(CLOCK, "drift", ("recording", "rate"))
MISSING_SAMPLES = FindingKind(CLOCK, "gap", PART, reports=(MissingSamples, IrregularSampling))
BACKWARD = FindingKind(CLOCK, "backward", PART, reports=(IrregularSampling,))
DUPLICATE = FindingKind(CLOCK, "duplicate", reports=(IrregularSampling,))
JITTER = FindingKind(CLOCK, "jitter", ("recording", "resample"), reports=(IrregularSampling,))
RATE_CHANGE = FindingKind(CLOCK, "rate change", PART)
CLOCKS_JUMP = FindingKind(CLOCK, "clocks jump")

#: What is done with samples that are not equally spaced.
INTERPOLATED = setting(
    "resample", value=True, words="Interpolate onto a uniform clock: resample = true."
)

#: Two clocks that drift apart by more than this get a warning; quartz keeps 1e-4.
MAX_DRIFT = 2e-4

#: … and from here on the speeds, and with them all parameters, are off by a per cent.
DRIFT_WRONG = 1e-2

#: Two time columns that differ by more do not mean the same time.
ANOTHER_CLOCK = 0.2

#: What is done with the stretches between gaps.
USED_APART = "The {n} stretch(es) between gaps are used as recordings of their own."

#: Intervals that differ by less differ by the rounding of their stamps, relative.
ROUNDING = 1e-9


@dataclass(frozen=True, eq=False)
class Timing:
    """What the clock is like."""

    findings: tuple[Finding, ...]
    intervals: np.ndarray  # between finite stamps [s]; empty without a clock
    rate: float | None  # sampling rate of the stamps or as given [Hz], or None
    regular: bool  # whether samples can be taken as equidistant


def check_timing(log: Log) -> Timing:
    """Judge every clock of a log, and the motion where it shows lost samples."""
    findings: list[Finding] = []
    intervals, rate, regular = np.empty(0), log.rate, True
    clock = log.clock
    if clock is None:
        if log.rate is None:
            text = "The log has no time column, and no rate is given."
            step = "Name the time column (columns = {t = …}) or give the rate in Hz."
            findings.append(NO_CLOCK.finding("error", text, "", step))
            regular = False
    else:
        name = next(iter(log.clocks))
        intervals, stamped, regular, own = _one_clock(log, name, clock)
        findings += own
        rate = log.rate or stamped
        if log.rate and stamped:
            findings.append(_against_rate(log.rate, clock, name))
        for other in list(log.clocks)[1:]:
            findings += _against_clock(name, clock, other, log.clocks[other])
    if "q" in log.channels and rate:
        findings += check_steps(log, rate, regular and clock is not None)
    return Timing(tuple(findings), intervals, rate, regular)


def at_equal_intervals(values: np.ndarray, t: np.ndarray | None, timing: Timing) -> np.ndarray:
    """Finite samples, at equal intervals where the stamps t are not, shape (samples, columns)."""
    whole = np.isfinite(values).all(axis=1)
    if t is None or timing.regular or len(t) != len(values):
        return values[whole]
    whole &= np.isfinite(t)
    t, values = t[whole], values[whole]
    forward = np.diff(np.maximum.accumulate(t), prepend=-np.inf) > 0
    t, values = t[forward], values[forward]
    grid = np.arange(t[0], t[-1], 1.0 / (timing.rate or 1.0)) if len(t) > MIN_SAMPLES else t
    if not MIN_SAMPLES < len(grid) < 2 * len(t):  # a clock that says nothing
        return values
    return resample_smooth(t, values, grid)


def _one_clock(
    log: Log, name: str, t: np.ndarray
) -> tuple[np.ndarray, float | None, bool, list[Finding]]:
    """Intervals, rate, regularity and findings of one time column."""

    def finding(
        severity: Severity,
        kind: FindingKind,
        text: str,
        sample: int,
        step: str,
        repairs: Sequence[Repair] = (),
        **numbers: Quantity,
    ) -> Finding:
        evidence = numbers | at_sample(sample, log.time_of(sample))
        return kind.finding(severity, text, name, step, evidence, repairs=repairs)

    findings, regular = [], True
    bad = np.flatnonzero(~np.isfinite(t))
    if bad.size:
        text = f"{bad.size} time stamp(s) are missing or infinite, the first at sample {bad[0]}."
        step = "Remove these rows, or give the rate if the samples themselves are regular."
        findings.append(
            finding("error", NO_STAMP, text, int(bad[0]), step, stamps=Quantity(bad.size))
        )
        regular = False
    finite = t[np.isfinite(t)]
    place = np.flatnonzero(np.isfinite(t))
    steps = np.diff(finite)
    forward = steps[steps > 0]
    if len(finite) < 3 or not forward.size:
        text = "The time column never advances."
        findings.append(finding("error", NO_CLOCK, text, 0, "Name another time column."))
        return steps, None, False, findings
    period = usual_interval(forward)
    for wrong, kind, words, step in (
        (steps < 0, BACKWARD, "go backward", "Cut the log there; two logs may have been joined."),
        (
            steps == 0,
            DUPLICATE,
            "repeat the one before",
            "Remove the repeated rows, or give the rate if the stamps are only coarse.",
        ),
    ):
        at = np.flatnonzero(wrong)
        if at.size:
            k = int(place[at[0] + 1])
            text = f"{at.size} time stamp(s) {words}, the first at sample {k} (t = {t[k]:.6g} s)."
            findings.append(finding("error", kind, text, k, step, stamps=Quantity(float(at.size))))
            regular = False
    change = rate_change(finite) if regular else None
    if change is not None:
        k, before, after = change
        text = (
            f"The clock changes its rate at sample {place[k]} (t = {finite[k]:.6g} s): it ticks "
            f"every {1e3 * before:.5g} ms before and every {1e3 * after:.5g} ms behind."
        )
        ends = [(finite[0], finite[k]), (finite[k], finite[-1] + after)]
        parts = [[float(f"{x:.6g}") for x in part] for part in ends]
        listed = [f"part = [{first:.6g}, {last:.6g}]" for first, last in parts]
        step = f"Make two recordings of it, with {listed[0]} and {listed[1]}."
        repairs = [only(part, words) for part, words in zip(parts, listed, strict=True)]
        severity: Severity = "warning" if log.resample else "error"
        if log.resample:
            text += " New samples at one rate are made for all of it."
        interval = Quantity(1e3 * after, "ms", bound=1e3 * before)
        sample = int(place[k])
        found = finding(severity, RATE_CHANGE, text, sample, step, repairs, interval=interval)
        return steps, mean_rate(finite), False, [*findings, found]
    ratio = steps / period
    tolerated, gaps = GAP * period, lacking(steps, period)
    if log.resample:  # which fills the shorter ones
        tolerated = bridged_interval(period)
        gaps = np.flatnonzero(steps > tolerated)
    if gaps.size > 0.9 * np.sum(steps > tolerated):
        lost = int(np.sum(np.round(ratio[gaps]) - 1))
        longest = int(gaps[np.argmax(ratio[gaps])])
        k = int(place[longest])
        text = (
            f"{lost} sample(s) are missing in {gaps.size} gap(s); the longest lasts "
            f"{_duration(steps[longest])} after sample {k} (t = {t[k]:.6g} s)."
        )
        logged = float(np.sum(np.delete(steps, gaps)))
        if gaps.size == 1 and steps[longest] > logged:
            text = (
                f"The clock jumps ahead by {_duration(steps[longest])} after sample {k} (t = "
                f"{t[k]:.6g} s), longer than all that was logged ({_duration(logged)}): the logger "
                "paused, the clock was set, or two logs have been joined."
            )
        step = "Fix the stamps first; then cut the recording there (part)."
        repairs = []
        if regular:
            left = stretches(finite)
            left = replace(left, resample=False) if log.resample else left
            step = f"{capital(left.advice())}."
            repairs = _without_gaps(left)
        missing = Quantity(float(lost), "samples")
        apart = regular and (log.resample or not left.resample) and bool(left.parts)
        if apart:
            text += f" {USED_APART.format(n=len(left.parts))}"
            step = f"{written(left.longest)} under [recording] uses the longest alone."
            repairs = [only(left.longest)]
        severity = "warning" if apart else "error"
        findings.append(finding(severity, MISSING_SAMPLES, text, k, step, repairs, missing=missing))
        regular = False
        steps = steps[steps <= tolerated]
        ratio = steps / period
    inside = ratio[(ratio > 0)]
    largest = float(np.abs(inside - 1.0).max(initial=0.0))
    spread = float(np.std(inside - 1.0))
    late = int(place[min(int(np.argmax(np.abs(ratio - 1.0))), len(place) - 1)])
    text = f"The clock ticks every {1e3 * period:.6g} ms; "
    if largest > JITTER_TOLERANCE:
        kept = steps[steps > 0]
        text = (
            f"The clock ticks every {1e3 * np.mean(kept):.5g} ms on average, after "
            f"{1e3 * kept.min():.4g} to {1e3 * kept.max():.4g} ms: "
        )
    text += (
        "all intervals are equal."
        if largest < ROUNDING
        else f"single intervals differ by up to {100 * largest:.3g} % (standard deviation "
        f"{100 * spread:.2g} %)."
    )
    jitter = Quantity(100 * largest, "%", bound=100 * JITTER_TOLERANCE)
    harmless = JITTER.finding("ok", text, name, evidence={"jitter": jitter})
    if largest > ROUNDING and log.resample:
        text += " New samples are made at equal intervals, as requested by resample = true."
        findings.append(replace(harmless, message=text))
        regular = False
    elif largest > JITTER_TOLERANCE and log.rate and not _error_of_stamps(log, t) < 1.0 / EVEN:
        text += f" The samples are taken for equally spaced, as rate = {log.rate:.6g} says."
        findings.append(replace(harmless, message=text))
    elif largest > JITTER_TOLERANCE:
        step, repairs = _resample_or_rate(log, t)
        findings.append(finding("error", JITTER, text, late, step, repairs, jitter=jitter))
        regular = False
    else:
        findings.append(harmless)
    rising = finite[np.r_[True, np.diff(np.maximum.accumulate(finite)) > 0]]
    rate = mean_rate(rising) if len(rising) > 1 else 1.0 / period  # the first may be the highest
    if not LIKELY_RATES[0] <= rate <= LIKELY_RATES[1]:
        text = f"The stamps advance at {rate:.4g} Hz, unlike any robot's log."
        step = 'Give the unit of the stamps: units = {t = "ms"} or "us", "ns".'
        units = likely_time_units(1.0 / (rate * factor_to_si("t", log.clock_unit)[0]))
        repairs = [
            setting("units", "t", value=unit, words=f"The stamps are in {unit}.") for unit in units
        ]
        findings.append(finding("error", RATE, text, 0, step, repairs, rate=Quantity(rate, "Hz")))
    return steps, rate, regular, findings


def _duration(seconds: float) -> str:
    """In ms, or in s from one second on."""
    return f"{seconds:.4g} s" if seconds >= 1.0 else f"{1e3 * seconds:.4g} ms"


def rate_change(t: np.ndarray) -> tuple[int, float, float] | None:
    """The sample at which a clock that is regular before and behind changes its interval [s].

    The intervals are cut in two where their squares about the two means add up to least. Both parts
    are regular clocks of different intervals, or there is no such change.
    """
    steps = np.diff(t)
    n = len(steps)
    if n < 2 * MIN_SAMPLES:
        return None
    sums = np.cumsum(steps)[:-1]
    number = np.arange(1, n)
    explained = sums**2 / number + (steps.sum() - sums) ** 2 / (n - number)
    k = int(np.argmax(explained)) + 1
    if min(k, n - k) < MIN_SAMPLES:
        return None
    parts = steps[:k], steps[k:]
    before, after = (usual_interval(part) for part in parts)
    regular = all(
        np.abs(part / usual - 1.0).max() <= JITTER_TOLERANCE
        for part, usual in zip(parts, (before, after), strict=True)
    )
    apart = abs(before - after) > 2.0 * JITTER_TOLERANCE * min(before, after)
    return (k, before, after) if regular and apart else None


def _error_of_stamps(log: Log, t: np.ndarray) -> float:
    """How much worse the motion fits the stamps than equal steps; NaN: nothing moves."""
    q = log.channels.get("q")
    if q is None or len(q) != len(t):
        return np.nan
    use = np.isfinite(q).all(axis=1) & np.isfinite(t)
    use &= np.diff(np.fmax.accumulate(np.where(use, t, -np.inf)), prepend=-np.inf) > 0
    return stamp_error(q[use], t[use])


def _resample_or_rate(log: Log, t: np.ndarray) -> tuple[str, list[Repair]]:
    """What to do about irregular stamps: the motion shows whether the samples are irregular too."""
    error = _error_of_stamps(log, t)
    if error > EVEN:
        rate = float(f"{mean_rate(t[np.isfinite(t)]):.6g}")
        step = (
            "The joints move as if the samples were equally spaced, and only the stamps are not: "
            f"set rate = {rate:.6g} under [recording]."
        )
        words = f"Take the samples for equally spaced: rate = {rate:.6g}."
        return step, [setting("rate", value=rate, words=words)]
    if error < 1.0 / EVEN:
        step = "The joints move as the stamps say: resample onto a uniform grid (resample = true)."
        return step, [INTERPOLATED]
    step = (
        "Resample onto a uniform grid (resample = true), or give the rate if only the stamps "
        "are irregular and the samples are not."
    )
    return step, [INTERPOLATED]


def only(part: Sequence[float], said: str = "") -> Repair:
    """That nothing but a stretch [s] is used; ``said``: as the file has it, if otherwise."""
    said = said or written((part[0], part[1]))
    return setting("part", value=list(part), words=f"Keep this part of the log only: {said}.")


def _without_gaps(left: Stretches) -> list[Repair]:
    """Each stretch between gaps, the longest first, and new samples where shorter ones remain."""
    filled = INTERPOLATED.edits if left.resample else ()
    if not left.lost and len(left.parts) < 2:
        return [INTERPOLATED] if filled else []
    parts = dict.fromkeys((left.longest, *left.listed))
    return [replace(only(part), edits=(*only(part).edits, *filled)) for part in parts]


def _against_rate(rate: float, t: np.ndarray, name: str) -> Finding:
    """How far the stamps run away from the declared rate."""
    k = np.flatnonzero(np.isfinite(t))
    drift, standard_error = _slope(k / rate, t[k])
    finding = _drift_finding(name, f"the declared rate of {rate:g} Hz", drift, standard_error)
    by_stamps = setting("rate", words="Take the rate of the time stamps: remove rate.")
    return finding if finding.severity == "ok" else replace(finding, repairs=(by_stamps,))


def _against_clock(name: str, t: np.ndarray, other: str, u: np.ndarray) -> list[Finding]:
    """How far two clocks of one log run apart, and whether they jump against each other."""
    both = np.flatnonzero(np.isfinite(t) & np.isfinite(u))
    if both.size < 3 or np.ptp(t[both]) == 0:
        return []
    drift, standard_error = _slope(t[both], u[both])
    if abs(drift) > ANOTHER_CLOCK:
        return []  # it counts something else, such as the samples of another loop
    findings = [_drift_finding(other, f"the clock {name}", drift, standard_error)]
    apart = (u - t)[both] - np.median((u - t)[both])
    jump = np.abs(np.diff(apart))
    period = float(np.median(np.abs(np.diff(t[both]))))
    k = int(np.argmax(jump))
    if jump[k] > GAP * period:
        where = int(both[k + 1])
        text = (
            f"The clocks {name} and {other} shift by {1e3 * jump[k]:.4g} ms relative to each other "
            f"at sample {where}."
        )
        step = "One of the two loggers was late there; do not mix channels of both clocks."
        evidence = {
            "jump": Quantity(1e3 * float(jump[k]), "ms", bound=1e3 * GAP * period),
            **at_sample(where, float(t[where])),
        }
        findings.append(CLOCKS_JUMP.finding("warning", text, other, step, evidence))
    return findings


def _slope(x: np.ndarray, y: np.ndarray) -> tuple[float, float]:
    """Slope Σxy / Σx² from the first sample on, less one, and its standard error by jitter."""
    x, y = x - x[0], y - y[0]
    slope = float(np.dot(x, y) / np.dot(x, x))
    residual = y - slope * x
    return slope - 1.0, float(np.std(residual) / max(float(x[-1]), 1e-300))


def _drift_finding(name: str, against: str, drift: float, standard_error: float) -> Finding:
    severity: Severity = "ok"
    if abs(drift) > MAX_DRIFT + 2 * standard_error:
        severity = "error" if abs(drift) > DRIFT_WRONG else "warning"
    text = (
        f"The clock {name} runs {abs(1e6 * drift):.3g} ppm {'slower' if drift < 0 else 'faster'} "
        f"than {against}."
    )
    step = "" if severity == "ok" else "Find out which of the two is right; speeds scale with it."
    evidence = {
        "drift": Quantity(
            1e6 * drift,
            "ppm",
            bound=1e6 * MAX_DRIFT,
            interval=(1e6 * (drift - 2 * standard_error), 1e6 * (drift + 2 * standard_error)),
        )
    }
    return DRIFT.finding(severity, text, name, step, evidence)
