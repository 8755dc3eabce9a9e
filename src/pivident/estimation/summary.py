"""Results as plain text: one identification, several methods side by side, a fitted simulation.

A fitted simulation as plain text: its errors joint by joint, and the unknowns of its loop.
"""

from __future__ import annotations

import textwrap
from collections.abc import Iterator, Mapping, Sequence

import numpy as np

from pivident.dynamics.parameters import Parameter
from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import (
    CONTRADICTION,
    ParameterRange,
    ParameterRow,
    aligned_rows,
    largest_difference,
    method_labels,
    parameter_rows,
    range_texts,
)
from pivident.estimation.signal_recipes import Algebraic, Bandpass
from pivident.estimation.simulation_result import LoopParameter, SimulationResult
from pivident.foundation.text.numbers import (
    GAP,
    column,
    format_exact,
    format_significant,
    lines_of,
    percent,
    plain_table,
    with_spread,
)
from pivident.foundation.text.sentences import listed

#: Width of a table in characters, unless its numbers need more.
WIDTH = 110
#: A group written out gets at least this many characters.
_SHORTEST_EXPRESSION = 12
#: What was compared, in words.
COMPARED_WORDS = {
    "positions": "positions",
    "torques": "torques",
    "both": "positions and torques",
}


def simulation_text(identification: Identification) -> str:
    """How near a fitted simulation comes, and what else of the loop was identified; or empty."""
    simulation = identification.simulation
    if simulation is None:
        return ""
    parts = [f"{simulation_heading(simulation)}:", _error_table(identification, simulation)]
    if simulation.loop_parameters:
        parts += ["", "Parameters of the loop:", _parameter_table(simulation)]
    return "\n".join([*parts, *held_lines(simulation), weights_line(simulation)])


def simulation_heading(simulation: SimulationResult) -> str:
    """What was simulated and what was compared, without a full stop."""
    if simulation.loop == "open":
        over = f" over {simulation.horizon:.3g} s" if simulation.horizon else ""
        return f"Simulation in open loop, driven by the recorded torques{over}; compared: positions"
    compared = COMPARED_WORDS[simulation.compares]
    return f"Simulation in closed loop, from the reference; compared: {compared}"


def held_lines(simulation: SimulationResult) -> Iterator[str]:
    """Sentences about parameters that were held, and those at a bound."""
    if simulation.held:
        names = listed(simulation.held)
        yield f"Held, since the compared signals do not determine them: {names}."
    if simulation.at_bound:
        yield f"At a bound, interval of one side: {listed(simulation.at_bound)}."


def weights_line(simulation: SimulationResult) -> str:
    """What the simulation errors were weighted by."""
    if not simulation.noise_orders:
        return "Weights: the size of each joint's errors, without noise models."
    joints = len(simulation.position_rms)
    channels = ("positions", "torques") if simulation.compares == "both" else (simulation.compares,)
    orders = (
        f"{', '.join(map(str, simulation.noise_orders[k * joints : (k + 1) * joints]))} ({name})"
        for k, name in enumerate(channels)
    )
    return f"Weights: noise models of the simulation errors, of orders {'; '.join(orders)}."


def _error_table(identification: Identification, simulation: SimulationResult) -> str:
    """Rms errors of positions and torques of each joint."""
    columns = [
        ("joint", "<", [fit.name for fit in identification.joints]),
        ("position rms", ".", [format_significant(x) for x in simulation.position_rms]),
        ("unit", "<", [joint.position_unit for joint in identification.robot.joints]),
    ]
    if np.isfinite(simulation.torque_rms).any():
        columns += [
            ("torque rms", ".", [format_significant(x) for x in simulation.torque_rms]),
            ("unit", "<", [fit.torque_unit for fit in identification.joints]),
        ]
    return plain_table(columns)


def _parameter_table(simulation: SimulationResult) -> str:
    """Value and interval of each unknown of the loop."""
    own = simulation.loop_parameters
    texts = [parameter_texts(p) for p in own]
    return plain_table(
        [
            ("parameter", "<", [p.name for p in own]),
            ("value", ".", [value for value, _ in texts]),
            ("±2σ", "<", [spread for _, spread in texts]),
            ("unit", "<", [p.unit or "–" for p in own]),
        ]
    )


def parameter_texts(parameter: LoopParameter) -> tuple[str, str]:
    """Value of an unknown of the loop, and its interval of 2σ as text, of one side at a bound."""
    if parameter.held:
        return format_significant(parameter.value, 5), "held"
    value, spread = with_spread(parameter.value, 2.0 * parameter.std)
    value = value if parameter.value else "0"
    if parameter.bound == "low":
        return value, f"+{spread}, at its lower bound"
    if parameter.bound == "high":
        return value, f"−{spread}, at its upper bound"
    return value, spread


def identification_table(
    identification: Identification,
    *,
    with_warnings: bool = True,
    ranges: Sequence[ParameterRange] = (),
) -> str:
    """One result: how it came about, its parameters with intervals, its joints, its warnings.

    ``ranges``: of its parameters over blocks of the motion and friction laws, as of a verdict.
    """
    rows = parameter_rows(identification)
    spreads = [row.value_and_spread for row in rows]
    columns = [
        column("parameter", [row.name for row in rows], "<"),
        column("value", [value for value, _ in spreads], "."),
        column("±2σ", [spread for _, spread in spreads], "."),
        column("σ/|θ| %", [format_significant(row.relative_std, 2) for row in rows], "."),
        column("unit", [row.unit for row in rows], "<"),
    ]
    if ranges:
        columns.insert(-2, column("range", range_texts(identification.names, ranges), "<"))
    room = max(WIDTH - sum(len(own[0]) + len(GAP) for own in columns), _SHORTEST_EXPRESSION)
    columns.append(column("group", [shortened(row.expression, room) for row in rows], "<"))
    parts = [headline(identification), lines_of(columns), _joint_table(identification)]
    parts += filter(None, [simulation_text(identification)])
    lines = [
        std_line([identification]),
        *identification.known.sentences(),
        range_line(ranges),
        rows_line(identification),
        signals_line(identification),
        friction_line(identification),
        *label_lines([identification]),
    ]
    parts.append("\n".join(filter(None, lines)))
    if with_warnings:
        words = {"note": "Note", "error": "Error"}
        parts += [
            f"{words.get(w.severity, 'Warning')}: {w.advised}" for w in identification.warnings
        ]
    return "\n\n".join(parts)


def comparison_table(
    identifications: Sequence[Identification],
    truth: Mapping[str, float] | None = None,
    ranges: Sequence[ParameterRange] = (),
    ranged: str = "",
) -> str:
    """Several methods side by side: value and relative σ of each, and their largest difference.

    ``ranges``: of the parameters by the method ``ranged``, as of a verdict.
    """
    labels = method_labels(identifications)
    table = aligned_rows(identifications, truth)
    columns = [
        column("parameter", list(table), "<", top=""),
        column("unit", [_first(rows).unit for rows in table.values()], "<", top=""),
    ]
    if truth:
        truths = [format_exact(_first(rows).truth) for rows in table.values()]
        columns.append(column("truth", truths, ".", top=""))
    for k, label in enumerate(labels):
        rows = [entry[k] for entry in table.values()]
        columns += _method_columns(label, rows, errors=bool(truth))
    differences = [0.0]
    if len(identifications) > 1:
        differences = [largest_difference(rows)[0] for rows in table.values()]
        marks = [f"{format_significant(d, 2)}{' *' * (d > CONTRADICTION)}" for d in differences]
        columns.append(column("diff. [σ]", marks, ".", top="largest"))
    if ranges:
        columns.append(column("range", range_texts(list(table), ranges), "<", top=ranged))
    errors = ", ".join(
        f"{label} {percent(100.0 * i.relative_error)} ({error_rows(i)})"
        for label, i in zip(labels, identifications, strict=True)
    )
    parts = [lines_of(columns), f"relative error of the torque: {errors}"]
    if len({i.is_decimated for i in identifications}) > 1:
        parts.append(
            "  filtered rows have lost most of the noise that all samples still have; compare "
            "only errors over the same rows"
        )
    parts += filter(None, [std_line(identifications), range_line(ranges)])
    parts.append(friction_line(identifications[0]))
    parts += label_lines(identifications)
    for label, identification in zip(labels, identifications, strict=True):
        if text := simulation_text(identification):
            parts.append(f"\n{label}\n{text}")
    if len(identifications) > 1 and max(differences) > CONTRADICTION:
        parts.append(f"* two methods differ by more than {CONTRADICTION:g} combined σ")
    return "\n".join(parts)


def headline(identification: Identification) -> str:
    """Method, robot, how the iteration ended, relative error and condition, on one line."""
    return (
        f"{identification.method} of {identification.robot.name}: {ending(identification)}, "
        f"relative error {percent(100.0 * identification.relative_error)} "
        f"({rows_kind(identification)}), "
        f"condition {format_significant(identification.condition)}"
    )


def rows_kind(identification: Identification) -> str:
    """Which rows a relative error of the torque is taken over, in two words."""
    return "filtered rows" if identification.is_decimated else "all samples"


def error_rows(identification: Identification) -> str:
    """The same with the rate of these rows."""
    rates = dict.fromkeys(f"{r.whitened_rate:.4g}" for r in identification.recordings)
    kind = rows_kind(identification)
    return f"{kind}, {' and '.join(rates)} Hz" if rates else kind


def rows_line(identification: Identification) -> str:
    """What the rows are that the errors are taken over."""
    rows = f"Errors: over {error_rows(identification)}"
    if identification.is_decimated:
        return f"{rows}: low-passed and thinned, which takes most of the noise out of the torque"
    if all(r.torque_source == "measured" for r in identification.recordings):
        return f"{rows}, with all the noise of the logged torque"
    return f"{rows}, with the encoder noise that the control law answers to"


def std_line(identifications: Sequence[Identification]) -> str:
    """Which standard errors σ is."""
    if not all(np.isfinite(i.robust_std).all() for i in identifications):
        return "σ: the method's own standard errors, where no robust ones are known"
    return "σ: robust standard errors, for correlated residuals of changing variance"


def range_line(ranges: Sequence[ParameterRange]) -> str:
    """What ranges are taken over; empty without any."""
    over = {own.by: own.estimates for own in ranges}
    said = [
        f"estimates by {count} friction laws that fit about as well"
        if by == "friction laws"
        else f"±2σ of a jackknife over {count} {by}, with {count - 1} degrees of freedom"
        for by, count in over.items()
    ]
    text = f"range: {'; '.join(said)}" if said else ""
    return textwrap.fill(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def label_lines(identifications: Sequence[Identification]) -> list[str]:
    """What (Ĉ) behind the name of a method means, where it occurs."""
    if not any("(Ĉ)" in i.method for i in identifications):
        return []
    return ["(Ĉ): with instruments from a control law that was identified from the record"]


def name_lines(identifications: Sequence[Identification]) -> list[str]:
    """What the names of their parameters stand for."""
    named = {n: p for i in identifications for n, p in zip(i.names, i.parameters, strict=True)}
    return [names_in_words(named)] if named else []


def signals_line(identification: Identification) -> str:
    """What the signals were filtered with, in hertz; empty where that is not known."""
    method, names = identification.method_used, [j.name for j in identification.joints]
    if method is None:
        return ""
    if isinstance(method.signals, Bandpass):
        rates = dict.fromkeys(f"{0.5 * r.whitened_rate:.4g}" for r in identification.recordings)
        band = f", equations to {' and '.join(rates)} Hz" if rates else ""
        frequencies: Sequence[float] = list(method.signals.cutoffs(len(names)))
        text = f"positions low-passed at {frequencies_text(frequencies, names)}{band}"
    elif isinstance(method.signals, Algebraic):
        frequencies = list(method.signals.cutoffs(len(names)))
        text = f"positions in windows with half gain at {frequencies_text(frequencies, names)}"
    else:
        frequencies = [joint.f50 for joint in identification.joints]
        text = f"positions smoothed, half power at {frequencies_text(frequencies, names)}"
    if np.isnan(frequencies).all():
        return ""
    head = "Signals"
    if identification.simulation is not None:  # the simulation is compared with what was measured
        head = "Signals of the start and of the torque errors"
    return textwrap.fill(f"{head}: {text}", WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def frequencies_text(frequencies: Sequence[float], names: Sequence[str]) -> str:
    """A frequency of each joint with its unit, one alone where all are equal."""
    known = [
        f"{format_significant(f)} Hz" if np.isfinite(f) else "no frequency" for f in frequencies
    ]
    if len(set(known)) == 1:
        return known[0]
    return ", ".join(f"{value} ({name})" for name, value in zip(names, known, strict=True))


def friction_line(identification: Identification) -> str:
    """Friction law of the robot with its slopes, in as many lines as it takes."""
    text = f"Friction: {identification.robot.friction_text()}"
    return textwrap.fill(text, WIDTH, subsequent_indent="  ", break_on_hyphens=False)


def ending(identification: Identification) -> str:
    """How the iteration ended, in a few words."""
    count = identification.iterations
    if not identification.converged:
        return f"NOT converged after {count} iteration{'s' * (count != 1)}"
    return f"converged in {count} iterations" if count > 1 else "solved in one step"


def shortened(text: str, width: int) -> str:
    """A text cut at a blank to a width, with … for what is missing."""
    if len(text) <= width:
        return text
    head = text[: width - 1]
    return f"{head[: head.rfind(' ') + 1] or head}…"


def _joint_table(identification: Identification) -> str:
    """Fit of each joint with the order of its noise model."""
    joints = identification.joints
    orders = [f"{j.ar_order}{' (bound)' * j.ar_at_bound}" for j in joints]
    columns = [
        column("joint", [j.name for j in joints], "<"),
        column("error %", [format_significant(100.0 * j.relative_error, 2) for j in joints], "."),
        column("rms error", [format_significant(j.rms_error) for j in joints], "."),
        column("unit", [j.torque_unit for j in joints], "<"),
        column("noise σ", [format_significant(j.noise_std) for j in joints], "."),
        column("unit", [j.noise_unit for j in joints], "<"),
        column("AR order", orders, "<"),
        column("rows", [str(j.rows) for j in joints], ">"),
        column("masked %", [f"{100.0 * j.masked:.1f}" for j in joints], ">"),
    ]
    return lines_of(columns)


def _method_columns(
    label: str, rows: Sequence[ParameterRow | None], *, errors: bool
) -> list[list[str]]:
    """Value and relative σ of one method, with its error in percent where there is a truth."""
    values = ["" if r is None else with_spread(r.value, 2.0 * r.std)[0] for r in rows]
    relative = ["" if r is None else format_significant(r.relative_std, 2) for r in rows]
    columns = [
        column("value", values, ".", top=label),
        column("σ %", relative, ".", top=""),
    ]
    if errors:
        error = ["" if r is None else format_significant(r.error_percent, 2) for r in rows]
        columns.append(column("error %", error, ".", top=""))
    return columns


def _first(rows: Sequence[ParameterRow | None]) -> ParameterRow:
    return next(row for row in rows if row is not None)


#: Stems of inertial and coupling parameters, those that share their words side by side.
_STEMS = {
    ("xx", "yy", "zz"): "moments of inertia of a link about the axes of its frame",
    ("xy", "xz", "yz"): "products of inertia",
    ("mx", "my", "mz"): "mass times the coordinates of its centre",
    ("m",): "mass",
    ("ia",): "rotor inertia on the joint side",
    ("iam",): "rotor inertia of a coupling",
    ("fvm", "fcm"): "viscous and dry friction of a coupling",
}


def names_in_words(parameters: Mapping[str, Parameter]) -> str:
    """What the names of some parameters stand for, in a line without a full stop.

    Args:
        parameters: by their names as shown; in these an ``r`` marks the head of a group.
    """
    stems = {p.stem for p in parameters.values()}
    words = [
        f"{', '.join(present)}: {meaning}"
        for together, meaning in _STEMS.items()
        if (present := [stem for stem in together if stem in stems])
    ]
    friction = {p.stem: p.friction for p in parameters.values() if p.friction is not None}
    words += [
        f"{stem}: {term.column.words}" for stem, term in friction.items() if term.column.words
    ]
    if others := [s for s, term in friction.items() if not term.column.words]:
        words.append(f"{', '.join(others)}: further terms of the friction law")
    if any(name != p.name for name, p in parameters.items()):
        words.append("with r: together with others that no motion of this robot tells from it")
    if any(name[-1:].isdigit() for name in parameters):
        words.append("the number is that of the link or joint, counted from the base")
    return "; ".join(words)
