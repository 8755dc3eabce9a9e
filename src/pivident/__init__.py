"""Identification of the dynamic parameters of robots from closed-loop records.

One verb, ``identify(problem, method)``. A `Problem` holds what is given (robot, recordings,
control loop), a method how to estimate (`LeastSquares`, `InstrumentalVariables`,
`PrefilteredIV`), and an `Identification` the answer with everything needed to doubt it. Names
are imported when they are first used, so that ``import pivident`` costs nothing.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

from pivident.version import __version__

if TYPE_CHECKING:
    from pivident.comparison.compare import compare
    from pivident.consistency.consistent_model import make_consistent
    from pivident.control_law.identified_law import identify_controller
    from pivident.control_law.unknown_loop import reconstruct_loop
    from pivident.diagnostics.diagnostics import diagnose
    from pivident.diagnostics.verdict import verdict
    from pivident.dynamics.base_parameters import base_parameters
    from pivident.errors import PividentError
    from pivident.estimation.identification import Identification
    from pivident.estimation.identify import build_regression, identify
    from pivident.estimation.methods import (
        Arma,
        AutoRegressive,
        Bandpass,
        InstrumentalVariables,
        LeastSquares,
        PrefilteredIV,
        RandomWalk,
    )
    from pivident.estimation.problem import Problem
    from pivident.estimation.stored_identification import load_identification
    from pivident.experiment import load_experiment
    from pivident.friction.laws.law_choice import choose_laws
    from pivident.friction.laws.shapes import identify_shapes
    from pivident.linear.free_law import identify_free_law
    from pivident.recording.load import load_recording
    from pivident.recording.recording import Recording
    from pivident.report.builder import write_report
    from pivident.robot import Robot, load_robot
    from pivident.simulation.control_loop import Loop
    from pivident.simulation.controllers import PD, PID, Cascade, PythonController
    from pivident.simulation.gravity_compensation import GravityCompensated, GravityModel
    from pivident.simulation.simulated_record import SimulatedRecord, simulate
    from pivident.simulation.virtual_pd import virtual_pd
    from pivident.tables.chosen import table
    from pivident.validation.essential_parameters import essential_parameters
    from pivident.validation.held_out.cross_validation import cross_validate

#: Where each name of the front door lives.
_HOME = {
    "Arma": "pivident.estimation.methods",
    "AutoRegressive": "pivident.estimation.methods",
    "Bandpass": "pivident.estimation.methods",
    "Cascade": "pivident.simulation.controllers",
    "GravityCompensated": "pivident.simulation.gravity_compensation",
    "GravityModel": "pivident.simulation.gravity_compensation",
    "Identification": "pivident.estimation.identification",
    "InstrumentalVariables": "pivident.estimation.methods",
    "LeastSquares": "pivident.estimation.methods",
    "Loop": "pivident.simulation.control_loop",
    "PD": "pivident.simulation.controllers",
    "PID": "pivident.simulation.controllers",
    "PividentError": "pivident.errors",
    "PrefilteredIV": "pivident.estimation.methods",
    "Problem": "pivident.estimation.problem",
    "PythonController": "pivident.simulation.controllers",
    "RandomWalk": "pivident.estimation.methods",
    "Recording": "pivident.recording.recording",
    "Robot": "pivident.robot",
    "SimulatedRecord": "pivident.simulation.simulated_record",
    "base_parameters": "pivident.dynamics.base_parameters",
    "build_regression": "pivident.estimation.identify",
    "compare": "pivident.comparison.compare",
    "reconstruct_loop": "pivident.control_law.unknown_loop",
    "choose_laws": "pivident.friction.laws.law_choice",
    "cross_validate": "pivident.validation.held_out.cross_validation",
    "essential_parameters": "pivident.validation.essential_parameters",
    "diagnose": "pivident.diagnostics.diagnostics",
    "identify": "pivident.estimation.identify",
    "identify_controller": "pivident.control_law.identified_law",
    "identify_free_law": "pivident.linear.free_law",
    "identify_shapes": "pivident.friction.laws.shapes",
    "load_experiment": "pivident.experiment",
    "load_identification": "pivident.estimation.stored_identification",
    "load_recording": "pivident.recording.load",
    "load_robot": "pivident.robot",
    "make_consistent": "pivident.consistency.consistent_model",
    "simulate": "pivident.simulation.simulated_record",
    "table": "pivident.tables.chosen",
    "verdict": "pivident.diagnostics.verdict",
    "virtual_pd": "pivident.simulation.virtual_pd",
    "write_report": "pivident.report.builder",
}

__all__ = [
    "PD",
    "PID",
    "Arma",
    "AutoRegressive",
    "Bandpass",
    "Cascade",
    "GravityCompensated",
    "GravityModel",
    "Identification",
    "InstrumentalVariables",
    "LeastSquares",
    "Loop",
    "PividentError",
    "PrefilteredIV",
    "Problem",
    "PythonController",
    "RandomWalk",
    "Recording",
    "Robot",
    "SimulatedRecord",
    "__version__",
    "base_parameters",
    "build_regression",
    "choose_laws",
    "compare",
    "cross_validate",
    "diagnose",
    "essential_parameters",
    "identify",
    "identify_controller",
    "identify_free_law",
    "identify_shapes",
    "load_experiment",
    "load_identification",
    "load_recording",
    "load_robot",
    "make_consistent",
    "reconstruct_loop",
    "simulate",
    "table",
    "verdict",
    "virtual_pd",
    "write_report",
]


def __getattr__(name: str) -> Any:
    """A name of the front door, imported from its home at first use."""
    if name not in _HOME:
        raise AttributeError(f"module 'pivident' has no attribute {name!r}")
    value = getattr(import_module(_HOME[name]), name)
    globals()[name] = value
    return value


def __dir__() -> list[str]:
    return sorted({*globals(), *_HOME})
