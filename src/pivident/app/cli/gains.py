"""The command ``pivident gains``: drive gains, which ratios are known, and which scale is not."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from pivident.app.cli.console import Progress, name_bodies
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.numbers import plain_table, plus_minus, with_spread

if TYPE_CHECKING:
    from pivident.estimation.drives.log_units import GainGroup, MotorInLogUnits
    from pivident.experiment.experiment import Experiment
    from pivident.experiment.gains_table import GainsOfExperiment


def gains(
    experiment: Path,
    /,
    *,
    out: Path | None = None,
    in_log_units: bool = False,
    least_squares: bool = False,
) -> int:
    """Find drive gains from a known payload or a trusted number, or ratios of gains without one.

    Parameters
    ----------
    experiment
        The experiment file; its table [gains] holds what is known.
    out
        File to write the TOML lines with the gains to.
    in_log_units
        Also identify every motor's row in the unit of its own log.
    least_squares
        Also show the gains by weighted and total least squares, as in the literature.
    """
    from pivident.experiment.experiment import load_experiment
    from pivident.experiment.gains_table import gains_of, lines_for_file
    from pivident.foundation.files import check_output, write_file

    if out is not None and out.exists():
        raise ExperimentError(f"{out} is there already", advice="name another file for the gains")
    if out is not None:
        check_output(out.parent)
    loaded = load_experiment(experiment)
    name_bodies(loaded.robot)
    with Progress() as progress:
        found = gains_of(loaded, progress.say)
        rows = _rows_in_log_units(loaded) if in_log_units else ()
    print(gains_text(found))
    if least_squares:
        print("\n" + least_squares_text(found))
    for row in rows:
        print("\n" + log_units_text(row))
    lines = lines_for_file(found)
    if lines:
        print("\nFor the experiment file:\n\n" + "\n".join(lines))
    if out is not None:
        if not lines:
            raise ExperimentError(f"no gain is known, so there is nothing to write to {out}")
        write_file(out, "\n".join(lines) + "\n")
    return 0


def gains_text(found: GainsOfExperiment) -> str:
    """Table of the gains, sentences about ratios and scales, temperature coefficients."""
    parts = [_gain_table(found)]
    parts += _sentences(found)
    if found.temperatures:
        parts.append(_temperature_table(found))
    if found.gears:
        parts.append(_gear_table(found))
    return "\n\n".join(parts)


def _gain_table(found: GainsOfExperiment) -> str:
    """One line for each joint."""
    result, known = found.gains, found.gains.anchored
    group_of = {m: g for g in result.groups for m in g.motors}
    gain, interval, unit, against, declared = [], [], [], [], []
    for j in range(len(result.joints)):
        name, reference = found.declared[j], group_of[j].reference
        of_command = f"{found.torque_units[j]}/{name.base_unit}"
        unit.append("× declared" if name.place == "dataset" else of_command)
        if known[j]:
            value, spread = with_spread(found.values[j], 2 * found.std[j])
            gain.append(value)
            interval.append(spread)
            over = plus_minus(result.kappa[j], 2 * result.std[j])
            declared.append(over if name.given else "none given")
        else:
            gain.append("not known")
            interval.append("–")
            declared.append("–" if name.given else "none given")
        ratio, std = _ratio(found, j, reference)
        if len(group_of[j].motors) == 1:
            against.append("–")
        elif j == reference:
            against.append("reference")
        else:
            against.append(f"{plus_minus(ratio, 2 * std)} × {result.joints[reference]}")
    return plain_table(
        [
            ("joint", "<", list(result.joints)),
            ("gain", ".", gain),
            ("±2σ", ".", interval),
            ("unit", "<", unit),
            ("over the declared gain", "<", declared),
            ("ratio", "<", against),
            ("residual %", ".", [f"{100 * r:.1f}" for r in result.residual]),
            ("of its own %", ".", [f"{100 * r:.1f}" for r in result.own_residual]),
        ]
    )


#: Estimators of the literature in words.
LEAST_SQUARES = {
    "wls": "weighted least squares",
    "tls": "total least squares",
    "mixed-tls": "total, commands noisy",
}


def least_squares_text(found: GainsOfExperiment) -> str:
    """Gains by the least squares of the literature, which need a payload or a trusted parameter."""
    if not found.gains.literature:
        return "No weighted or total least squares: they need a known payload or parameter."
    scale = [d.value for d in found.declared]
    columns = [("joint", "<", list(found.gains.joints))]
    for name, (kappa, std) in found.gains.literature.items():
        cells = [
            plus_minus(k * s, 2 * d * abs(s)) for k, d, s in zip(kappa, std, scale, strict=True)
        ]
        columns.append((LEAST_SQUARES[name], "<", cells))
    units = [f"{t}/{d.base_unit}" for t, d in zip(found.torque_units, found.declared, strict=True)]
    columns.append(("unit", "<", units))
    return (
        "Gains by least squares with the commands as regressors, ±2σ by their own formula, which "
        f"is valid for white noise only:\n{plain_table(columns)}"
    )


def _ratio(found: GainsOfExperiment, joint: int, reference: int) -> tuple[float, float]:
    """Ratio of two gains in the units of the file."""
    value, std = found.gains.ratio(joint, reference)
    scale = found.declared[joint].value / found.declared[reference].value
    return value * scale, std * abs(scale)


def _sentences(found: GainsOfExperiment) -> Iterator[str]:
    """What is known, what is not, and what would make it known."""
    result = found.gains
    share = f"{100 * result.known_within:.0f} %"
    for group in result.groups:
        names = [result.joints[m] for m in group.motors]
        if group.anchored:
            means = [] if found.payload is None else [f"the payload of {found.payload.mass:g} kg"]
            means += [f"the trusted {name}" for name in found.trusted]
            yield (
                f"Known: the gains of {', '.join(names)}, by {' and '.join(means)}: an error of "
                "1 % in that is one of 1 % in these gains and in all masses by them."
            )
        elif len(names) == 1:
            yield (
                f"Not known: the gain of {names[0]}. No other joint determines it to within "
                f"±{share}; {_remedy(found, names[0])}"
            )
        else:
            yield (
                f"Known: {_known_ratios(found, group)}. "
                f"Not known: the common scale of {', '.join(names)}; "
                f"{_remedy(found, 'one of them')}"
            )
    worse = [
        f"{result.joints[j]} {100 * result.residual[j]:.1f} % instead of {100 * own:.1f} %"
        for j, own in enumerate(result.own_residual)
        if result.residual[j] > 1.25 * own
    ]
    if worse:
        yield (
            f"The rows do not agree well on common parameters: {', '.join(worse)}. Intervals do "
            "not contain such model error in full; look for a "
            "wrong geometry, load-dependent friction or a payload other than declared."
        )
    yield from result.warnings
    yield f"Estimated by {result.method}; intervals allow for correlated residuals."


def _known_ratios(found: GainsOfExperiment, group: GainGroup) -> str:
    """The ratios of a group with their intervals."""
    joints, reference = found.gains.joints, group.reference
    ratios = []
    for m in group.motors:
        if m != reference:
            value, std = _ratio(found, m, reference)
            share = 200.0 * std / abs(value)
            ratios.append(f"k({joints[m]})/k({joints[reference]}) = {value:.4g} to ±{share:.2g} %")
    return ", ".join(ratios)


def _remedy(found: GainsOfExperiment, whose: str) -> str:
    if found.payload is None:
        return (
            f"a run with a known payload ([gains.payload]), or one trusted gain or parameter of "
            f"{whose}, fixes it."
        )
    return f"move {whose} more with the payload, hold it further from the axis, or trust a gain."


def _temperature_table(found: GainsOfExperiment) -> str:
    """Temperature coefficients, and whether they were worth it."""
    rows = found.temperatures
    scale, unit = (100.0, "%/K") if rows[0].unit == "1/K" else (100.0 * 3600.0, "%/h")
    texts = [with_spread(scale * r.coefficient, 2 * scale * r.std) for r in rows]
    table = plain_table(
        [
            ("joint", "<", [r.joint for r in rows]),
            (f"a [{unit}]", ".", [value for value, _ in texts]),
            ("±2σ", ".", [spread for _, spread in texts]),
            ("F", ".", [f"{r.f_statistic:.1f}" for r in rows]),
            ("p", ">", [f"{r.p_value:.2g}" for r in rows]),
            ("taken", "<", ["yes" if r.is_significant else "no, not significant" for r in rows]),
        ]
    )
    return f"Motor constants k = k₀ (1 + a (T - T₀)), gains are those at T₀:\n{table}"


def _gear_table(found: GainsOfExperiment) -> str:
    """What the torques before and behind each gear say of it."""
    from pivident.estimation.drives.gear_losses import QUANTITIES

    gears, units = found.gears, ("", "", "kg m²", "N m s/rad", "N m", "N m")
    columns = [("gear of", "<", [gear.joint for gear in gears])]
    for k, (name, unit) in enumerate(zip(QUANTITIES, units, strict=True)):
        cells = []
        for gear, said, torque in zip(gears, found.declared, found.torque_units, strict=True):
            scale, own = (said.value, f" {torque}/{said.base_unit}") if k == 0 else (1.0, "")
            cells.append(plus_minus(scale * gear.values[k], 2 * scale * gear.std[k]) + own)
        columns.append((f"{name} {unit}".strip(), "<", cells))
    columns.append(("left %", ".", [f"{100 * gear.relative_error:.1f}" for gear in gears]))
    return (
        "Gears by the torques before and behind them (± 2σ; kg, N and N s/m where a joint slides); "
        f"the scale is that of the sensors:\n{plain_table(columns)}"
    )


def _rows_in_log_units(experiment: Experiment) -> tuple[MotorInLogUnits, ...]:
    """Every motor's row in the unit of its log."""
    from pivident.estimation.drives.log_units import identify_in_log_units
    from pivident.experiment.gains_table import declared_gains, with_unit_gains

    declared = declared_gains(experiment.content.recording[0], experiment.robot)
    bare = with_unit_gains(experiment)
    content = bare.content.model_copy(update={"recording": experiment.content.recording})
    problem = type(experiment)(experiment.path, content).problem()
    return identify_in_log_units(problem, tuple(d.base_unit for d in declared))


def log_units_text(row: MotorInLogUnits) -> str:
    """Parameters of one motor, each divided by its gain."""
    texts = [with_spread(v, 2 * s) for v, s in zip(row.values, row.std, strict=True)]
    table = plain_table(
        [
            (f"{row.joint}: θ/k", "<", list(row.names)),
            ("value", ".", [value for value, _ in texts]),
            ("±2σ", ".", [spread for _, spread in texts]),
            ("unit", "<", list(row.units)),
        ]
    )
    left = f"\nnot separable in this row: {', '.join(row.left_out)}" if row.left_out else ""
    return f"{table}\nresidual {100 * row.relative_error:.1f} %{left}"
