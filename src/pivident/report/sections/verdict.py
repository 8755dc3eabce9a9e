"""Should one believe it? The verdict, at the head of the page, and how each method ended."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.diagnostics.estimate_statements import WELL
from pivident.diagnostics.verdict import beside_verdict
from pivident.estimation.parameter_rows import parameter_rows
from pivident.estimation.summary_tables import ending, error_rows, label_lines, rows_kind
from pivident.report.result_findings import disagreements, findings
from pivident.report.sections.base import Section
from pivident.text.finding import Finding
from pivident.text.numbers import format_significant, percent


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
            "next_motion": found.next_motion(data.folder) if data.folder else "",
            "robots": list({i.robot.name: i.robot for i in data.identifications}.values()),
            "recordings": [
                (name, len(r.t), float(r.t[-1] - r.t[0])) for name, r in recordings.items()
            ],
            "accounts": any(r.account for r in recordings.values()),
            "labels": data.labels,
            "label_lines": label_lines(data.identifications),
            "several": data.several,
            "key_figures": self._key_figures(best),
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

    def _key_figures(self, best: int) -> list[tuple[str, str, str]]:
        """What it is, its value, and a remark, of the estimate to take."""
        data = self.data
        identification = data.identifications[best]
        relative = 2.0 * np.array([r.shown_percent for r in parameter_rows(identification)])
        well = int((relative <= WELL).sum())
        compared_with = f"of {len(data.labels)} compared" if data.several else ""
        figures = [
            ("Estimate to take", data.labels[best], compared_with),
            (
                "Parameters known to 10 % or better (2σ)".replace("10", f"{WELL:g}"),
                f"{well} of {relative.size}",
                f"best {percent(float(np.nanmin(relative)))}"
                if np.isfinite(relative).any()
                else "",
            ),
        ]
        compared = data.diagnostics.out_of_sample
        name = list(data.diagnostics.identifications)[best]
        if compared is None or name not in compared.results:
            misses = percent(100.0 * identification.relative_error)
            return [*figures, ("Torque error, fitted motion", misses, rows_kind(identification))]
        result = compared.results[name]
        error = result.prediction
        below = f"below {format_significant(error.band)} Hz"
        worst = int(np.argmax(error.relative_in_band))
        by_joint = f"{percent(error.relative_in_band[worst])} on {error.joint_names[worst]}"
        remark = f"{below}, at most {by_joint}" if len(error.joint_names) > 1 else below
        return [
            *figures,
            ("Torque error, motion not fitted", percent(error.total_in_band), remark),
            ("Torque error, fitted motion", percent(result.training.total_in_band), below),
        ]


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
