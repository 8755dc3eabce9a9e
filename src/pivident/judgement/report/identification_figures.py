"""Figures of an identification: torques, reference, signals, residual, iterations."""

from __future__ import annotations

import html
import math

import numpy as np

from pivident.estimation.identification import FittedRecording, Identification
from pivident.foundation.document.curves import Curves, compared, torque_axis
from pivident.foundation.document.plot import (
    ERROR,
    MEASURED,
    METHOD_COLOURS,
    SHADE,
    Figure,
    Plot,
    colour,
    drawn,
    empty_plot,
    line,
    packed,
    stretches,
    trace,
    traces_of,
)
from pivident.foundation.text.numbers import format_significant, percent
from pivident.judgement.validation.residuals.residual_tests import JointResidualTests
from pivident.loop.simulation.control_loop import IdentifiedLaw


def torque_curves(
    identification: Identification, recording: FittedRecording, joint: int, method: int
) -> Curves:
    """Measured, or commanded, and reconstructed torque of one joint, and their difference."""
    fit = identification.joints[joint]
    origin = "Measured" if recording.torque_source == "measured" else "Commanded"
    measured, model = recording.tau[:, joint], recording.tau_model[:, joint]
    error = f"relative error {percent(100.0 * fit.relative_error)}"
    return Curves(
        fit.name,
        torque_axis(fit.torque_unit),
        recording.t,
        compared(measured, model, "reconstructed", method, recording.torque_label),
        f"{origin} and reconstructed torque of {fit.name}",
        f"{error}, rms error {format_significant(fit.rms_error)} {fit.torque_unit}",
    )


def torque_figure(
    identification: Identification, recording: FittedRecording, joint: int, method: int, points: int
) -> Figure:
    """The same as a figure; rows that were not used are shaded."""
    curves = torque_curves(identification, recording, joint, method)
    figure = drawn(curves, points, recording.name)
    _shade(figure.plot, _excluded(recording, joint), _time(recording))
    return figure


def law_figure(found: IdentifiedLaw, joint: int, method: int, points: int) -> Figure:
    """Recorded controller output of one joint, what its law makes of it, and the difference."""
    from pivident.estimation.control_law.law_equations import START

    law, used = found.joints[joint], slice(START, None)  # before, there is no speed yet
    measured, model = found.output[used, joint], found.model[used, joint]
    t = np.arange(len(found.output))[used] / found.rate
    traces = traces_of(t, compared(measured, model, "law", method), points)
    plot = empty_plot(f"{found.compared} [{found.unit}]", "time [s]", traces)
    rms = f"rms {format_significant(law.rms)} {found.unit}"
    note = f"not explained {percent(100.0 * law.relative_error)}, {rms}"
    span = f"over {format_significant(t[-1])} s"
    label = f"Measured {found.compared} of {law.name} and its law {span}: {note}"
    # The law's rows begin at another instant than the fitted ones: it has a window of its own.
    own = f"law of {', '.join(found.recordings)}"
    return Figure(plot, 250, law.name, label, note, recording=own)


def reference_figure(
    identification: Identification, recording: FittedRecording, joint: int, method: int, points: int
) -> Figure:
    """Measured position of one joint with its reference, and their difference below."""
    assert recording.q_ref is not None
    name, unit = identification.joints[joint].name, identification.robot.joints[joint].position_unit
    t = _time(recording)
    measured, reference = recording.q_measured[:, joint], recording.q_ref[:, joint]
    lines = traces_of(t, compared(measured, reference, "reference", method), points)
    plot = empty_plot("", traces=[*lines[:2], lines[2] | {"yaxis": "y2"}])
    plot.stack([f"q [{unit}]", f"difference [{unit}]"])
    plot.update(yaxis2={"automargin": True})
    rms = format_significant(float(np.sqrt(np.mean((measured - reference) ** 2))))
    label = f"Measured position of {name} and its reference over {format_significant(t[-1])} s"
    note = f"measured less reference: rms {rms} {unit}"
    return Figure(
        plot, 320, name, f"{label}; {note}", note, recording.name, _start(recording)
    )  # fmt: skip


def residual_figure(tests: JointResidualTests, method: int) -> Figure:
    """Autocorrelation of one joint's residual with the band of white noise."""
    found = tests.autocorrelation
    lags = np.arange(1, found.rho.size + 1)
    bars = trace(
        "bar",
        x=packed(lags),
        y=packed(found.rho),
        marker={"color": colour(method)},
        name="autocorrelation",
    )
    ends = [
        trace(
            x=packed(lags),
            y=packed(sign * found.band),
            mode="lines",
            line={"color": ERROR, "width": 1, "dash": "dash"},
            name="±2/√n",
        )
        for sign in (-1.0, 1.0)
    ]
    reach = 1.15 * max(float(np.nanmax(np.abs(found.rho))), 2.0 * float(np.median(found.band)))
    plot = empty_plot(
        "autocorrelation",
        f"lag [samples of {format_significant(1e3 / found.rate)} ms]",
        [bars, *ends],
        y={"range": [-reach, reach]},
    )
    note = f"{percent(100.0 * found.outside)} outside ±2/√n. {tests.whiteness}"
    label = f"Autocorrelation of the residual of {tests.name} at lags 1 to {lags[-1]}: {note}"
    return Figure(plot, height=220, title=tests.name, label=label, note=note)


def signal_figure(
    identification: Identification, recording: FittedRecording, joint: int, method: int, points: int
) -> Figure:
    """Position, speed and acceleration of one joint below each other."""
    fit, unit = identification.joints[joint], identification.robot.joints[joint].position_unit
    t = _time(recording)
    rows = (
        ("q", unit, recording.q),
        ("dq", f"{unit}/s", recording.dq),
        ("ddq", f"{unit}/s²", recording.ddq),
    )
    lines = [
        line(t, signal[:, joint], points, f"{name} estimated", colour(method), width=1.2)
        | {"yaxis": f"y{k}" if k > 1 else "y"}
        for k, (name, _, signal) in enumerate(rows, start=1)
    ]
    measured = line(t, recording.q_measured[:, joint], points, "measured", MEASURED, width=2.4)
    plot = empty_plot("", traces=[measured, *lines])
    plot.stack([f"{name} [{row_unit}]" for name, row_unit, _ in rows])
    _shade(plot, _excluded(recording, joint), t)
    note = (
        f"smoother: half power at {format_significant(fit.f50)} Hz"
        if math.isfinite(fit.f50)
        else ""
    )
    label = f"Position, speed and acceleration of {fit.name} over {format_significant(t[-1])} s"
    return Figure(plot, 420, fit.name, label, note, recording.name, _start(recording))


def distance_figure(identification: Identification) -> Figure:
    """Distance of every parameter from its final value over the iterations, in σ."""
    history = identification.history
    theta = np.array([iteration.theta for iteration in history])
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = np.abs(theta - identification.theta) / identification.std
    distance[~(np.isfinite(distance) & (distance > 0.0))] = np.nan
    columns = zip(identification.names, identification.parameters, distance.T, strict=True)
    plot = empty_plot(
        "distance from the estimate [σ]",
        "iteration",
        [
            trace(
                x=packed(np.arange(1, len(history) + 1)),
                y=packed(values),
                name=html.escape(name, quote=False),
                mode="lines+markers",
                line={"color": colour(parameter.joint), "width": 1.2},
                marker={"size": 4},
            )
            for name, parameter, values in columns
        ],
        x={"dtick": 1, "range": [0.8, len(history) + 0.2]},
        y={"type": "log", "exponentformat": "power", "dtick": 1},
    )
    plot.horizontal(1.0, {"color": ERROR, "width": 1, "dash": "dash"})
    label = (
        f"Distance of {len(identification.names)} parameters from their estimate over "
        f"{len(history)} iterations, in standard errors"
    )
    note = "one line per parameter, coloured by joint; the dashed line is 1σ"
    return Figure(plot, height=300, title="Parameters", label=label, note=note)


def change_figure(identification: Identification) -> Figure:
    """Largest relative change and relative error over the iterations.

    The error is that of the torque, or of a fitted simulation, weighted by its noise.
    """
    history = identification.history
    fitted = identification.simulation is not None
    error = "weighted simulation error" if fitted else "relative error of the torque"
    plot = empty_plot(
        "%",
        "iteration",
        [
            trace(
                x=packed(np.arange(1, len(history) + 1)),
                y=packed(100.0 * np.array(values, dtype=float)),
                name=name,
                mode="lines+markers",
                line={"color": line_colour, "width": 1.6},
            )
            for name, line_colour, values in (
                ("largest relative change", METHOD_COLOURS[0], [i.change for i in history]),
                (error, METHOD_COLOURS[1], [i.residual for i in history]),
            )
        ],
        x={"dtick": 1, "range": [0.8, len(history) + 0.2]},
        y={"type": "log", "exponentformat": "power"},
        legend=True,
    )
    last = history[-1]
    label = (
        f"Largest relative change and {error} over {len(history)} iterations; at the end "
        f"{percent(100.0 * last.change)} and {percent(100.0 * last.residual)}"
    )
    note = (
        "the weighted error is 100 % where it is as large as its weights expect" if fitted else ""
    )
    return Figure(plot, height=300, title="Criteria", label=label, note=note)


def _shade(plot: Plot, excluded: np.ndarray, t: np.ndarray) -> None:
    """Grey background where rows were not used."""
    plot.update(
        shapes=[
            {
                "type": "rect",
                "layer": "below",
                "yref": "paper",
                "x0": start,
                "x1": stop,
                "y0": 0,
                "y1": 1,
                "fillcolor": SHADE,
                "line": {"width": 0},
            }
            for start, stop in stretches(excluded, t)
        ]
    )


def _excluded(recording: FittedRecording, joint: int) -> np.ndarray:
    """True for rows that were not used."""
    return ~np.asarray(recording.used, dtype=bool)[:, joint]


def _time(recording: FittedRecording) -> np.ndarray:
    """Time since the first row [s]: a clock's absolute time has too many digits to draw."""
    return recording.t - recording.t[0]


def _start(recording: FittedRecording) -> float:
    """Instant of the first row on the recording's clock [s]."""
    return float(recording.t[0])
