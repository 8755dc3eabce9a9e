"""Bode plots: filters of the signals, prefilters, and the closed loop of a joint."""

from __future__ import annotations

import html
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from pivident.estimation.signal_recipes import Algebraic, Bandpass, Decimated
from pivident.estimation.summary import frequencies_text
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
    packed,
)
from pivident.foundation.text.numbers import format_significant, plus_minus
from pivident.signals.algebraic import algebraic_gain
from pivident.signals.bandpass import bandpass_response
from pivident.signals.decimation import EDGE_OF_BAND, decimation_gain, decimation_stages
from pivident.signals.prefilter import Prefilter
from pivident.signals.random_walk_model import gain as smoother_gain, nvr_from_f50

if TYPE_CHECKING:
    from pivident.judgement.validation.identified_loop import IdentifiedJointLoop

#: Points of a curve.
POINTS = 240

#: Gains below this are not drawn [dB].
FLOOR = -160.0

#: Line styles of a position and its derivatives.
_DASHES = ("solid", "dash", "dot")


def bandpass_figure(signals: Bandpass, names: Sequence[str], rate: float, method: int) -> Figure:
    """Magnitude and phase from the measured position to q̂, dq̂ and ddq̂; the highest cut-off."""
    cutoffs = signals.cutoffs(len(names))
    cutoff = float(cutoffs.max())
    frequency = _frequencies(0.01 * cutoff, rate)
    plot = _bode("gain [dB re 1, 1/s, 1/s²]")
    for n, name in enumerate(("q", "dq", "ddq")):
        response = bandpass_response(frequency, rate, cutoff, signals.order, n)
        line = {"color": colour(method), "width": 1.8, "dash": _DASHES[n]}
        _gain(plot, frequency, np.abs(response), name, line)
        if n:
            ideal = {"color": MEASURED, "width": 1}
            _gain(plot, frequency, (2 * np.pi * frequency) ** n, f"ideal {name}", ideal, False)
        _curve(plot, frequency, np.full(frequency.size, 90.0 * n), name, line, "y2")
    for value in np.unique(cutoffs):
        _mark(plot, value, f"cut-off {format_significant(value)} Hz")
    top = 20 * np.log10((2 * np.pi * cutoff) ** 2)
    plot.update(yaxis={"range": [-80, top + 20]}, yaxis2={"tickvals": [0, 90, 180]})
    fine = np.linspace(frequency[0], 0.5 * rate, 20_000)
    peaks = [
        fine[np.abs(bandpass_response(fine, rate, cutoff, signals.order, n)).argmax()]
        for n in (1, 2)
    ]
    note = (
        f"Butterworth of order {signals.order} forwards and backwards: -6 dB at "
        f"{frequencies_text(list(cutoffs), names)}, no phase of its own. Combined with central "
        f"differences it is a band-pass, largest at {format_significant(peaks[0])} Hz for dq and "
        f"{format_significant(peaks[1])} Hz for ddq"
        f"{' of the highest cut-off' if np.ptp(cutoffs) else ''}. Grey: ideal derivatives."
    )
    label = (
        f"Bode plot of the band-pass from measured position to q, dq, ddq. {note} Phases are 0°, "
        "90°, 180°."
    )
    return Figure(plot, 420, "Positions to derivatives", label, note)


def decimation_figure(signals: Decimated, rate: float, method: int) -> Figure:
    """Gain of the parallel decimation on torque and observation matrix; rate before it [Hz]."""
    stages = decimation_stages(signals.factor(rate))
    total = int(np.prod(stages))
    nyquist = 0.5 * rate / total
    frequency = _frequencies(0.05 * nyquist, rate)
    gain = decimation_gain(frequency, rate, stages)
    plot = _over_frequency("gain [dB]")
    _gain(plot, frequency, gain, "decimation", {"color": colour(method), "width": 1.8})
    _mark(plot, nyquist, f"new Nyquist {format_significant(nyquist)} Hz")
    plot.y_axis(range=[FLOOR, 10])
    fine = np.linspace(0.2 * nyquist, nyquist, 4000)
    half = fine[int(np.argmax(decimation_gain(fine, rate, stages) < 0.5))]
    split = " · ".join(map(str, stages))
    note = (
        f"every {total}th sample kept ({split}), {format_significant(rate)} Hz to "
        f"{format_significant(rate / total)} Hz; Chebyshev of order 8 in each stage, forwards and "
        f"backwards, no phase: flat to {format_significant(EDGE_OF_BAND * nyquist)} Hz, -6 dB at "
        f"{format_significant(float(half))} Hz"
    )
    label = f"Gain of the parallel decimation over frequency: {note}"
    return Figure(plot, 420, "Parallel decimation of torque and observation matrix", label, note)


def smoother_figure(
    names: Sequence[str], f50: Sequence[float], order: int, rate: float, method: int
) -> Figure:
    """Gain of each joint's random walk smoother.

    f50 [Hz] per joint is NaN or infinite where there is none; the rate is in Hz.
    """
    known = [(name, f) for name, f in zip(names, f50, strict=True) if 0 < f <= 0.5 * rate]
    frequency = _frequencies(0.02 * min(f for _, f in known), rate)
    w = 2 * np.pi * frequency / rate
    curves = {
        f"{name}, f₅₀ {format_significant(f)} Hz": smoother_gain(
            w, nvr_from_f50(f, order, rate), order
        )
        for name, f in known
    }
    plot = _low_passes(frequency, curves, method)
    half = ", ".join(f"{name} {format_significant(f)} Hz" for name, f in known)
    note = (
        f"integrated random walk of order {order}, no phase; dashed: one half (-6 dB), reached at "
        f"{half}"
    )
    label = f"Gain of the position smoother of {len(known)} joints over frequency: {note}"
    return Figure(plot, 340, "Smoother of the positions", label, note)


def _low_passes(frequency: np.ndarray, curves: Mapping[str, np.ndarray], method: int) -> Plot:
    """Gain of each joint's low-pass by its title, with one half as a line."""
    plot = _over_frequency("gain [dB]")
    for k, (title, gain) in enumerate(curves.items()):
        line = _joint_line(k) if len(curves) > 1 else {"color": colour(method), "width": 1.8}
        _gain(plot, frequency, gain, title, line)
    plot.horizontal(20 * np.log10(0.5), {"color": ERROR, "width": 1, "dash": "dash"})
    plot.y_axis(range=[-80, 5])
    plot.update(showlegend=True, legend=LEGEND)
    return plot


def window_figure(signals: Algebraic, names: Sequence[str], rate: float, method: int) -> Figure:
    """Gain of each joint's window, which position, derivatives and torque share; rate in Hz."""
    windows, cutoffs = signals.windows(len(names)), signals.cutoffs(len(names))
    frequency = _frequencies(0.02 * float(cutoffs.min()), rate)
    curves = {
        f"{name}, {format_significant(cutoff)} Hz": np.abs(
            algebraic_gain(frequency, float(window), signals.degree, signals.exponent)
        )
        for name, window, cutoff in zip(names, windows, cutoffs, strict=True)
    }
    plot = _low_passes(frequency, curves, method)
    lengths = [f"{format_significant(1e3 * t)} ms" for t in windows]
    listed = ", ".join(f"{name} {own}" for name, own in zip(names, lengths, strict=True))
    note = (
        f"algebraic differentiation of degree {signals.degree} and exponent "
        f"{format_significant(signals.exponent)}, no phase; windows: {listed}; dashed: one half "
        f"(-6 dB), reached at {frequencies_text(list(cutoffs), names)}"
    )
    label = f"Gain of the windows of {len(names)} joints over frequency: {note}"
    return Figure(plot, 340, "Windows of the positions", label, note)


def prefilter_figure(
    name: str, unit: str, prefilter: Prefilter, rate: float, method: int
) -> Figure:
    """Magnitude and phase of one joint's prefilter, and of its inverse controller alone."""
    frequency = _frequencies(1e-4 * rate, rate)
    response = prefilter.response(frequency, rate)
    plot = _bode(f"gain [dB re 1/({unit})]")
    has_controller = len(prefilter.denominator) > 1
    curves = [("L", response, {"color": colour(method), "width": 1.8})]
    if has_controller:
        inverse = Prefilter(
            prefilter.numerator, prefilter.denominator, (1.0,), prefilter.variance
        ).response(frequency, rate)
        curves.append(("without A", inverse, {"color": MEASURED, "width": 1.4, "dash": "dash"}))
    for title, values, line in curves:
        _gain(plot, frequency, np.abs(values), title, line)
        _curve(plot, frequency, np.degrees(np.unwrap(np.angle(values))), title, line, "y2")
    decibel = _decibel(np.abs(response))
    largest, smallest = int(decibel.argmax()), int(decibel.argmin())
    poles = np.roots(np.trim_zeros(np.asarray(prefilter.denominator, float), "b"))
    note = (
        f"whitener of order {len(prefilter.fir) - 1}"
        + (f", {poles.size} pole{'s' if poles.size != 1 else ''}" if has_controller else "")
        + f"; gain from {format_significant(decibel[smallest])} dB at "
        f"{format_significant(frequency[smallest])} Hz to "
        f"{format_significant(decibel[largest])} dB at "
        f"{format_significant(frequency[largest])} Hz"
    )
    return Figure(plot, 360, name, f"Bode plot of the prefilter of {name}: {note}", note)


def loop_figure(joint: IdentifiedJointLoop, method: int) -> Figure:
    """Gains of plant, sensitivity and complementary sensitivity of one joint."""
    loop = joint.loop
    assert loop is not None
    rate = loop.feedback.rate
    centre = loop.bandwidth if np.isfinite(loop.bandwidth) else 0.01 * rate
    frequency = _frequencies(min(0.02 * centre, 0.01 * rate), rate)
    position = "rad" if "²" in joint.inertia_unit else "m"
    torque = "N m" if position == "rad" else "N"
    plot = _stacked("gain [dB]", f"plant [dB re {position}/({torque})]")
    for title, quantity, own, axis in (
        ("T", "complementary", METHOD_COLOURS[0], "y"),
        ("S", "sensitivity", METHOD_COLOURS[1], "y"),
        ("plant", "plant", colour(method), "y2"),
    ):
        low, high = (_decibel(x) for x in joint.band(quantity, frequency))
        if (high - low).max() > 0.02:
            plot.data.append(band(frequency, low, high, own, axis=axis))
        gain = np.abs(getattr(loop, quantity)(frequency))
        _curve(plot, frequency, _decibel(gain), title, {"color": own, "width": 1.8}, axis)
    plot.horizontal(-3.01, {"color": MEASURED, "width": 1, "dash": "dot"})
    plot.update(yaxis={"range": [-60, 15]})
    i = joint.inertia
    inertia = f"J = {_interval(i.mean, i.std[1])} {joint.inertia_unit}"
    if i.highest - i.lowest > 1e-6 * abs(i.mean):
        inertia += (
            f", {format_significant(i.lowest)} to {format_significant(i.highest)} over the postures"
        )
    if joint.reason:
        note = f"{inertia}; {joint.reason}"
    else:
        _mark(plot, joint.bandwidth, f"bandwidth {format_significant(joint.bandwidth)} Hz")
        peak = format_significant(20 * np.log10(loop.peak), 2)
        note = (
            f"{inertia}; bandwidth {bandwidth_text(joint)}; |T| falls to -3 dB at "
            f"{format_significant(loop.noise_bandwidth)} Hz; largest |S| {peak} dB"
        )
    label = f"Sensitivity, complementary sensitivity and plant of {joint.name}: {note}"
    return Figure(plot, 400, joint.name, label, note)


def bandwidth_text(joint: IdentifiedJointLoop) -> str:
    """Bandwidth with its 2σ interval and its range over the postures."""
    text = f"{_interval(joint.bandwidth, joint.bandwidth_std)} Hz"
    if joint.fastest - joint.slowest > 0.01 * joint.bandwidth:
        ends = f"{format_significant(joint.slowest)} to {format_significant(joint.fastest)} Hz"
        text += f" ({ends} over the postures)"
    return text


def _interval(value: float, std: float) -> str:
    return plus_minus(value, 2.0 * std)


def _decibel(gain: np.ndarray) -> np.ndarray:
    """A gain in dB, finite also where it is zero."""
    return 20 * np.log10(np.maximum(gain, 1e-20))


def _frequencies(lowest: float, rate: float) -> np.ndarray:
    """Points of a curve up to just below the Nyquist frequency [Hz]."""
    return np.geomspace(min(lowest, 0.05 * rate), 0.499 * rate, POINTS)


def _joint_line(k: int) -> dict[str, object]:
    """Colour and dash of a joint's line; both, so that neither is needed."""
    dashes = ("solid", "dash", "dot", "dashdot", "longdash", "longdashdot")
    return {"color": colour(k), "width": 1.6, "dash": dashes[k % len(dashes)]}


def _bode(gain_title: str) -> Plot:
    """Gain above, phase below, over one logarithmic axis of frequency."""
    plot = _stacked(gain_title, "phase [°]")
    plot.update(yaxis={"domain": [0.42, 1.0]}, yaxis2={"domain": [0.0, 0.34]})
    return plot


def _stacked(upper: str, lower: str) -> Plot:
    plot = _over_frequency(upper)
    plot.x_axis(anchor="y2")
    plot.update(
        yaxis={"domain": [0.46, 1.0], "zeroline": False},
        yaxis2={"domain": [0.0, 0.38], "title": {"text": lower, "standoff": 4}, "zeroline": False},
        showlegend=True,
        legend=LEGEND,
    )
    return plot


def _over_frequency(title: str) -> Plot:
    plot = empty_plot(title)
    plot.x_axis("frequency [Hz]", type="log")
    return plot


def _gain(
    plot: Plot,
    frequency: np.ndarray,
    gain: np.ndarray,
    name: str,
    line: dict[str, object],
    legend: bool = True,
) -> None:
    """A gain as a line in dB, without what lies below the floor."""
    decibel = _decibel(gain)
    shown = np.where(decibel < FLOOR, np.nan, decibel)
    _curve(plot, frequency, shown, name, line, "y", legend)


def _curve(
    plot: Plot,
    x: np.ndarray,
    y: np.ndarray,
    name: str,
    line: dict[str, object],
    axis: str,
    legend: bool = True,
) -> None:
    plot.add(
        x=packed(x),
        y=packed(y),
        yaxis=axis,
        mode="lines",
        name=html.escape(name, quote=False),
        line=line,
        showlegend=legend and (axis == "y" or name == "plant"),
    )


def _mark(plot: Plot, frequency: float, text: str) -> None:
    """A vertical line with words; annotations of a logarithmic axis count in decades."""
    plot.vertical(frequency, {"color": ERROR, "width": 1, "dash": "dash"})
    words = {
        "x": float(np.log10(frequency)), "xref": "x", "yref": "paper", "y": 1.0, "yanchor": "top",
        "xanchor": "left", "text": f" {text}", "showarrow": False, "font": {"size": 11},
    }  # fmt: skip
    plot.update(annotations=[*plot.layout.get("annotations", []), words])
