"""How near fitted simulations come to what was measured, and what else of the loop they found."""

from __future__ import annotations

from typing import Any

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.methods import OutputError
from pivident.estimation.simulation_result import SimulationResult
from pivident.estimation.simulation_tables import held_lines, parameter_texts, simulation_heading
from pivident.report.sections.base import Gallery, Section
from pivident.report.simulation_figures import simulation_figure, thinned_errors
from pivident.validation.residuals.simulation_residuals import simulation_whiteness


class SimulationSection(Section):
    """Errors by joint, unknowns of the loop with their intervals, and errors over time."""

    title = "Simulation"
    anchor = "simulation"

    @property
    def applies(self) -> bool:
        """Only with a method that fits a simulation."""
        return any(i.simulation is not None for i in self.data.identifications)

    def context(self) -> dict[str, Any]:
        """One entry for each such method."""
        entries: list[dict[str, Any]] = []
        for k, identification in enumerate(self.data.identifications):
            simulation = identification.simulation
            if simulation is None:
                continue
            entries.append(
                {
                    "label": self.data.labels[k],
                    "method": k,
                    "opened": self.opened(k),
                    "heading": simulation_heading(simulation),
                    "torques": bool(np.isfinite(simulation.torque_rms).any()),
                    "weighted": bool(simulation.noise_orders),
                    "joints": _joints(identification, simulation),
                    "parameters": [(p, parameter_texts(p)) for p in simulation.loop_parameters],
                    "held": held_lines(simulation),
                    "compared_to": _bandwidth(identification),
                    "gallery": self._gallery(k, identification, simulation),
                }
            )
        last = max(entry["method"] for entry in entries)
        for entry in entries:
            entry["opened"] = entry["method"] == last
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


def _bandwidth(identification: Identification) -> float:
    """Frequency up to which errors are compared [Hz], NaN where it is not known."""
    method = identification.method_used
    return method.bandwidth if isinstance(method, OutputError) else np.nan
