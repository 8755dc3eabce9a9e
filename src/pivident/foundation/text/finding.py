"""A finding: how grave, about what, the numbers behind it, and what to do.

Audit of a log, check of an experiment, verdict, friction and payload all report findings.
"""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from math import nan
from typing import Annotated, Any, Literal, TypeVar

from pivident.foundation.text.display import Displayed
from pivident.foundation.text.numbers import plus_minus
from pivident.foundation.text.plain_values import LATER, NOT_STORED, SPARSE, As, Known, Null, plain
from pivident.foundation.text.repair import RECORDING, Place, Repair, joined_repairs
from pivident.foundation.text.sentences import plural

Severity = Literal["ok", "note", "warning", "error"]

#: Repairs in a file are of the experiment file of that run, and are not read with a finding.
NOT_READ_BACK = As(
    list[Any], lambda repairs: [repair.as_json() for repair in repairs], lambda stored: ()
)

#: From harmless to harmful.
SEVERITIES: tuple[Severity, ...] = ("ok", "note", "warning", "error")

#: One character for each severity.
MARKS: dict[Severity, str] = {"ok": "+", "note": "·", "warning": "!", "error": "×"}

#: Names of evidence that say where in a log a finding begins.
WHERE_IN_LOG = ("sample", "time")


@dataclass(frozen=True)
class Quantity:
    """A number with its unit.

    Attributes:
        value: the number.
        unit: its unit, empty for a ratio or a count.
        bound: the value from which it would be worse, or None.
        interval: ±2σ of the value where it is an estimate.
        digits: significant digits in sentences.
    """

    value: Known
    unit: Annotated[str, LATER] = ""
    bound: Annotated[float | None, LATER] = None
    interval: Annotated[tuple[float, float] | None, LATER, Null(nan)] = None
    digits: Annotated[int, NOT_STORED] = 4

    def __str__(self) -> str:
        text = (
            f"{self.value:.{self.digits}g}"
            if self.interval is None
            else plus_minus(self.value, (self.interval[1] - self.interval[0]) / 2)
        )
        return text if self.unit.startswith("unit") else f"{text} {self.unit}".rstrip()


@dataclass(frozen=True)
class Topic:
    """What a check looks at.

    Attributes:
        name: one word for programs, such as ``timing``.
        heading: over its findings on a page; empty where they have no section.
    """

    name: str
    heading: str = ""


@dataclass(frozen=True)
class FindingKind:
    """What a check may find, declared beside it.

    Attributes:
        topic: what was looked at.
        name: what was found, one word or two for programs (``gap``, ``late`` …).
        place: tables and keys of the experiment file where it is changed, from ``recording`` on for
            the recording that it is about; a single finding may say another one.
        reservation: whether it is a reservation about every estimate of the record.
        stops: whether an identification stops at it.
        spoils: checks that make no sense behind a fault of this kind, by name.
        reports: errors of the reader that say the same with fewer numbers.
    """

    topic: Topic
    name: str
    place: Place = (*RECORDING, "files")
    reservation: bool = False
    stops: bool = False
    spoils: tuple[str, ...] = ()
    reports: tuple[type[Exception], ...] = ()

    def finding(
        self,
        severity: Severity,
        message: str,
        subject: str = "",
        next_step: str = "",
        evidence: Mapping[str, Quantity] | None = None,
        *,
        repairs: Iterable[Repair] = (),
        place: Place | None = None,
    ) -> Finding:
        """A finding of this kind; see there."""
        return Finding(
            severity,
            self.topic.name,
            self.name,
            message,
            subject,
            next_step,
            evidence or {},
            place=self.place if place is None else place,
            repairs=tuple(repairs),
            declared=self,
        )


@dataclass(frozen=True)
class Finding(Displayed):
    """One statement about data, a file or a result.

    Attributes:
        severity: ``ok``: nothing to do; ``note``: neither good nor bad; ``warning``: may be right,
            look at it; ``error``: a result would be wrong or impossible.
        topic: what was looked at (``timing``, ``delay``, ``noise`` …).
        kind: what was found, one word or two for programs (``gap``, ``late`` …); findings of one
            kind differ in their subject and their evidence only.
        message: what was found, in a sentence.
        subject: joint, channel, column, file or recording; empty for the whole.
        next_step: what to do next; empty where nothing needs to be done.
        evidence: numbers by name, the decisive one first; ``sample`` and ``time`` say where in a
            log it begins.
        basis: the test behind it with its numbers, in words.
        place: tables and keys of the experiment file where it is changed; empty for none.
        repairs: ways to set it right, the most likely first; empty where none is definite.
        declared: its kind, where that is declared beside its check.
    """

    severity: Severity
    topic: str
    kind: str
    message: str
    subject: Annotated[str, LATER] = ""
    next_step: Annotated[str, LATER] = ""
    evidence: Annotated[Mapping[str, Quantity], LATER] = field(default_factory=dict)
    basis: Annotated[str, LATER] = ""
    place: Annotated[Place, SPARSE] = ()
    repairs: Annotated[tuple[Repair, ...], SPARSE, NOT_READ_BACK] = ()
    declared: FindingKind | None = field(default=None, compare=False, repr=False)

    def __str__(self) -> str:
        basis = f" [{self.basis}]" if self.basis else ""
        return f"{MARKS[self.severity]} {self.topic}: {self.advised}{basis}"

    @property
    def advised(self) -> str:
        """The message and the next step."""
        return f"{self.message} {self.next_step}".rstrip()

    @property
    def numbers(self) -> dict[str, Quantity]:
        """The evidence without the place in a log."""
        return {name: x for name, x in self.evidence.items() if name not in WHERE_IN_LOG}

    @property
    def quantity(self) -> Quantity | None:
        """The decisive number, or None."""
        return next(iter(self.numbers.values()), None)

    @property
    def is_reservation(self) -> bool:
        """Whether it is about every estimate of the record."""
        return self.declared is not None and self.declared.reservation

    def spoils(self, check: str) -> bool:
        """Whether it is a fault behind which a check makes no sense."""
        spoilt = () if self.declared is None else self.declared.spoils
        return self.severity == "error" and check in spoilt

    @property
    def sample(self) -> int | None:
        """Index of the first sample concerned, or None."""
        found = self.evidence.get("sample")
        return None if found is None else int(found.value)

    @property
    def time(self) -> float | None:
        """Time of that sample on the log's clock [s], or None."""
        found = self.evidence.get("time")
        return None if found is None else found.value

    @property
    def amount(self) -> str:
        """The numbers in words: one alone, several by name; empty without evidence."""
        numbers = self.numbers
        if len(numbers) < 2:
            return "".join(map(str, numbers.values()))
        return ", ".join(f"{name} {x}" for name, x in numbers.items())

    @property
    def heading(self) -> str:
        """Where it is changed, in words; empty unless it is a finding about a file."""
        return ""

    @property
    def group(self) -> tuple[object, ...]:
        """What findings have in common that differ in subject and numbers only."""
        return self.severity, self.topic, self.kind, self.next_step, *self.numbers

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become None, repairs are there if any are."""
        return plain(self)


AnyFinding = TypeVar("AnyFinding", bound=Finding)


def at_sample(sample: int, time: float | None) -> dict[str, Quantity]:
    """Evidence that says where in a log a finding begins.

    Args:
        sample: index of the first sample concerned.
        time: its time on the log's clock [s], or None.
    """
    where = {"sample": Quantity(sample)}
    return where if time is None else where | {"time": Quantity(time, "s")}


def worst(findings: Iterable[Finding]) -> Severity:
    """The gravest severity, ``ok`` where there is no finding."""
    return max((f.severity for f in findings), key=SEVERITIES.index, default="ok")


def gravest_first(findings: Iterable[AnyFinding]) -> list[AnyFinding]:
    """Findings in order of severity; equals keep their order."""
    return sorted(findings, key=lambda f: -SEVERITIES.index(f.severity))


def serious(findings: Iterable[AnyFinding]) -> list[AnyFinding]:
    """Warnings and errors, the gravest first; what several subjects share is one finding."""
    limit = SEVERITIES.index("warning")
    return merged(f for f in gravest_first(findings) if SEVERITIES.index(f.severity) >= limit)


def merged(findings: Iterable[AnyFinding]) -> list[AnyFinding]:
    """Findings with those of one kind in one: the first, and for which subjects else it holds.

    Args:
        findings: in the order in which they are reported.
    """
    groups: dict[object, list[AnyFinding]] = {}
    for number, finding in enumerate(findings):
        groups.setdefault(finding.group if finding.subject else number, []).append(finding)
    return [_joined(group) for group in groups.values()]


def _joined(group: Sequence[AnyFinding]) -> AnyFinding:
    first, *others = group
    if not others:
        return first
    named = [f"{f.subject} ({f.amount})" if f.amount else f.subject for f in others]
    message = f"{first.message} The same for {', '.join(named)}."
    return replace(
        first, message=message, repairs=tuple(joined_repairs([f.repairs for f in group]))
    )


def counted(findings: Iterable[Finding]) -> str:
    """How many there are of what needs attention: ``2 errors, 1 warning``.

    Args:
        findings: of all severities.
    """
    counts = Counter(finding.severity for finding in findings)
    named: tuple[Severity, ...] = ("error", "warning")
    return ", ".join(plural(counts[s], s) for s in named)
