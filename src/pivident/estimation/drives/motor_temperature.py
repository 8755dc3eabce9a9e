"""Temperature of the motor constant: k(T) = k₀ (1 + a (T - T₀)), for each motor.

Magnets lose strength as they warm, about 0.1 % (neodymium) to 0.2 % (ferrite) per kelvin. With the
temperature logged, or the time since the start instead of it,

    c = (Φ θ + ΔT Φ_f β) / (1 + a ΔT),      ΔT = T - T₀,

where β is the change of friction. Friction changes far more with temperature than magnets do, and
would bias a without a β of its own. So a follows from gravity and inertia alone. Each motor is
identified separately, in the unit of its log: no gain has to be known.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.estimation.covariance.windows import Windows
from pivident.estimation.drives.drive_equations import (
    WINDOWS,
    drive_columns,
    motor_coupling,
    motor_rows,
    motor_valid_samples,
    refuse_load_friction,
)
from pivident.estimation.drives.log_units import independent_columns, restricted, solved_row
from pivident.estimation.full_rate import BLOCK, valid_samples
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.normal_equations import JointSums
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.foundation.distributions import fisher
from pivident.foundation.errors import ExperimentError, IdentificationError
from pivident.loop.motion.motion import Kinematics, SpeedLimits, packed_stretch, with_inner
from pivident.robot.transmission import Transmission

#: Significance level of a temperature coefficient.
LEVEL = 0.05

#: Passes of the Gauss–Newton iteration; a ΔT is small, and three suffice.
PASSES = 4

#: Largest plausible relative change of a motor constant over the record.
MAX_CHANGE = 0.5


@dataclass(frozen=True)
class MotorTemperature:
    """Temperature coefficient of one motor constant."""

    joint: str
    coefficient: float  # a [per unit of T]
    std: float  # standard error by the sandwich
    unit: str  # ``1/K``, or ``1/s`` where time replaces temperature
    reference: float  # T₀ [K, °C or s]
    span: float  # range of T in the records
    f_statistic: float  # (a/σ)², valid for correlated residuals
    degrees: int  # denominator degrees of freedom, from the windows of time
    p_value: float  # probability of so large a value if a = 0

    @property
    def is_significant(self) -> bool:
        """Whether the coefficient is significantly different from zero."""
        return self.p_value < LEVEL


def identify_motor_temperature(
    problem: Problem,
    temperatures: Sequence[np.ndarray] | None = None,
    reference: float | None = None,
    friction_drift: bool = True,
    signals: RandomWalk | None = None,
) -> tuple[MotorTemperature, ...]:
    """Temperature coefficient of every motor constant; commands in any unit.

    ``temperatures`` of each recording have shape (samples, joints) or (samples,); None: time
    replaces them, and the drift is linear in it. T₀ is their mean if not given.
    """
    for recording in problem.recordings:
        recording.require_torque("the temperature of motors is found")
    recipe = signals or RandomWalk()
    timed = temperatures is None
    refuse_load_friction(problem.regressor)
    given = [r.t for r in problem.recordings] if temperatures is None else temperatures
    warmth = [_per_motor(t, r) for t, r in zip(given, problem.recordings, strict=True)]
    everything = np.hstack(warmth)
    span = np.ptp(everything, axis=1)
    if (span <= 0).any():
        joint = problem.robot.joint_names[int(np.argmin(span))]
        raise IdentificationError(
            f"the temperature of joint {joint!r} is the same throughout",
            advice="take a longer record from a cold start, or leave temperature out",
        )
    centre = np.mean(everything, axis=1)
    zero = centre if reference is None else np.full(len(span), float(reference))
    kinematics = [
        with_inner(problem.regressor, estimate_kinematics(r, recipe)) for r in problem.recordings
    ]
    limits = [problem.speed_limits(r) for r in problem.recordings]
    # ΔT in units of its range keeps all columns of one size
    scaled = [(t - zero[:, None]) / span[:, None] for t in warmth]
    rate = np.zeros(problem.robot.size)
    std, degrees = np.full(rate.size, np.inf), np.ones(rate.size, dtype=int)
    state: list[np.ndarray | None] = [None] * rate.size
    for k in range(PASSES):
        sums = _sums(problem, kinematics, limits, scaled, rate, state, friction_drift)
        for m, own in enumerate(sums):
            # the first pass finds a model, which gives the slope of the next ones
            found, std[m], degrees[m], state[m] = _step(own, with_slope=k > 0)
            rate[m] = np.clip(found, -MAX_CHANGE, MAX_CHANGE)

    answers = []
    for m, name in enumerate(problem.robot.joint_names):
        a, standard_error = rate[m] / span[m], std[m] / span[m]
        statistic = float((a / standard_error) ** 2)
        answers.append(
            MotorTemperature(
                name, float(a), float(standard_error), "1/s" if timed else "1/K", float(zero[m]),
                float(span[m]), statistic, int(degrees[m]),
                float(fisher.sf(statistic, 1, degrees[m])),
            )
        )  # fmt: skip
    return tuple(answers)


def at_reference_temperature(
    recording: Recording,
    transmission: Transmission,
    coefficients: Sequence[float],
    temperature: np.ndarray,
    reference: Sequence[float],
) -> Recording:
    """The record with all motors at their reference temperature T₀ (joints,).

    Coefficients a of each motor, zero: unchanged; temperature (samples, joints) or (samples,).
    """
    warmth = _per_motor(temperature, recording) - np.asarray(reference, float)[:, None]
    coupling = motor_coupling(transmission)
    commands = np.linalg.solve(coupling, recording.tau.T)
    factor = 1.0 + np.asarray(coefficients, float)[:, None] * warmth
    return replace(recording, tau=(coupling @ (commands * factor)).T)


def _per_motor(temperature: np.ndarray, recording: Recording) -> np.ndarray:
    """Temperatures time last, shape (joints, samples)."""
    values = np.asarray(temperature, dtype=float)
    if values.ndim == 1:
        values = np.repeat(values[:, None], recording.joints, axis=1)
    if values.shape != recording.q.shape:
        raise ExperimentError(
            f"temperatures of recording {recording.name!r} have shape {values.shape}",
            advice=f"{recording.q.shape} or one value for each sample is needed",
        )
    if not np.isfinite(values).all():
        raise ExperimentError(
            f"temperatures of recording {recording.name!r} hold NaN", advice="repair them"
        )
    return values.T


def _sums(
    problem: Problem,
    kinematics: Sequence[Kinematics],
    limits: Sequence[SpeedLimits],
    warmth: Sequence[np.ndarray],
    rate: np.ndarray,
    state: Sequence[np.ndarray | None],
    friction_drift: bool,
) -> list[JointSums]:
    """Linearised rows [Φ, ΔT Φ_f, ∂/∂a] of every motor, with the command as regressand."""
    robot, regressor = problem.robot, problem.regressor
    columns = drive_columns(robot, regressor)
    rows = np.linalg.inv(motor_coupling(robot.transmission))
    friction = [
        np.array(
            [i for i, c in enumerate(own) if not regressor.parameters[c].carries_load], dtype=int
        )
        if friction_drift
        else np.zeros(0, dtype=int)
        for own in columns
    ]
    count = WINDOWS * len(kinematics)
    sums = [
        JointSums.empty(name, np.arange(own.size + f.size + 1), count)
        for name, own, f in zip(robot.joint_names, columns, friction, strict=True)
    ]
    for r, (k, limit, warm) in enumerate(zip(kinematics, limits, warmth, strict=True)):
        windows = Windows(k.q.shape[1], WINDOWS, r * WINDOWS)
        valid, commands = valid_samples(k, k.dq, limit), rows @ k.tau
        for start in range(0, windows.samples, BLOCK):
            span = slice(start, min(start + BLOCK, windows.samples))
            packed = packed_stretch(regressor, k, span)
            shares = list(windows.shares(span))
            for m in range(robot.size):
                phi = motor_rows(regressor, rows[m], columns[m], packed)
                growth = 1.0 + rate[m] * warm[m, span]
                linear = np.vstack([phi, warm[m, span] * phi[friction[m]]]) / growth
                model = np.zeros(phi.shape[1]) if state[m] is None else state[m] @ linear
                slope = -warm[m, span] * model / growth
                # linearised at the present rate: the regressand includes its slope
                target = commands[m, span] + rate[m] * slope
                sums[m].add(
                    np.vstack([linear, slope]), None, target,
                    motor_valid_samples(rows[m], valid[:, span]), shares,
                )  # fmt: skip
    return sums


def _step(own: JointSums, with_slope: bool) -> tuple[float, float, int, np.ndarray]:
    """New rate and its standard error, degrees of freedom, coefficients of linear columns."""
    last = len(own.ff) - 1
    kept = independent_columns(own.ff[:last, :last])
    if with_slope:
        kept = np.append(kept, last)
    values, std = solved_row(restricted(own, kept))
    linear = np.zeros(last)
    linear[kept[kept < last]] = values[kept < last]
    rate, standard_error = (float(values[-1]), float(std[-1])) if with_slope else (0.0, np.inf)
    return rate, standard_error, len(own.window_zt) - 1, linear
