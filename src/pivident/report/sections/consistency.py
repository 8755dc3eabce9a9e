"""Can a real machine have these parameters? The consistent stage, where it ran."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from pivident.consistency.consistent_estimate import (
    CONFIDENCE,
    ConsistentEstimate,
    NoConsistentEstimate,
    interval_text,
)
from pivident.consistency.consistent_tables import millimetres, moments_text
from pivident.consistency.significance import HALF_INTERVAL
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.estimation.equation_record import FittedRecording
from pivident.report.consistency_figures import VIEWS, bodies_figure, moved_figure
from pivident.report.plotly_figures import Figure
from pivident.report.sections.base import Section
from pivident.robot.description import Robot
from pivident.text.numbers import format_significant

#: An end of an interval that nothing bounds is drawn this far away [σ].
FAR = 20.0


class ConsistencySection(Section):
    """For each estimate: how far it had to move, what that costs, and the bodies of the links."""

    title = "Physical consistency"
    anchor = "consistency"

    @property
    def applies(self) -> bool:
        """Only where the stage ran."""
        return bool(self.data.diagnostics.consistent)

    def context(self) -> dict[str, Any]:
        """Tables and figures of each estimate, reasons where there is none."""
        diagnostics = self.data.diagnostics
        names = list(diagnostics.identifications)
        made = [(names.index(name), found) for name, found in diagnostics.consistent.items()]
        last = made[-1][0]
        return {
            "confidence": f"{CONFIDENCE:.0%}".replace("%", " %"),
            "failed": [
                (k, found.label, found.reason)
                for k, found in made
                if isinstance(found, NoConsistentEstimate)
            ],
            "estimates": [
                {
                    "method": k,
                    "label": found.label,
                    "opened": k == last,
                    "found": found,
                    "links": _link_cells(found),
                    "moved": _moved_cells(found),
                    "figures": _figures(found, k),
                }
                for k, found in made
                if isinstance(found, ConsistentEstimate)
            ],
            "half_interval": f"{HALF_INTERVAL:g}",
            "several": len(made) > 1,
        }


def _link_cells(found: ConsistentEstimate) -> list[tuple[str, list[tuple[str, str]]]]:
    """Name of each link, and value and interval of each quantity as text."""
    rows = []
    for r in found.links:
        cells = [(format_significant(r.mass.value), interval_text(r.mass))]
        cells += [
            (millimetres(c.value), interval_text(c, factor=1e3, digits=2)) for c in r.center_of_mass
        ]
        moments = moments_text(np.array([m.value for m in r.moments]))
        cells += [
            (text, interval_text(m, digits=2)) for text, m in zip(moments, r.moments, strict=True)
        ]
        rows.append((r.name, cells))
    return rows


def _moved_cells(found: ConsistentEstimate) -> list[tuple[str, ...]]:
    """Parameters that moved, as text."""
    return [
        (
            row.name,
            format_significant(row.free, 4),
            format_significant(row.spread, 2),
            format_significant(row.consistent, 4),
            row.interval,
            f"{row.moved:+.2f}",
            row.unit,
        )
        for row in found.moved_rows()
    ]


def _posture(robot: Robot, recordings: Sequence[FittedRecording]) -> np.ndarray:
    """Positions of all joints at the first sample; without a record at the robot's own posture."""
    if not recordings:
        return np.zeros(robot.size) if robot.constraints is None else robot.constraints.posture
    own = recordings[0].q[0]
    return own if robot.constraints is None else ClosedChains(robot).start(own).q


def _figures(found: ConsistentEstimate, method: int) -> tuple[Figure, ...]:
    """The arm with its bodies, and free and consistent intervals."""
    model = found.model
    free, std = model.free.theta, model.free.std
    moved, low, high = (
        np.clip(x, -FAR, FAR)
        for x in (model.moved, *((end - free) / std for end in (found.base.low, found.base.high)))
    )
    q = _posture(model.robot, model.free.recordings)
    left_out = model.base_values.size - len(model.names)
    inertial = [row.inertia for row in found.links]
    return (
        *(bodies_figure(model.robot, inertial, q, view) for view in VIEWS),
        moved_figure(model.names, moved, low, high, method, left_out=left_out),
    )
