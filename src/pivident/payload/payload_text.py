"""A load as text: a table with units and intervals, and sentences about undetermined parts."""

from __future__ import annotations

import math

from pivident.payload.load_estimate import LoadEstimate
from pivident.payload.load_rows import LoadRow, load_rows
from pivident.payload.possible_load import PossibleLoad
from pivident.text.numbers import with_spread


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
