"""Quantities of a load with their intervals, and sentences about those that are not determined."""

from __future__ import annotations

import numpy as np

from pivident.foundation.document.table import Column, Table, Values
from pivident.robot.description import INERTIAL
from pivident.studies.payload.load_estimate import TWO_SIDED_95, LoadEstimate
from pivident.studies.payload.possible_load import PossibleLoad

#: Difference between an interval and value ± 1.96 σ that is shown, as a share of the half width.
ASYMMETRIC = 0.05

#: Quantities in words: mass, centre of mass, inertia about it, ten parameters at the origin.
LABELS = {
    "mass": "mass",
    **{f"c{axis}": f"centre of mass {axis}" for axis in "xyz"},
    **{f"j{name}": f"inertia about it {name}" for name in INERTIAL[:6]},
    **{name: f"{name} at the origin" for name in INERTIAL},
}

#: Their units.
UNITS = ("kg", *["m"] * 3, *["kg m²"] * 12, *["kg m"] * 3, "kg")


def load_quantities(load: LoadEstimate) -> Table:
    """All quantities with standard errors and intervals of 95 %, each in the unit of its row.

    The value of a quantity that is not determined is NaN and its standard error infinite; intervals
    of the centre of mass are Fieller's.
    """
    values = np.array([load.mass, *load.center_of_mass, *load.inertia, *load.values])
    std = np.array([load.mass_std, *load.center_of_mass_std, *load.inertia_std, *load.std])
    half, known = TWO_SIDED_95 * std, np.isfinite(std)
    lower, upper = np.where(known, values - half, -np.inf), np.where(known, values + half, np.inf)
    lower[1:4], upper[1:4] = load.fieller_interval().T
    shown = np.where(known, values, np.nan)
    columns: dict[str, Values] = {"name": tuple(LABELS), "value": shown, "std": std}
    return Table("load", columns | {"lower": lower, "upper": upper, "unit": UNITS})


def is_asymmetric(quantities: Table) -> np.ndarray:
    """Whether each interval differs from value ± 1.96 σ, shape (quantities,)."""
    value, std, lower, upper = (np.array(quantities[k]) for k in ("value", "std", "lower", "upper"))
    half = TWO_SIDED_95 * std
    with np.errstate(invalid="ignore"):
        ends = np.abs([lower - (value - half), upper - (value + half)])
        return np.isfinite(std) & ~(ends <= ASYMMETRIC * half).all(axis=0)


def determined(quantities: Table) -> Table:
    """The quantities that are determined; Fieller's interval where it is not symmetric."""
    skew, std = is_asymmetric(quantities), np.array(quantities["std"])
    rows = [k for k in np.flatnonzero(np.isfinite(std)) if k < len(LABELS) - 1]  # m is the mass
    columns = {
        "quantity": Column([tuple(LABELS.values())[k] for k in rows]),
        "value": Column(
            np.array(quantities["value"])[rows], spread=2 * std[rows], spread_title="±2σ"
        ),
        "unit": Column([UNITS[k] for k in rows]),
    }
    if skew[rows].any():
        ends = zip(quantities["lower"], quantities["upper"], skew, strict=True)
        texts = [
            "" if not own else f"{a:.3g} to {b:.3g}" if np.isfinite([a, b]).all() else "unbounded"
            for a, b, own in ends
        ]
        columns["interval"] = Column([texts[k] for k in rows], "95 % interval")
    return Table("determined", columns, title="Determined quantities of the load")


def load_sentences(load: LoadEstimate, nearest: PossibleLoad | None) -> list[str]:
    """Undetermined parameters, and whether a body can have these parameters."""
    if not load.mass > 0:
        return []
    sentences = []
    std = load_quantities(load)["std"]
    lost = [label for label, x in zip(LABELS.values(), std, strict=True) if not np.isfinite(x)]
    if lost:
        sentences.append(
            f"The torques of these records determine {load.rank} of 10 combinations of the load's "
            f"parameters. Not determined: {', '.join(lost)}."
        )
    if nearest is None:
        return [
            *sentences,
            "The solver did not find the nearest real body, so it is unknown whether a body can "
            "have these parameters, and over which range.",
        ]
    if not nearest.was_possible:
        sentences.append(_impossible(nearest))
    if ranges := _bounded(load, nearest):
        sentences.append(f"Not determined by torque, but bounded for real bodies (95 %): {ranges}.")
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
    rows = zip(INERTIAL, UNITS[10:], load.determined, nearest.intervals, strict=True)
    return "; ".join(
        f"{LABELS[name]} {low:.2g} to {high:.2g} {unit}"
        for name, unit, known, (low, high) in rows
        if not known and np.isfinite([low, high]).all()
    )
