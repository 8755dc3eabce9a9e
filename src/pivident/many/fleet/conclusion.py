"""Files of an assessed fleet: table of parameters, alarms and page."""

from __future__ import annotations

import io
import json
from collections.abc import Callable
from dataclasses import asdict
from typing import Any

from pivident.many.fleet.fleet_page import render_page
from pivident.many.fleet.identify_fleet import Fleet
from pivident.many.fleet.judgement import Judgement, judge, parameter_table, promise
from pivident.many.fleet.wear import Rate
from pivident.text.plain_values import plain

PARAMETERS, ALARMS, PAGE = "parameters.parquet", "alarms.json", "fleet.html"


def conclude_fleet(fleet: Fleet, say: Callable[[str], None] | None = None) -> Judgement:
    """Judge a fleet and write its table, its alarms and its page into the results folder.

    Args:
        fleet: the estimates.
        say: progress.

    Returns:
        The judgement that was written.

    Raises:
        FleetError: a watched parameter was not estimated.
        FleetFolderError: the folder cannot be written to.
    """
    say = say or (lambda line: None)
    buffer = io.BytesIO()
    parameter_table(fleet).write_parquet(buffer)
    fleet.store.write(PARAMETERS, buffer.getvalue())
    say("testing for changes")
    judgement = judge(fleet)
    fleet.store.write(ALARMS, alarms_json(judgement))
    fleet.store.write(PAGE, render_page(judgement))
    return judgement


def alarms_json(judgement: Judgement) -> str:
    """Alarms with their level, as strict JSON: numbers that are not finite are null."""
    fleet, entry = judgement.fleet, judgement.fleet.template.fleet
    content: dict[str, Any] = {
        "schema": 1,
        "level": judgement.level,
        "promise": promise(judgement),
        "tests": judgement.tests,
        "robots": len(fleet.robots),
        "logs": len(fleet.logs),
        "failed": len(fleet.failures),
        "method": fleet.template.method_name,
        "baseline": entry.baseline,
        "baseline_records": entry.baseline_records,
        "alarms": [
            asdict(a)
            | {
                f"relative_{k}": v
                for k, v in zip(("change", "low", "high"), a.relative, strict=True)
            }
            for a in judgement.alarms
        ],
        "parameters": {
            w.parameter: {
                "unit": w.unit,
                "level": w.level,
                "scatter": b.scatter * b.typical_scale,
                "degrees": b.degrees,
                "temperature_per_unit": _rate(w.temperature),
                "wear_per": fleet.axis.unit,
                "wear": {robot: _rate(rate) for robot, rate in w.robots.items()},
            }
            for b, w in zip(judgement.baselines, judgement.wear, strict=True)
        },
        "notes": list(judgement.notes),
    }
    return json.dumps(plain(content), indent=1, allow_nan=False)


def _rate(rate: Rate | None) -> list[float] | None:
    """Value and interval."""
    return None if rate is None else [rate.value, rate.low, rate.high]
