"""Units of positions and references, from names, limits of the joints, and one another."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.data.logs.recognition.channel_words import Sureness
from pivident.data.logs.units import POSITION
from pivident.robot.description import Robot

#: How far beyond its limits a joint may be logged, in spans of its limits.
SLACK = 0.05

#: Largest angle that an arm without known limits is believed to reach [rad].
FARTHEST = 4.0 * np.pi

#: Smallest range of motion that supports a unit by itself [rad].
SPEAKING = 0.2

#: Correlation from which on one signal follows another.
FOLLOWS = 0.9


@dataclass(frozen=True)
class AssumedUnits:
    """Unit of each joint of a channel."""

    units: tuple[str, ...]  # one for each joint; ``counts/4096``: so many per revolution
    sure: Sureness  # how sure they are
    seen: str

    @property
    def value(self) -> Any:
        """As a file says it: one unit where all are alike."""
        said = [unit_spec(unit) for unit in self.units]
        return said[0] if len(set(self.units)) == 1 else said

    def factors(self, table: dict[str, float]) -> np.ndarray:
        """SI per unit, shape (joints,)."""
        return np.array([position_factor(unit, table) for unit in self.units])


def unit_spec(unit: str) -> Any:
    """A unit as a file says it: its name, or counts with their number per revolution."""
    counts = counts_in(unit)
    return unit if counts is None else {"unit": "counts", "per_revolution": counts}


def counts_in(unit: str | None) -> int | None:
    """Counts per revolution of a unit such as ``counts/4096``, None for any other unit."""
    name, _, counts = (unit or "").partition("/")
    return int(counts) if name == "counts" and counts.isdecimal() else None


def position_factor(unit: str, table: Mapping[str, float]) -> float:
    """SI per unit of a position."""
    counts = counts_in(unit)
    return table[unit] if counts is None else 2.0 * np.pi / counts


def position_unit(
    robot: Robot, q: np.ndarray, names: Mapping[str, str], answer: str | None, logger: str = ""
) -> AssumedUnits:
    """Unit of the logged positions; q (samples, joints).

    ``names``: units that the names of columns say, by joint. ``logger``: whose columns they are,
    where it is that that says the unit: limits of the joints may contradict it.
    """
    turning = [j for j, joint in enumerate(robot.joints) if joint.kind == "revolute"]
    some = any(np.isfinite(q[:, j]).any() for j in turning)
    sliding = [j for j, joint in enumerate(robot.joints) if joint.kind == "prismatic"]
    slide = _best(robot, q, sliding, ("m", "mm"))[0] if sliding else "m"
    said = {j: names[joint.name] for j, joint in enumerate(robot.joints) if joint.name in names}
    named = next((said[j] for j in turning if j in said), None)
    length = next((said[j] for j in sliding if j in said), None)
    by_name = length in ("m", "mm")
    slide = str(length) if by_name else slide
    if counts_in(named) is not None and answer is None:
        unit, sure = str(named), "certain"
        seen = f"{counts_in(named)} counts per revolution, as the preset {logger} says"
    elif logger and named in ("rad", "deg") and answer is None and some:
        unit, sure, seen = _angle(robot, q, turning)
        if unit == named or sure != "certain":
            unit, sure, seen = str(named), "likely", f"{named}, as the preset {logger} says; {seen}"
        else:
            seen += f", although the preset {logger} says {named}: the data decide"
    elif answer in POSITION or (named in POSITION and named not in ("m", "mm")):
        unit, sure = str(answer or named), "certain"
        seen = "answered" if answer else f"the columns' names say {unit}"
    elif not some:
        unit, sure, seen = slide, "likely", f"limits of the joints fit {slide}"
        if by_name:
            sure, seen = "certain", f"the columns' names say {slide}"
    else:
        unit, sure, seen = _angle(robot, q, turning)
    if unit in ("m", "mm"):
        slide = unit
    units = tuple(slide if j in sliding else unit for j in range(robot.size))
    if sliding and turning:
        seen += f"; sliding joints in {slide}, by their {'names' if by_name else 'limits'}"
    return AssumedUnits(units, sure, seen)  # type: ignore[arg-type]


def _angle(robot: Robot, q: np.ndarray, turning: Sequence[int]) -> tuple[str, str, str]:
    """Radians or degrees."""
    unit, outside = _best(robot, q, turning, ("rad", "deg"))
    logged = q[:, [j for j in turning if np.isfinite(q[:, j]).any()]]
    low, high = float(np.nanmin(logged)), float(np.nanmax(logged))
    spans = [robot.joints[j].position_limits for j in turning]
    known = [span for span in spans if span is not None]
    text = f"values from {low:.4g} to {high:.4g}"
    if known:
        ends = (min(s[0] for s in known), max(s[1] for s in known))
        text += f", limits of the robot {ends[0]:.4g} to {ends[1]:.4g} rad"
    other = "deg" if unit == "rad" else "rad"
    moved = float((np.nanmax(logged, axis=0) - np.nanmin(logged, axis=0)).max()) * POSITION[unit]
    if outside[unit] > 0:
        return unit, "assumed", f"{text}: beyond the limits in either unit, least so as {unit}"
    if outside[other] > 0 or (unit == "deg" and high - low > 20.0):
        return unit, "certain" if known else "likely", f"{text}: too far for {other}"
    return (
        unit,
        "likely" if moved > SPEAKING else "assumed",
        f"{text}: as {other} hardly any motion",
    )


def _best(
    robot: Robot, q: np.ndarray, joints: Sequence[int], units: Sequence[str]
) -> tuple[str, dict[str, float]]:
    """The first unit in which the joints stay within their limits, or are least beyond."""
    outside = {unit: 0.0 for unit in units}
    for unit in units:
        for j in joints:
            limits = robot.joints[j].position_limits
            values = q[np.isfinite(q[:, j]), j] * POSITION[unit]
            if not values.size:  # a joint that is in the log by name alone
                continue
            if limits is None:
                limits = (-FARTHEST, FARTHEST)
            slack = SLACK * (limits[1] - limits[0])
            beyond = np.maximum(limits[0] - slack - values, values - limits[1] - slack)
            outside[unit] = max(outside[unit], float(beyond.max()) / (limits[1] - limits[0]))
    return min(units, key=lambda unit: max(outside[unit], 0.0)), outside


def following_unit(
    values: np.ndarray, si: np.ndarray, names: Sequence[str], table: dict[str, float]
) -> tuple[str, float] | None:
    """Unit in which a channel follows another one, and the share of it that is left."""
    x, y = values - values.mean(axis=0), si - si.mean(axis=0)
    size = float(np.linalg.norm(x) * np.linalg.norm(y))
    if not np.isfinite(size) or size == 0.0 or float((x * y).sum()) < FOLLOWS * size:
        return None
    slope = float((x * y).sum() / (x * x).sum())
    unit = min(names, key=lambda name: abs(np.log(slope / table[name])))
    if abs(np.log(slope / table[unit])) > 0.5:
        return None
    return unit, float(np.linalg.norm(x * table[unit] - y) / np.linalg.norm(y))
