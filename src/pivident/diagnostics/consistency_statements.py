"""What the verdict says about parameters that a real machine can have."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pivident.consistency.consistent_estimate import NoConsistentEstimate
from pivident.consistency.significance import NOTABLE_COST
from pivident.diagnostics.diagnostics import Diagnostics
from pivident.diagnostics.statement import Statement
from pivident.text.numbers import format_significant

#: A step to consistent parameters that is less probable lies outside the intervals.
IMPROBABLE = 0.01


def consistency(diagnostics: Diagnostics, name: str) -> Iterator[Statement]:
    """Whether a real machine can have these parameters."""
    made = diagnostics.consistent
    found = made.get(name) or next(reversed(list(made.values())), None)
    if found is None:
        return
    if isinstance(found, NoConsistentEstimate):
        yield Statement("physics", "caution", f"{found.label}: {found.reason}.")
        return
    model, prediction = found.model, found.prediction
    cost = model.torque_cost if prediction is None else prediction.cost
    if model.was_consistent:
        text = "A real machine can have exactly these parameters."
        yield Statement("physics", "good", text, f"{found.label} has the same torques")
        return
    evidence = (
        f"least distance {format_significant(model.least_distance, 2)} σ, p = {model.p_value:.2g}; "
        f"distance of those taken {format_significant(model.distance, 2)} σ"
    )
    if prediction is not None:
        evidence += f"; {prediction}"
    elif math.isfinite(cost):
        evidence += f"; torque error on the fitted record, relative change {100 * cost:+.2g} %"
    if held_back := found.held_back():
        evidence += f"; held back most by {held_back[0]}"
    take = f"take {found.label} for simulation and export"
    near, cheap = model.p_value > IMPROBABLE, cost <= NOTABLE_COST
    if not math.isfinite(cost):
        where = "within" if near else "outside"
        text = (
            f"Parameters that a real machine can have lie {where} the intervals; what they cost in "
            "torque is not known without torque sums or held-out motion: identify again to have "
            "them."
        )
        yield Statement("physics", "note" if near else "caution", text, evidence)
    elif near and cheap:
        text = f"Parameters that a real machine can have lie within the intervals: {take}."
        yield Statement("physics", "good", text, evidence)
    elif cheap:
        text = (
            "The nearest parameters that a real machine can have lie outside the intervals, which "
            f"do not know all model error, but predict as well: {take}."
        )
        yield Statement("physics", "note", text, evidence)
    else:
        text = (
            "The nearest parameters that a real machine can have predict worse than the estimate: "
            "geometry, friction law or a bound is not the machine's."
        )
        yield Statement("physics", "caution", text, evidence)
