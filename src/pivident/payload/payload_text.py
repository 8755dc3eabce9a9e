"""A load as rows and as text: a table with units, sentences about undetermined parts."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.payload.load_estimate import TWO_SIDED_95, LoadEstimate
from pivident.payload.possible_load import PossibleLoad
from pivident.robot.description import INERTIAL
from pivident.text.numbers import with_spread

Kind = Literal["mass", "center_of_mass", "inertia", "parameter"]

#: Difference between an interval and value ± 1.96 σ that is shown, as a share of the half width.
ASYMMETRIC = 0.05


@dataclass(frozen=True)
class LoadRow:
    """One quantity of a load."""

    # ``mass``, ``cx``, ``jxx`` (about the centre of mass), ``xx`` (at the frame's origin)
    name: str
    label: str  # name in words
    kind: Kind
    value: float  # estimate, NaN if undetermined
    std: float  # standard error, infinite if undetermined
    interval: tuple[float, float]  # 95 % interval; Fieller's for the centre of mass
    unit: str
    asymmetric: bool = False  # whether the interval differs from value ± 1.96 σ


def load_rows(load: LoadEstimate) -> list[LoadRow]:
    """Mass, centre of mass, inertia about it, and the ten parameters at the frame's origin."""
    rows = [_row("mass", "mass", "mass", load.mass, load.mass_std, "kg")]
    fieller = load.fieller_interval()
    for k, axis in enumerate("xyz"):
        plain = _row(
            f"c{axis}",
            f"centre of mass {axis}",
            "center_of_mass",
            load.center_of_mass[k],
            load.center_of_mass_std[k],
            "m",
        )
        rows.append(_with_interval(plain, (float(fieller[k, 0]), float(fieller[k, 1]))))
    rows += [
        _row(f"j{name}", f"inertia about it {name}", "inertia", value, std, "kg m²")
        for name, value, std in zip(INERTIAL[:6], load.inertia, load.inertia_std, strict=True)
    ]
    units = ["kg m²"] * 6 + ["kg m"] * 3 + ["kg"]
    rows += [
        _row(name, f"{name} at the origin", "parameter", value, std, unit)
        for name, value, std, unit in zip(INERTIAL, load.values, load.std, units, strict=True)
    ]
    return rows


def _row(name: str, label: str, kind: Kind, value: float, std: float, unit: str) -> LoadRow:
    half = TWO_SIDED_95 * float(std)
    value = float(value) if np.isfinite(half) else np.nan
    interval = (value - half, value + half) if np.isfinite(half) else (-np.inf, np.inf)
    return LoadRow(name, label, kind, value, float(std), interval, unit)


def _with_interval(row: LoadRow, interval: tuple[float, float]) -> LoadRow:
    half = TWO_SIDED_95 * row.std
    away = np.abs(np.subtract(interval, row.interval)) if np.isfinite(half) else np.zeros(2)
    return replace(row, interval=interval, asymmetric=bool((~(away <= ASYMMETRIC * half)).any()))


def load_table(rows: list[LoadRow]) -> str:
    """Determined values with their intervals."""
    from pivident.text.plain_table import plain_table

    shown = [r for r in rows if math.isfinite(r.std) and r.name != "m"]  # m is the mass above
    texts = [with_spread(r.value, 2 * r.std) for r in shown]
    columns = [
        ("quantity", "<", [r.label for r in shown]),
        ("value", ".", [value for value, _ in texts]),
        ("±2σ", ".", [spread for _, spread in texts]),
        ("unit", "<", [r.unit for r in shown]),
    ]
    if any(r.asymmetric for r in shown):
        columns.append(("95 % interval", "<", [_interval(r) for r in shown]))
    return plain_table(columns)


def _interval(row: LoadRow) -> str:
    """Fieller's interval if it differs from value ± 2σ."""
    if not row.asymmetric:
        return ""
    if not all(map(math.isfinite, row.interval)):
        return "unbounded"
    return f"{row.interval[0]:.3g} to {row.interval[1]:.3g}"


def load_sentences(load: LoadEstimate, nearest: PossibleLoad | None) -> list[str]:
    """Undetermined parameters, and whether a body can have these parameters."""
    sentences = []
    lost = [r.label for r in load_rows(load) if not math.isfinite(r.std)]
    if lost and load.mass > 0:
        sentences.append(
            f"The torques of these records determine {load.rank} of 10 combinations of the load's "
            f"parameters. Not determined: {', '.join(lost)}."
        )
    if not load.mass > 0:
        return sentences
    if nearest is None:
        return [
            *sentences,
            "The solver did not find the nearest real body, so it is unknown whether a body can "
            "have these parameters, and over which range.",
        ]
    if not nearest.was_possible:
        sentences.append(_impossible(nearest))
    if ranges := _bounded(load, nearest):
        sentences.append(ranges)
    if nearest.not_found:
        sentences.append(
            f"The solver did not find the range over real bodies of "
            f"{', '.join(nearest.not_found)}; whether they are bounded is unknown."
        )
    return sentences


def _impossible(nearest: PossibleLoad) -> str:
    mass = nearest.values[9]
    verdict = (
        "this can be noise; the intervals hold"
        if nearest.p_value > 0.01
        else "noise is an unlikely cause: check the records, the frame and the known parts"
    )
    return (
        "No real body has exactly these parameters. The nearest one is "
        f"{nearest.distance:.2g} standard errors away ({mass:.4g} kg): {verdict}."
    )


def _bounded(load: LoadEstimate, nearest: PossibleLoad) -> str:
    """Ranges over real bodies of parameters that no torque determines; empty without any."""
    rows = [r for r in load_rows(load) if r.kind == "parameter"]
    ranges = [
        f"{row.label} {low:.2g} to {high:.2g} {row.unit}"
        for row, (low, high) in zip(rows, nearest.intervals, strict=True)
        if not math.isfinite(row.std) and math.isfinite(low) and math.isfinite(high)
    ]
    if not ranges:
        return ""
    return f"Not determined by torque, but bounded for real bodies (95 %): {'; '.join(ranges)}."
