"""How far beyond the fitted range of speed, load and position a joint's laws were judged."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.friction_laws.filtered_rows import row_samples
from pivident.friction_laws.law_scores import JointJudge
from pivident.text.numbers import format_significant


@dataclass(frozen=True)
class TriedRange:
    """The farthest that held-out motion went beyond the motion fitted at the same time."""

    unit: str  # of the joint's position, rad or m
    torque_unit: str  # N m or N
    speed: float  # largest held-out speed over the largest fitted one
    fastest: float  # largest held-out speed there [unit/s]
    load: float  # largest held-out load over the largest fitted one
    heaviest: float  # largest held-out load there [N m or N]
    position: float  # largest distance beyond the fitted positions, zero within [unit]
    travel: tuple[float, float]  # all positions that were judged [unit]

    @classmethod
    def of(cls, judge: JointJudge, kind: str) -> TriedRange:
        """Over all divisions of a joint; ``kind``: revolute or prismatic."""
        j, cells = judge.joint, judge.cells
        rows = [row_samples(r) for r in judge.last.equations.records]
        pairs = list(zip(judge.motions, rows, strict=True))
        speed = cells.by_cell([np.abs(k.dq[j, own]) for k, own in pairs], np.max)
        load = cells.by_cell([np.abs(x) for x in judge.load], np.max)
        low = cells.by_cell([k.q[j, own] for k, own in pairs], np.min)
        high = cells.by_cell([k.q[j, own] for k, own in pairs], np.max)
        held = [d.held_out for d in judge.divisions]
        faster = max((_beyond(speed, h) for h in held), key=lambda x: x[0])
        heavier = max((_beyond(load, h) for h in held), key=lambda x: x[0])
        farther = max(
            max(low[~h].min() - low[h].min(), high[h].max() - high[~h].max(), 0.0) for h in held
        )
        units = ("rad", "N m") if kind == "revolute" else ("m", "N")
        travel = (float(low.min()), float(high.max()))
        return cls(*units, *faster, *heavier, float(farther), travel)

    def __str__(self) -> str:
        number = format_significant
        low, high = (number(x) for x in self.travel)
        where = (
            f"{number(self.position, 2)} {self.unit} beyond the fitted ones"
            if self.position > 0.0
            else "all within the fitted ones"
        )
        return (
            f"tried up to {self.speed:.2f} times the fitted speed ({number(self.fastest)} "
            f"{self.unit}/s) and {self.load:.2f} times the fitted load ({number(self.heaviest)} "
            f"{self.torque_unit}), at positions from {low} to {high} {self.unit}, {where}"
        )


def _beyond(values: np.ndarray, held_out: np.ndarray) -> tuple[float, float]:
    """Largest held-out value over the largest fitted one, and itself."""
    largest = float(values[held_out].max())
    return largest / max(float(values[~held_out].max()), 1e-300), largest
