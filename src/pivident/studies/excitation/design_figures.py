"""Figures of a design: its motion and torques against the limits, and its predicted errors."""

from __future__ import annotations

import html

import numpy as np

from pivident.foundation.document.plot import (
    ERROR,
    LEGEND,
    MEASURED,
    METHOD_COLOURS,
    Figure,
    Plot,
    band,
    colour,
    empty_plot,
    kept_samples,
    packed,
)
from pivident.foundation.text.numbers import format_significant, percent
from pivident.judgement.validation.parameter_correlation import ParameterCorrelation
from pivident.studies.excitation.design import PAGE_RATE, Design

#: Name of the motion on the page: figures over its time belong together.
MOTION = "motion"

#: Rate at which the motion is drawn [Hz], and the points of a trace.
DRAWN_RATE, POINTS = 200.0, 1500

#: Height of an axis [px].
_ROW = 118

#: Axes: quantity of its limit, symbol, unit per unit of the position.
_SIGNALS = (("position", "q", ""), ("speed", "dq", "/s"), ("acceleration", "ddq", "/s²"))


def motion_figure(design: Design, joint: int) -> Figure:
    """Position, speed, acceleration and torque of one joint, each between its limits.

    Args:
        design: the design.
        joint: index of the joint.
    """
    robot, motion = design.robot, design.motion
    own = robot.joints[joint]
    rate = min(DRAWN_RATE, max(PAGE_RATE, 4 * POINTS / motion.duration))
    t = motion.times(rate)
    rows = [
        (quantity, symbol, f"{own.position_unit}{per}", t, signal[:, joint])
        for (quantity, symbol, per), signal in zip(_SIGNALS, motion.sampled(rate), strict=True)
    ]
    plot = empty_plot("")
    if design.torque is not None:
        instants = motion.times(PAGE_RATE)
        torque = design.torque[:, joint]
        rows.append(("torque", "τ", own.torque_unit, instants, torque))
        if design.torque_margin is not None:
            margin = design.torque_margin[:, joint]
            axis = f"y{len(rows)}"
            plot.data.append(
                band(instants, torque - margin, torque + margin, colour(joint), axis=axis)
            )
    for k, (_, symbol, unit, instants, values) in enumerate(rows, start=1):
        kept = kept_samples(values, POINTS)
        plot.add(
            x=packed(instants[kept]),
            y=packed(values[kept]),
            yaxis="y" if k == 1 else f"y{k}",
            mode="lines",
            name=f"{symbol} [{unit}]",
            line={"color": colour(joint), "width": 1.4},
        )
    plot.stack([f"{symbol} [{unit}]" for _, symbol, unit, _, _ in rows], automargin=True)
    used = []
    for k, (quantity, *_) in enumerate(rows, start=1):
        _limit_lines(plot, design, own.name, quantity, k)
        shares = [u.share for u in design.limits if (u.joint, u.quantity) == (own.name, quantity)]
        if shares and np.isfinite(shares[0]):
            used.append(f"{quantity} {percent(100.0 * shares[0])}")
    note = f"share of the limits: {', '.join(used)}" if used else "no limits are known"
    words = " and ".join([", ".join(quantity for quantity, *_ in rows[:-1]), rows[-1][0]])
    label = (
        f"{words.capitalize()} of {own.name} over {format_significant(motion.duration)} s; {note}"
    )
    return Figure(plot, 60 + _ROW * len(rows), own.name, label, note, recording=MOTION)


def errors_figure(design: Design) -> Figure | None:
    """Standard errors over the sizes that matter, before the motion and after it.

    None where there is none to draw.

    Args:
        design: the design.
    """
    shown = [p for p in design.predicted if np.isfinite(p.share)]
    if not shown:
        return None
    names = [html.escape(p.name, quote=False) for p in shown]
    after = 100.0 * np.array([p.share for p in shown])
    before = np.array([100.0 * p.before / p.size for p in shown])
    plot = empty_plot("σ/size [%]")
    plot.x_axis(tickangle=-90, dtick=1, tickfont={"size": 9}, automargin=True)
    drawn = np.concatenate([after, before[np.isfinite(before)]])
    drawn = drawn[drawn > 0.0]
    decades = drawn.size > 0 and drawn.max() > 30.0 * drawn.min()
    plot.y_axis(type="log", exponentformat="power", dtick=1 if decades else None)
    if np.isfinite(before).any():
        kept = np.isfinite(before)
        plot.add(
            x=[name for name, known in zip(names, kept, strict=True) if known],
            y=packed(before[kept]),
            mode="markers",
            name="earlier records alone",
            marker={"color": MEASURED, "size": 7, "symbol": "line-ew-open", "line": {"width": 2}},
        )
    for name, own, wanted in (
        ("predicted", METHOD_COLOURS[0], False),
        ("predicted, asked for", METHOD_COLOURS[1], True),
    ):
        kept = np.array([p.wanted == wanted for p in shown])
        if kept.any():
            plot.add(
                x=[n for n, chosen in zip(names, kept, strict=True) if chosen],
                y=packed(after[kept]),
                mode="markers",
                name=name,
                marker={"color": own, "size": 8, "symbol": "diamond" if wanted else "circle"},
            )
    plot.update(
        showlegend=True,
        legend=LEGEND,
        xaxis={"categoryorder": "array", "categoryarray": names},
    )
    largest = shown[int(np.argmax(after))]
    note = f"largest: {largest.name}, {percent(100.0 * largest.share)}"
    label = f"Predicted standard errors of {len(shown)} parameters, over their sizes; {note}"
    return Figure(plot, 340, "Standard errors over the sizes that matter", label, note)


def predicted_correlation(design: Design) -> ParameterCorrelation | None:
    """Correlations of the parameters that are determined; None where these are fewer than two.

    Args:
        design: the design.
    """
    known = np.isfinite(np.diag(design.correlation))
    kept = [k for k, p in enumerate(design.predicted) if np.isfinite(p.std) and known[k]]
    matrix = design.correlation[np.ix_(kept, kept)]
    if len(kept) < 2 or not np.isfinite(matrix).all():
        return None
    return ParameterCorrelation(tuple(design.predicted[k].name for k in kept), matrix.copy())


def _limit_lines(plot: Plot, design: Design, joint: str, quantity: str, row: int) -> None:
    """Dashed lines at the limits of a quantity, on the axis of its row."""
    axis = "y" if row == 1 else f"y{row}"
    for use in design.limits:
        if (use.joint, use.quantity) != (joint, quantity):
            continue
        for bound in (use.low, use.high):
            if np.isfinite(bound):
                line = {"color": ERROR, "width": 1, "dash": "dash"}
                ends = {"x0": 0, "x1": 1, "y0": bound, "y1": bound}
                plot.add_shape("line", xref="paper", yref=axis, line=line, **ends)
