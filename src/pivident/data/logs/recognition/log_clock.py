"""The clock of a log: columns that hold time, in which unit, at which rate, how regular.

Which columns hold time stamps, by name and values, and in which unit they are.

Columns that differ only in the joint they belong to: ``actual_q_0`` … ``actual_q_5``.

A table with sixty columns has ten such series. Which joint a column belongs to follows from a joint
name of the robot in it, or else by the number in which it differs from its neighbours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from pivident.data.logs.nominal_rate import QUARTZ, usual_near, usual_rate
from pivident.data.logs.recognition.channel_words import (
    TIME_UNITS,
    TIME_WORDS,
    Reading,
    Sureness,
    read_words,
    without_unit,
    words_of,
)
from pivident.data.logs.timestamps import (
    GAP,
    JITTER_TOLERANCE,
    LOWEST_RATE,
    bridged_interval,
    likely_time_units,
    mean_rate,
    round_rate,
    runs_of,
    usual_interval,
    without_repeats,
)
from pivident.data.logs.units import TIME

#: Time of day since 1970 [s], from 1985 to 2128.
EPOCH = (5e8, 5e9)
#: Share of samples that may be stamped together, as messages that a network delivered late.
TOGETHER = 0.02
#: Share of stamps that must not go backward.
FORWARD = 0.9
#: Share of stamps that may repeat the one before in a clock that is only coarse.
COARSE = 0.9
#: Steps over which logged speeds are summed: the noise of positions and speeds averages out.
SUMMED = (1, 2, 4, 8, 16, 32, 64)
#: Correlation of steps and speeds from which on these are the speeds of the positions.
SPEEDS = 0.8

#: Lowest and highest rate [Hz].
RateInterval = tuple[float, float]


@dataclass(frozen=True, eq=False)
class LogClock:
    """What is known about time."""

    column: str | None  # the time column, or None
    unit: str
    rate: float  # sampling rate [Hz]
    sure: Sureness  # how sure column and rate are
    seen: str
    resample: bool  # whether the stamps between gaps are too irregular for equidistant
    by_rate: bool  # whether the rate stands for the stamps, which repeat or go backward
    seconds: np.ndarray  # the stamps [s], or those that follow from the rate, shape (samples,)
    together: int = 0  # samples that were stamped together, which lie in a gap of ``seconds``
    twice: tuple[int, ...] = ()  # rows that were logged twice, which are not used


def names_time(name: str) -> bool:
    """Whether a word of a column's name means time."""
    return bool(TIME_WORDS & set(words_of(name)))


def is_clock(name: str, values: np.ndarray) -> bool:
    """Whether a column holds time stamps, be they broken: by its name, and nearly increasing."""
    if not names_time(name) or len(values) < 3:
        return False
    finite = values[np.isfinite(values)]
    steps = np.diff(finite)
    return bool(steps.size and np.mean(steps >= 0) > FORWARD and np.ptp(finite))


def is_usable_clock(name: str, values: np.ndarray) -> bool:
    """Whether stamps are finite and go forward; without a name for it, perfectly evenly."""
    if len(values) < 3 or not np.isfinite(values).all():
        return False
    steps = np.diff(values)
    turnover = float(np.abs(steps).sum())
    if turnover == 0.0 or values[-1] - values[0] < FORWARD * turnover:
        return False
    if np.mean(steps == 0) > COARSE:
        return False
    # A column without such a name is a clock if nothing else could be as regular.
    return names_time(name) or bool(steps.min() > 0 and steps.max() < 1.001 * steps.min())


def clocks_in(
    stamps: Mapping[str, np.ndarray], unit: str | None
) -> tuple[dict[str, np.ndarray], str, list[str]]:
    """Time columns in seconds, the unit of the first, and a sentence where one was assumed."""
    clocks, notes = {}, []
    for number, (name, values) in enumerate(stamps.items()):
        own = unit if unit and not number else assumed_unit(values)
        clocks[name] = values * TIME.get(str(own), 1.0)
        if unit is None and own != "s":
            notes.append(f"The time stamps {name} were taken for {own}.")
    first = next(iter(stamps.values()), None)
    return clocks, unit or ("s" if first is None else assumed_unit(first)), notes


def assumed_unit(stamps: np.ndarray) -> str:
    """Seconds, unless only another unit makes a robot's rate of the stamps."""
    steps = np.diff(stamps[np.isfinite(stamps)])
    interval = float(np.median(steps[steps > 0])) if (steps > 0).any() else 0.0
    return next(iter(likely_time_units(interval)), "s") if interval > 1.0 / LOWEST_RATE else "s"


def read_clock(
    columns: dict[str, np.ndarray], hint: RateInterval | None, given: float | None
) -> LogClock:
    """Find the clock of a table; hint: of `speed_rate` [Hz], given [Hz]."""
    samples = len(next(iter(columns.values())))
    candidates = [name for name, values in columns.items() if is_usable_clock(name, values)]
    if not candidates:
        return _without(columns, samples, hint, given)
    column = min(candidates, key=lambda name: _roughness(columns[name]))
    stamps = columns[column]
    unit, why, sure = stamp_unit(column, stamps, hint)
    seconds = (stamps - stamps[0]) * TIME[unit]
    start = float(stamps[0] * TIME[unit])
    steps = np.diff(seconds)
    rate = given or round_rate((samples - 1) / float(seconds[-1]))
    together = 0
    if (apart := _apart(seconds)) is not None:
        together, seconds = int((steps == 0).sum()), apart
        steps = np.diff(seconds)
    seconds, keep = without_repeats(
        seconds, (values for name, values in columns.items() if name != column)
    )
    twice = np.flatnonzero(~keep)
    for k in twice:  # somewhere between its neighbours: it is not used
        seconds[k] += 0.5 * ((seconds[k + 1] if k + 1 < samples else seconds[k] + 1.0) - seconds[k])
    steps = np.diff(seconds)
    if (steps <= 0).any():
        repeats = int((steps <= 0).sum())
        coarse = float(np.max(np.abs(steps)) / np.ptp(seconds))
        rate = given or usual_rate(rate * (1.0 - coarse), rate * (1.0 + coarse)) or rate
        seen = (
            f"{repeats} of {samples} stamps in column {column!r} ({why}) repeat the one before or "
            f"go backward, so that only the rate is taken from them: {rate:.6g} Hz"
        )
        return LogClock(None, unit, rate, "assumed", seen, False, True, np.arange(samples) / rate)
    steps = np.diff(seconds[keep])
    period = usual_interval(steps)
    if (steps > GAP * period).any():  # rows were lost: that rate is none of the clock
        rate = given or mean_rate(seconds[keep])
    worst = float(np.abs(steps[steps <= bridged_interval(period)] / period - 1.0).max())
    jitter = f"intervals from {1e3 * steps.min():.4g} to {1e3 * steps.max():.4g} ms"
    if together:
        jitter = (
            f"but {together} samples have the stamp of the one before, as messages that arrive "
            "together; the longer side of them is used"
        )
    elif twice.size:
        jitter += f"; {twice.size} row(s) were logged twice, the first is {twice[0]}"
    seen = f"column {column!r} increases, {why}; {rate:.6g} Hz, {jitter}"
    resample = bool(together) or worst > JITTER_TOLERANCE
    rows = tuple(twice.tolist())
    return LogClock(
        column, unit, rate, sure, seen, resample, False, seconds + start, together, rows
    )


def _apart(seconds: np.ndarray) -> np.ndarray | None:
    """Stamps of which runs of equal ones lie in the middle of a gap of their own.

    A network that holds messages back delivers them together. When they were taken is not known, so
    that the log is used on one side of the gap. None: there are no such runs, or too many, or no
    gap goes with them, or stamps go backward.
    """
    steps = np.diff(seconds)
    if not 0 < np.count_nonzero(steps == 0) <= TOGETHER * len(seconds) or (steps < 0).any():
        return None
    apart, bridged = seconds.copy(), bridged_interval(usual_interval(steps[steps > 0]))
    for start, stop in runs_of(steps == 0):
        before = seconds[start - 1] if start else seconds[0] - 3.0 * bridged
        after = seconds[stop + 1] if stop + 1 < len(seconds) else seconds[-1] + 3.0 * bridged
        if after - before < 2.5 * bridged:
            return None
        apart[start : stop + 1] = 0.5 * (before + after) + np.arange(stop + 1 - start) * 1e-6
    return apart


def stamp_unit(
    name: str, stamps: np.ndarray, hint: RateInterval | None = None
) -> tuple[str, str, Sureness]:
    """Unit of time stamps, the reason, and how sure it is; stamps (samples,), hint [Hz]."""
    steps = np.diff(stamps)
    period = float(np.median(steps[steps > 0]))
    likely = likely_time_units(period)
    words = set(words_of(name))
    for unit, own in TIME_UNITS.items():
        if words & own and (unit in likely or not likely):
            return unit, f"its name says {unit}", "certain"
    size = float(np.median(np.abs(stamps)))
    for unit, s in TIME.items():
        if EPOCH[0] < size * s < EPOCH[1] and unit in likely:
            return unit, f"values of {size:.3g} are {unit} since 1970", "certain"
    if hint:
        middle = float(np.sqrt(hint[0] * hint[1]))
        near = min(TIME, key=lambda unit: abs(np.log(middle * period * TIME[unit])))
        if abs(np.log(middle * period * TIME[near])) < 0.2:
            return near, f"steps of {period:.4g} fit the logged speeds as {near}", "certain"
    if likely:
        sure: Sureness = "likely" if likely[0] == "s" or len(likely) == 1 else "assumed"
        rate = 1.0 / (period * TIME[likely[0]])
        return likely[0], f"steps of {period:.4g} are {rate:.4g} Hz as {likely[0]}", sure
    return "s", f"steps of {period:.4g} make a likely rate in no unit", "assumed"


def speed_rate(q: np.ndarray, dq: np.ndarray) -> RateInterval | None:
    """Interval of the rate at which logged speeds are the slopes of the positions [Hz], or None.

    Between two samples positions x and sums y of speeds differ by the rate f, y = f x. Noise of the
    positions makes Σxy/Σx² too small, noise of the speeds Σy²/Σxy too large; the truth lies between
    them. Sums over more steps have less noise: the narrowest interval is taken.

    Args:
        q: positions, shape (samples, joints).
        dq: speeds, of the same shape.
    """
    found: list[RateInterval] = []
    middle = 0.5 * (dq[1:] + dq[:-1])
    if not (np.isfinite(q).all() and np.isfinite(middle).all()):
        return None
    sums = np.vstack([np.zeros((1, q.shape[1])), np.cumsum(middle, axis=0)])
    for count in SUMMED:
        if count > 1 and 10 * count > len(q):
            break
        x, y = q[count:] - q[:-count], sums[count:] - sums[:-count]
        together, size, other = (float((a * b).sum()) for a, b in ((x, y), (x, x), (y, y)))
        if size == 0.0 or other == 0.0 or together < SPEEDS * np.sqrt(size * other):
            continue
        found.append((together / size, other / together))
    return min(found, key=lambda interval: interval[1] / interval[0], default=None)


def _roughness(stamps: np.ndarray) -> tuple[float, float]:
    """Share of stamps that do not advance, and relative spread of the intervals."""
    steps = np.diff(stamps)
    return float(np.mean(steps <= 0)), round(float(np.std(steps) / np.mean(steps)), 3)


def _without(
    columns: dict[str, np.ndarray], samples: int, hint: RateInterval | None, given: float | None
) -> LogClock:
    """The rate of a log without time column."""
    pair = _seconds_and_rest(columns)
    sure: Sureness
    if given:
        rate, sure, seen = given, "certain", "the rate was given"
    elif pair:
        mean, sure = (samples - 1) / pair[1], "likely"
        rate = usual_near(mean) or round_rate(mean)
        seen = f"the columns {pair[0]} hold the stamps in two parts, {rate:.6g} Hz on average"
    elif hint:
        usual, sure = usual_rate(hint[0] * (1.0 - QUARTZ), hint[1] * (1.0 + QUARTZ)), "likely"
        rate = usual or float(f"{np.sqrt(hint[0] * hint[1]):.3g}")
        seen = "there is no time column; logged speeds fit the positions at "
        seen += f"{hint[0]:.4g} to {hint[1]:.4g} Hz"
        seen += f", which allows the usual {rate:g} Hz" if usual else ""
    else:
        rate, sure = 1000.0, "assumed"
        seen = "there is no time column, and nothing in the log gives the rate"
    return LogClock(None, "s", rate, sure, seen, False, True, np.arange(samples) / rate)


def _seconds_and_rest(columns: dict[str, np.ndarray]) -> tuple[str, float] | None:
    """Names of a column of whole seconds and one of the rest in ns, and the time they span [s]."""
    whole = [n for n in columns if set(words_of(n)) & TIME_UNITS["s"]]
    rest = [n for n in columns if set(words_of(n)) & TIME_UNITS["ns"]]
    for a in whole:
        for b in rest:
            span = columns[a][-1] - columns[a][0] + 1e-9 * (columns[b][-1] - columns[b][0])
            if np.isfinite(span) and span > 0 and np.max(columns[b]) < 1.001e9:
                return f"{a!r} and {b!r}", float(span)
    return None


#: What stands for the joint in the words of a series.
JOINT = "{}"


@dataclass(frozen=True)
class Series:
    """One signal of several joints."""

    words: tuple[str, ...]  # words of the names, with `JOINT` for the joint
    columns: Mapping[str, str]  # by joint's name or number, empty without either
    named: bool  # whether the keys are names of the robot's joints
    reading: Reading  # what the words say
    units: Mapping[str, str] = field(default_factory=dict)  # beside the names, by joint

    @property
    def channel(self) -> str | None:
        """The quantity, see `Reading`."""
        return self.reading.channel


def column_series(columns: Sequence[str], joint_names: Sequence[str] = ()) -> list[Series]:
    """All series of a table, in the order of their first columns."""
    phrases = joint_phrases(joint_names)
    bare = {column: without_unit(column) for column in columns}
    words = {column: words_of(bare[column][0]) for column in columns}
    found: dict[str, tuple[tuple[str, ...], str, bool]] = {}
    for column in columns:
        match = joint_in(words[column], phrases)
        if match is not None:
            joint, first, last = match
            pattern = (*words[column][:first], JOINT, *words[column][last:])
            found[column] = (pattern, joint, True)
    counts = Counter(
        pattern for c in columns if c not in found for pattern, _ in _numbered(words[c])
    )
    for column in columns:
        if column not in found:
            patterns = _numbered(words[column])
            # The number that most neighbours differ in; of two the last one.
            pattern, key = max(reversed(patterns), key=lambda p: counts[p[0]])
            found[column] = (pattern, key, False)
    grouped: dict[tuple[tuple[str, ...], bool, str | None], dict[str, str]] = {}
    for column in columns:
        pattern, key, named = found[column]
        # Degrees of a turning joint and millimetres of a sliding one are one series.
        grouped.setdefault((pattern, named, bare[column][2]), {}).setdefault(key, column)
    return [
        Series(
            pattern,
            own,
            named,
            # with the unit of its first column, and the quantity that it implies
            read_words([w for w in pattern if w != JOINT], *bare[next(iter(own.values()))][1:]),
            {key: unit for key, column in own.items() if (unit := bare[column][1]) is not None},
        )
        for (pattern, named, _), own in grouped.items()
    ]


def _numbered(words: Sequence[str]) -> list[tuple[tuple[str, ...], str]]:
    """The patterns that a name fits, one for each number in it, with that number."""
    places = [k for k, word in enumerate(words) if word.isdecimal()]
    if not places:
        return [(tuple(words), "")]
    return [((*words[:k], JOINT, *words[k + 1 :]), words[k]) for k in places]


def joint_phrases(joint_names: Sequence[str]) -> dict[tuple[str, ...], str]:
    """What a column may call each joint: its words, and those without what all joints share."""
    own = {name: tuple(words_of(name)) for name in joint_names}
    phrases = {words: name for name, words in own.items() if words}
    shared = _shared_beginning(list(own.values()))
    shorter: dict[tuple[str, ...], list[str]] = {}
    for name, words in own.items():
        ends = [words[k:] for k in range(shared + 1)]
        for short in (*ends, *map(_without_joint, ends)):
            if any(not word.isdecimal() and word != "joint" for word in short):
                shorter.setdefault(short, []).append(name)
    for words, names in shorter.items():
        if len(set(names)) == 1:
            phrases.setdefault(words, names[0])
    return phrases


def _shared_beginning(names: Sequence[Sequence[str]]) -> int:
    """Number of words that all names begin with."""
    if len(names) < 2:
        return 0
    shared = 0
    while all(len(n) > shared + 1 for n in names) and len({n[shared] for n in names}) == 1:
        shared += 1
    return shared


def _without_joint(words: tuple[str, ...]) -> tuple[str, ...]:
    """The words without a "joint" at their end."""
    return words[:-1] if words[-1:] in (("joint",), ("jnt",)) else words


def joint_in(
    words: Sequence[str], phrases: Mapping[tuple[str, ...], str]
) -> tuple[str, int, int] | None:
    """The joint that a name names, and where in its words; of two the longer one."""
    for size in sorted(set(map(len, phrases)), reverse=True):
        for first in reversed(range(len(words) - size + 1)):
            joint = phrases.get(tuple(words[first : first + size]))
            if joint is not None:
                return joint, first, first + size
    return None
