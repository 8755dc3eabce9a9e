"""Figures of a search for ripple; their look is that of the report."""

from __future__ import annotations

import numpy as np

from pivident.friction.ripple.ripple_lines import JointRipple
from pivident.report.plot_parts import kept_samples
from pivident.report.plotly_figures import ERROR, MEASURED, METHOD_COLOURS, Figure, empty_plot
from pivident.text.numbers import format_significant

#: Points of one trace.
POINTS = 2400

#: Points of one motor revolution of the ripple over position.
TURN = 400


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
    kept = kept_samples(amplitude, POINTS)
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
    made: list[Figure | None] = []
    for angle in range(len(joint.angles)):
        made += [order_figure(joint, angle), turn_figure(joint, angle)]
    return [figure for figure in made if figure is not None]
