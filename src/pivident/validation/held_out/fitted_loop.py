"""A loop simulated with all that a fit found of it: parameters of the model and of the loop."""

from __future__ import annotations

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.output_error.loop_unknowns import loop_unknowns
from pivident.estimation.output_error.record_stretches import closed_stretches
from pivident.estimation.output_error.unknowns import with_values
from pivident.estimation.problem import Problem
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion
from pivident.simulation.closed_loop import Trajectory, simulate
from pivident.simulation.direction import ParametrisedLoop


def has_own_loop(found: Identification) -> bool:
    """Whether unknowns of the closed loop were identified with the model."""
    simulation = found.simulation
    return simulation is not None and simulation.loop == "closed" and bool(
        simulation.loop_parameters
    )  # fmt: skip


def drive_delay(found: Identification, declared: float) -> float:
    """Delay of the drives in a fitted closed loop [s]; ``declared`` where it was not sought."""
    own = found.simulation.loop_parameters if found.simulation and has_own_loop(found) else ()
    return next((p.value for p in own if p.name == "delay"), declared)


def with_loop_parameters(
    problem: Problem, loop: ParametrisedLoop, found: Identification
) -> ParametrisedLoop:
    """A loop as it was declared, with the values that a fit gave its unknowns."""
    own = () if found.simulation is None else found.simulation.loop_parameters
    unknowns = loop_unknowns(problem, loop, [p.name for p in own])
    return with_values(loop, unknowns, np.array([p.value for p in own]))


def motion_of(loop: ParametrisedLoop) -> Trajectory:
    """Motion of a loop."""
    return simulate(loop.model, loop.controller, loop.signals, loop.robot.joint_names, loop.begin)


def encoder_offsets(loop: ParametrisedLoop) -> np.ndarray:
    """What the encoders show beside the position, shape (joints,) [rad or m]."""
    noise = loop.signals.noise
    return np.zeros(loop.robot.size) if noise is None else np.asarray(noise)[0]


def closed_motion(
    problem: Problem, kinematics: Kinematics, found: Identification, samples: int
) -> SimulatedMotion:
    """What encoders and torque show of the fitted closed loop of a problem's only recording.

    Raises:
        SimulationDiverged: the loop with these values is unstable.
    """
    assert problem.loop is not None
    (stretch,) = closed_stretches(
        problem, problem.loop, found.parameters, found.theta, [kinematics]
    )
    loop = with_loop_parameters(problem, stretch.loop, found)
    made, rate = motion_of(loop), kinematics.recording.rate
    shown = made.q + encoder_offsets(loop)
    q, tau = (_at(signal, made.rate / rate, samples) for signal in (shown, made.tau))
    return SimulatedMotion(q.T, rate, None, tau.T)


def _at(signal: np.ndarray, ratio: float, samples: int) -> np.ndarray:
    """A simulated signal at the samples of a record; ``ratio``: of its rate to the record's."""
    step = round(ratio)
    if step >= 1 and abs(ratio - step) < 1e-9:
        return signal[::step][:samples]
    from scipy.interpolate import CubicSpline

    last = int((len(signal) - 1) / ratio + 1e-6)
    return CubicSpline(np.arange(len(signal)) / ratio, signal)(np.arange(min(samples, last + 1)))
