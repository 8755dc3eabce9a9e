"""A record of a robot of one's own, simulated in closed loop with noise, and its true parameters.

The parameters of a real robot are unknown. A simulated one has known ones, so that an estimator,
a motion or a control law can be tried where the answer is given:

    reference → control law → τ → robot → q,     q + encoder noise → control law

The control law reads the noisy position, as a real one does: this is what biases least squares.

Noise of simulated records: encoders (white, coloured, counted), (P-8), and torque sensors.

Every stream of random numbers has its own seed, (run, stream, study): a run's numbers depend on
nothing but that, whoever computes it and after whatever.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from numbers import Real
from typing import Literal

import numpy as np

from pivident.data.recording.recording import Recording
from pivident.dynamics.base_parameters import BaseParameters, base_parameters, parameter_index
from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import Parameter, nominal_values
from pivident.foundation.errors import ExperimentError, ShapeMismatch, require_kind
from pivident.foundation.progress import Stages
from pivident.foundation.text.display import Displayed
from pivident.loop.simulation.closed_loop import (
    LoopSignals,
    Trajectory,
    in_whole_counts,
    simulate as simulate_loop,
)
from pivident.loop.simulation.control_loop import Loop, loop_feed_forward, with_measured_gravity
from pivident.loop.simulation.controllers import Controller
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.description import Robot

#: A simulated loop that leaves its reference further than this [rad or m], or is faster, diverges.
FARTHEST, FASTEST = 0.5, 50.0
#: Random postures lie so far from the middle of a joint's range: a share of its half width, and no
#: more than this [rad or m].
REACH_SHARE, MAX_REACH = 0.8, 1.5
#: Share of the rated speed that a random motion uses, and the speed where none is known [rad/s].
SPEED_SHARE, USUAL_SPEED = 0.8, 1.5
#: Postures of a random motion: so many, and one for each of these seconds.
POSTURES, MIN_MOVE = 12, 0.6
#: Random postures of a closed mechanism are drawn nearer to that of its description so many times
#: at most; looked at are so many points of each move.
NEARER, BETWEEN = 20, 5
#: Stream of random numbers that draws the postures, beside those of the noise.
MOTION = 4
#: Reference q, dq and ddq, each (samples, joints).
Reference = tuple[np.ndarray, np.ndarray, np.ndarray]
#: Streams of random numbers of a run.
ENCODER, TORQUE, COLOURED = 0, 1, 2
#: Which run, or which run of which study; a study of seed zero has the numbers of none.
Seed = int | tuple[int, int]
#: A standard deviation of all joints, or one for each.
Spread = float | tuple[float, ...]
#: Share of the start of an autoregressive noise that may be left when it is used.
SETTLED = 1e-9


@dataclass(frozen=True, eq=False)
class SimulatedRecord(Displayed):
    """What `simulate` makes.

    Attributes:
        recording: the log: positions and torques with their noise, and the reference.
        truth: true value of every base parameter by its name [SI unit of the parameter].
        motion: positions, speeds, accelerations and torques without the noise of the log.
    """

    recording: Recording
    truth: dict[str, float]
    motion: Trajectory = field(repr=False)


@dataclass(frozen=True)
class Noise:
    """Noise of a simulated record."""

    #: Standard deviation of white position noise [rad or m].
    encoder: Spread = 3.5e-6 / np.sqrt(3.0)
    #: Standard deviation of the torque sensor, on the record only [N m or N].
    torque: Spread = 0.05
    coloured: Spread = 0.0  # standard deviation of further position noise, AR(2) [rad or m]
    frequency: float = 600.0  # at which its spectrum peaks [Hz]
    radius: float = 0.998  # of the poles of its AR(2) model, of modulus below one
    #: What the encoders count in, to which positions are rounded [rad or m]; zero: they are not.
    count: Spread = 0.0
    rate: float = 5000.0  # sampling rate of the encoder, that of the control law [Hz]
    #: ``loop``: the control law reads the position noise too; ``record``: it is on the record only,
    #: which another sensor has made.
    where: Literal["loop", "record"] = "loop"
    #: ``record``: positions are rounded after the loop has run; ``loop``: the control law reads
    #: rounded ones.
    rounding: Literal["record", "loop"] = "record"

    def __post_init__(self) -> None:
        if not 0.0 <= self.radius < 1.0:
            raise ExperimentError(f"radius must lie between 0 and 1, not {self.radius}")
        if not 0.0 < self.frequency < self.rate / 2:
            raise ExperimentError(
                f"frequency must lie below {self.rate / 2:g} Hz, not {self.frequency}"
            )

    @property
    def denominator(self) -> np.ndarray:
        """D(z⁻¹) = 1 - 2 r cos(2π f/rate) z⁻¹ + r² z⁻² of the coloured noise."""
        cosine = np.cos(2.0 * np.pi * self.frequency / self.rate)
        return np.array([1.0, -2.0 * self.radius * cosine, self.radius**2])

    @property
    def gain(self) -> float:
        """Standard deviation of 1/D driven by white noise of unit variance."""
        _, a1, a2 = self.denominator
        return float(np.sqrt((1.0 + a2) / ((1.0 - a2) * ((1.0 + a2) ** 2 - a1**2))))

    def in_loop(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """Position noise of a run [rad or m], wherever it is added.

        ``shape``: (samples, joints) at the control rate.
        """
        noise = np.asarray(self.encoder) * stream(seed, ENCODER).standard_normal(shape)
        if np.any(self.coloured):
            noise += np.asarray(self.coloured) * self._autoregressive(seed, shape)
        return noise

    def of_torque(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """Noise of the torque sensors [N m or N], shape (samples, joints) of the record."""
        return np.asarray(self.torque) * stream(seed, TORQUE).standard_normal(shape)

    def _autoregressive(self, seed: Seed, shape: tuple[int, ...]) -> np.ndarray:
        """AR(2) noise of unit variance, stationary from its first sample on."""
        from scipy.signal import lfilter

        settling = int(np.ceil(np.log(SETTLED) / np.log(self.radius))) if self.radius > 0 else 1
        white = stream(seed, COLOURED).standard_normal((settling + shape[0], *shape[1:]))
        return lfilter([1.0], self.denominator, white, axis=0)[settling:] / self.gain

    def quantised(self, q: np.ndarray) -> np.ndarray:
        """Positions as the encoders count them [rad or m], shape (samples, joints)."""
        return in_whole_counts(q, self.count)


def stream(seed: Seed, number: int) -> np.random.Generator:
    """One stream of random numbers of a run."""
    run, *study = seed if isinstance(seed, tuple) else (seed,)
    return np.random.default_rng((run, number, *study))


def simulate(
    robot: Robot,
    loop: Loop,
    reference: np.ndarray | None = None,
    *,
    values: Mapping[str, float] | None = None,
    rate: float = 1000.0,
    duration: float = 10.0,
    encoder: float | Sequence[float] = 0.0,
    torque: float | Sequence[float] = 0.0,
    seed: int = 0,
    name: str = "simulated",
) -> SimulatedRecord:
    """Simulate a robot in its control loop and log it: a recording with known truth.

    Args:
        robot: the robot. Its masses, inertias and frictions are those of its description.
        loop: the control law, drive gains, limits and feed-forward.
        reference: reference positions, shape (samples, joints) [rad or m]; None: random moves
            between postures, within 80 % of each joint's range and rated speed.
        values: true values by the name of a base parameter, in place of those of the description
            [SI unit of the parameter]; a URDF knows no Coulomb friction and no rotors, for example.
        rate: of control law, simulation and log [Hz].
        duration: of a random motion [s]; a given reference has its own length.
        encoder: standard deviation of the white position noise that the control law reads and
            the log holds, one number or one for each joint [rad or m].
        torque: standard deviation of the torque sensors' noise, on the log only, likewise
            [N m or N].
        seed: of motion and noise; the same seed gives the same record.
        name: of the recording.

    Returns:
        The record, its truth and its motion.

    Raises:
        ExperimentError: a parameter has no such name, the description has no masses and no values
            are given, or a rate, duration or noise is not possible.
        ShapeMismatch: the reference does not have one column for each joint.
        SimulationDiverged: the loop is unstable; names the joint and the time.
        MassMatrixNotPositiveDefinite: the values are those of no machine; names the joint.

    Example:
        >>> robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
        >>> made = pv.simulate(robot, loop, duration=5.0, encoder=1e-5, seed=1)
        >>> made.recording
        <Recording 'simulated': 5000 samples of 2 joints at 1000 Hz, 4.999 s, channels q, tau, ...>
        >>> made.truth["fc1"]
        4.0
    """
    if not isinstance(loop, Loop):
        raise ExperimentError(
            f"loop is {loop!r}", advice="give the control loop, such as Loop(PD(kp=…, kd=…))"
        )
    if not (np.isfinite(rate) and rate > 0):
        raise ExperimentError(f"rate is {rate:g} Hz", advice="give the control rate, such as 1000")
    base = base_parameters(robot)
    theta = _true_values(base, values or {})
    if reference is None:
        wanted = _random_motion(robot, rate, duration, seed)
    else:
        wanted = _with_derivatives(reference, rate, robot.size)
    noise = Noise(
        _spreads("encoder", encoder, robot.size),
        _spreads("torque", torque, robot.size),
        frequency=rate / 4.0,  # of coloured noise, which there is none of
        rate=rate,
    )
    added = noise.in_loop(seed, wanted[0].shape)
    with Stages(None) as say:
        say(f"simulating {len(added) / rate:g} s of {robot.name} at {rate:g} Hz")
        motion = loop_motion(robot, loop, rate, wanted, base.parameters, theta, noise=added)
    recording = Recording(
        name,
        robot.joint_names,
        motion.q + added,
        motion.tau + noise.of_torque(seed, motion.tau.shape),
        rate,
        q_ref=wanted[0],
        dq_ref=wanted[1],
        ddq_ref=wanted[2],
        saturation="refuse" if np.isinf(loop.limit).all() else "allow",
    )
    return SimulatedRecord(recording, dict(zip(base.names, theta.tolist(), strict=True)), motion)


def loop_motion(
    robot: Robot,
    loop: Loop,
    rate: float,
    reference: Reference,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    *,
    controller: Controller | None = None,
    noise: np.ndarray | None = None,
    count: np.ndarray | None = None,
    clip: bool = False,
) -> Trajectory:
    """The closed loop with given parameters along a reference, from the reference's own start.

    ``reference``: q, dq, ddq, each (samples, joints); ``noise``: position noise that the control
    law reads, shape (samples, joints) [rad or m]; ``count``: what its encoder counts in, shape
    (joints,) [rad or m].
    """
    q_ref, dq_ref, _ = reference
    n = robot.size
    signals = LoopSignals(
        rate,
        q_ref,
        dq_ref,
        loop_feed_forward(robot, loop, reference),
        noise,
        np.broadcast_to(np.asarray(loop.drive_gain, float), n),
        np.broadcast_to(np.asarray(loop.limit, float), n),
        np.full(n, FARTHEST),
        np.full(n, FASTEST),
        count=count,
    )
    model = make_model(robot, parameters, theta, clip=clip)
    start = q_ref[0].copy(), dq_ref[0].copy()
    law = controller or with_measured_gravity(
        loop.controller, robot, loop.drive_gain, loop.feed_forward
    )
    return simulate_loop(model, law, signals, robot.joint_names, start)


def _true_values(base: BaseParameters, values: Mapping[str, float]) -> np.ndarray:
    """Values of all base parameters: the description's, and those that were given."""
    theta = base.values(nominal_values(base.robot, base.standard))
    inertial = [k for k, p in enumerate(base.parameters) if p.is_inertial or p.stem == "ia"]
    for name, value in values.items():
        if not np.isfinite(value):
            raise ExperimentError(
                f"the value of parameter {name!r} is {value}", advice="give a number"
            )
        theta[parameter_index(base, name)] = value
    if not theta[inertial].any():
        raise ExperimentError(
            f"robot {base.robot.name!r} has neither masses nor inertias to be simulated with",
            advice="add them to its description, or give values of its base parameters (values = "
            f"{{…}}): {', '.join(base.names[k] for k in inertial)}",
        )
    return theta


def _random_motion(robot: Robot, rate: float, duration: float, seed: int) -> Reference:
    """Rest-to-rest moves between random postures."""
    require_kind("duration", duration, Real, "give seconds, such as 10")
    samples = round(duration * rate) if np.isfinite(duration) else 0
    if samples < 2:
        raise ExperimentError(
            f"duration is {duration:g} s", advice="give that of the motion, such as 10"
        )
    limits = [joint.position_limits or (-MAX_REACH, MAX_REACH) for joint in robot.joints]
    low, high = np.array(limits, dtype=float).T
    reach = np.minimum(REACH_SHARE * (high - low) / 2.0, MAX_REACH)
    count = POSTURES + int(duration / MIN_MOVE)
    rng = np.random.default_rng((seed, MOTION))
    postures = (low + high) / 2.0 + reach * rng.uniform(-1.0, 1.0, (count, robot.size))
    if robot.constraints is not None:
        postures = _closing_postures(robot, postures)
    rated = robot.rated_speeds
    speeds = np.where(np.isnan(rated), USUAL_SPEED, SPEED_SHARE * rated)
    return point_to_point(postures, speeds, rate, samples)


def _closing_postures(robot: Robot, postures: np.ndarray) -> np.ndarray:
    """Postures nearer to that of the description, so that loops close at them and between them.

    Where the limits of a joint are not known, the posture of the description is its middle.
    """
    assert robot.constraints is not None
    rest, chains = robot.constraints.posture[list(robot.places)], ClosedChains(robot)
    bounded = np.array([joint.position_limits is not None for joint in robot.joints])
    way = np.where(bounded, postures - rest, postures)
    between = np.linspace(0.0, 1.0, BETWEEN)[:, None, None]
    for share in 0.8 ** np.arange(NEARER):
        nearer = rest + share * way
        moves = nearer[:-1] + between * np.diff(nearer, axis=0)
        if chains.closing(moves.reshape(-1, robot.size)).all():
            return nearer
    raise ExperimentError(
        f"the loops of robot {robot.name!r} close hardly anywhere near the posture of its "
        "description",
        advice="give a reference along which they do",
    )


def _with_derivatives(reference: np.ndarray, rate: float, joints: int) -> Reference:
    """A reference with its speeds and accelerations, by central differences."""
    q_ref = np.asarray(reference, dtype=float)
    if q_ref.ndim != 2 or q_ref.shape[1] != joints or len(q_ref) < 3:
        raise ShapeMismatch("reference", q_ref.shape, (max(3, len(np.atleast_1d(q_ref))), joints))
    dq_ref = np.gradient(q_ref, 1.0 / rate, axis=0)
    return q_ref, dq_ref, np.gradient(dq_ref, 1.0 / rate, axis=0)


def _spreads(key: str, value: float | Sequence[float], joints: int) -> tuple[float, ...]:
    """One standard deviation for each joint."""
    spreads = np.asarray(value, dtype=float)
    fits = spreads.ndim == 0 or spreads.shape == (joints,)
    if not fits or not (np.isfinite(spreads) & (spreads >= 0)).all():
        raise ExperimentError(
            f"{key} is {value!r}",
            advice="give the standard deviation of the noise, not negative, as one number or as "
            f"one for each of the {joints} joint(s)",
        )
    return tuple(np.broadcast_to(spreads, joints).tolist())
