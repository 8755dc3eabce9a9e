"""What an audit says about one thing: how bad it is, where, how much, and what to do."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from typing import Any, Literal

from pivident.plain_values import plain

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

    def as_json(self) -> dict[str, Any]:
        """Plain values; numbers that are not finite become None."""
        return plain(asdict(self))


def worst(findings: Iterable[Finding]) -> Severity:
    """The gravest severity, ``fine`` where there is no finding."""
    return max((f.severity for f in findings), key=SEVERITIES.index, default="fine")


def gravest_first(findings: Iterable[Finding]) -> list[Finding]:
    """Findings in order of severity; equals keep their order."""
    return sorted(findings, key=lambda f: -SEVERITIES.index(f.severity))


def grouped(findings: Iterable[Finding]) -> list[tuple[Severity, str, str]]:
    """Severity, sentence and next step of what is not fine, the gravest first.

    What many channels share is said once.

    Args:
        findings: of one log.
    """
    groups: dict[tuple[str, str, str], list[Finding]] = {}
    for finding in gravest_first(findings):
        if finding.severity != "fine":
            step = finding.kind if finding.kind in SHARED else finding.step
            groups.setdefault((finding.severity, finding.kind, step), []).append(finding)
    rows: list[tuple[Severity, str, str]] = []
    for group in groups.values():
        first, others = group[0], group[1:]
        also = f" The same for {', '.join(f.where for f in others)}." if len(others) > 1 else ""
        rows.append((first.severity, first.sentence + also, first.step))
        if len(others) == 1:
            rows.append((others[0].severity, others[0].sentence, others[0].step))
    return rows
