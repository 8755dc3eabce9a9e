"""One sequence for every record: find a fault, set it right, look for the next.

Audit, check, draft and verdict ask the same checks, each in its turn. A check is given the record
with the faults made good that those before it have found, so that one wrong column is not reported
once for every number that depends on it, and it is not asked where such a fault spoils its answer.
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from typing import Any, ClassVar

from pivident.data.logs.log import Log
from pivident.foundation.text.finding import Finding
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.judgement.audit.timing import Timing


@dataclass(frozen=True, eq=False)
class Examination:
    """A record as far as it has been looked at.

    Attributes:
        log: the record as it is.
        timing: its clock.
        model: rows τ = Φ θ of its inverse model, with the faults made good that were found.
        findings: of the checks so far.
        results: what the checks have measured, by their names.
    """

    log: Log
    timing: Timing
    model: InverseModel
    findings: tuple[Finding, ...] = ()
    results: Mapping[str, Any] = field(default_factory=dict)

    def after(
        self,
        check: str,
        findings: Iterable[Finding],
        result: Any = None,
        model: InverseModel | None = None,
    ) -> Examination:
        """The same after one more check.

        Args:
            check: its name.
            findings: of the check.
            result: what it has measured.
            model: the rows with a fault made good; None: there was none.
        """
        return replace(
            self,
            model=model or self.model,
            findings=(*self.findings, *findings),
            results={**self.results, check: result},
        )

    def of(self, *topics: str) -> list[Finding]:
        """Findings of some topics."""
        return [finding for finding in self.findings if finding.topic in topics]


class LogCheck:
    """One check of a record.

    Attributes:
        name: by which faults say that they spoil it, and which its results have.
    """

    name: ClassVar[str]

    def examine(self, seen: Examination) -> Examination:
        """The examination with the findings of this check, and with its fault made good."""
        raise NotImplementedError(f"{type(self).__name__} does not examine anything")


def in_turn(seen: Examination, checks: Iterable[LogCheck]) -> Examination:
    """The examination after some checks, without those that a fault spoils."""
    for check in checks:
        if not any(finding.spoils(check.name) for finding in seen.findings):
            seen = check.examine(seen)
    return seen
