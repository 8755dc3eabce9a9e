"""A load as rows for tables and files: name, value, standard error, interval, unit."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from pivident.payload.load_estimate import TWO_SIDED_95, LoadEstimate
from pivident.robot.description import INERTIAL

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
