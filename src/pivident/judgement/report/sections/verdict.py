"""Should one believe it? The verdict, at the head of the page, and how each method ended."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Any

import numpy as np

from pivident.dynamics.signs import NegativeParameter, negative_parameters
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import (
    CONTRADICTION,
    aligned_rows,
    largest_difference,
    parameter_rows,
)
from pivident.estimation.summary import ending, error_rows, label_lines
from pivident.foundation.text.finding import Finding, Quantity
from pivident.foundation.text.numbers import percent
from pivident.foundation.text.sentences import listed
from pivident.judgement.diagnostics.verdict import beside_verdict
from pivident.judgement.report.sections.base import Section
from pivident.judgement.validation.residuals.residual_tests import ResidualTests


def findings(identification: Identification, tests: ResidualTests) -> tuple[Finding, ...]:
    """Findings about one result: the estimator's own warnings first."""
    own = identification.warnings
    said = {w.topic for w in own} | ({"physics"} if any(w.topic == "signs" for w in own) else set())
    more = (
        *_about_convergence(identification),
        *_about_parameters(identification),
        *_about_noise(identification, tests),
    )
    return (*own, *(f for f in more if f.topic not in said))


def disagreements(identifications: Sequence[Identification], labels: Sequence[str]) -> str | None:
    """Which parameters two methods contradict each other on, None where there are none."""
    apart = []
    for name, rows in aligned_rows(identifications).items():
        distance, i, j = largest_difference(rows)
        if distance > CONTRADICTION:
            apart.append((distance, f"{name} ({labels[i]} and {labels[j]})"))
    if not apart:
        return None
    names = [text for _, text in sorted(apart, reverse=True)]
    return (
        f"Two methods differ by more than {CONTRADICTION:g} combined standard errors on "
        f"{listed(names)}; at least one of their intervals is too narrow."
    )


def _about_convergence(identification: Identification) -> Iterator[Finding]:
    if not identification.converged:
        changes = [percent(100.0 * i.change) for i in identification.history[-1:]]
        last = f" (last change {changes[0]})" if changes else ""
        text = (
            f"The iteration did not converge within {identification.iterations} passes{last}; "
            "these values are not an estimate yet."
        )
        evidence = {"passes": Quantity(identification.iterations)}
        yield Finding("error", "iteration", "not converged", text, evidence=evidence)


def _about_parameters(identification: Identification) -> Iterator[Finding]:
    rows = parameter_rows(identification)
    undetermined = [row.name for row in rows if row.includes_zero]
    if undetermined:
        text = (
            f"{len(undetermined)} of {len(rows)} parameters are not significantly different from "
            f"zero, which their ±2σ includes: {listed(undetermined)}."
        )
        evidence = {"not significant": Quantity(len(undetermined))}
        yield Finding("warning", "parameters", "not significant", text, evidence=evidence)
    certain = [p for p in _negative(identification) if p.is_certain]
    if certain:
        names = listed([p.name for p in certain])
        text = f"Negative, which friction and rotor inertia cannot be: {names}."
        evidence = {p.name: p.quantity for p in certain}
        yield Finding("error", "physics", "negative", text, evidence=evidence)


def _about_noise(identification: Identification, tests: ResidualTests) -> Iterator[Finding]:
    bound = [joint.name for joint in identification.joints if joint.ar_at_bound]
    if bound:
        text = f"Noise models of the largest order allowed: {listed(bound)}."
        step = "A larger one might fit better."
        yield Finding("warning", "noise model", "order at its bound", text, next_step=step)
    correlated = [joint for joint, test in tests.of("whiteness") if test.matters]
    if correlated:
        text = (
            f"Residuals that are not white: {listed(correlated)}. "
            f"{_about_standard_errors(identification)}"
        )
        yield Finding("warning", "noise", "coloured", text)


def _about_standard_errors(identification: Identification) -> str:
    """What correlated residuals mean for the reported standard errors."""
    if not np.isfinite(identification.robust_std).all():
        return "The method's own standard errors assume that they are, and no others are known."
    return (
        "The standard errors account for that, but a better model of friction, elasticity or noise "
        "would make them smaller."
    )


def _negative(identification: Identification) -> list[NegativeParameter]:
    found = identification
    return negative_parameters(found.parameters, found.names, found.theta, found.std)


class VerdictSection(Section):
    """Which estimate to take, what supports it, and what is a reservation."""

    title = "Verdict"
    anchor = "verdict"

    def context(self) -> dict[str, Any]:
        """What was identified, the verdict with its reservations first, and its key figures."""
        data = self.data
        found, best = data.verdict, data.recommended
        recordings = {r.name: r for i in data.identifications for r in i.recordings}
        against = [s for s in found.statements if s.severity in ("error", "warning")]
        return {
            "verdict": found,
            "robots": list({i.robot.name: i.robot for i in data.identifications}.values()),
            "recordings": [
                (name, len(r.t), float(r.t[-1] - r.t[0])) for name, r in recordings.items()
            ],
            "accounts": any(r.account for r in recordings.values()),
            "labels": data.labels,
            "label_lines": label_lines(data.identifications),
            "several": data.several,
            "summary": data.summary,
            "groups": [
                (title, statements)
                for title, statements in (
                    ("Reservations", against),
                    ("What else was found", [s for s in found.statements if s not in against]),
                )
                if statements
            ],
            "files": [file for file in data.downloads if file.method == best],
        }


class SummarySection(Section):
    """One line per method, then the remarks in plain words."""

    title = "Summary"
    anchor = "summary"

    def context(self) -> dict[str, Any]:
        """Methods at a glance and remarks."""
        data = self.data
        apart = disagreements(data.identifications, data.labels)
        names = list(data.diagnostics.identifications)
        noticed = {
            name: findings(i, tests)
            for name, i, tests in zip(
                names, data.identifications, data.diagnostics.residuals.values(), strict=True
            )
        }
        remarks: dict[tuple[str, ...], list[Finding]] = {}
        for holders, finding in beside_verdict(data.verdict, noticed):
            remarks.setdefault(holders, []).append(finding)
        return {
            "methods": [
                (label, i, ending(i), error_rows(i))
                for label, i in zip(data.labels, data.identifications, strict=True)
            ],
            "remarks": [
                ([(data.labels[names.index(n)], names.index(n)) for n in holders], own)
                for holders, own in remarks.items()
            ],
            "disagreement": apart,
        }
