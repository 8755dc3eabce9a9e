"""Identification of one log of a fleet, one row for each parameter.

A failed log has a row too: error class and message in place of estimates.
"""

from __future__ import annotations

import os
import pickle
import time
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import PividentError
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.experiment.temperature import TEMPERATURE, without_temperature
from pivident.many.batch.results_folder import Row, failure
from pivident.many.fleet.logs import FleetLog
from pivident.many.fleet.template import Template
from pivident.recording.recording import Recording

#: Friction of a motor that also turns with a second joint.
COUPLED_FRICTION = ("fvm", "fcm")

#: The template that this process used last: robot and options are the same for all logs.
_last_template: dict[str, Template] = {}


@dataclass(frozen=True)
class Task:
    """The data of a fleet for a worker; small, and the same for all logs."""

    key: str  # hash of the template
    payload: bytes  # file, tables and robot, pickled

    @classmethod
    def of(cls, template: Template) -> Task:
        """The task of a template."""
        parts = (str(template.path), template.content, template.experiment.robot)
        return cls(template.hash, pickle.dumps(parts))

    @property
    def template(self) -> Template:
        """The template, made once per process."""
        if self.key not in _last_template:
            path, content, robot = pickle.loads(self.payload)
            made = Template(Path(path), content)
            vars(made.experiment)["robot"] = robot  # its file need not be where the worker is
            _last_template.clear()
            _last_template[self.key] = made
        return _last_template[self.key]


def identify_log(task: Task, log: FleetLog) -> list[Row]:
    """All rows of a log, one for each parameter."""
    begin = time.perf_counter()
    common: Row = {"task": log.name, "sha256": None}
    try:
        template = task.template
        common["method"] = template.method_name
        if log.fault:
            raise PividentError(log.fault)
        common["sha256"] = log.digest()
        problem, temperatures = _problem(template, log)
        found = identify(problem, template.method)
    except Exception as error:
        seconds = time.perf_counter() - begin
        return [common | {"computed": time.time()} | failure(error, seconds)]
    common |= {
        "computed": time.time(),
        "converged": bool(found.converged),
        "iterations": found.iterations,
        "samples": sum(r.samples for r in problem.recordings),
        "relative_error": found.relative_error,
        "condition": found.condition,
        "seconds": time.perf_counter() - begin,
    }
    return [common | row for row in _parameters(found, temperatures)]


def identify_log_alone(task: Task, log: FleetLog) -> list[Row]:
    """``identify_log`` in a worker process with one thread: workers share the cores."""
    os.environ["PIVIDENT_THREADS"] = "1"
    return identify_log(task, log)


def lost_log(task: Task, log: FleetLog, times: int) -> list[Row]:
    """The row of a log whose worker died each time; it is retried in the next call."""
    message = f"the worker died {times} times on this log; is there enough memory?"
    common: Row = {"task": log.name, "sha256": None, "method": task.template.method_name}
    return [common | {"computed": time.time(), "error": "WorkerLost", "message": message}]


def _problem(template: Template, log: FleetLog) -> tuple[Problem, np.ndarray | None]:
    """The problem of a log, and the mean temperature of each joint if the log has it."""
    experiment = template.experiment_of(log)
    recordings = experiment.recordings()
    temperatures = None
    if template.fleet.temperature is not None:
        temperatures = _mean_temperatures(recordings)
        recordings = tuple(without_temperature(r) for r in recordings)
    return experiment.problem(recordings=recordings), temperatures


def _mean_temperatures(recordings: tuple[Recording, ...]) -> np.ndarray:
    """Mean over all samples, shape (joints,), in the unit of the log."""
    every = np.concatenate([r.inputs[TEMPERATURE] for r in recordings])
    return every.mean(axis=0)


def _parameters(found: Identification, temperatures: np.ndarray | None) -> list[Row]:
    """Names, values and standard errors."""
    names, places = found.robot.tree.joint_names, found.robot.places
    rows: list[dict[str, Any]] = []
    for k, (name, p) in enumerate(zip(found.names, found.parameters, strict=True)):
        dissipates = p.friction is not None and p.friction.is_dissipative
        rows.append(
            {
                "joint": names[p.joint],
                "parameter": name,
                "unit": p.unit,
                "value": float(found.theta[k]),
                "std": float(found.std[k]),
                "robust_std": float(found.robust_std[k]),
                "friction": dissipates or p.stem in COUPLED_FRICTION,
                "temperature": None
                if temperatures is None or p.joint not in places
                else float(temperatures[places.index(p.joint)]),
            }
        )
    return rows
