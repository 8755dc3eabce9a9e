"""A load as text: a table with units and intervals, and sentences about what is not known."""

from __future__ import annotations

import math

import numpy as np

from pivident.payload.identify_payload import PayloadIdentification
from pivident.payload.load_estimate import LoadEstimate
from pivident.payload.load_rows import LoadRow, load_rows
from pivident.payload.possible_load import PossibleLoad
from pivident.text.numbers import plus_minus, with_spread

#: Change of a friction parameter, in deviations, from which on it is named.
FRICTION_NAMED = 3.0


def payload_text(found: PayloadIdentification) -> str:
    """Table of the load and what has to be said about it."""
    load = found.load
    errors = ", ".join(
        f"{name} {100 * e:.1f} % ({100 * fit.relative_error:.1f})"
        for name, e, fit in zip(found.joints, found.relative_errors, found.arm.joints, strict=True)
    )
    worst = int(np.argmax(np.abs(found.arm_change)))
    parts = [
        f"Load on link {found.link!r} by {found.method}, {found.iterations} estimates.\n"
        f"Frame: {load.frame}.",
        load_table(load_rows(load)),
        *_sentences(load, found.possible),
        f"Torque error with the load (and without): {errors}.",
        "The arm in both records: largest difference "
        f"{abs(found.arm_change[worst]):.1f} deviations ({found.arm.names[worst]}).",
    ]
    if changed := _friction_sentence(found):
        parts.append(changed)
    parts += [f"! {sentence}" for sentence in found.warnings]
    return "\n\n".join(parts)


def load_table(rows: list[LoadRow]) -> str:
    """Values with their intervals, as far as they are determined."""
    from pivident.text.plain_table import plain_table

    shown = [r for r in rows if math.isfinite(r.std) and r.name != "m"]  # m is the mass above
    texts = [with_spread(r.value, 2 * r.std) for r in shown]
    columns = [
        ("quantity", "<", [r.label for r in shown]),
        ("value", ".", [value for value, _ in texts]),
        ("±2σ", ".", [spread for _, spread in texts]),
        ("unit", "<", [r.unit for r in shown]),
    ]
    if any(r.lopsided for r in shown):
        columns.append(("95 % interval", "<", [_interval(r) for r in shown]))
    return plain_table(columns)


def _interval(row: LoadRow) -> str:
    """Fieller's interval where it is not the value ± 2σ."""
    if not row.lopsided:
        return ""
    if not all(map(math.isfinite, row.interval)):
        return "none: any is possible"
    return f"{row.interval[0]:.3g} to {row.interval[1]:.3g}"


def _sentences(load: LoadEstimate, nearest: PossibleLoad | None) -> list[str]:
    """What is not determined, and whether a body can be like this."""
    said = []
    lost = [r.label for r in load_rows(load) if not math.isfinite(r.std)]
    if lost and load.mass > 0:
        said.append(
            f"The torques of these records tell {load.rank} of 10 combinations of the load's "
            f"parameters. Not determined: {', '.join(lost)}."
        )
    if not load.mass > 0:
        return said
    if nearest is None:
        return [
            *said,
            "The solver did not find the nearest real body, so that nothing is said of whether a "
            "body can be like this estimate, nor of ranges over bodies.",
        ]
    if not nearest.was_possible:
        said.append(_impossible(nearest))
    if ranges := _bounded(load, nearest):
        said.append(ranges)
    if nearest.not_found:
        said.append(
            f"The solver did not find the range over bodies of {', '.join(nearest.not_found)}; "
            "that says nothing of whether one bounds them."
        )
    return said


def _impossible(nearest: PossibleLoad) -> str:
    mass = nearest.values[9]
    verdict = (
        "noise can do that; the intervals hold"
        if nearest.p_value > 0.01
        else "noise hardly does that: look at the records, the frame and the known parts"
    )
    return (
        "No real body has exactly these parameters. The nearest one is "
        f"{nearest.distance:.2g} deviations away ({mass:.4g} kg): {verdict}."
    )


def _bounded(load: LoadEstimate, nearest: PossibleLoad) -> str:
    """Ranges of what no torque tells, from what bodies can be; empty where there are none."""
    rows = [r for r in load_rows(load) if r.kind == "parameter"]
    ranges = [
        f"{row.label} {low:.2g} to {high:.2g} {row.unit}"
        for row, (low, high) in zip(rows, nearest.intervals, strict=True)
        if not math.isfinite(row.std) and math.isfinite(low) and math.isfinite(high)
    ]
    if not ranges:
        return ""
    return f"No torque tells, but only bodies with these are real (95 %): {'; '.join(ranges)}."


def _friction_sentence(found: PayloadIdentification) -> str:
    """Friction that is another one with the load."""
    named = [
        f"{name} {plus_minus(change, 2 * std, sign=True)} {_unit(found, name)}"
        for name, change, std in zip(
            found.friction_names, found.friction_change, found.friction_std, strict=True
        )
        if abs(change) > FRICTION_NAMED * std
    ]
    return f"Friction that differs with the load: {', '.join(named)}." if named else ""


def _unit(found: PayloadIdentification, name: str) -> str:
    return found.arm.units[found.arm.names.index(name)]
