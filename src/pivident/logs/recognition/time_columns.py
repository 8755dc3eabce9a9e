"""Which columns hold time stamps, by name and values, and in which unit they are."""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from pivident.logs.clocks.timestamps import LOWEST_RATE, likely_time_units
from pivident.logs.recognition.channel_words import TIME_WORDS, words_of
from pivident.logs.units import TIME

#: Share of stamps that must not go backward.
FORWARD = 0.9

#: Share of stamps that may repeat the one before in a clock that is only coarse.
COARSE = 0.9


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
    if not interval > 1.0 / LOWEST_RATE:
        return "s"
    return next(iter(likely_time_units(interval)), "s")
