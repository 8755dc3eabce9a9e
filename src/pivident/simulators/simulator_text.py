"""A fitted simulator as text."""

from __future__ import annotations

import math

from pivident.simulators.held_out import HeldOut, milli
from pivident.simulators.simulator_fit import FittedValue, SimulatorFit
from pivident.text.numbers import format_significant, with_spread
from pivident.text.plain_table import plain_table


def interval_text(value: FittedValue) -> str:
    """Value, interval and unit on one line."""
    if not math.isfinite(value.std):
        return f"{format_significant(value.value)} {value.unit} (no interval: {value.note})"
    number, spread = with_spread(value.value, value.value - value.low)
    return f"{number} ± {spread} {value.unit}"


def values_table(fit: SimulatorFit) -> str:
    """All values with their intervals of 95 %, one row each."""
    texts = [
        with_spread(v.value, v.value - v.low)
        if math.isfinite(v.std)
        else (format_significant(v.value), "–")
        for v in fit.values
    ]
    return plain_table(
        [
            ("quantity", "<", [v.quantity for v in fit.values]),
            ("joint", "<", [v.joint or "all" for v in fit.values]),
            ("value", ".", [value for value, _ in texts]),
            ("± 95 %", ".", [spread for _, spread in texts]),
            ("unit", "<", [v.unit for v in fit.values]),
        ]
    )


def held_out_table(held_out: HeldOut) -> str:
    """Errors of the position by joint, before and after."""
    robot = held_out.robot
    units = ["mrad" if j.position_unit == "rad" else "mm" for j in robot.joints]
    columns = [("joint", "<", list(robot.joint_names))]
    columns += [
        (title, ".", [milli(x) for x in errors.tolist()])
        for title, errors in held_out.rms().items()
    ]
    return plain_table([*columns, ("unit", "<", units)])


def findings(fit: SimulatorFit, held_out: HeldOut | None) -> list[str]:
    """What speaks against a fit, in sentences."""
    return [*fit.findings(), *(() if held_out is None else held_out.findings())]


def simulator_text(fit: SimulatorFit, held_out: HeldOut | None) -> str:
    """Everything that the command prints."""
    head = (
        f"{fit.robot.name}: {len(fit.values)} values from {fit.samples} samples of "
        f"{fit.robot.size} joints ({', '.join(fit.recordings)}), positions only"
    )
    parts = [head, values_table(fit)]
    if held_out is not None:
        parts += [
            f"Position error of MuJoCo on {held_out.name}, root mean square:",
            held_out_table(held_out),
        ]
        parts += [f"{sentence}." for sentence in held_out.sentences()]
    parts += findings(fit, held_out)
    return "\n\n".join(parts)
