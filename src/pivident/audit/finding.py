"""What an audit says about one thing: how bad it is, where, how much, and what to do."""

from __future__ import annotations

import re
from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from typing import Any, Literal, Protocol, TypeVar

from pivident.text.numbers import plus_minus
from pivident.text.plain_values import plain

Severity = Literal["fine", "look", "wrong"]

#: From harmless to harmful.
SEVERITIES: tuple[Severity, ...] = ("fine", "look", "wrong")


#: Kinds of findings that a fault of the logger gives many channels at once.
SHARED = ("digits", "step", "missing", "spike", "clipped")


@dataclass(frozen=True)
class Finding:
    """One statement about a log.

    Attributes:
        severity: ``fine``: nothing to do; ``look``: may be right, look at it; ``wrong``: an
            identification would be wrong or impossible.
        check: what was looked at (``timing``, ``delay`` …).
        kind: what was found, one word for programs (``gap``, ``late`` …).
        sentence: in plain words.
        where: channel or joint, empty for the whole log.
        step: what to do next, empty where nothing needs to be done.
        value: the number, or None.
        unit: its unit.
        bound: the value from which it would be worse, or None.
        interval: ±2σ of the value where it is an estimate.
        sample: index of the first sample concerned, or None.
        time: its time on the log's clock [s], or None.
    """

    severity: Severity
    check: str
    kind: str
    sentence: str
    where: str = ""
    step: str = ""
    value: float | None = None
    unit: str = ""
    bound: float | None = None
    interval: tuple[float, float] | None = None
    sample: int | None = None
    time: float | None = None

    @property
    def amount(self) -> str:
        """The number with its interval and unit, empty without one."""
        if self.value is None:
            return ""
        text = f"{self.value:.4g}"
        if self.interval is not None:
            text = plus_minus(self.value, (self.interval[1] - self.interval[0]) / 2)
        return text if self.unit.startswith("unit") else f"{text} {self.unit}".rstrip()

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become None."""
        return plain(asdict(self))


class Statement(Protocol):
    """What findings of an audit and remarks of a check have in common."""

    @property
    def severity(self) -> Severity:
        """How bad it is."""

    @property
    def kind(self) -> str:
        """What was found, for programs."""

    @property
    def sentence(self) -> str:
        """What was seen."""

    @property
    def step(self) -> str:
        """What to do next."""

    @property
    def where(self) -> str:
        """Joint or channel."""

    @property
    def amount(self) -> str:
        """The number with its unit."""


AnyStatement = TypeVar("AnyStatement", bound=Statement)

#: A number that is no part of a name.
_NUMBER = re.compile(r"(?<!\w)[-+]?\d+(?:\.\d+)?(?:e[-+]?\d+)?(?!\w)")


def alike(statements: Iterable[AnyStatement]) -> list[list[AnyStatement]]:
    """Statements in groups that say the same of different joints or channels.

    They have severity, kind and next step in common, and the sentence but for the name and, where
    the amount tells it, the number. What a fault of the logger gives many channels is alike
    whatever it says in detail.

    Args:
        statements: in the order in which they are to be told.
    """
    groups: dict[object, list[AnyStatement]] = {}
    for number, statement in enumerate(statements):
        shared = statement.kind in SHARED
        words = "" if shared else _pattern(statement.sentence, statement)
        step = "" if shared else _pattern(statement.step, statement)
        key = (statement.severity, statement.kind, getattr(statement, "place", ()), words, step)
        groups.setdefault(key if statement.where else number, []).append(statement)
    return list(groups.values())


def merged(group: Sequence[Statement]) -> str:
    """One sentence for all statements of a group: the first, and for whom else it holds.

    Args:
        group: statements that are alike.
    """
    first, *others = group
    named = [f"{s.where} ({s.amount})" if s.amount else s.where for s in others]
    return first.sentence + (f" The same for {', '.join(named)}." if named else "")


def _pattern(text: str, statement: Statement) -> str:
    """A text without the name, and without numbers where the amount tells them."""
    joint = statement.where.rpartition(" of ")[2]
    for name in filter(None, (statement.where, joint)):
        text = re.sub(rf"(?<!\w){re.escape(name)}(?!\w)", "…", text)
    return _NUMBER.sub("#", text) if statement.amount else text


def worst(findings: Iterable[Finding]) -> Severity:
    """The gravest severity, ``fine`` where there is no finding."""
    return max((f.severity for f in findings), key=SEVERITIES.index, default="fine")


def gravest_first(findings: Iterable[Finding]) -> list[Finding]:
    """Findings in order of severity; equals keep their order."""
    return sorted(findings, key=lambda f: -SEVERITIES.index(f.severity))


def grouped(findings: Iterable[Finding]) -> list[tuple[Severity, str, str]]:
    """Severity, sentence and next step of what is not fine, the gravest first.

    What joints or channels share is said once.

    Args:
        findings: of one log.
    """
    serious = (f for f in gravest_first(findings) if f.severity != "fine")
    return [(group[0].severity, merged(group), group[0].step) for group in alike(serious)]
