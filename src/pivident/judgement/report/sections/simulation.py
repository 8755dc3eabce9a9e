"""How near fitted simulations come to what was measured, and what else of the loop they found."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.output_error.simulation_fit import SimulationFit
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES, Thinning, means_at
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.summary import held_lines, parameter_texts, simulation_heading
from pivident.foundation.document.plot import ERROR, MEASURED, Figure, colour, empty_plot, line
from pivident.foundation.text.numbers import format_significant
from pivident.judgement.report.sections.base import Gallery, Section
from pivident.judgement.validation.residuals.residual_tests import simulation_whiteness

#: Height of each part of a figure on the page [px].
PART, MARGIN = 120, 60


@dataclass(frozen=True, eq=False)
class ThinnedErrors:
    """What a simulation is compared with in one recording, as the fit sees it, time first."""

    recording: str  # its name
    t: np.ndarray  # middles of the means, shape (rows,) [s]
    measured: np.ndarray  # positions, shape (rows, joints) [rad or m]
    errors: dict[int, np.ndarray]  # measured minus simulated, by channel, each (rows, joints)


def thinned_errors(fit: SimulationFit) -> list[ThinnedErrors]:
    """Errors of each recording; NaN between its stretches and where nothing was compared."""
    names = list(dict.fromkeys(stretch.name for stretch in fit.stretches))
    return [_of_recording(fit, name) for name in names]


def _of_recording(fit: SimulationFit, name: str) -> ThinnedErrors:
    times, measured = [], []
    errors: dict[int, list[np.ndarray]] = {channel: [] for channel in fit.channels}
    compared = (
        np.where(made.used, error, np.nan) for made, error in zip(fit.made, fit.errors, strict=True)
    )
    for stretch, own, factor in zip(fit.stretches, compared, fit.factors, strict=True):
        if stretch.name != name:
            continue
        half = 0.5 * Thinning(factor).width * factor / stretch.rate if factor > 1 else 0.0
        rows = np.arange(own.shape[2] + 1)  # one more, for the gap behind it
        times.append(stretch.start_time + rows * factor / stretch.rate + half)
        measured.append(_with_gap(means_at(stretch.q, factor)))
        for c, channel in enumerate(fit.channels):
            errors[channel].append(_with_gap(own[c].T))
    return ThinnedErrors(
        name,
        np.concatenate(times)[:-1],
        np.concatenate(measured)[:-1],
        {channel: np.concatenate(own)[:-1] for channel, own in errors.items()},
    )


def _with_gap(rows: np.ndarray) -> np.ndarray:
    """Rows and one of NaN behind them, (rows + 1, joints)."""
    return np.concatenate([rows, np.full((1, rows.shape[1]), np.nan)])


def simulation_figure(
    identification: Identification, own: ThinnedErrors, joint: int, method: int, points: int
) -> Figure:
    """Positions of one joint, and the errors of what was compared, below each other."""
    fit, position = identification.joints[joint], identification.robot.joints[joint].position_unit
    t = own.t - own.t[0]
    parts: list[tuple[str, list[tuple[str, np.ndarray, str, float]]]] = []
    notes = []
    if POSITIONS in own.errors:
        measured, error = own.measured[:, joint], own.errors[POSITIONS][:, joint]
        lines = [("measured", measured, MEASURED, 2.4)]
        lines.append(("simulated", measured - error, colour(method), 1.2))
        parts += [
            (f"q [{position}]", lines),
            (f"error of q [{position}]", [("error of q", error, ERROR, 1.0)]),
        ]
        notes.append(f"positions: rms error {_rms(error)} {position}")
    if TORQUES in own.errors:
        error, unit = own.errors[TORQUES][:, joint], fit.torque_unit
        parts.append((f"error of τ [{unit}]", [("error of τ", error, ERROR, 1.0)]))
        notes.append(f"torques: rms error {_rms(error)} {unit}")
    plot = empty_plot("")
    for k, (_, lines) in enumerate(parts, start=1):
        for name, values, ink, width in lines:
            trace = line(t, values, points, name, ink, width=width)
            plot.data.append(trace | {"yaxis": f"y{k}" if k > 1 else "y"})
    plot.stack([title for title, _ in parts], exponentformat="power", automargin=True)
    note = f"{'; '.join(notes)}, of the means that are compared"
    label = f"Simulation of {fit.name} over {format_significant(t[-1])} s: {note}"
    height = PART * len(parts) + MARGIN
    return Figure(plot, height, fit.name, label, note, own.recording, float(own.t[0]))


def _rms(x: np.ndarray) -> str:
    return format_significant(float(np.sqrt(np.nanmean(x**2))))


class SimulationSection(Section):
    """Errors by joint, unknowns of the loop with their intervals, and errors over time."""

    title = "Simulation"
    anchor = "simulation"

    def context(self) -> dict[str, Any]:
        """One entry for each such method."""
        simulated = [
            (k, i, i.simulation)
            for k, i in enumerate(self.data.identifications)
            if i.simulation is not None
        ]
        entries = [
            {
                "label": self.data.labels[k],
                "method": k,
                "opened": k == simulated[-1][0],
                "heading": simulation_heading(simulation),
                "torques": bool(np.isfinite(simulation.torque_rms).any()),
                "weighted": bool(simulation.noise_orders),
                "joints": _joints(identification, simulation),
                "parameters": [(p, parameter_texts(p)) for p in simulation.loop_parameters],
                "held": list(held_lines(simulation)),
                "compared_to": float(identification.options.get("bandwidth", np.nan)),
                "gallery": self._gallery(k, identification, simulation),
            }
            for k, identification, simulation in simulated
        ]
        return {"entries": entries, "several": len(entries) > 1}

    def _gallery(
        self, method: int, identification: Identification, simulation: SimulationResult
    ) -> Gallery:
        """One figure per joint and recording; none for a result that was read from a file."""
        recordings = [] if simulation.fit is None else thinned_errors(simulation.fit)
        titled = len(recordings) > 1
        groups = tuple(
            (
                own.recording if titled else "",
                tuple(
                    simulation_figure(identification, own, joint, method, self.data.points)
                    for joint in range(identification.robot.size)
                ),
            )
            for own in recordings[: self.data.shown_recordings]
        )
        return Gallery(self.data.labels[method], method, True, groups)


def _joints(identification: Identification, simulation: SimulationResult) -> list[dict[str, Any]]:
    """One row for each joint."""
    count = identification.robot.size
    white = {(t.joint, t.what): t.test for t in simulation_whiteness(identification)}
    orders = [", ".join(map(str, simulation.noise_orders[j::count])) or "–" for j in range(count)]
    return [
        {
            "name": fit.name,
            "position": float(simulation.position_rms[j]),
            "position_unit": joint.position_unit,
            "torque": float(simulation.torque_rms[j]),
            "torque_unit": fit.torque_unit,
            "orders": orders[j],
            "white": [
                (what, test) for (name, what), test in white.items() if name == fit.name
            ],
        }
        for j, (fit, joint) in enumerate(
            zip(identification.joints, identification.robot.joints, strict=True)
        )
    ]  # fmt: skip
