"""Columns that differ only in the joint they belong to: ``actual_q_0`` … ``actual_q_5``.

A table with sixty columns has ten such series. Which joint a column belongs to follows from a joint
name of the robot in it, or else by the number in which it differs from its neighbours.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

from pivident.data.logs.recognition.channel_words import Reading, read_words, without_unit, words_of

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
            read_words([w for w in pattern if w != JOINT], *_unit(own, bare)),
            {key: unit for key, column in own.items() if (unit := bare[column][1]) is not None},
        )
        for (pattern, named, _), own in grouped.items()
    ]


def _unit(own: Mapping[str, str], bare: Mapping[str, tuple[str, str | None, str | None]]):
    """Unit of a series' first column, and the quantity that it implies."""
    return bare[next(iter(own.values()))][1:]


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
