"""The record, identified by pivident's simulation error methods."""

from __future__ import annotations

import tempfile
from dataclasses import dataclass, replace
from pathlib import Path
from time import perf_counter, process_time

import numpy as np

import pivident as pv
from pivident.estimation.methods import METHODS
from pivident.estimation.output_error.output_error import OutputError
from pivident.foundation.errors import ExperimentError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import TAPS, SampledLaw
from pivident.robot.friction import FrictionLaw
from pivident.robot.mjcf import read_mjcf

from .arm import STEP, Bodies, mjcf
from .record import Record


@dataclass(frozen=True, eq=False)
class PositionActuators:
    """MuJoCo's position actuators, τ = kp (u - q) - kv dq with q and dq in continuous time.

    What acts over a period is the mean of it: q and dq in its middle, from a parabola through the
    last three positions,

        q̂ = (15 q_k - 10 q_{k-1} + 3 q_{k-2})/8,    dq̂ = (2 q_k - 3 q_{k-1} + q_{k-2})/h
    """

    kp: np.ndarray  # [N m/rad], shape (joints,)
    kv: np.ndarray  # [N m s/rad], likewise

    def check(self, joints: int) -> None:
        """Refuse gains of another number of joints."""
        if len(self.kp) != joints or len(self.kv) != joints:
            raise ExperimentError(f"give kp and kv of {joints} joints")

    def law(self, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray | None) -> SampledLaw:
        """The law at ``rate`` [Hz]."""
        n = q_ref.shape[1]
        feedback = np.outer(self.kp, [15.0, -10.0, 3.0]) / 8.0
        feedback += np.outer(self.kv, [2.0, -3.0, 1.0]) * rate
        pole = np.tile(np.eye(1, TAPS), (n, 1))
        return SampledLaw(feedback, pole, pole.copy(), np.zeros(n), self.kp * q_ref, q_ref.copy())


def robot_of(bodies: Bodies, friction: FrictionLaw) -> pv.Robot:
    """The arm, read from its MJCF file."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "arm.xml"
        path.write_text(mjcf(bodies), encoding="utf-8")
        return read_mjcf(path, friction=friction)


def problem_of(record: Record, start: Bodies, friction: FrictionLaw) -> pv.Problem:
    """What pivident is given: the file that is wrong, the log and the gains."""
    chain = start.chain
    log = pv.Recording(
        "run", chain.joints, record.q, record.mean_torque, 1.0 / STEP, q_ref=record.u
    )
    return pv.Problem(robot_of(start, friction), log, Loop(PositionActuators(chain.kp, chain.kv)))


@dataclass(frozen=True, eq=False)
class OwnFit:
    """What pivident found, and what it took."""

    result: pv.Identification
    wall: float  # [s]
    processor: float  # of all threads [s]


def fitted(problem: pv.Problem, method: OutputError) -> OwnFit:
    """One identification, timed."""
    wall, processor = perf_counter(), process_time()
    result = pv.identify(problem, method)
    return OwnFit(result, perf_counter() - wall, process_time() - processor)


def named(name: str, **changes) -> OutputError:
    """A method by its name, from the values of the file as the other program starts."""
    method = METHODS[name]
    assert isinstance(method, OutputError)
    return replace(method, start="initial", **changes)
