"""A fitted simulator as one HTML page, in the look of the report."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.report.builder import page_environment, page_of
from pivident.report.plotly_figures import Figure, errors_figure
from pivident.simulators.held_out import HeldOut, milli
from pivident.simulators.simulator_fit import FittedValue, SimulatorFit
from pivident.simulators.simulator_text import findings
from pivident.text.numbers import format_significant, with_spread

#: Points of a trace.
POINTS = 2000


def simulator_page(fit: SimulatorFit, held_out: HeldOut | None) -> str:
    """The page: values with intervals, and the errors on held-out motion before and after."""
    environment = page_environment("pivident.simulators")
    values = environment.get_template("simulator_values.html").render(
        headline=(
            f"{len(fit.values)} values from {fit.samples} samples of {fit.robot.size} joints, "
            "positions only"
        ),
        rows=[_row(value) for value in fit.values],
        findings=findings(fit, held_out),
    )
    sections = [("values", "Fitted values", Markup(values))]
    if held_out is not None:
        body = environment.get_template("simulator_held_out.html").render(_errors(held_out))
        sections.append(("held-out", f"Errors on {held_out.name}", Markup(body)))
    return page_of(environment, f"{fit.robot.name}: fitted simulator", sections)


def _row(value: FittedValue) -> dict[str, str]:
    shown = (format_significant(value.value), "–")
    if math.isfinite(value.std):
        shown = with_spread(value.value, value.value - value.low)
    return {
        "joint": value.joint or "all",
        "quantity": value.quantity,
        "value": shown[0],
        "spread": shown[1],
        "unit": value.unit,
        "start": format_significant(value.start),
    }


def _errors(held_out: HeldOut) -> dict[str, Any]:
    """What the section on held-out motion shows."""
    rms = held_out.rms()
    rows = []
    for j, joint in enumerate(held_out.robot.joints):
        cells = [milli(float(own[j])) for own in rms.values()]
        unit = "mrad" if joint.position_unit == "rad" else "mm"
        rows.append({"joint": joint.name, "cells": cells, "unit": unit})
    return {
        "titles": list(rms),
        "rows": rows,
        "sentences": held_out.sentences(),
        "figures": [_figure(held_out, j) for j in range(held_out.robot.size)],
    }


def _figure(held_out: HeldOut, j: int) -> Figure:
    """Position errors of one joint before and after."""
    joint, rms = held_out.robot.joints[j], held_out.rms()
    unit = "mrad" if joint.position_unit == "rad" else "mm"
    seen = slice(held_out.first, None)
    errors = {
        title: 1e3 * (held_out.q - own)[seen, j]
        for title, own in (("before", held_out.before), ("after", held_out.after))
        if np.isfinite(rms[title][j])
    }
    note = ", ".join(
        f"{title} {format_significant(1e3 * float(rms[title][j]))} {unit} rms" for title in errors
    )
    return errors_figure(joint.name, unit, held_out.t[seen], errors, POINTS, note)
