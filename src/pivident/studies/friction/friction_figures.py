"""Drawings of friction: functions with their bands, maps with their intervals, ripple.

Figures of a search for ripple; their look is that of the report.
"""

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
    colour_scale,
    empty_plot,
    kept_samples,
    packed,
)
from pivident.foundation.text.numbers import format_significant
from pivident.studies.friction.effects import FrictionFinding, pm
from pivident.studies.friction.friction_map import FrictionMap
from pivident.studies.friction.friction_study import JointFriction
from pivident.studies.friction.ripple_lines import JointRipple
from pivident.studies.friction.state_dependent import common_speeds

FORWARDS, BACKWARDS = METHOD_COLOURS[0], METHOD_COLOURS[1]
LAW = MEASURED
#: Points of a drawn law.
POINTS = 200
#: Points of one trace.
POINTS_OF_RIPPLE = 2400
#: Points of one motor revolution of the ripple over position.
TURN = 400


def joint_figures(joint: JointFriction) -> list[Figure]:
    """All drawings of a joint."""
    drawn = [speed_figure(joint), position_figure(joint)]
    if "load" in joint.fit:
        drawn.append(load_figure(joint))
    drawn += [time_figure(joint), acceleration_figure(joint)]
    if np.isfinite(joint.plane.value).any():
        drawn.append(plane_figure(joint))
    return drawn


def speed_figure(joint: JointFriction) -> Figure:
    """Friction against the motion over speed, for both directions, with the estimate's law."""
    unit, per = joint.torque.torque_unit, f"{joint.torque.position_unit}/s"
    plot = _plot(f"against the motion [{unit}]", f"speed [{per}]", legend=True)
    for name, words, sign, colour in (
        ("positive", "forwards", 1.0, FORWARDS),
        ("negative", "backwards", -1.0, BACKWARDS),
    ):
        p = joint.fit[name]
        _band(plot, p.state, sign * p.value, p.std, colour, words)
        _points(plot, joint.maps[f"speed, {words}"], colour, words)
    _law(plot, joint)
    low, high = common_speeds(joint.fit)
    note = (
        f"lines: functions of speed with their 2σ bands; points: means over "
        f"{joint.maps['time'].value.size} bins, "
        f"2σ by passes; grey: the law of the estimate. Slower than {joint.torque.standstill:.2g} "
        f"{per} counts as standstill."
    )
    label = (
        f"Friction of {joint.name} against the motion from {low:.3g} to {high:.3g} {per}; "
        f"{_sentence(joint, 'level')}"
    )
    return Figure(_within(plot), 320, "Speed and direction", label, note)


def position_figure(joint: JointFriction) -> Figure:
    """What depends on position, whatever the direction."""
    torque = joint.torque
    plot = _plot(
        f"torque [{torque.torque_unit}]", f"position [{torque.position_unit}]", legend=True
    )
    if "position" in joint.fit:
        p = joint.fit["position"]
        _band(plot, p.state, p.value, p.std, METHOD_COLOURS[2], "function")
    for words, colour in (("forwards", FORWARDS), ("backwards", BACKWARDS)):
        _points(plot, joint.maps[f"position, {words}"], colour, words)
    note = (
        "less the other functions. Where both directions agree it is not friction but gravity, "
        "a spring or cogging; where they differ, friction depends on position."
    )
    return Figure(_within(plot), 300, "Position", _sentence(joint, "position"), note)


def load_figure(joint: JointFriction) -> Figure:
    """Friction against the motion over the load."""
    unit = joint.torque.torque_unit
    plot = _plot(f"against the motion [{unit}]", f"torque of the rigid part [{unit}]")
    p = joint.fit["load"]
    _band(plot, p.state, p.value, p.std, METHOD_COLOURS[3], "function")
    _points(plot, joint.maps["load"], METHOD_COLOURS[3], "bins")
    note = (
        "less the other functions, mean zero; load-dependent friction is a V. The rigid part is "
        f"known to ±{2.0 * joint.torque.load_std:.2g} {unit} (2σ, rms)."
    )
    return Figure(_within(plot), 280, "Load", _sentence(joint, "load"), note)


def time_figure(joint: JointFriction) -> Figure:
    """What changes while the record lasts."""
    plot = _plot(f"against the motion [{joint.torque.torque_unit}]", "time [s]")
    p = joint.fit["time"]
    _band(plot, p.state, p.value, p.std, METHOD_COLOURS[4], "straight line")
    _points(plot, joint.maps["time"], METHOD_COLOURS[4], "bins")
    note = "less the other functions, mean zero; the line is what drifts"
    return Figure(_within(plot), 280, "Time", _sentence(joint, "drift"), note)


def acceleration_figure(joint: JointFriction) -> Figure:
    """What all functions leave, over acceleration: a slope is an inertia that is wrong."""
    torque = joint.torque
    plot = _plot(f"residual [{torque.torque_unit}]", f"acceleration [{torque.position_unit}/s²]")
    _points(plot, joint.maps["acceleration"], METHOD_COLOURS[5], "bins")
    note = "what all functions leave; a slope would be an inertia that the rigid part has wrong"
    label = f"Residual of {joint.name} over its acceleration"
    return Figure(_within(plot), 280, "Acceleration", label, note)


def plane_figure(joint: JointFriction) -> Figure:
    """What the functions of speed leave, over speed and position."""
    torque, plane = joint.torque, joint.plane
    unit = torque.torque_unit
    plot = _plot(f"position [{torque.position_unit}]", f"speed [{torque.position_unit}/s]")
    seen = np.isfinite(plane.value)
    reach = float(np.abs(plane.value[seen]).max()) if seen.any() else 1.0
    text = [
        ["" if not ok else pm(v, 0.5 * s) for v, s, ok in zip(*row, strict=True)]
        for row in zip(plane.value, plane.spread, seen, strict=True)
    ]
    plot.add(
        "heatmap",
        x=plane.x,
        y=plane.y,
        z=plane.value,
        text=text,
        hovertemplate=f"%{{x:.3g}}, %{{y:.3g}}: %{{text}} {unit}<extra></extra>",
        hoverongaps=False,
        colorscale=colour_scale("RdBu"),
        reversescale=True,
        zmin=-reach,
        zmax=reach,
        colorbar={"title": {"text": unit}, "thickness": 10},
    )
    plot.update(margin={"r": 4})
    note = (
        f"what the functions of speed, load and time leave; {seen.sum()} of {seen.size} cells have "
        "two independent passes or more"
    )
    label = f"Residual torque of {joint.name} over speed and position: {note}"
    return Figure(plot, 300, "Speed and position", label, note)


def gain_figure(joints: tuple[JointFriction, ...]) -> Figure:
    """What functions gain over constants on motion that was not fitted, by joint."""
    plot = _plot("smaller error [%]", "", legend=True)
    names = [joint.name for joint in joints]
    for words, colour, which in (
        ("functions of speed", FORWARDS, "speed"),
        ("all functions", METHOD_COLOURS[2], "full"),
    ):
        gains = [getattr(j.held_out, which).gain(j.held_out.constant) for j in joints]
        plot.add(
            "bar",
            x=[html.escape(n, quote=False) for n in names],
            y=np.array([g for g, _ in gains]),
            error_y={
                "type": "data",
                "array": np.array([2.0 * s for _, s in gains]),
                "thickness": 1.2,
            },
            name=words,
            marker={"color": colour},
        )
    plot.update(barmode="group", bargap=0.3 if len(joints) > 2 else 0.7)
    ends = [float(np.min(bar["y"] - bar["error_y"]["array"])) for bar in plot.data]
    plot.y_axis(range=[max(min(-2.0, 1.1 * min(ends)), -100.0), 100.0])
    note = (
        f"rms error below {joints[0].held_out.band:g} Hz on held-out blocks, against viscous and "
        "Coulomb friction with an offset fitted to the same blocks; bars: 2σ by jackknife"
    )
    return Figure(plot, 300, "What functions gain over constants", note, note)


def _plot(y_title: str, x_title: str, *, legend: bool = False) -> Plot:
    """Axes without decoration, in the look of the report."""
    plot = empty_plot(y_title)
    plot.update(margin={"t": 26 if legend else 8}, showlegend=legend, legend=LEGEND)
    plot.x_axis(x_title, automargin=True)
    plot.y_axis(automargin=True)
    return plot


def _band(
    plot: Plot, x: np.ndarray, y: np.ndarray, std: np.ndarray, colour: str, name: str
) -> None:
    """A function with its 2σ band."""
    plot.data.append(band(x, y - 2.0 * std, y + 2.0 * std, colour))
    plot.add(
        x=packed(x), y=packed(y), mode="lines", name=name, line={"color": colour, "width": 1.6}
    )


def _points(plot: Plot, found: FrictionMap, colour: str, name: str) -> None:
    """Bins with their intervals; open where there are too few passes for one."""
    seen = np.isfinite(found.value)
    known = np.isfinite(found.upper) & seen
    plot.add(
        x=packed(found.centre[seen]),
        y=packed(found.value[seen]),
        error_y={
            "type": "data",
            "array": packed(np.nan_to_num(found.upper - found.value)[seen]),
            "thickness": 1,
            "width": 0,
        },
        customdata=found.passes[seen],
        hovertemplate="%{x:.3g}: %{y:.3g} (%{customdata} passes)<extra></extra>",
        mode="markers",
        name=name,
        showlegend=False,
        marker={
            "color": colour,
            "size": 5,
            "symbol": ["circle" if k else "circle-open" for k in known[seen]],
        },
    )


def _within(plot: Plot) -> Plot:
    """Axis that shows functions, bands and points; intervals of few passes may reach beyond."""
    values = np.concatenate([np.asarray(trace["y"], dtype=float) for trace in plot.data])
    values = values[np.isfinite(values)]
    if values.size:
        low, high = float(values.min()), float(values.max())
        room = 0.25 * ((high - low) or 1.0)
        plot.y_axis(range=[low - room, high + room])
    return plot


def _law(plot: Plot, joint: JointFriction) -> None:
    """The estimate's own law, mean over both directions of |speed|, on its bins."""
    torque = joint.torque
    for sign in (1.0, -1.0):
        own = np.flatnonzero(torque.direction == sign)
        speed, law = np.abs(torque.dq[own]), sign * torque.law[own]
        edges = np.linspace(0.0, float(speed.max()), POINTS + 1)
        place = np.clip(np.searchsorted(edges, speed) - 1, 0, POINTS - 1)
        count = np.bincount(place, minlength=POINTS)
        with np.errstate(invalid="ignore", divide="ignore"):
            x = np.bincount(place, speed, POINTS) / count
            y = np.bincount(place, law, POINTS) / count
        seen = count > 0
        plot.add(
            x=packed(x[seen]),
            y=packed(y[seen]),
            mode="lines",
            name="law of the estimate",
            showlegend=sign > 0,
            line={"color": LAW, "width": 1.2, "dash": "solid" if sign > 0 else "dot"},
        )


def _sentence(joint: JointFriction, key: str) -> str:
    found: FrictionFinding | None = next((f for f in joint.findings if f.kind == key), None)
    return f"{joint.name}: {found.message}" if found else joint.name


def order_figure(joint: JointRipple, angle: int = 0) -> Figure | None:
    """Amplitude of the residual over the order, with what would be found and what was.

    None where no order could be searched.
    """
    spectrum, over = joint.spectra[angle], joint.angles[angle]
    shown = spectrum.searched
    if not shown.any():
        return None
    orders, amplitude = spectrum.orders[shown], spectrum.amplitude[shown]
    limit = spectrum.smallest_visible()[shown]
    gears = [(name, gear) for name, gear in over.motors if gear != 1.0]
    scale, title = 1.0, f"order of {over.name} [{'1/turn' if joint.unit == 'N m' else 'rad/m'}]"
    if gears:
        scale, title = gears[0][1], f"order [cycles per revolution of the {gears[0][0]}]"
    plot = empty_plot(f"amplitude [{joint.unit}]")
    kept = kept_samples(amplitude, POINTS_OF_RIPPLE)
    plot.add(
        x=orders[kept] / scale,
        y=amplitude[kept],
        mode="lines",
        name="residual",
        line={"color": METHOD_COLOURS[0], "width": 1.0},
    )
    few = np.unique(np.linspace(0, orders.size - 1, min(orders.size, 300)).astype(int))
    plot.add(
        x=orders[few] / scale,
        y=limit[few],
        mode="lines",
        name="found from here on",
        line={"color": MEASURED, "width": 1.4, "dash": "dash"},
    )
    lines = [line for line in joint.lines if line.angle.name == over.name]
    if lines:
        plot.add(
            x=[line.order / scale for line in lines],
            y=[line.amplitude for line in lines],
            error_y={
                "type": "data",
                "symmetric": False,
                "array": [line.interval[1] - line.amplitude for line in lines],
                "arrayminus": [line.amplitude - line.interval[0] for line in lines],
                "color": ERROR,
                "thickness": 1.2,
            },
            mode="markers",
            name="ripple",
            text=[str(line) for line in lines],
            marker={"color": ERROR, "size": 7},
        )
    plot.x_axis(title)
    plot.y_axis(rangemode="tozero")
    listed = ", ".join(
        f"{format_significant(line.amplitude)} {joint.unit} at {line.order / scale:.4g}"
        for line in lines
    )
    note = f"lines: {listed}" if lines else "no line"
    label = f"Amplitude of the residual of {joint.name} over the order of {over.name}; {note}"
    return Figure(plot, 280, f"{joint.name} over {over.name}", label, note)


def turn_figure(joint: JointRipple, angle: int = 0) -> Figure | None:
    """The ripple of an angle over one turn: of its motor, or of the slowest line.

    None without a line over this angle.
    """
    over = joint.angles[angle]
    lines = [li for li in joint.lines if li.angle.name == over.name and li.beside is None]
    if not lines:
        return None
    gears = [gear for _, gear in over.motors if gear != 1.0]
    period = 2.0 * np.pi / (gears[0] if gears else min(line.order for line in lines))
    position = np.linspace(0.0, period, TURN)
    total = np.zeros(TURN)
    plot = empty_plot(f"ripple [{joint.unit}]")
    for line in lines:
        phase = line.order * position
        own = line.cosine * np.cos(phase) + line.sine * np.sin(phase)
        total += own
        plot.add(
            x=position, y=own, mode="lines", name=f"{line.order:.5g}",
            line={"color": MEASURED, "width": 1.0},
        )  # fmt: skip
    plot.add(
        x=position, y=total, mode="lines", name="sum",
        line={"color": METHOD_COLOURS[0], "width": 2.0},
    )  # fmt: skip
    unit = "m" if joint.unit == "N" else "rad"
    plot.x_axis(f"{over.name} [{unit}]")
    what = "one revolution of the motor" if gears else "one period of the slowest line"
    height = format_significant(float(np.ptp(total)))
    note = f"{what}, sum of {len(lines)} line(s), peak to peak {height} {joint.unit}"
    label = f"Ripple of {joint.name} over {over.name}: {note}"
    return Figure(plot, 250, f"{joint.name} over {over.name}", label, note)


def ripple_figures(joint: JointRipple) -> list[Figure]:
    """All figures of one joint, one pair for each angle."""
    made = (
        drawn(joint, angle)
        for angle in range(len(joint.angles))
        for drawn in (order_figure, turn_figure)
    )
    return [figure for figure in made if figure is not None]
