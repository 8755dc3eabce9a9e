"""The judgement of a fleet as plain text, for terminals."""

from __future__ import annotations

import math

from pivident.many.fleet.control_chart import Alarm
from pivident.many.fleet.judgement import Judgement, promise


def judgement_text(judgement: Judgement, most: int) -> str:
    """Alarms in sentences, failed logs, and notes."""
    fleet = judgement.fleet
    lines = [
        f"{len(fleet.robots)} robot(s), {len(fleet.logs)} log(s), method "
        f"{fleet.template.method_name}: {len(judgement.alarms)} alarm(s)",
        *(f"! {alarm_sentence(alarm)}" for alarm in judgement.alarms[:most]),
        *_more(len(judgement.alarms) - most, "alarms"),
        *(
            f"- {row['task']}: {row['error']}: {row['message']}"
            for row in fleet.failures.head(most).iter_rows(named=True)
        ),
        *_more(len(fleet.failures) - most, "logs without an estimate"),
        *judgement.notes,
        promise(judgement),
        "",
    ]
    return "\n".join(lines)


def alarm_sentence(alarm: Alarm) -> str:
    """Robot, joint, time and size of a change."""
    share, low, high = (100.0 * value for value in alarm.relative)
    of_level = f", {share:+.3g} % ({low:+.3g} to {high:+.3g} %)" if math.isfinite(share) else ""
    return (
        f"{alarm.robot}, {alarm.joint}: {alarm.parameter} has changed since {alarm.time} by "
        f"{alarm.change:+.3g} {alarm.unit} (95 %: {alarm.low:+.3g} to {alarm.high:+.3g}){of_level}"
    )


def _more(count: int, what: str) -> list[str]:
    return [f"  and {count} more {what}"] if count > 0 else []
