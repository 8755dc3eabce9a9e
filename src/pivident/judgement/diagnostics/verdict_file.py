"""The verdict as ``verdict.json``; `pivident.judgement.diagnostics.stored_verdict` reads it."""

from __future__ import annotations

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from pivident.foundation.text.plain_values import plain
from pivident.judgement.diagnostics.summary import Summary
from pivident.judgement.diagnostics.trials import Trial
from pivident.judgement.diagnostics.verdict import Verdict

#: The number of its layout.
SCHEMA = 3


def save_verdict(
    found: Verdict,
    path: Path,
    terms: Sequence[str] = (),
    summary: Summary | None = None,
    experiment: str = "",
) -> None:
    """Write a verdict as JSON.

    ``terms``: what names and signs in it stand for, line by line; ``summary``: the verdict on one
    screen, with the commands of its folder; ``experiment``: SHA-256 of the experiment file.
    """
    shown = summary or found.summary
    content = {
        "schema": SCHEMA,
        "experiment": experiment,
        "method": found.method,
        "name": found.name,
        "severity": found.severity,
        "headline": found.headline,
        "uses": {use.name: plain(use) for use in found.uses},
        "summary": plain(shown),
        "repairs": [
            _trial(trial) | {"number": number, "repair": trial.repair.as_json()}
            for number, trial in enumerate(found.repairs, start=1)
            if trial.repair is not None
        ],
        "tried": [_trial(trial) for trial in found.trials],
        "statements": plain(found.statements),
        "terms": list(terms),
        "open": list(found.open),
        "ranges": plain(found.ranges),
        "held_out": plain(found.held_out),
    }
    path.write_text(json.dumps(content, indent=1, ensure_ascii=False) + "\n", encoding="utf-8")


def _trial(trial: Trial) -> dict[str, Any]:
    """One repair that was tried, as plain values; errors in percent."""
    return plain(
        {
            "cause": trial.cause,
            "outcome": trial.outcome,
            "before": trial.before,
            "after": trial.after,
            "evidence": trial.evidence,
            "alike": list(trial.alike),
        }
    )
