"""What the verdict says about parameters that a real machine can have."""

from __future__ import annotations

import math
from collections.abc import Iterator

from pivident.foundation.text.finding import Finding, Quantity, Severity
from pivident.foundation.text.numbers import format_significant, percent
from pivident.foundation.text.sentences import listed
from pivident.judgement.diagnostics.consistent_estimate import NoConsistentEstimate
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.models.consistency.metric import NOTABLE_COST

#: Links and joints that are named where no machine has the parameters.
MOST_HELD = 3

#: A step to consistent parameters that is less probable lies outside the intervals.
IMPROBABLE = 0.01


def consistency(diagnostics: Diagnostics, name: str) -> Iterator[Finding]:
    """Whether a real machine can have these parameters."""
    made = diagnostics.consistent
    found = made.get(name) or next(reversed(list(made.values())), None)
    if found is None:
        yield from _nearest_machine(diagnostics)
        return
    if isinstance(found, NoConsistentEstimate):
        message = f"{found.label}: {found.reason}."
        yield Finding("warning", "physics", "no consistent estimate", message)
        return
    model, prediction = found.model, found.prediction
    cost = model.torque_cost if prediction is None else prediction.cost
    if model.was_consistent:
        text = "These parameters are physically possible."
        basis = f"{found.label} has the same torques"
        yield Finding("ok", "physics", "consistent", text, basis=basis)
        return
    basis = (
        f"least distance {format_significant(model.least_distance, 2)} σ, p = {model.p_value:.2g}; "
        f"distance of those taken {format_significant(model.distance, 2)} σ"
    )
    if prediction is not None:
        basis += f"; {prediction}"
    elif math.isfinite(cost):
        basis += f"; torque error on the fitted record, relative change {100 * cost:+.2g} %"
    if held_back := found.held_back():
        basis += f"; held back most by {held_back[0]}"
    evidence = {
        "least distance": Quantity(model.least_distance, "σ"),
        "p": Quantity(model.p_value),
        "distance": Quantity(model.distance, "σ"),
    }
    take = f"take {found.label} for simulation and export"
    severity: Severity
    near, cheap = model.p_value > IMPROBABLE, cost <= NOTABLE_COST
    if not math.isfinite(cost):
        where = "within" if near else "outside"
        text = (
            f"Parameters that a real machine can have lie {where} the intervals; their cost in "
            "torque is unknown without torque sums or held-out motion: identify again to get "
            "them."
        )
        severity, kind = ("note" if near else "warning"), "consistent, cost unknown"
    elif near and cheap:
        text = f"Parameters that a real machine can have lie within the intervals: {take}."
        severity, kind = "ok", "consistent within the intervals"
    elif cheap:
        text = (
            "The nearest parameters that a real machine can have lie outside the intervals, which "
            f"do not include all model error, but predict as well: {take}."
        )
        severity, kind = "note", "consistent outside the intervals"
    else:
        text = (
            "The nearest parameters that a real machine can have predict worse than the estimate: "
            "geometry, friction law or a bound does not match the machine."
        )
        severity, kind = "warning", "consistent parameters predict worse"
    yield Finding(severity, "physics", kind, text, evidence=evidence, basis=basis)


def _nearest_machine(diagnostics: Diagnostics) -> Iterator[Finding]:
    """The same where no consistent estimate was asked for: how far the nearest machine is."""
    model = diagnostics.nearest
    if model is None:
        return
    if model.was_consistent:
        text, basis = "These parameters are physically possible.", "0 σ from those of a machine"
        yield Finding("ok", "physics", "consistent", text, basis=basis)
        return
    basis = (
        f"least distance {format_significant(model.least_distance, 2)} σ, p = {model.p_value:.2g}"
    )
    evidence = {
        "least distance": Quantity(model.least_distance, "σ"),
        "p": Quantity(model.p_value),
        "torque error": Quantity(100.0 * model.torque_error_free, "%"),
        "of the nearest": Quantity(100.0 * model.torque_error, "%"),
    }
    if not model.is_far:
        near = model.p_value > IMPROBABLE
        where = "within" if near else "outside"
        text = f"Parameters that a real machine can have lie {where} the intervals"
        if not near:
            text += (
                ", but predict as well: the intervals include neither what was left out of the "
                "estimate nor all model error"
            )
        text += "."
        severity: Severity = "ok" if near else "note"
        yield Finding(
            severity, "physics", f"nearest {where} the intervals", text, "", "", evidence, basis
        )
        return
    text = (
        f"No machine has these parameters: the nearest possible ones lie "
        f"{format_significant(model.least_distance, 2)} σ away and raise the torque error of the "
        f"fitted record from {percent(100.0 * model.torque_error_free)} to "
        f"{percent(100.0 * model.torque_error)}."
    )
    held = listed(list(dict.fromkeys(a.subject for a in model.active))[:MOST_HELD])
    step = (
        "Positions or torques of two joints may be exchanged, a sign, a unit or a length wrong, or "
        f"samples lost: look at {held} first, and ask pivident check and pivident audit."
    )
    yield Finding("warning", "physics", "no machine", text, "", step, evidence, basis)
