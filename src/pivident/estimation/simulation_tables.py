"""A fitted simulation as plain text: its errors joint by joint, and the unknowns of its loop."""

from __future__ import annotations

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.simulation_result import LoopParameter, SimulationResult
from pivident.text.lists import listed
from pivident.text.numbers import format_significant, with_spread
from pivident.text.plain_table import plain_table

#: What was compared, in words.
COMPARED_WORDS = {
    "positions": "positions",
    "torques": "torques",
    "both": "positions and torques",
}


def simulation_text(identification: Identification) -> str:
    """How near the simulation comes, and what else of the loop was identified.

    Empty for a method that fits no simulation.
    """
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
        return "Simulation in open loop, driven by the recorded torques; compared: positions"
    compared = COMPARED_WORDS[simulation.compares]
    return f"Simulation in closed loop, from the reference; compared: {compared}"


def held_lines(simulation: SimulationResult) -> list[str]:
    """Sentences about parameters that were held, and those at a bound."""
    lines = []
    if simulation.held:
        names = listed(simulation.held)
        lines.append(f"Held, since the compared signals do not determine them: {names}.")
    if simulation.at_bound:
        lines.append(f"At a bound, interval of one side: {listed(simulation.at_bound)}.")
    return lines


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
    joints = identification.robot.joints
    columns = [
        ("joint", "<", [fit.name for fit in identification.joints]),
        ("position rms", ".", [format_significant(x) for x in simulation.position_rms]),
        ("unit", "<", [joint.position_unit for joint in joints]),
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
