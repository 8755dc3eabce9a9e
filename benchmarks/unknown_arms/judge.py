"""Estimates beside the truth: errors in standard errors, coverage, torque on a held-out motion."""

from __future__ import annotations

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from pivident.loop.motion.motion import SpeedLimits

from .truth import Machine, true_standard, value_of_group

#: Half width of a 95 % interval in standard errors.
WIDTH = 1.96

#: Slower samples are left out of fits and errors [of the rated speed], as `identify` does.
SLOWEST = 0.01


@dataclass(frozen=True)
class Judged:
    """One estimate beside the truth; arrays are (parameters,).

    Attributes:
        method: as on the command line.
        names: of the base parameters.
        estimate: their values.
        std: their standard errors.
        truth: their true values, NaN where the machine has no such parameter.
        attainable: least squares on noise-free signals, with the user's torque constants and the
            result's friction law: what no amount of data could improve.
        held_out: error of the torque on the held-out motion over the torque [%].
        instruments: which instruments the result says it used.
        converged: whether the result says so.
        seconds: how long it took [s].
    """

    method: str
    names: tuple[str, ...]
    estimate: np.ndarray
    std: np.ndarray
    truth: np.ndarray
    attainable: np.ndarray
    held_out: float
    instruments: str
    converged: bool
    seconds: float

    @property
    def z(self) -> np.ndarray:
        """Errors in standard errors, (estimate - truth)/σ."""
        return (self.estimate - self.truth) / self.std

    @property
    def z_attainable(self) -> np.ndarray:
        """Distance from what is attainable, in standard errors."""
        return (self.estimate - self.attainable) / self.std

    @property
    def is_friction(self) -> np.ndarray:
        """Which parameters belong to friction or offsets."""
        return np.array([name.startswith(("f", "off")) for name in self.names])


def judge(folder: Path, made: Machine, runs: Sequence[str], method: str, seconds: float) -> Judged:
    """Compare a stored result with the truth.

    Args:
        folder: of the record.
        made: its machine.
        runs: the runs it was identified from.
        method: as on the command line.
        seconds: how long the command took [s].
    """
    import pivident as pv

    stored = _result_file(folder, method)
    result: Any = pv.load_identification(stored)
    robot = result.robot
    frozen = robot.urdf.frozen if robot.urdf else {}
    standard = true_standard(made, robot.joint_names, frozen)
    return Judged(
        method=method,
        names=result.names,
        estimate=result.theta,
        std=result.std,
        truth=np.array([value_of_group(text, standard) for text in result.expressions]),
        attainable=_noise_free_fit(folder, made, result, runs),
        held_out=_held_out_error(folder, made, result),
        instruments=_instruments(stored),
        converged=result.converged,
        seconds=seconds,
    )


def _result_file(folder: Path, method: str) -> Path:
    """The stored result of a method, whether it ran with the others or by itself."""
    results = folder / "experiment-results"
    for place in (results / method, results / f"alone-{method}", results):
        for file in sorted(place.rglob("identification.json")):
            if place != results:
                return file
    return results / "identification.json"


def _true_signals(folder: Path, made: Machine, result: Any, run: str):
    """True motion, the torque as the user converts it, and rows that are fast enough."""
    places = [joint.name for joint in made.arm.joints]
    at = [places.index(name) for name in result.robot.joint_names]
    with np.load(folder / f"truth_{run}.npz") as data:
        q, dq, ddq, tau = (data[key][:, at] for key in ("q", "dq", "ddq", "tau"))
    tau = (tau + made.offset[at]) * (made.sheet_gain / made.gain)[at]
    limits = SpeedLimits(SLOWEST * made.arm.speeds[at], result.robot.couplings)
    return q, dq, ddq, tau, limits.moving(dq.T).T


def _noise_free_fit(folder: Path, made: Machine, result: Any, runs: Sequence[str]) -> np.ndarray:
    """Weighted least squares on the true signals, joints weighted as the result's residuals."""
    from pivident.dynamics.regressor import Regressor

    regressor = Regressor.build(result.robot, result.parameters)
    weights = 1.0 / np.array([joint.rms_error for joint in result.joints])
    size = len(result.names)
    gram, moment = np.zeros((size, size)), np.zeros(size)
    for run in runs:
        q, dq, ddq, tau, fast = _true_signals(folder, made, result, run)
        factor = weights * fast
        phi = regressor.matrix(q, dq, ddq) * factor[:, :, None]
        gram += np.einsum("kja,kjb->ab", phi, phi)
        moment += np.einsum("kja,kj->a", phi, tau * factor)
    scale = 1.0 / np.sqrt(np.diag(gram))
    return scale * np.linalg.lstsq(gram * np.outer(scale, scale), scale * moment, rcond=1e-12)[0]


def _held_out_error(folder: Path, made: Machine, result: Any) -> float:
    """Relative torque error on a motion that nobody fitted, without noise [%]."""
    q, dq, ddq, tau, fast = _true_signals(folder, made, result, "held_out")
    error = result.predict(q, dq, ddq) - tau
    return float(100.0 * np.linalg.norm(error[fast]) / np.linalg.norm(tau[fast]))


def _instruments(stored: Path) -> str:
    """What the result says of its instruments, in its own words where it has any."""
    content = json.loads(stored.read_text(encoding="utf-8"))
    if content.get("instruments"):
        return json.dumps(content["instruments"], ensure_ascii=False)[:80]
    law = content.get("controller")
    if not law:
        return "none"
    if isinstance(law, list):
        return "identified law: " + ", ".join(law[0].get("terms", []))
    return str(law.get("type", law))[:80]
