"""What is seen in a joint's friction, each effect with a number and its 2σ.

A finding is *clear* if it is larger than its interval and of practical size; where its place was
searched for (the deepest point of a curve, its largest range) the bar is 3σ. What depends on
position, load or time must also predict motion that was not fitted.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.studies.friction.friction_torque import FrictionTorque
from pivident.studies.friction.held_out_friction import HeldOut
from pivident.studies.friction.state_dependent import (
    StateDependentFit,
    StateDependentParameter,
    against_motion,
    at,
    combined,
    common_speeds,
    offset,
    slope_over_size,
)

#: Points at which a curve is searched.
SEARCHED = 41

#: Fewest periods over the range of the position that are called a repetition.
MIN_PERIODS = 3.0

#: Smallest share of the friction level that is of practical size [%].
PRACTICAL = 2.0


@dataclass(frozen=True)
class FrictionFinding(Finding):
    """One effect; a warning is what viscous and Coulomb friction do not describe.

    Its kind is ``level``, ``asymmetry``, ``stribeck``, ``bend``, ``load``, ``position``, ``drift``
    or ``prediction``, its evidence ``value`` and ``two_sigma``.

    Attributes:
        clear: whether it stands out of its interval and is of practical size.
        brief: the same in a few words, for the joint's one sentence; empty where it is not clear.
        terms: terms of a friction law that would describe it, in words.
    """

    clear: bool = False
    brief: str = ""
    terms: str = ""


def _seen(
    kind: str,
    message: str,
    value: float,
    two_sigma: float,
    unit: str,
    clear: bool,
    brief: str = "",
    terms: str = "",
) -> FrictionFinding:
    """One effect with its number."""
    evidence = {"value": Quantity(value, unit), "two_sigma": Quantity(two_sigma, unit)}
    severity: Severity = "warning" if clear and brief else "note"
    return FrictionFinding(
        severity,
        "friction",
        kind,
        message,
        evidence=evidence,
        clear=clear,
        brief=brief,
        terms=terms,
    )


def findings(
    torque: FrictionTorque,
    fit: StateDependentFit,
    held_out: HeldOut,
) -> tuple[FrictionFinding, ...]:
    """All findings of a joint.

    Args:
        torque: its friction torque.
        fit: its functions.
        held_out: errors on motion that was not fitted.
    """
    found = [
        _level(torque, fit),
        _asymmetry(torque, fit),
        _stribeck(torque, fit),
        _bend(torque, fit),
    ]
    if "load" in fit:
        found.append(_load(torque, fit, held_out))
    found += [
        _position(torque, fit, held_out),
        _drift(torque, fit, held_out),
        _prediction(held_out),
    ]
    return tuple(found)


def _level(torque: FrictionTorque, fit: StateDependentFit) -> FrictionFinding:
    low, high = common_speeds(fit)
    at_low, low_std = fit.contrast(against_motion(fit, low))
    at_high, high_std = fit.contrast(against_motion(fit, high))
    unit = torque.torque_unit
    sentence = (
        f"Friction against the motion is {pm(at_low, low_std)} {unit} at {_speed(torque, low)} "
        f"and {pm(at_high, high_std)} {unit} at {_speed(torque, high)}."
    )
    return _seen("level", sentence, at_high, 2.0 * high_std, unit, True, "", "viscous, Coulomb")


def _asymmetry(torque: FrictionTorque, fit: StateDependentFit) -> FrictionFinding:
    """Twice o(v) as a share of g(v), at low and at high speed."""
    low, high = common_speeds(fit)
    shares = []
    for speed in (low + 0.15 * (high - low), high - 0.15 * (high - low)):
        value, std = fit.contrast(offset(fit, speed))
        scale = fit.contrast(against_motion(fit, speed))[0]
        shares.append((speed, 200.0 * value / abs(scale), 200.0 * std / abs(scale)))
    (slow, at_slow, slow_std), (fast, at_fast, fast_std) = shares
    change, change_std = fit.contrast(
        combined([(1.0, offset(fit, fast)), (-1.0, offset(fit, slow))])
    )
    differs = abs(change) > 2.0 * change_std
    clear = any(abs(s) > 2.0 * d and abs(s) > PRACTICAL for _, s, d in shares)
    sentence = (
        f"Friction forwards less friction backwards is {pm(at_slow, slow_std)} % of their mean "
        f"at {_speed(torque, slow)} and {pm(at_fast, fast_std)} % at {_speed(torque, fast)}."
    )
    terms = brief = ""
    if clear:
        speed, share, std = max(shares, key=lambda s: abs(s[1]) / max(s[2], 1e-300))
        brief = f"forwards less backwards {pm(share, std)} % at {_speed(torque, speed)}"
        terms = (
            "viscous friction for each direction, offset"
            if differs
            else "offset, or asymmetric Coulomb friction"
        )
    return _seen("asymmetry", sentence, at_fast, 2.0 * fast_std, "%", clear, brief, terms)


def _stribeck(torque: FrictionTorque, fit: StateDependentFit) -> FrictionFinding:
    """Fall of g from the lowest speed to its lowest point below half speed."""
    low, high = common_speeds(fit)
    lowest = _lowest_friction(fit)
    unit = torque.torque_unit
    if lowest == low:
        speeds = np.linspace(low, 0.5 * (low + high), SEARCHED)
        rise, std = fit.contrast(
            combined([(1.0, against_motion(fit, speeds[4])), (-1.0, against_motion(fit, low))])
        )
        sentence = (
            f"No Stribeck effect is seen: friction rises by {pm(rise, std)} {unit} from "
            f"{_speed(torque, low)} to {_speed(torque, speeds[4])}."
        )
        return _seen("stribeck", sentence, -rise, 2.0 * std, unit, False)
    drop, std = fit.contrast(
        combined([(1.0, against_motion(fit, low)), (-1.0, against_motion(fit, lowest))])
    )
    clear = drop > 3.0 * std and 100.0 * drop > PRACTICAL * torque.level
    words = "falls" if clear else "may fall, within its interval,"
    sentence = (
        f"Friction {words} by {pm(drop, std)} {unit} between {_speed(torque, low)} and "
        f"{_speed(torque, lowest)} (Stribeck effect)."
    )
    brief = f"a fall of {pm(drop, std)} {unit} from standstill to {_speed(torque, lowest)}"
    return _seen(
        "stribeck", sentence, drop, 2.0 * std, unit, clear, *(brief, "Stribeck") if clear else ()
    )


def _lowest_friction(fit: StateDependentFit) -> float:
    """Speed below half speed at which friction is lowest."""
    low, high = common_speeds(fit)
    speeds = np.linspace(low, 0.5 * (low + high), SEARCHED)
    levels = [fit.contrast(against_motion(fit, v))[0] for v in speeds]
    return float(speeds[int(np.argmin(levels))])


def _bend(torque: FrictionTorque, fit: StateDependentFit) -> FrictionFinding:
    """Mean slope of g over the upper half of the speeds less that over the lower half."""
    low, high = common_speeds(fit)
    # What lies below the lowest friction, and a tenth beyond it, belongs to the Stribeck effect.
    start = _lowest_friction(fit) + 0.1 * (high - low)
    middle = 0.5 * (start + high)
    halves = [
        combined(
            [(1.0 / (b - a), against_motion(fit, b)), (-1.0 / (b - a), against_motion(fit, a))]
        )
        for a, b in ((start, middle), (middle, high))
    ]
    slopes = [fit.contrast(w) for w in halves]
    change, std = fit.contrast(combined([(1.0, halves[1]), (-1.0, halves[0])]))
    # What the bend makes of the friction at the middle, in percent of it.
    size = 100.0 * abs(change) * (high - start) / 4.0 / max(torque.level, 1e-300)
    clear = abs(change) > 2.0 * std and size > PRACTICAL
    unit = f"{torque.torque_unit} s/{torque.position_unit}"
    brief = terms = ""
    if clear:
        words = "falls" if change < 0.0 else "rises"
        brief = f"a slope over speed that {words} by {pm(abs(change), std)} {unit}"
        terms = (
            "polynomial or progressive viscous friction"
            if change > 0.0
            else "polynomial or degressive viscous friction"
        )
        sentence = (
            f"The slope over speed {words} from {pm(*slopes[0])} to {pm(*slopes[1])} {unit} "
            f"(below and above {_speed(torque, middle)})."
        )
    else:
        sentence = (
            f"Viscous friction is linear within the intervals: slopes {pm(*slopes[0])} and "
            f"{pm(*slopes[1])} {unit} below and above {_speed(torque, middle)}."
        )
    return _seen("bend", sentence, change, 2.0 * std, unit, clear, brief, terms)


def _load(torque: FrictionTorque, fit: StateDependentFit, held_out: HeldOut) -> FrictionFinding:
    """Slope of p₃ against |load|, up to the load that is exceeded a tenth of the time."""
    reach = float(np.quantile(np.abs(torque.load[torque.moving]), 0.9))
    slope, std = fit.contrast({"load": slope_over_size(fit["load"])})
    share, spread = (100.0 * x * reach / max(torque.level, 1e-300) for x in (slope, std))
    gain, gain_std = held_out.full.gain(held_out.by_term["load"])
    large = abs(share) > 2.0 * spread and abs(share) > PRACTICAL
    predicts = gain > 2.0 * gain_std
    upto = f"up to a load of {format_significant(reach)} {torque.torque_unit}"
    words = "shrinks" if slope < 0.0 and large else "grows"
    size = pm(-share if words == "shrinks" else share, spread)
    sentence = (
        f"Friction {words} by {size} % {upto}; with a function of load {_change(gain, gain_std)}."
    )
    brief = terms = ""
    if predicts and large:
        change = "a fall" if words == "shrinks" else "a growth"
        brief, terms = f"{change} of {size} % {upto}", "load-dependent friction"
    elif predicts and gain > PRACTICAL:
        brief = "a dependence on the load other than on its size"
        terms = "no usual law: presliding, or inertia that the rigid part lacks"
    return _seen("load", sentence, share, 2.0 * spread, "%", bool(brief), brief, terms)


def _position(torque: FrictionTorque, fit: StateDependentFit, held_out: HeldOut) -> FrictionFinding:
    """Range of p₂ where there are samples, and whether it predicts."""
    p = fit["position"]
    seen = p.density > 0.25 * float(np.median(p.density))
    top = int(np.argmax(np.where(seen, p.value, -np.inf)))
    bottom = int(np.argmin(np.where(seen, p.value, np.inf)))
    weights = np.zeros(p.state.size)
    weights[top] += 1.0
    weights[bottom] -= 1.0
    reach, std = fit.contrast({"position": weights})
    gain, gain_std = held_out.full.gain(held_out.by_term["position"])
    share = 100.0 * reach / max(torque.level, 1e-300)
    clear = gain > 2.0 * gain_std and reach > 3.0 * std and share > PRACTICAL
    unit = torque.torque_unit
    words = "varies" if reach > 3.0 * std else "varies, within its interval,"
    sentence = (
        f"The torque {words} over the position by {pm(reach, std)} {unit} ({share:.0f} % of the "
        f"friction), whatever the direction; with it {_change(gain, gain_std)}."
    )
    terms = brief = ""
    if clear:
        brief = f"a part that depends on position, {pm(reach, std)} {unit} peak to peak"
        terms = "gravity, a spring or a cable that the model lacks"
        period, carried = main_period(p)
        if period < (p.state[-1] - p.state[0]) / MIN_PERIODS and carried > 0.5:
            often = f"every {format_significant(period)} {torque.position_unit}"
            if torque.position_unit == "rad":
                often += f", {2.0 * np.pi / period:.1f} times per turn of the joint"
            sentence += f" It repeats {often} ({100.0 * carried:.0f} % of its variance)."
            brief += f", {often}"
            terms = "position ripple"
    return _seen("position", sentence, reach, 2.0 * std, unit, clear, brief, terms)


def main_period(p: StateDependentParameter) -> tuple[float, float]:
    """Period of the sine that carries most of a function, and its share of the variance.

    The straight line is taken off; sines of all periods from four points to the whole range are
    fitted, points counted by the samples that they have.

    Args:
        p: the function.
    """
    x, w = p.state - p.state[0], np.sqrt(p.density)
    line = np.column_stack([np.ones(x.size), x]) * w[:, None]
    y = p.value * w
    y = y - line @ np.linalg.lstsq(line, y, rcond=None)[0]
    total = float(y @ y)
    best = (float(x[-1]), 0.0)
    for cycles in np.arange(1.0, x.size / 4.0, 0.1):
        phase = 2.0 * np.pi * cycles * x / x[-1]
        waves = np.column_stack([np.cos(phase), np.sin(phase)]) * w[:, None]
        left = y - waves @ np.linalg.lstsq(waves, y, rcond=None)[0]
        carried = 1.0 - float(left @ left) / max(total, 1e-300)
        if carried > best[1]:
            best = (float(x[-1]) / cycles, carried)
    return best


def _drift(torque: FrictionTorque, fit: StateDependentFit, held_out: HeldOut) -> FrictionFinding:
    """Change from the beginning to the end, in percent of the friction."""
    p = fit["time"]
    change, deviation = fit.contrast({"time": at(p, p.state[-1]) - at(p, p.state[0])})
    share, std = (100.0 * x / max(torque.level, 1e-300) for x in (change, deviation))
    length = float(p.state[-1] - p.state[0])
    gain, gain_std = held_out.full.gain(held_out.by_term["time"])
    large = abs(share) > 2.0 * std and abs(share) > PRACTICAL
    if not large:
        sentence = f"No drift is seen: {pm(share, std)} % of the friction over {length:.3g} s."
        return _seen("drift", sentence, share, 2.0 * std, "%", False)
    size = f"{pm(abs(share), std)} % over {length:.3g} s"
    words = "falls" if share < 0.0 else "rises"
    sentence = f"Friction {words} by {size}; with a drift {_change(gain, gain_std)}."
    brief = terms = ""
    if gain > 2.0 * gain_std:
        brief = f"{'a fall' if share < 0.0 else 'a rise'} of {size}"
        terms = "none in speed: warming up, or a wrong rigid part"
    return _seen("drift", sentence, share, 2.0 * std, "%", bool(brief), brief, terms)


def _prediction(held_out: HeldOut) -> FrictionFinding:
    """Whether functions predict better than constants."""
    gain, std = held_out.full.gain(held_out.constant)
    of_speed, speed_std = held_out.speed.gain(held_out.constant)
    sentence = (
        "On motion that was not fitted, with functions of speed instead of constants "
        f"{_change(of_speed, speed_std)}; with all functions together {_change(gain, std)} (rms "
        f"error below {held_out.band:g} Hz)."
    )
    return _seen("prediction", sentence, gain, 2.0 * std, "%", abs(gain) > 2.0 * std)


def headline(found: tuple[FrictionFinding, ...]) -> str:
    """One short sentence about a joint: what stands out.

    Args:
        found: its findings.
    """
    parts = [f.brief for f in found if f.clear and f.brief]
    if not parts:
        return "Viscous and Coulomb friction describe all that is seen here."
    return f"Beside viscous and Coulomb friction: {'; '.join(parts)}."


def pm(value: float, std: float) -> str:
    """A value ± 2σ in matching digits.

    Args:
        value: the value.
        std: its standard deviation.
    """
    return plus_minus(value, 2.0 * std)


def _change(gain: float, std: float) -> str:
    """How the held-out error changes by a gain [% of it]."""
    if gain < -2.0 * std:
        return f"the held-out error rises by {pm(-gain, std)} %"
    if gain > 2.0 * std:
        return f"the held-out error falls by {pm(gain, std)} %"
    return f"the held-out error does not fall significantly ({pm(gain, std)} %)"


def _speed(torque: FrictionTorque, speed: float) -> str:
    return f"{format_significant(speed, 2)} {torque.position_unit}/s"
