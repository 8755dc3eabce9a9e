"""A design in words: what was reached, which limits bind, what remains undetermined."""

from __future__ import annotations

from collections.abc import Iterator
from textwrap import wrap

import numpy as np

from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.numbers import (
    format_exact,
    format_significant,
    percent,
    plain_table,
    with_spread,
)
from pivident.foundation.text.sentences import listed
from pivident.studies.excitation.design import ClearanceUse, Design, LimitUse, PredictedError
from pivident.studies.excitation.limits import ASSUMED, DESCRIPTION, FILE, PLANNED_SHARE, ROOM

#: Parameters that the text lists, those whose errors matter most.
LISTED = 8

#: Width of a line, in characters.
WIDTH = 100

#: Where limits come from.
SOURCES = {
    DESCRIPTION: "limit of the description",
    FILE: "limit that was given",
    ASSUMED: "limit assumed",
}

#: Heading over the limits that a motion reaches, and what stands in its place.
BINDING = (
    f"Limits that bind (the search keeps to {100 * PLANNED_SHARE:.0f} % of them, and "
    f"{1e3 * ROOM:.0f} mm beyond the clearance)"
)
NO_LIMIT = "The motion comes near to no limit."


def design_text(design: Design) -> str:
    """The account of a design for a terminal.

    Args:
        design: the design.

    Returns:
        The text, 15 to 40 lines.
    """
    return escaped("\n".join(_lines(design)))


def headline(design: Design) -> str:
    """What was reached, one sentence without its full stop.

    Args:
        design: the design.
    """
    start, end = (format_significant(x) for x in design.cost)
    return (
        f"{format_exact(design.motion.duration)} s {kind_words(design)} for "
        f"{design.robot.name}: {design.cost_words} {end} (start of the search {start})"
    )


def kind_words(design: Design) -> str:
    """The kind of motion in words, such as ``Fourier motion of 5 harmonics``.

    Args:
        design: the design.
    """
    family = design.motion.family
    rounds = f", {family.rounds} rounds" if family.rounds > 1 else ""
    if family.kind == "fourier":
        return f"Fourier motion of {(family.size - 1) // 2} harmonics{rounds}"
    if family.kind == "splines":
        return f"spline motion of {family.size - 1} functions{rounds}"
    return f"motion between {family.size} postures{rounds}"


def limit_words(use: LimitUse | ClearanceUse) -> str:
    """Use of a limit in words, without a full stop.

    Args:
        use: of a joint's limit, or of the room between two bodies.
    """
    if isinstance(use, ClearanceUse):
        return (
            f"{use.name}: {format_significant(1e3 * use.least)} mm apart at "
            f"{use.t:.2f} s, {format_significant(1e3 * use.needed)} mm needed"
        )
    return (
        f"{use.quantity} of {use.joint}: {percent(100.0 * use.share)} of its limit "
        f"{'' if np.isnan(use.t) else f'at {use.t:.2f} s '}({SOURCES.get(use.source, use.source)})"
    )


def broken(design: Design) -> tuple[LimitUse | ClearanceUse, ...]:
    """Limits that the motion does not keep, and bodies that come too near to each other.

    Args:
        design: the design.
    """
    limits = [use for use in design.limits if use.share > 1.0 + 1e-6]
    return (*limits, *(c for c in design.clearances if c.least < c.needed - 1e-6))


def hardest(design: Design, count: int) -> list[PredictedError]:
    """Determined parameters whose errors matter most, wanted ones first.

    Args:
        design: the design.
        count: how many at most.
    """
    found = [p for p in design.predicted if not p.remark and np.isfinite(p.std)]
    found.sort(key=lambda p: (not p.wanted, -np.nan_to_num(p.share, nan=-1.0)))
    return found[:count]


def percentage(share: float) -> str:
    """Standard error over a value or a size in words: a percentage, ``∞`` or ``–``.

    Args:
        share: the quotient.
    """
    return percent(100.0 * share) if np.isfinite(share) else format_significant(100.0 * share)


def _lines(design: Design) -> Iterator[str]:
    yield from wrap(f"{headline(design)}.", WIDTH)
    condition = [format_significant(x) for x in design.condition]
    yield f"Criterion {design.criterion}; search {format_significant(design.seconds)} s."
    yield f"Condition number of the observation matrix {condition[1]}, at the start {condition[0]}."
    yield from wrap(design.noise, WIDTH)
    yield ""
    determined = sum(not p.remark and np.isfinite(p.std) for p in design.predicted)
    yield f"{determined} of {len(design.predicted)} parameters are determined. Least certain:"
    if rows := hardest(design, LISTED):
        yield plain_table(_columns(rows))
    asked = [p for p in design.predicted if p.wanted] or list(design.predicted)
    if small := [p.name for p in asked if not p.remark and p.value and p.relative > 1.0]:
        yield from wrap(f"Of little effect, σ is above the value: {listed(small)}.", WIDTH)
    if wrong := broken(design):
        yield f"LIMITS THAT ARE NOT KEPT: {len(wrong)}"
        yield from _some(wrong)
    binding = [use for use in design.binding if use not in wrong]
    if binding:
        yield f"{BINDING}: {len(binding)}"
        yield from _some(binding)
    elif not wrong:
        yield NO_LIMIT
    if design.undetermined:
        yield from _undetermined(design)
    for note in design.notes:
        yield from wrap(f"Note: {note}", WIDTH, subsequent_indent="  ")


def _columns(rows: list[PredictedError]) -> list[tuple[str, str, list[str]]]:
    """Columns of the table of parameters."""
    values = [with_spread(p.value, p.std) for p in rows]
    before = [format_significant(p.before, 2) for p in rows]
    return [
        ("  parameter", "<", [f"{'*' if p.wanted else ' '} {p.name}" for p in rows]),
        ("value", ".", [text for text, _ in values]),
        ("σ predicted", ".", [text for _, text in values]),
        ("σ before", ".", before),
        ("σ/size", ".", [percentage(p.share) for p in rows]),
        ("unit", "<", [p.unit for p in rows]),
    ]


def _some(uses: tuple[LimitUse | ClearanceUse, ...] | list[LimitUse | ClearanceUse]) -> list[str]:
    """The first limits in words, and how many more there are."""
    lines = [f"  {limit_words(use)}" for use in uses[:LISTED]]
    more = len(uses) - LISTED
    return [*lines, f"  and {more} more"] if more > 0 else lines


def _undetermined(design: Design) -> Iterator[str]:
    """Parameters that remain undetermined, those of one reason together."""
    yield f"Not determined: {len(design.undetermined)}"
    for reason, names in design.reasons.items():
        yield from wrap(
            f"{listed(names)}: {reason}", WIDTH, initial_indent="  ", subsequent_indent="    "
        )
