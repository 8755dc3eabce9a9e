"""The verdict: should one believe this result, in plain words, each with its numbers.

A verdict is made of statements in a fixed order: which estimate to take; what is well determined
and what is not; whether the feedback biases least squares; whether the noise model whitens; whether
the instruments are fit for use; how well unseen motion is predicted; and what the residual is made
of. Each statement is a finding with its severity and the test that it is based on.
"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from pivident.diagnostics.consistency_statements import consistency
from pivident.diagnostics.diagnostics import Diagnostics, diagnose_one
from pivident.diagnostics.estimate_statements import (
    choice,
    convergence,
    determined,
    further_warnings,
    identified_law,
    signs,
    torque_scale,
)
from pivident.diagnostics.instrument_statements import feedback_bias, strength
from pivident.diagnostics.prediction_statements import prediction, simulated_loop
from pivident.diagnostics.residual_statements import (
    friction_law,
    model_or_noise,
    noise,
    spectral_lines,
)
from pivident.estimation.identification import Identification
from pivident.logs.torque_scale import scale_headline
from pivident.text import display
from pivident.text.finding import Finding, Severity, worst

#: Number of the layout of ``verdict.json``.
SCHEMA = 2


@dataclass(frozen=True)
class Verdict:
    """Should one believe it?

    Attributes:
        method: name of the method whose estimate to take.
        name: its short name.
        statements: in the order of the page.
        scale: in what units all parameters are, a sentence; empty where torques are known in SI.
    """

    method: str
    name: str
    statements: tuple[Finding, ...]
    scale: str = ""

    @property
    def severity(self) -> Severity:
        """The gravest of all statements; a note is no reservation."""
        gravest = worst(self.statements)
        return "ok" if gravest == "note" else gravest

    @property
    def headline(self) -> str:
        """The verdict in one sentence, and another one where the parameters are not in SI."""
        return f"{self._advice()} {self.scale}".rstrip()

    def _advice(self) -> str:
        """Whether to take the estimate."""
        reservations = sum(s.severity == "warning" for s in self.statements)
        if self.severity == "error":
            wrong = (s.topic for s in self.statements if s.severity == "error")
            topics = ", ".join(dict.fromkeys(wrong))
            return f"Do not use this result as it is: {topics} (marked ×)."
        if self.severity == "warning":
            many = "one reservation" if reservations == 1 else f"{reservations} reservations"
            return f"Take the estimate of {self.method}, with {many} (marked !)."
        return f"Take the estimate of {self.method}: no reservations."

    def __str__(self) -> str:
        return "\n".join(["Verdict: " + self.headline, *(f"  {s}" for s in self.statements)])

    def __repr__(self) -> str:
        return f"<Verdict: {self.headline}>"

    def _repr_html_(self) -> str:
        return display.html_of(self)


def verdict(diagnostics: Diagnostics | Identification) -> Verdict:
    """Put what was found out into words.

    Args:
        diagnostics: tests and comparisons; for a result alone the tests that need nothing else.

    Returns:
        Statements in a fixed order, each with a severity and its numbers.
    """
    if isinstance(diagnostics, Identification):
        diagnostics = diagnose_one({diagnostics.method: diagnostics})
    name = diagnostics.recommended
    result = diagnostics.identifications[name]
    statements = [
        *choice(diagnostics, name),
        *torque_scale(result),
        *convergence(result),
        *determined(result),
        *signs(result),
        *feedback_bias(diagnostics, name),
        *noise(result, diagnostics.residuals[name]),
        *spectral_lines(result),
        *strength(diagnostics, name),
        *prediction(diagnostics, name),
        *simulated_loop(diagnostics, name),
        *model_or_noise(diagnostics),
        *friction_law(diagnostics, name),
        *consistency(diagnostics, name),
        *identified_law(result),
        *further_warnings(result),
        *(Finding("note", "not tested", "not tested", text) for text in diagnostics.notes),
    ]
    return Verdict(result.method, name, tuple(statements), scale_headline(result.torque_scale))


def save_verdict(found: Verdict, path: Path) -> None:
    """Write a verdict as JSON."""
    import json

    content = {
        "schema": SCHEMA,
        "method": found.method,
        "severity": found.severity,
        "headline": found.headline,
        "statements": [s.as_json() for s in found.statements],
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")
