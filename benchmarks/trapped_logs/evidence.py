"""By what a fault can be seen in a log: figures that no verdict is asked for.

Each figure compares the log with something that the fault leaves alone: logged speeds with the
slope of the positions, torques with those of the description's masses, drive commands with a known
law, positions and speeds with the limits of the description.
"""

from __future__ import annotations

from pathlib import Path
from typing import Any

import numpy as np

from pivident import load_experiment
from pivident.data.recording.recording import Recording
from pivident.experiment.experiment import Experiment
from pivident.foundation.errors import PividentError
from pivident.judgement.audit.inverse_model import InverseModel, build_inverse_model
from pivident.judgement.audit.recording_audit import log_of
from pivident.judgement.audit.timing import check_timing

#: Stretches of time that the jackknife leaves out in turn.
STRETCHES = 10

#: Samples that the figures are made of, at most.
MAX_SAMPLES = 20_000

#: Share of a command's limit below which it is free.
FREE = 0.98

#: Delays of the torque that are tried [ms].
DELAYS = np.arange(-40.0, 61.0, 4.0)


def evidence(folder: Path) -> dict[str, Any]:
    """Figures about the log of an experiment's folder, by joint; empty where it is refused.

    Returns:
        ``speeds``: slope of the positions over the logged speed, or that of the references.
        ``gravity`` and ``inertia``: logged torque over that of the description, its standard error
        beside it. ``unexplained``: share of the torque that neither of them nor friction gives [%].
        ``delay``: of the torque, with which all base parameters leave least, its standard error
        beside it [ms]. ``beyond``: share of the samples outside the limits of position or speed
        [%]. ``law``: factors of position error and speed in a cascade's law, which is that of the
        experiment file where both are 1.
    """
    try:
        experiment = load_experiment(folder / "experiment.toml")
        recording = experiment.recordings()[0]
    except PividentError as error:
        return {"refused": str(error)}
    figures: dict[str, Any] = {"beyond": _beyond_limits(experiment, recording)}
    pairs = ((recording.q, recording.dq), (recording.q_ref, recording.dq_ref))
    for positions, speeds in pairs:
        if positions is not None and speeds is not None:
            slopes = np.gradient(positions, 1.0 / recording.rate, axis=0)
            figures["speeds"] = ((slopes * speeds).sum(axis=0) / (speeds**2).sum(axis=0)).tolist()
            break
    if experiment.content.controller and experiment.content.controller.type == "cascade":
        figures["law"] = _cascade_factors(experiment, recording)
    try:
        log = log_of(experiment.robot, recording)
        model = build_inverse_model(log, check_timing(log))
        figures |= _description_factors(model) | {"delay": _delay(model)}
    except (PividentError, np.linalg.LinAlgError) as error:
        figures["masses"] = str(error)
    return figures


def _beyond_limits(experiment: Experiment, recording: Recording) -> list[float]:
    """Share of the samples beyond a joint's limits of position or speed [%]."""
    slopes = np.gradient(recording.q, 1.0 / recording.rate, axis=0)
    shares = []
    for j, joint in enumerate(experiment.robot.joints):
        lower, upper = joint.position_limits or (-np.inf, np.inf)
        fastest = joint.rated_speed if joint.rated_speed else np.inf
        outside = (recording.q[:, j] < lower) | (recording.q[:, j] > upper)
        shares.append(100.0 * float(np.mean(outside | (np.abs(slopes[:, j]) > fastest))))
    return shares


def _cascade_factors(experiment: Experiment, recording: Recording) -> list[float]:
    """Factors of position error and speed in the command of a cascade."""
    law = experiment.content.controller
    assert law is not None and recording.q_ref is not None
    slopes = np.gradient(recording.q, 1.0 / recording.rate, axis=0)
    terms = [law.kv * law.kp * (recording.q_ref - recording.q), -law.kv * slopes]
    command = (recording.tau / np.asarray(law.drive_gain))[:, 0]
    free = np.abs(command) < FREE * (law.limit or np.inf)
    return np.linalg.lstsq(np.hstack(terms)[free], command[free], rcond=None)[0].tolist()


def _delay(model: InverseModel) -> list[float]:
    """Delay of the torque that leaves least, and its standard error over stretches of time [ms]."""
    left = np.zeros((STRETCHES, len(DELAYS)))  # squares, relative to those without a delay
    for j in range(model.robot.size):
        rows = np.flatnonzero(model.moving[:, j])
        rows = rows[:: max(1, len(rows) // MAX_SAMPLES)]
        if len(rows) < 5 * STRETCHES:
            continue
        basis, _ = np.linalg.qr(model.columns[j][rows])
        rest = np.array([model.tau(1e-3 * delay)[rows, j] for delay in DELAYS])
        rest -= rest @ basis @ basis.T
        squares = np.array([(x**2).sum(axis=1) for x in np.array_split(rest, STRETCHES, axis=1)])
        left += squares / squares.sum(axis=0).min()
    whole = _lowest(left.sum(axis=0))
    parts = [_lowest(left.sum(axis=0) - own) for own in left]
    return [whole, float(np.sqrt((STRETCHES - 1) * np.var(parts)))]


def _lowest(left: np.ndarray) -> float:
    """Where a parabola through the lowest of equally spaced values has its vertex [ms]."""
    k = int(np.clip(np.argmin(left), 1, len(left) - 2))
    before, at, behind = left[k - 1 : k + 2]
    bend = before - 2.0 * at + behind
    step = DELAYS[1] - DELAYS[0]
    return float(DELAYS[k] + (0.5 * step * (before - behind) / bend if bend > 0.0 else 0.0))


def _description_factors(model: InverseModel) -> dict[str, Any]:
    """Logged torque over that of the description, of gravity and of inertia apart."""
    found: dict[str, list[Any]] = {"gravity": [], "inertia": [], "unexplained": []}
    tau = model.tau()
    for j in range(model.robot.size):
        rows = np.flatnonzero(model.moving[:, j])
        rows = rows[:: max(1, len(rows) // MAX_SAMPLES)]
        columns = [model.gravity, model.inertial, model.ddq, model.dq, np.sign(model.dq)]
        design = np.column_stack([*(x[rows, j] for x in columns), np.ones(len(rows))])
        size = np.linalg.norm(design, axis=0)
        present = np.flatnonzero(size > 1e-9 * max(float(size.max(initial=0.0)), 1e-300))
        design, torque = design[:, present], tau[rows, j]
        if len(rows) < 5 * STRETCHES:
            for values in found.values():
                values.append(None)
            continue
        whole = np.linalg.lstsq(design, torque, rcond=1e-8)[0]
        parts = np.array_split(np.arange(len(rows)), STRETCHES)
        left_out = [
            np.linalg.lstsq(
                np.delete(design, part, axis=0), np.delete(torque, part), rcond=1e-8
            )[0]
            for part in parts
        ]  # fmt: skip
        spread = np.sqrt((STRETCHES - 1) * np.var(left_out, axis=0))
        for k, name in enumerate(("gravity", "inertia")):
            at = np.flatnonzero(present == k)
            found[name].append([float(whole[at[0]]), float(spread[at[0]])] if at.size else None)
        rest = torque - design @ whole
        found["unexplained"].append(
            100.0 * float(np.linalg.norm(rest) / max(float(np.linalg.norm(torque)), 1e-300))
        )
    return found
