"""Consistent parameters as files: ``consistent.json`` and ``consistent_parameters.csv``.

The JSON is self-contained: it holds the robot and all standard parameters, so a model can be built
from it without the identification. Unbounded ends of intervals are null in the JSON and empty in
the table. So are ends that the solver did not find; ``not_found`` in the JSON lists their
quantities.
"""

from __future__ import annotations

import hashlib
import json
from pathlib import Path
from typing import Any

from pivident.foundation.document.table import Table, Values
from pivident.foundation.text.plain_values import plain
from pivident.judgement.diagnostics.consistent_estimate import CONFIDENCE, ConsistentEstimate
from pivident.models.consistency.link_quantities import LinkRow
from pivident.models.stored_model import CONSISTENT, CONSISTENT_FILE
from pivident.robot.robot_values import robot_values

#: Name of the table beside `CONSISTENT_FILE`.
TABLE_FILE = "consistent_parameters.csv"


def write_consistent(estimate: ConsistentEstimate, folder: Path, identification: Path) -> None:
    """Write both files into a folder."""
    (folder / CONSISTENT_FILE).write_text(
        consistent_json(estimate, identification), encoding="utf-8", errors="backslashreplace"
    )
    (folder / TABLE_FILE).write_text(consistent_csv(estimate), encoding="utf-8")


def consistent_json(estimate: ConsistentEstimate, identification: Path) -> str:
    """Strict JSON of the complete result."""
    model = estimate.model
    content = CONSISTENT.header | model.to_values()
    for entries, intervals in (
        (content["standard"], estimate.standard),
        (content["base"], estimate.base),
    ):
        for entry, low, high in zip(entries, intervals.low, intervals.high, strict=True):
            entry |= {"low": low, "high": high}
    for entry, row in zip(content["links"], estimate.links, strict=True):
        entry |= _link_values(row)
    prediction = estimate.prediction
    content |= {
        "confidence": CONFIDENCE,
        "not_found": list(estimate.not_found()),
        "options": estimate.options.to_values(),
        "held_out": None
        if prediction is None
        else {
            "stretches": prediction.stretches,
            "band": prediction.free.band,
            "error_free": prediction.free.total_in_band,
            "error": prediction.consistent.total_in_band,
            "cost": prediction.cost,
            "failures": list(prediction.failures),
        },
        "identification": {
            "file": identification.name,
            "sha256": hashlib.sha256(identification.read_bytes()).hexdigest(),
            "method": model.free.method,
        },
        "sources": dict(model.free.sources),
        "version": model.free.version,
        "robot_description": robot_values(model.robot),
    }
    return json.dumps(plain(content), indent=1, ensure_ascii=False, allow_nan=False) + "\n"


def consistent_csv(estimate: ConsistentEstimate) -> str:
    """All standard parameters with the ends of their 95 % intervals in the unit of their row."""
    model, intervals = estimate.model, estimate.standard
    tree = model.robot.tree
    columns: dict[str, Values] = {
        "name": [p.name for p in model.parameters],
        "value": model.values,
        "low": intervals.low,
        "high": intervals.high,
        "unit": [p.unit for p in model.parameters],
        "joint": [tree.joints[p.joint].name for p in model.parameters],
        "link": [tree.links[p.joint].name for p in model.parameters],
    }
    return Table("parameters", columns).to_csv()


def _link_values(row: LinkRow) -> dict[str, Any]:
    """Intervals of a link, and its principal moments with their axes."""
    return {
        "mass_interval": (row.mass.low, row.mass.high),
        "center_of_mass_interval": [(c.low, c.high) for c in row.center_of_mass],
        "principal_moments": [m.value for m in row.moments],
        "principal_moments_interval": [(m.low, m.high) for m in row.moments],
        "principal_axes": row.axes.T,
    }
