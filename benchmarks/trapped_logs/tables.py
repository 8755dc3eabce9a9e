"""The tables of the benchmark: verdicts by trap, and by what each trap can be seen."""

from __future__ import annotations

from collections import Counter
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from .judging import Judgement
from .running import Outcome
from .visible import INAPPLICABLE, VISIBLE


@dataclass
class Row:
    """A trap in a log.

    Attributes:
        log: name.
        trap: name.
        joints: that are concerned, by name.
        outcome: of the log with the trap.
        clean: of the log without one.
        judgement: None for the log without a trap.
        evidence: figures of the log with the trap.
        clean_evidence: and of that without.
    """

    log: str
    trap: str
    joints: list[str]
    outcome: Outcome
    clean: Outcome
    judgement: Judgement | None
    evidence: dict[str, Any] = field(default_factory=dict)
    clean_evidence: dict[str, Any] = field(default_factory=dict)

    @property
    def visible(self) -> str:
        """By what it can be seen, after the table."""
        return VISIBLE.get(self.log, {}).get(self.trap, "?")


def verdict_table(rows: Iterable[Row]) -> list[str]:
    """What the verdicts say, a line for each trap."""
    lines = [
        "| log | trap | seen by | exit | verdict | new reservations, errors first | LS held out % "
        "(untrapped) | recommended % (untrapped) | named | taken | repaired | wall s | CPU s |",
        "|---|---|---|---:|---|---|---|---|---|---|---|---:|---:|",
    ]
    for row in rows:
        own, judged = row.outcome, row.judgement
        cells = [
            row.log,
            row.trap,
            row.visible if judged else "",
            str(own.code),
            own.severity if own.severity != "refused" else f"refused: {own.headline[:90]}",
            _new_reservations(row),
            _compared(own.least_squares, row.clean.least_squares),
            _compared(own.held_out, row.clean.held_out),
            f"{judged.named} {judged.by}".strip() if judged else _offered(own),
            judged.taken if judged else "",
            {True: "yes", False: "no", None: ""}[judged.repaired if judged else None],
            f"{own.wall:.1f}",
            f"{own.processor:.1f}",
        ]
        lines.append("| " + " | ".join(cell.replace("|", "/") for cell in cells) + " |")
    for log in dict.fromkeys(row.log for row in rows):
        for trap, reason in INAPPLICABLE.get(log, {}).items():
            lines.append(f"| {log} | {trap} | cannot apply: {reason} |" + " |" * 10)
    return lines


def evidence_table(rows: Iterable[Row]) -> list[str]:
    """By what each trap can be seen, in figures; those of the log without a trap in brackets."""
    lines = [
        "| log | trap | joint | LS held out % | slope of q over dq | torque over that of the "
        "description: by gravity | by inertia | unexplained % | delay ms | beyond limits % "
        "| law |",
        "|---|---|---|---|---|---|---|---|---|---|---|",
    ]
    for row in rows:
        seen, clean = row.evidence, row.clean_evidence
        j = _most_changed(seen, clean)
        cells = [
            row.log,
            row.trap,
            str(j + 1),
            _compared(row.outcome.least_squares, row.clean.least_squares),
            _of_joint(seen, clean, "speeds", j),
            _of_joint(seen, clean, "gravity", j),
            _of_joint(seen, clean, "inertia", j),
            _of_joint(seen, clean, "unexplained", j),
            f"{_shown(seen.get('delay'))} ({_shown(clean.get('delay'))})",
            _of_joint(seen, clean, "beyond", int(np.argmax(seen.get("beyond", [0.0])))),
            ", ".join(f"{x:.3g}" for x in seen.get("law", [])),
        ]
        if "refused" in seen:
            cells[4] = "refused"
        lines.append("| " + " | ".join(cells) + " |")
    return lines


def summary(rows: Iterable[Row]) -> list[str]:
    """How many traps are named, taken and repaired, those that can be seen beside all."""
    judged = [row for row in rows if row.judgement]
    visible = [row for row in judged if row.visible not in ("", "?")]
    lines = []
    for name, chosen in (("all", judged), ("those that can be seen", visible)):
        named = Counter(row.judgement.named for row in chosen if row.judgement)
        taken = Counter(row.judgement.taken for row in chosen if row.judgement)
        repaired = sum(bool(row.judgement and row.judgement.repaired) for row in chosen)
        later = len(chosen) - named["first"] - named["no"]
        lines.append(
            f"{name}: {len(chosen)} traps; named first {named['first']}, later {later}, not "
            f"{named['no']}; repaired {repaired}; taken silently {taken['silently']}, unnoticed "
            f"{taken['unnoticed']}"
        )
    plain = [row for row in rows if row.judgement is None]
    offered = sum(len(row.outcome.repairs) for row in plain)
    errors = sum(one["severity"] == "error" for row in plain for one in row.outcome.statements)
    lines.append(f"logs without a trap: {len(plain)}; repairs offered {offered}; errors {errors}")
    return lines


def _new_reservations(row: Row) -> str:
    known = [] if row.judgement is None else [_short(one) for one in row.clean.reservations]
    new = [said for said in map(_short, row.outcome.reservations) if said not in known]
    return "; ".join(new)


def _short(statement: Mapping[str, str]) -> str:
    mark = {"error": "×", "warning": "!"}[statement["severity"]]
    subject = f" ({statement['subject']})" if statement["subject"] else ""
    return f"{mark} {statement['topic']}: {statement['kind']}{subject}"


def _offered(outcome: Outcome) -> str:
    return f"{len(outcome.repairs)} repairs" if outcome.repairs else ""


def _compared(value: float | None, clean: float | None) -> str:
    shown = ["–" if x is None else f"{x:.3g}" for x in (value, clean)]
    return f"{shown[0]} ({shown[1]})"


def _most_changed(seen: Mapping[str, Any], clean: Mapping[str, Any]) -> int:
    """The joint whose torque fits the description least, compared with the log without a trap."""
    pairs = zip(seen.get("unexplained", []), clean.get("unexplained", []), strict=False)
    growth = [(a or 0.0) / (b or 1.0) for a, b in pairs]
    changes = []
    for name in ("gravity", "inertia"):
        for j, (a, b) in enumerate(zip(seen.get(name, []), clean.get(name, []), strict=False)):
            if a and b:
                changes.append((abs(a[0] - b[0]) / np.hypot(a[1], b[1]), j))
    if max(growth, default=0.0) > 1.5:
        return int(np.argmax(growth))
    return max(changes, default=(0.0, 0))[1]


def _of_joint(seen: Mapping[str, Any], clean: Mapping[str, Any], name: str, j: int) -> str:
    own = [figures.get(name) for figures in (seen, clean)]
    values = [x[j] if isinstance(x, list) and j < len(x) else None for x in own]
    return f"{_shown(values[0])} ({_shown(values[1])})"


def _shown(value: Any) -> str:
    """A number, or one with its standard error."""
    if value is None:
        return "–"
    return f"{value[0]:.3g} ± {value[1]:.1g}" if isinstance(value, list) else f"{value:.3g}"
