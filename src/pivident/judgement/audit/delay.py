"""Delay between torque and position: the shift at which the inverse model fits best.

Correlating torque with position finds no delay: in a closed loop they drive each other, and
friction moves the peak. The inverse model explains the torque by the motion of the same instant, so
its residual is smallest where both channels are aligned,

    s_j = argmin_s min_θ ‖τ_j(t + s) - Φ_j θ‖².

A search over a grid of shifts finds the valley, Gauss-Newton steps its bottom: dτ_j/dt is one more
column, and its coefficient the step. Intervals come from a jackknife over stretches of time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.data.logs.log import Log
from pivident.data.logs.nominal_rate import usual_near
from pivident.data.recording.checks import TIMING_WORDS
from pivident.foundation.common_work import kept_numbers
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Severity, Topic
from pivident.foundation.text.numbers import with_spread
from pivident.foundation.text.repair import Repair, setting
from pivident.foundation.text.sentences import listed
from pivident.judgement.audit.blocked_fit import BLOCKS, CLEAR, blocked_fit, jackknife
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.judgement.audit.spoilt_checks import COMPARISONS
from pivident.signals.alignment import torque_shift

#: What this check looks at, and where a delay is declared.
DELAY, DECLARED = Topic("delay", "Delay between torque and position"), ("recording", "delay")

UNKNOWN = FindingKind(DELAY, "unknown")
LATE = FindingKind(DELAY, "late", DECLARED, reservation=True, spoils=COMPARISONS)
EARLY = FindingKind(DELAY, "early", DECLARED, reservation=True, spoils=COMPARISONS)
TIMING = FindingKind(DELAY, "timing", ("recording", "torque_timing"))
LOOP_RATE = FindingKind(DELAY, "loop rate", ("recording", "control_rate"))
JOINT_LATE = FindingKind(
    DELAY, "joint late", ("recording", "columns", "tau"), reservation=True, spoils=COMPARISONS
)
JOINT_EARLY = FindingKind(
    DELAY, "joint early", ("recording", "columns", "tau"), reservation=True, spoils=COMPARISONS
)

#: Shifts that are tried [s], but at least so many samples on each side.
MAX_SHIFT, MIN_SHIFT_SAMPLES = 0.04, 6

#: A clear delay counts if so much of the residual's sum of squares goes away with it.
GAIN_WARNING, GAIN_ERROR = 0.05, 0.5

#: … and if that is so much of the torque.
EFFECT_WARNING, EFFECT_ERROR = 0.0002, 0.003

#: One joint's delay counts if so much of its residual, and of its torque, goes away with it.
GAIN_OF_ONE, EFFECT_OF_ONE = 0.2, 0.005

#: Delays below these shares of a sampling period are not reported, or only as a warning.
SHORT, LONG = 0.1, 0.5

#: How far in sampling periods a delay may be from that of another timing, besides its error.
OFF_TIMING = 0.1

#: Share of a sampling period for which a torque is held at least, half way from a fifth to a sixth.
SHORTEST_HOLD = 11.0 / 60.0

#: Share of a sampling period below which one joint's torque is not late: it comes with the others.
ONE_JOINT = 0.7

#: A valley whose bottom is beyond this share of the shifts that are tried has no other side.
INSIDE = 0.9

#: Share of the band in which one joint's delay has to be seen again, unless it explains nearly all.
SLOW, NEARLY_ALL = 0.25, 0.9

#: Joints whose delays differ by so many of their standard errors have a model error in them.
APART = 3.0

#: Delays of joints, on other rows, from which a median is taken.
LEAST_VALUES = 4

#: Above this standard error [s] a joint's delay is not used; so many times it beside a single one.
BLUNT, ALONE = 5e-3, 4.0


@dataclass(frozen=True, eq=False)
class Delay:
    """Delays by joint."""

    findings: tuple[Finding, ...]
    shifts: np.ndarray  # that were tried [s]
    errors: np.ndarray  # relative error of each joint at each shift, shape (shifts, joints)
    estimates: np.ndarray  # by joint, beyond the declared delay [s], or NaN
    standard_errors: np.ndarray  # of the estimates [s]
    common: tuple[float, float]  # of all joints together, and its standard error [s], or NaN
    gains: np.ndarray  # share of the sum of squares that goes away with it, by joint
    effects: np.ndarray  # torque that it explains, as share of the joint's torque

    def beside(self, joint: int | None) -> tuple[float, float]:
        """Delay of a joint against the others, or of all for None, and its standard error [s]."""
        if joint is None:
            return self.common
        others = np.where(np.arange(len(self.estimates)) == joint, np.nan, self.estimates)
        none = np.full((0, len(others)), np.nan)
        rest, uncertain = _common(others, self.standard_errors, none)
        apart = float(self.estimates[joint] - rest)
        return apart, float(np.hypot(self.standard_errors[joint], uncertain))


class DelayCheck(LogCheck):
    """The delay of the torques; what all of them have in common is made good."""

    name = "delay"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        delay = check_delay(seen.log, seen.model)
        is_clear = any(
            finding.severity == "error" or finding.declared is TIMING
            for finding in delay.findings
            if not finding.subject
        )
        aligned = seen.model.delayed(delay.common[0]) if is_clear else None
        return seen.after(self.name, delay.findings, delay, aligned)


def check_delay(log: Log, model: InverseModel) -> Delay:
    """Estimate how much later the torque was logged than the positions.

    Static friction of a standstill reaches into the motion beside it and can look like a delay. One
    that is not there without those rows is none. What the law of dry friction lacks where a joint
    turns back differs by joint: its delay has to be visible without rest, and between the reversals
    as well. Nor is what an encoder adds with every turn of its motor a delay: it lies above the
    frequencies of the motion, among which a delay is the same.

    Where joints stick, all of them seem early, each by its own time; where friction has to be wound
    up behind a reversal, as teeth and bearings give way before they slide, all of them seem late.
    The common delay is that between the reversals if joints agree there, and it is sharper and
    another one; where joints disagree there as well, the median that low frequencies show, too.
    """
    found = _estimated(log, model)
    disagree = _disagreement(found.estimates, found.standard_errors) > APART
    if not disagree and all(finding.severity == "ok" for finding in found.findings):
        return found
    fast = _estimated(log, model.away_from_reversals(), np.inf)
    agree = _disagreement(fast.estimates, fast.standard_errors) <= APART
    if agree and fast.common[1] < found.common[1] and (disagree or _differs(found, fast, None)):
        common, *_ = _findings(log, model, fast)
        found = replace(found, common=fast.common, findings=(common, *found.findings[1:]))
    elif disagree:
        found = _of_several(log, model, found, fast)
    if all(finding.severity == "ok" for finding in found.findings):
        return found
    apart = _estimated(log, model.away_from_rest())
    names = {name: j for j, name in enumerate(model.robot.joint_names)}
    graver = [f for f in found.findings if f.severity != "ok"]
    slow = None
    if any(finding.subject in names for finding in graver):
        slow = _estimated(log, model.below(SLOW), np.inf)
    findings = []
    for finding in found.findings:
        j = names.get(finding.subject)
        none = finding.severity != "ok" and not _agree(found, apart, j)
        if finding.severity != "ok" and j is not None and slow is not None:
            seen = min(found.gains[j], apart.gains[j], fast.gains[j]) > GAIN_OF_ONE
            seen &= found.gains[j] > NEARLY_ALL or _agree(found, slow, j)
            none |= _contradicts(found, fast, j) or _differs(found, fast, j) or not seen
        findings.append(
            replace(finding, severity="ok", next_step="", repairs=()) if none else finding
        )
    return replace(found, findings=tuple(findings))


def _of_several(log: Log, model: InverseModel, found: Delay, fast: Delay) -> Delay:
    """The common delay as the median of all joints between the reversals and at low frequencies.

    Its error follows from their median distance from it, as of independent joints.
    """
    slow = _estimated(log, model.below(SLOW), np.inf)
    values = np.concatenate([fast.estimates, slow.estimates])
    values = values[np.isfinite(values)]
    if len(values) < LEAST_VALUES:
        return found
    median = float(np.median(values))
    deviation = 1.4826 * float(np.median(np.abs(values - median)))
    error = np.sqrt(np.pi / 2.0) * deviation / np.sqrt(len(values) / 2)
    made = replace(found, common=(median, max(float(error), found.common[1])))
    return replace(made, findings=tuple(_findings(log, model, made)))


def _agree(found: Delay, other: Delay, joint: int | None) -> bool:
    """Whether the delay of a joint, or of all for None, is there on other rows as well."""
    (delay, _), (again, uncertain) = found.beside(joint), other.beside(joint)
    return delay * again > 0 and abs(again) > 0.5 * CLEAR * uncertain


def _differs(found: Delay, fast: Delay, joint: int | None) -> bool:
    """Whether a delay is clearly another one between the reversals."""
    (delay, error), (again, uncertain) = found.beside(joint), fast.beside(joint)
    return bool(abs(delay - again) > CLEAR * np.hypot(error, uncertain))


def _contradicts(found: Delay, other: Delay, joint: int) -> bool:
    """Whether other rows show another delay of a joint, and no clear one."""
    (delay, _), (again, uncertain) = found.beside(joint), other.beside(joint)
    return abs(again) < CLEAR * uncertain and abs(delay - again) > 0.5 * CLEAR * uncertain


def _estimated(log: Log, model: InverseModel, blunt: float = BLUNT) -> Delay:
    """The same on the rows of a model, without standard errors above ``blunt`` [s]."""
    reach = min(max(MAX_SHIFT, MIN_SHIFT_SAMPLES / model.rate), model.at[0] / model.rate)
    shifts, joints = np.linspace(-reach, reach, 81), model.robot.size
    rows = model.at, model.shift, model.rate, model.moving, model.block, *model.columns
    made = kept_numbers(
        ("delay", *rows, model.torque.x, model.torque.c, shifts),
        (len(shifts) + 2 + BLOCKS, joints),
        lambda: _searched(model, shifts),
    )
    errors, (estimates, gains), replicates = np.split(made, [len(shifts), len(shifts) + 2])
    standard_errors = np.array(
        [jackknife(x[np.isfinite(x)]) if np.isfinite(x).sum() > 2 else np.nan for x in replicates.T]
    )
    known = np.isfinite(estimates) & (standard_errors > 0)
    sharp = known & (standard_errors < blunt)
    if sharp.sum() == 1:  # one joint does not speak for all: the others are heard as well
        sharp = known & (standard_errors < ALONE * blunt)
    estimates = np.where(sharp, estimates, np.nan)
    effects = model.relative_errors * np.sqrt(np.clip(gains, 0.0, 1.0))
    common = _common(estimates, standard_errors, replicates)
    delay = Delay((), shifts, errors, estimates, standard_errors, common, gains, effects)
    return replace(delay, findings=tuple(_findings(log, model, delay)))


def _searched(model: InverseModel, shifts: np.ndarray) -> np.ndarray:
    """Of each joint the errors at the shifts, its delay, the gain and the delay's replicates."""
    torques = np.stack([model.tau(s) for s in shifts], axis=-1)
    joints = model.robot.size
    errors = np.array([model.relative_error(j, torques[:, j]) for j in range(joints)]).T
    estimates, gains = np.full(joints, np.nan), np.zeros(joints)
    replicates = np.full((BLOCKS, joints), np.nan)
    for j in range(joints):
        if model.usable(j) and np.isfinite(errors[:, j]).all():
            found = _joint_delay(model, j, float(shifts[np.argmin(errors[:, j])]), shifts[-1])
            if found is not None:
                estimates[j], replicates[: len(found[1]), j], gains[j] = found
    return np.vstack([errors, estimates, gains, replicates])


def _joint_delay(
    model: InverseModel, j: int, start: float, reach: float
) -> tuple[float, np.ndarray, float] | None:
    """Bottom of one joint's valley, its replicates, and what is gained there over no shift."""
    rows = model.moving[:, j]
    basis, block = model.bases[j], model.block[rows]
    torque = replace(model.torque, c=model.torque.c[:, :, j])
    slope = torque.derivative()
    delay = start
    for _ in range(12):
        place = model.at[rows] - model.shift + delay * model.rate
        tau, rising = torque(place), slope(place) * model.rate
        alone = rising - basis @ (basis.T @ rising)
        square = float(alone @ alone)
        if square == 0:
            return None
        step = -float(alone @ tau) / square
        delay = delay + float(np.clip(step, -0.25 * reach, 0.25 * reach))
        if abs(delay) > reach:
            return None
        if abs(step) < 1e-7:
            break
    steepness = float(np.linalg.norm(rising))
    fit = blocked_fit(np.column_stack([basis, rising / steepness]), tau, block)
    here = model.relative_error(j, model.tau(delay)[:, j])
    gain = 1.0 - (here / model.relative_errors[j]) ** 2
    return delay, delay - (fit.replicates[:, -1] - fit.estimate[-1]) / steepness, gain


def _common(
    estimates: np.ndarray, standard_errors: np.ndarray, replicates: np.ndarray
) -> tuple[float, float]:
    """Mean of the joints, weighted by their precision, and its standard error."""
    sharp = np.isfinite(estimates)
    if not sharp.any():
        return float("nan"), float("nan")
    weight = standard_errors[sharp] ** -2.0
    weight /= weight.sum()
    blocks = replicates[:, sharp]
    blocks = blocks[np.isfinite(blocks).all(axis=1)]
    own = float(np.sqrt(np.sum((weight * standard_errors[sharp]) ** 2)))
    spread = float(jackknife(blocks @ weight)) if len(blocks) > 2 else own
    mean = float(estimates[sharp] @ weight)
    # Joints that disagree beyond their standard errors show a model error, which all of them share.
    return mean, max(spread, own) * max(1.0, _disagreement(estimates, standard_errors))


def _disagreement(estimates: np.ndarray, standard_errors: np.ndarray) -> float:
    """Birge's ratio: scatter of the joints' delays over what their standard errors let expect."""
    sharp = np.isfinite(estimates)
    if sharp.sum() < 2:
        return 0.0
    weight = standard_errors[sharp] ** -2.0
    mean = float(estimates[sharp] @ weight / weight.sum())
    apart = np.sum(((estimates[sharp] - mean) / standard_errors[sharp]) ** 2)
    return float(np.sqrt(apart / (int(sharp.sum()) - 1)))


def _findings(log: Log, model: InverseModel, found: Delay) -> list[Finding]:
    """The delay of all joints, then those of joints that differ from it."""
    period = 1.0 / model.rate
    estimates, gains, effects = found.estimates, found.gains, found.effects
    mean, standard_error = found.common
    if not np.isfinite(mean):
        text = "The motion does not show whether torque and position were logged together."
        step = "Log a motion with reversals and accelerations."
        return [UNKNOWN.finding("ok", text, "", step)]
    sharp = np.isfinite(estimates)
    # What makes it visible has to be late as well: a gain of another sign is another fault.
    alike = np.where(sharp & (estimates * mean > 0.0), effects, 0.0)
    most = int(np.argmax(alike))
    severity = _severity(mean, standard_error, float(gains[most]), float(alike[most]), period)
    total = log.delay + mean
    amount = f"{_with_interval(abs(mean), 2 * standard_error)} ({abs(mean) / period:.2f} samples)"
    text = f"The torque is {amount} {'later' if mean > 0 else 'earlier'} than the positions" + (
        f", beyond the declared delay of {_milliseconds(log.delay)}." if log.delay else "."
    )
    step, repairs = "", list[Repair]()
    if severity != "ok":
        step = f"Set delay = {total:.3g} under [recording]."
        repairs.append(_declared("Declare how much later the torque is", "delay", total))
        if total < 0:
            step += (
                f" If the log holds the command and the drive responds late, set "
                f"drive_delay = {-total:.3g} instead: the simulated loop then has the same delay."
            )
            words = "Declare that the drive responds late to the logged command"
            repairs.append(_declared(words, "drive_delay", -total))
        if abs(abs(mean) / period - 0.5) < 0.15 and log.torque_timing == "held" and mean > 0:
            step += ' torque_timing = "sampled" would also explain half a sample.'
            repairs.append(_declared_timing("sampled"))
    kind, evidence = LATE if mean > 0 else EARLY, _evidence(mean, standard_error, period)
    clear = abs(mean) > CLEAR * standard_error  # which instant a torque belongs to needs no more
    timing = undeclared_timing(log, model.rate, found.common) if clear else None
    if timing is not None:
        severity, kind, repairs = "note", TIMING, [_declared_timing(timing)]
        text = (
            f"The torque is {TIMING_WORDS[timing]}: {amount} later than one that is held from its "
            "instant on."
        )
        step = f'Set torque_timing = "{timing}" under [recording].'
    possible = possible_loops(log, model.rate, found.common) if clear else []
    if possible:
        severity, kind, faster = "note", LOOP_RATE, possible[0]
        repairs = [_declared("Declare the rate of the control loop", "control_rate", faster, "g")]
        held = _with_interval(period - 2 * mean, 4 * standard_error)
        text = (
            f"The torque is held for {held} of the {_milliseconds(period)} between two samples: by "
            f"a control loop of {faster:g} Hz.{_other_loops(possible)}"
        )
        step = f"Set control_rate = {faster:g} under [recording]."
    findings = [kind.finding(severity, text, "", step, evidence, repairs=repairs)]
    for j in np.flatnonzero(sharp):
        if sharp.sum() < 2:
            continue
        apart, uncertain = found.beside(int(j))
        own = _severity(apart, uncertain, float(gains[j]), float(effects[j]), period)
        if own == "ok" or abs(apart) < ONE_JOINT * period or effects[j] < EFFECT_OF_ONE:
            continue
        if abs(estimates[j]) > INSIDE * found.shifts[-1]:
            continue
        name = model.robot.joints[j].name
        kind, side = (JOINT_LATE, "later") if apart > 0 else (JOINT_EARLY, "earlier")
        text = (
            f"The torque of {name} is {_with_interval(abs(apart), 2 * uncertain)} {side} than that "
            "of the other joints."
        )
        step = "One delay for all joints does not fit; log the channels at the same instants."
        evidence = _evidence(apart, uncertain, period)
        findings.append(kind.finding(own, text, name, step, evidence))
    return findings


def _declared(words: str, key: str, value: float, digits: str = ".3g") -> Repair:
    """A number that the recording declares."""
    return setting(
        key, value=float(f"{value:{digits}}"), words=f"{words}: {key} = {value:{digits}}."
    )


def _declared_timing(timing: str) -> Repair:
    """Which instant a torque sample belongs to."""
    words = f'Declare the instant of a torque sample: torque_timing = "{timing}".'
    return setting("torque_timing", value=timing, words=words)


def undeclared_timing(
    log: Log, rate: float, common: tuple[float, float]
) -> Literal["sampled", "averaged"] | None:
    """Which instant torque samples belong to, if nobody has said and it explains a delay.

    Held is what an unknown torque is taken for; a value at its instant is then found half a period
    late, and a mean over the period before it a whole one.

    Args:
        log: the log.
        rate: its sampling rate [Hz].
        common: delay of all joints and its standard error [s].
    """
    if log.torque_timing or possible_loops(log, rate, common):
        return None
    control = log.control_rate or rate
    held, *others = (
        torque_shift(rate, timing, control_rate=control)
        for timing in ("held", "sampled", "averaged")
    )
    found, standard_error = (rate * value for value in common)
    allowed = CLEAR * standard_error + OFF_TIMING
    sampled, averaged = (abs(found - (held - shift)) for shift in others)
    if abs(found) <= min(sampled, averaged) or min(sampled, averaged) > allowed:
        return None
    # Logs of values at their instants are the more usual: where both may be, they are.
    return "sampled" if sampled <= averaged + 2.0 * standard_error else "averaged"


def possible_loops(log: Log, rate: float, common: tuple[float, float]) -> list[float]:
    """Rates of loops that hold a torque for a part of the sampling period, likeliest first [Hz].

    Held for T_c < h a torque seems (h - T_c)/2 later than one that is held for h. T_c is told where
    it is clearly not all of h, and the loop's rate is two to five times the log's: a torque that is
    held for a shorter time is that of its instant. Where several are possible, one to which drives
    are set is likelier than one to which none is.

    Args:
        log: the log, of which nobody has said how the torque is held.
        rate: its sampling rate [Hz].
        common: delay of all joints and its standard error [s].
    """
    if log.torque_timing or log.control_rate:
        return []
    held, standard_error = 1.0 - 2.0 * rate * common[0], 2.0 * rate * common[1]
    clear = CLEAR * standard_error
    if not SHORTEST_HOLD < held < 1.0 - clear:
        return []
    multiples = range(2, round(1.0 / SHORTEST_HOLD) + 1)
    possible = [m for m in multiples if abs(1.0 / m - held) <= clear]
    possible.sort(key=lambda m: (usual_near(m * rate) is None, abs(1.0 / m - held)))
    return [usual_near(m * rate) or m * rate for m in possible]


def _other_loops(possible: Sequence[float]) -> str:
    """Which rates are possible besides the one that is taken, as a sentence."""
    if len(possible) < 2:
        return ""
    others = listed([f"{rate:g}" for rate in sorted(possible[1:])])
    usual = " is a usual rate of drives" if usual_near(possible[0]) else " fits best"
    return f" {others} Hz would be possible too; {possible[0]:g} Hz{usual}."


def _evidence(delay: float, standard_error: float, period: float) -> dict[str, Quantity]:
    """A delay with its interval ± 2 standard errors, in milliseconds."""
    interval = (1e3 * (delay - 2 * standard_error), 1e3 * (delay + 2 * standard_error))
    return {"delay": Quantity(1e3 * delay, "ms", bound=1e3 * LONG * period, interval=interval)}


def _severity(
    delay: float, standard_error: float, gain: float, effect: float, period: float
) -> Severity:
    """How bad a delay is: clear of noise, long enough, and visible in residual and torque."""
    if abs(delay) <= CLEAR * standard_error:
        return "ok"
    if abs(delay) > LONG * period and gain > GAIN_ERROR and effect > EFFECT_ERROR:
        return "error"
    visible = gain > GAIN_WARNING and effect > EFFECT_WARNING
    return "warning" if visible and abs(delay) > SHORT * period else "ok"


def _with_interval(seconds: float, half: float) -> str:
    """A short time ± half its interval, both to the same digit."""
    return "{} ± {} ms".format(*with_spread(1e3 * seconds, 1e3 * half))


def _milliseconds(seconds: float) -> str:
    """A short time with three digits."""
    return (
        f"{1e3 * seconds:.3g} ms" if seconds >= 1e-4 or seconds == 0 else f"{1e6 * seconds:.3g} µs"
    )
