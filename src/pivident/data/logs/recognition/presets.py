"""Presets of loggers that are used often: what their columns hold, by a table with its sources.

A preset is recognised by the names of columns and joints. What it says of units, of the side of the
gear and of gains is held against the data, which decide.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib.resources import files
from typing import Any

from pivident.data.logs.recognition.channel_words import Reading, words_of
from pivident.data.logs.recognition.log_clock import JOINT, Series
from pivident.foundation.text.toml import parse_toml


@dataclass(frozen=True)
class Preset:
    """What is known of one kind of log; ``presets.toml`` says what the entries mean."""

    name: str
    text: str
    sources: tuple[str, ...]
    columns: tuple[tuple[str, ...], ...]
    joints: frozenset[str] = frozenset()
    channels: Mapping[tuple[str, ...], Mapping[str, str]] = field(default_factory=dict)
    unit: str = ""
    side: str = ""
    gains: tuple[Mapping[str, Any], ...] = ()

    def __str__(self) -> str:
        """It with its first source."""
        return f"{self.text} ({self.sources[0]})"

    def gains_of(self, robot: str, joints: int) -> tuple[tuple[float, ...], str] | None:
        """Published gains of a robot by its name, N m per unit by joint, and their source."""
        for entry in self.gains:
            if robot.lower() in entry["robots"] and len(entry["values"]) == joints:
                return tuple(entry["values"]), str(entry["source"])
        return None

    def says(self, channel: str) -> bool:
        """Whether it gives the unit of a channel."""
        return any(m["channel"] == channel and "unit" in m for m in self.channels.values())

    def means(self, words: Sequence[str]) -> Mapping[str, str] | None:
        """Channel and unit of a name by its words: those of the longest phrase in it."""
        inside = [phrase for phrase in self.channels if _holds(words, phrase)]
        return self.channels[max(inside, key=len)] if inside else None


@cache
def presets() -> tuple[Preset, ...]:
    """All presets, in the order of their table."""
    table = parse_toml((files(__package__) / "presets.toml").read_text(encoding="utf-8"))
    return tuple(
        Preset(
            entry["name"],
            entry["text"],
            tuple(entry["sources"]),
            tuple(tuple(phrase.split()) for phrase in entry["columns"]),
            frozenset(entry.get("joints", ())),
            {tuple(k.split()): meant for k, meant in entry.get("channels", {}).items()},
            entry.get("torque", {}).get("unit", ""),
            entry.get("torque", {}).get("side", ""),
            tuple(entry.get("gains", ())),
        )
        for entry in table["preset"]
    )


def recognised(columns: Iterable[str], joint_names: Iterable[str]) -> Preset | None:
    """The preset whose phrases all stand in names of columns: of several the most particular."""
    named = [_plain(words_of(column)) for column in columns]
    own = set(joint_names)
    found = [
        preset
        for preset in presets()
        if all(any(_holds(words, phrase) for words in named) for phrase in preset.columns)
        and (not preset.joints or preset.joints & own)
    ]
    return max(found, key=lambda p: sum(map(len, p.columns)), default=None)


def with_meanings(preset: Preset, series: Iterable[Series]) -> list[Series]:
    """Series of columns with the channels and units that a preset gives them."""
    read = []
    for one in series:
        meant = preset.means(_plain(one.words))
        if meant is not None:
            channel, unit = meant["channel"] or None, meant.get("unit")
            one = replace(one, reading=Reading(channel, unit, 1, foreign=channel is None))
        read.append(one)
    return read


def _plain(words: Sequence[str]) -> tuple[str, ...]:
    """The words of a name without its numbers."""
    return tuple(word for word in words if word != JOINT and not word.isdecimal())


def _holds(words: Sequence[str], phrase: Sequence[str]) -> bool:
    """Whether a phrase stands in a name."""
    size = len(phrase)
    return any(tuple(words[k : k + size]) == tuple(phrase) for k in range(len(words) - size + 1))
