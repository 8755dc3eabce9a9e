"""An identified control law as text: gains, differentiator, fit, gravity model."""

from __future__ import annotations

from pivident.control_law.law_gravity import PLACE_TEXTS
from pivident.simulation.control_loop import IdentifiedLaw
from pivident.text.numbers import format_significant, with_spread
from pivident.text.plain_table import column, lines_of


def controller_table(found: IdentifiedLaw) -> str:
    """An identified control law: gains with intervals, differentiator, fit, for each joint.

    Where laws compensate gravity, their gravity models come as a second table.
    """
    names = list(dict.fromkeys(term for law in found.joints for term in law.terms))
    columns = [column("joint", [law.name for law in found.joints], "<")]
    for term in names:
        spreads = [
            with_spread(law.gain(term), 2.0 * law.std[law.terms.index(term)])
            if term in law.terms
            else ("", "")
            for law in found.joints
        ]
        columns.append(column(term, [value for value, _ in spreads], "."))
        columns.append(column("±2σ", [spread for _, spread in spreads], "."))
    speeds = [
        differentiator_text(law.averaged, law.derivative_time, law.derivative_time_std)
        for law in found.joints
    ]
    columns.append(column("speed", speeds, "<"))
    errors = [format_significant(100.0 * law.relative_error, 2) for law in found.joints]
    columns.append(column("error %", errors, "."))
    columns.append(column("saturated", [str(law.saturated) for law in found.joints], ">"))
    head = f"Control law of {', '.join(found.recordings)}, output per rad or m, rad/s or m/s, …"
    parts = [head, lines_of(columns), *_gravity_tables(found)]
    return "\n\n".join([*parts, *(f"Warning: {t}" for t in found.warnings)])


def _gravity_tables(found: IdentifiedLaw) -> list[str]:
    """What each joint's law takes for the robot's weight; nothing where none compensates it."""
    rows = [
        (law.name, PLACE_TEXTS[own.place], p.name, *with_spread(value, 2.0 * std), p.unit)
        for law in found.joints
        if (own := law.gravity) is not None
        for p, value, std in zip(own.parameters, own.values, own.std, strict=True)
    ]
    if not rows:
        return []
    titles = ("law of", "gravity at", "parameter", "value", "±2σ", "unit")
    columns = [
        column(title, list(cells), side)
        for title, side, cells in zip(titles, "<<<..<", zip(*rows, strict=True), strict=True)
    ]
    title = "Gravity that the law compensates, as its own model of the robot has it"
    return [title, lines_of(columns)]


def differentiator_text(averaged: bool, time: float = 0.0, std: float = 0.0) -> str:
    """How a law differentiates the position.

    ``time``: lag T [s].
    """
    if averaged:
        return "two-sample means"
    if time == 0.0:
        return "backward difference"
    value, spread = with_spread(1e3 * time, 2e3 * std)
    return f"lag {value} ± {spread} ms"
