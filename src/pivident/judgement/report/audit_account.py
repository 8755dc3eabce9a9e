"""Drawings of an audit; their look is that of the report.

An audit as files: ``audit.json``, and one HTML page in the look of the report.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from markupsafe import Markup

from pivident.foundation.document.plot import (
    ERROR,
    MEASURED,
    METHOD_COLOURS,
    Figure,
    Plot,
    Trace,
    colour_scale,
    empty_plot,
    kept_samples,
    trace,
)
from pivident.foundation.files import atomic_folder
from pivident.foundation.text.finding import Finding, counted, gravest_first, serious
from pivident.foundation.text.numbers import with_spread
from pivident.judgement.audit.audit import Audit, audits_json
from pivident.judgement.report.builder import page_environment, page_of, write_page

#: Points of one trace.
POINTS = 1200

#: Parameters that the drawing of the excitation names.
MAX_PARAMETERS = 80


def interval_figure(audit: Audit) -> Figure | None:
    """Histogram of the intervals between time stamps."""
    intervals = 1e3 * audit.timing.intervals
    if intervals.size < 3:
        return None
    counts, edges = np.histogram(intervals, bins=min(81, max(11, intervals.size // 50)))
    if np.ptp(intervals) < 1e-9 * abs(intervals[0]):
        counts, edges = np.array([intervals.size]), np.array([0.99, 1.01]) * intervals[0]
    middles = 0.5 * (edges[1:] + edges[:-1])
    bars = _bars(middles, counts, METHOD_COLOURS[0], width=np.diff(edges))
    plot = audit_plot("intervals", "interval [ms]", [bars], y={"type": "log"})
    low, high = intervals.min(), intervals.max()
    note = f"median {np.median(intervals):.6g} ms, from {low:.6g} to {high:.6g} ms"
    label = f"Histogram of {intervals.size} intervals between time stamps: {note}"
    return Figure(plot, 260, "Intervals between time stamps", label, note)


def clock_figure(audit: Audit) -> Figure | None:
    """Deviation of the stamps from a uniform clock over the samples."""
    clock = audit.log.clock
    if clock is None or len(clock) < 3:
        return None
    k = np.flatnonzero(np.isfinite(clock))
    t = clock[k]
    if t.size < 3 or t[-1] == t[0]:
        return None
    apart = 1e3 * (t - t[0] - (k - k[0]) * (t[-1] - t[0]) / (k[-1] - k[0]))
    kept = kept_samples(apart, POINTS)
    drawn = _lines(k[kept], apart[kept], METHOD_COLOURS[0])
    plot = audit_plot("deviation [ms]", "sample", [drawn])
    period = 1e3 * (t[-1] - t[0]) / (k[-1] - k[0])
    note = f"largest {np.abs(apart).max():.3g} ms from a clock of {period:.6g} ms"
    return Figure(plot, 260, "Stamps against a uniform clock", f"Deviation of stamps: {note}", note)


def grid_figure(audit: Audit) -> Figure | None:
    """Levels that each quantised signal has over its range."""
    grids = [g for g in audit.quantisation.grids if np.isfinite(g.step)]
    if not grids:
        return None
    bars = _bars([g.name for g in grids], [g.levels for g in grids], METHOD_COLOURS[2])
    y = {"type": "log", "rangemode": "tozero"}
    plot = audit_plot("levels over the range", traces=[bars], y=y)
    note = "steps of the grid that the values lie on; fewer levels make rougher derivatives"
    return Figure(plot, 280, "Quantisation", f"Levels of {len(grids)} quantised signals", note)


def steps_figures(audit: Audit) -> Iterator[Figure]:
    """Some samples of each quantised position and torque where it moves, as they are."""
    for grid in audit.quantisation.grids:
        values = audit.log.signals().get(grid.name)
        if values is None or not np.isfinite(grid.step) or grid.name.partition(" of ")[0] != "q":
            continue
        speed = np.abs(np.diff(np.nan_to_num(values)))
        middle = int(
            np.argmax(np.convolve(speed < 3 * grid.step, np.ones(50), "same") * (speed > 0))
        )
        part = slice(max(0, middle - 100), middle + 100)
        sample = np.arange(part.start, part.start + len(values[part]))
        steps = (values[part] - np.nanmean(values[part])) / grid.step
        drawn = _lines(sample, steps, METHOD_COLOURS[2], shape="hv")
        plot = audit_plot("steps", "sample", [drawn])
        label = f"Slow part of {grid.name} in steps of {grid.step:.4g}"
        yield Figure(plot, 220, grid.name, label, f"one step is {grid.step:.4g}")


def torque_speed_figures(audit: Audit) -> list[Figure]:
    """Torque of each joint over its speed, both low-passed."""
    model = audit.model
    if model is None:
        return []
    tau = model.tau()
    kept = np.arange(0, len(model.at), max(1, len(model.at) // POINTS))
    figures = []
    for j, joint in enumerate(model.robot.joints):
        points = trace(
            x=model.dq[kept, j].astype(np.float32),
            y=tau[kept, j].astype(np.float32),
            mode="markers",
            marker={"color": METHOD_COLOURS[0], "size": 3, "opacity": 0.6},
        )
        plot = audit_plot(
            f"torque [{joint.torque_unit}]", f"speed [{joint.position_unit}/s]", [points]
        )
        note = ""
        if audit.power is not None and np.isfinite(audit.power.friction[j]):
            taken, error = audit.power.friction[j], audit.power.standard_errors[j]
            note = "friction dissipates {} ± {} W".format(*with_spread(taken, 2 * error))
        label = f"Torque of {joint.name} over its speed; {note}"
        figures.append(Figure(plot, 260, joint.name, label, note))
    return figures


def shift_figure(audit: Audit) -> Figure | None:
    """Relative error of each joint's inverse model over the shift of its torque."""
    delay = audit.delay
    if delay is None:
        return None
    assert audit.log.robot is not None
    lines = [
        trace(
            x=1e3 * delay.shifts,
            y=100 * delay.errors[:, j],
            name=joint.name,
            mode="lines",
            line={"color": METHOD_COLOURS[j % len(METHOD_COLOURS)], "width": 1.6},
        )
        for j, joint in enumerate(audit.log.robot.joints)
        if np.isfinite(delay.errors[:, j]).all()
    ]
    plot = audit_plot(
        "relative error [%]", "delay of the torque [ms]", lines, y={"type": "log"}, legend=True
    )
    mean, error = delay.common
    note = "the lowest point of each line is the delay of that joint"
    if np.isfinite(mean):
        plot.vertical(1e3 * mean, {"color": ERROR, "width": 1, "dash": "dash"})
        note += "; together {} ± {} ms".format(*with_spread(1e3 * mean, 2e3 * error))
    label = (
        f"Relative error of the inverse model over the shift between torque and position; {note}"
    )
    return Figure(plot, 340, "Residual over shift", label, note)


def order_figure(audit: Audit) -> Figure | None:
    """Error of each torque on each joint's inverse model."""
    if audit.order is None or len(audit.order.errors) < 2:
        return None
    assert audit.log.robot is not None
    names = list(audit.log.robot.joint_names)
    cells = trace(
        "heatmap",
        x=names,
        y=names,
        z=100 * audit.order.errors,
        colorscale=colour_scale("Blues"),
        reversescale=True,
        zmin=0,
        zmax=100,
        colorbar={"title": {"text": "%"}, "thickness": 10},
        texttemplate="%{z:.0f}",
    )
    plot = audit_plot("joint", "torque column", [cells], y={"autorange": "reversed"})
    note = (
        "relative error of each torque column on each joint's model; the diagonal should be lowest"
    )
    return Figure(plot, 340, "Which torque fits which joint", note, note)


def excitation_figures(audit: Audit) -> list[Figure]:
    """What each parameter leaves open, and how much of its limits each joint uses."""
    excitation, model = audit.excitation, audit.model
    if excitation is None or model is None:
        return []
    share = 100 * np.minimum(excitation.open_torque, 10.0)
    worst = np.argsort(-share)[:MAX_PARAMETERS]
    colours = [ERROR if share[k] > 20 else METHOD_COLOURS[0] for k in worst]
    bars = _bars([excitation.names[k] for k in worst], share[worst], colours)
    plot = audit_plot("undetermined torque [%]", traces=[bars], y={"type": "log"})
    note = (
        f"rank {excitation.rank} of {len(excitation.names)}, condition {excitation.condition:.4g}; "
        "share of the torque of full motion that the uncertainty of each parameter alone leaves "
        "undetermined, above 20 % in red"
    )
    first = Figure(plot, 320, "Parameters", f"Excitation: {note}", note)
    joints, kinds = list(model.robot.joint_names), ("range", "rated speed", "acceleration")
    uses = [
        _bars(joints, 100 * excitation.ranges[:, k], METHOD_COLOURS[k], name=kind)
        for k, kind in enumerate(kinds)
    ]
    ranges = audit_plot("used [%]", traces=uses, barmode="group", legend=True)
    note = (
        "share of position limits, rated speed, and of the acceleration that reaches it in 0.15 s"
    )
    values = trace(
        x=np.arange(1, len(excitation.singular_values) + 1),
        y=np.maximum(excitation.singular_values, 1e-12),
        mode="lines+markers",
        line={"color": MEASURED, "width": 1.2},
        marker={"size": 4},
    )
    spectrum = audit_plot("singular value", "number", [values], y={"type": "log"})
    return [
        first,
        Figure(ranges, 300, "Use of the limits", f"Use of the limits by joint; {note}", note),
        Figure(
            spectrum,
            300,
            "Singular values",
            "Singular values of the scaled observation matrix",
            "of the weighted matrix with columns of unit length, relative to the largest",
        ),
    ]


def _bars(x: Any, y: Any, colour: Any, **more: Any) -> Trace:
    return trace("bar", x=x, y=y, marker={"color": colour}, **more)


def _lines(x: np.ndarray, y: np.ndarray, colour: str, **more: Any) -> Trace:
    return trace(x=x, y=y, mode="lines", line={"color": colour, "width": 1.2} | more)


def audit_plot(
    *content: Any,
    x: Mapping[str, Any] | None = None,
    y: Mapping[str, Any] | None = None,
    **layout: Any,
) -> Plot:
    """`empty_plot` with room for numbers of any size, as 4 × 10⁻¹³ and not 400f."""
    room = {"automargin": True}
    y = room | {"exponentformat": "power"} | dict(y or {})
    return empty_plot(*content, x=room | dict(x or {}), y=y, **layout)


def write_audit(audits: Sequence[Audit], folder: str | Path) -> Path:
    """Write ``audit.json`` and ``audit.html``, both or neither.

    Args:
        audits: of one log or several.
        folder: folder to create or to write into.

    Returns:
        The page.

    Raises:
        PividentError: the folder cannot be written.
    """
    page = render_page(audits)
    with atomic_folder(folder) as build:
        write_page(build, "audit", page, audits_json(audits))
    return Path(folder) / "audit.html"


def render_page(audits: Sequence[Audit]) -> str:
    """The page as text."""
    environment = page_environment()
    template = environment.get_template("audit.html")
    summary = environment.get_template("audit_summary.html")
    sections = []
    for number, audit in enumerate(audits, start=1):
        tag = f"-{number}" if len(audits) > 1 else ""
        name = f"{audit.log.name}: " if len(audits) > 1 else ""
        grave = serious(audit.findings)
        body = summary.render(audit=audit, serious=grave, counted=counted(audit.findings))
        sections.append((f"summary{tag}", f"{name}What was found", Markup(body)))
        for topic in audit.topics:
            check, heading = topic.name, topic.heading
            drawn = _figures(audit, check)
            found = gravest_first(audit.of(check))
            if found or drawn:
                body = template.render(
                    findings=found,
                    figures=drawn,
                    position=position,
                    placed=any(position(finding) for finding in found),
                )
                sections.append((f"{check}{tag}", f"{name}{heading}", Markup(body)))
    # What was found in a single log heads the page, before the list of contents.
    title = f"Audit of {', '.join(audit.log.name for audit in audits)}"
    return page_of(environment, title, sections, headed=len(audits) == 1)


def position(finding: Finding) -> str:
    """Where in the log a finding begins."""
    if finding.sample is None:
        return ""
    time = "" if finding.time is None else f", t = {finding.time:.6g} s"
    return f"sample {finding.sample}{time}"


def _figures(audit: Audit, check: str) -> list[Figure]:
    """The drawings that belong to a check."""
    drawers: dict[str, Callable[[], Sequence[Figure | None]]] = {
        "timing": lambda: [interval_figure(audit), clock_figure(audit)],
        "quantisation": lambda: [grid_figure(audit), *steps_figures(audit)],
        "order": lambda: [order_figure(audit)],
        "delay": lambda: [shift_figure(audit)],
        "power": lambda: torque_speed_figures(audit),
        "excitation": lambda: excitation_figures(audit),
    }
    drawn = drawers[check]() if check in drawers else []
    return [figure for figure in drawn if figure is not None]
