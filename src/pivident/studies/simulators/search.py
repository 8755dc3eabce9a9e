"""The search of one branch: where it starts, the approach, and the fit.

Starts are tried in turns until a fit settles: what the equations of motion give along the measured
motion (`equation_start`), then the description with shares of the joints' scales in place of what
it lacks. A loop that is unstable with that little inertia is tried with more.

First steps of a fit, from where the search starts to near the minimum.

    (H + μ diag H) δ = g,    H = Σ JᵀJ/s²,   g = Σ Jᵀe/s²        (Levenberg 1944, Marquardt 1963)

with the scale s of each joint's error fixed at the start. The fit proper makes its weights from the
errors that a step leaves, which is right close to the minimum; far away such weights change from
pass to pass, and steps that one of them promises another refuses.

Where the search starts: values whose equations of motion hold along the measured motion.

    min_p Σ_j ‖r_j‖²/s_j²,   r = τ(t - T - h/2) - Φ(q_m - b, dq, ddq) θ,   τ = law(q_ref, q_m)

The known law gives the torque at the positions q_m that its encoders showed, h is its period, over
which the torque is held, T the delay, b the bias of the encoders. Nothing is simulated here: where
a loop with wrong values swings or diverges, its simulation says little of the right ones, while the
equation is nearly linear in them. Noise in the accelerations biases it; it is a start, no estimate.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.dynamics.robot_regressor import regressor_of
from pivident.estimation.output_error.fit import fit_simulation
from pivident.estimation.output_error.loop_unknowns import Unknown, values_of, with_values
from pivident.estimation.output_error.record_stretches import Stretch
from pivident.estimation.output_error.simulated_errors import SimulatedErrors, simulated_errors
from pivident.estimation.output_error.simulation_fit import FitOptions, SimulationFit
from pivident.estimation.output_error.thinning import POSITIONS
from pivident.foundation.errors import (
    IdentificationError,
    MassMatrixNotPositiveDefinite,
    SimulationDiverged,
)
from pivident.loop.motion.law_torque import controller_outputs
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.signals.cubic_spline import cubic_spline
from pivident.signals.random_walk import smooth_channels
from pivident.studies.simulators.joint_quantities import JointQuantity

#: Factors of the armature where the search starts: a loop that is unstable with little is tried
#: again with more.
HEAVIER = (1.0, 4.0, 16.0)
#: Fits after which no further start is tried; those whose loops diverge do not count.
MAX_TRIED = 2
#: Errors of a simulation that has lost the motion: larger than these shares of the distance between
#: position and reference, and of the motion that was wanted.
MAX_OF_TRACKING, MAX_OF_MOTION = 0.5, 0.1
#: All positions are compared, and their errors count as white.
OPTIONS = FitOptions(channels=(POSITIONS,), noise=None, bandwidth=0.0)
#: Damping μ of the first step, and its factor after a good and after a bad one.
DAMPING, EASIER, HARDER = 1e-2, 0.1, 10.0
#: Least relative decrease of the squared errors that makes a further step worth its simulation.
DECREASE = 0.05
#: Steps at most, and bad ones in a row.
MAX_STEPS, MAX_REFUSED = 25, 6
#: Evaluations of the equations with their differences, at most, and the relative decrease of their
#: squares that is worth no further one.
MAX_EVALUATIONS, DECREASE_OF_EQUATIONS = 30, 1e-4
#: Weight of a prior at the values to begin with: what no equation depends on stays there. A change
#: by all of a value, or of its range, counts as a share of so much of each torque.
PRIOR = 1e-3


@dataclass(frozen=True, eq=False)
class _Place:
    values: np.ndarray
    gram: np.ndarray
    moment: np.ndarray
    cost: float


def approached(
    stretches: Sequence[Stretch], unknowns: Sequence[Unknown], say: Callable[[str], None]
) -> list[Stretch]:
    """The stretches with loops near the minimum, sought on the first half of each.

    Raises:
        SimulationDiverged: the loop is unstable where the search starts; names the joint.
        MassMatrixNotPositiveDefinite: the values there are those of no machine.
    """
    low, high = (np.array([getattr(u, side) for u in unknowns]) for side in ("low", "high"))
    whole, stretches = stretches, [_beginning(own) for own in stretches]
    here = np.clip(values_of(stretches[0].loop, unknowns), low, high)
    scale = _scale(_errors(stretches, unknowns, here))
    place = _at(stretches, unknowns, here, scale)
    damping, refused = DAMPING, 0
    for number in range(MAX_STEPS):
        reached = _step(stretches, unknowns, place, damping, low, high, scale)
        if reached is None or reached.cost >= place.cost:
            damping, refused = damping * HARDER, refused + 1
            if refused > MAX_REFUSED:
                break
            continue
        gain = 1.0 - reached.cost / place.cost
        place, damping, refused = reached, damping * EASIER, 0
        say(f"approach, step {number + 1}: error {np.sqrt(place.cost):.3g} of that at the start")
        if gain < DECREASE and damping <= DAMPING:
            break
    return [_moved(own, unknowns, place.values) for own in whole]


def _beginning(stretch: Stretch) -> Stretch:
    """The first half of a stretch."""
    samples = max(len(stretch.q) // 2, stretch.first + 1)
    signals, length = stretch.loop.signals, samples * stretch.step
    cut = replace(
        signals,
        q_ref=signals.q_ref[:length],
        dq_ref=None if signals.dq_ref is None else signals.dq_ref[:length],
        inputs=_cut(signals.inputs, length),
        noise=_cut(signals.noise, length),
    )
    return replace(
        stretch,
        loop=replace(stretch.loop, signals=cut),
        q=stretch.q[:samples],
        moving=stretch.moving[:samples],
    )


def _cut(signal: np.ndarray | None, length: int) -> np.ndarray | None:
    """A signal over fewer samples; a single row stands for all."""
    return signal if signal is None or len(signal) == 1 else signal[:length]


def _step(
    stretches: Sequence[Stretch],
    unknowns: Sequence[Unknown],
    place: _Place,
    damping: float,
    low: np.ndarray,
    high: np.ndarray,
    scale: np.ndarray,
) -> _Place | None:
    """A damped step within the bounds; None where it cannot be simulated."""
    size = np.sqrt(np.maximum(np.diag(place.gram), 1e-300))
    damped = place.gram / np.outer(size, size) + damping * np.eye(len(size))
    step = np.linalg.solve(damped, place.moment / size) / size
    try:
        return _at(stretches, unknowns, np.clip(place.values + step, low, high), scale)
    except (SimulationDiverged, MassMatrixNotPositiveDefinite):
        return None


def _moved(stretch: Stretch, unknowns: Sequence[Unknown], values: np.ndarray) -> Stretch:
    """A stretch with other values, its robot at rest where the encoders are without their bias."""
    loop = with_values(stretch.loop, unknowns, values)
    noise = loop.signals.noise
    start = stretch.q[0] - (0.0 if noise is None else np.asarray(noise)[0])
    return stretch.with_loop(replace(loop, start=(start, loop.begin[1])))


def _errors(
    stretches: Sequence[Stretch], unknowns: Sequence[Unknown], values: np.ndarray
) -> list[SimulatedErrors]:
    moved = [_moved(own, unknowns, values) for own in stretches]
    return simulated_errors(moved, unknowns, (POSITIONS,), [1] * len(moved))


def _scale(made: Sequence[SimulatedErrors]) -> np.ndarray:
    """Root mean square of each joint's error over the root of their number, (joints,)."""
    errors = np.concatenate([np.where(m.used, m.errors, 0.0)[0] for m in made], axis=1)
    return np.maximum(np.sqrt((errors**2).sum(axis=1) * len(errors)), 1e-300)


def _at(
    stretches: Sequence[Stretch],
    unknowns: Sequence[Unknown],
    values: np.ndarray,
    scale: np.ndarray,
) -> _Place:
    """Normal equations at some values."""
    gram, moment, cost = np.zeros((len(values),) * 2), np.zeros(len(values)), 0.0
    for made in _errors(stretches, unknowns, values):
        for j, own in enumerate(scale.tolist()):
            for rows, columns in made.columns.blocks(0, j):
                used = made.used[0, j, rows]
                e, columns = made.errors[0, j, rows][used] / own, columns[:, used] / own
                gram += columns @ columns.T
                moment += columns @ e
                cost += float(e @ e)
    return _Place(values, gram, moment, cost)


def searched(
    stretches: Sequence[Stretch], sought: Sequence[JointQuantity], say: Callable[[str], None]
) -> tuple[SimulationFit, np.ndarray]:
    """The fit of one branch, and what its values count from, shape (unknowns,).

    A fit that does not settle, or loses the motion, is begun anew from the next start; of several
    the one with the smallest errors is kept.

    Raises:
        SimulationDiverged: the loop is unstable from wherever the search starts; names the joint.
        RankDeficientRegressor: the record does not determine some quantities; names them.
    """
    unknowns = [own.unknown for own in sought]
    best: tuple[SimulationFit, np.ndarray] | None = None
    failure: IdentificationError | None = None
    tried = 0
    for begin in _starts(stretches, sought):
        try:
            near = approached(begin, unknowns, say)
            found = fit_simulation(near, unknowns, OPTIONS, say)
        except IdentificationError as error:
            failure = failure or error
            if isinstance(error, (SimulationDiverged, MassMatrixNotPositiveDefinite)):
                continue
        else:
            if is_lost(found):
                found = replace(found, converged=False)
            if found.converged:
                return found, _offsets(near[0], unknowns)
            if best is None or _size(found) < _size(best[0]):
                best = found, _offsets(near[0], unknowns)
        tried += 1
        if tried == MAX_TRIED:
            break
        say("did not settle; begun anew from another start")
    if best is None:
        assert failure is not None
        raise failure
    return best


def is_lost(fit: SimulationFit) -> bool:
    """Whether the simulation tells little of what the measured motion is beside its reference.

    Such a loop swings by itself, and the minimum that was found is one of many. Joints that were
    to stand still are left out.
    """
    squares, tracking, motion = [], [], []
    for own, errors in zip(fit.stretches, fit.errors, strict=True):
        compared = slice(own.first, own.samples)
        reference = own.loop.signals.q_ref[:: own.step][compared]
        squares.append(errors[POSITIONS][:, compared].T ** 2)
        tracking.append((own.q[compared] - reference) ** 2)
        motion.append((reference - reference.mean(axis=0)) ** 2)
    error, lag, size = (
        np.sqrt(np.concatenate(own).mean(axis=0)) for own in (squares, tracking, motion)
    )
    large = error > np.maximum(MAX_OF_TRACKING * lag, MAX_OF_MOTION * size)
    return bool((large & (size > 0.0)).any())


def _size(fit: SimulationFit) -> float:
    """Mean squares of the errors of all positions."""
    return float(np.sum(fit.rms[POSITIONS] ** 2))


@dataclass(frozen=True, eq=False)
class _Motion:
    """A record's smoothed motion, and what the law read."""

    stretch: Stretch
    q: np.ndarray  # that encoders show, shape (samples, joints) [rad or m]; likewise
    dq: np.ndarray
    ddq: np.ndarray
    read: np.ndarray  # at the rate of the law, shape (control samples, joints) [rad or m]

    @classmethod
    def of(cls, stretch: Stretch) -> _Motion:
        """Smooth the positions of a stretch, and interpolate them to the rate of its law."""
        smooth = smooth_channels(stretch.q, stretch.rate)
        logged = np.arange(stretch.samples) * stretch.step
        control = np.minimum(np.arange(len(stretch.loop.signals.q_ref)), logged[-1])
        read = cubic_spline(logged, smooth.q)(control)
        return cls(stretch, smooth.q, smooth.dq, smooth.ddq, read)

    def residual(
        self, unknowns: Sequence[Unknown], values: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Residuals r and torques τ of the compared samples, each (samples, joints) [N m or N]."""
        loop = with_values(self.stretch.loop, unknowns, values)
        signals = loop.signals
        bias = 0.0 if signals.noise is None else np.asarray(signals.noise)[0]
        tau = _law_torque(loop, self.read)
        late = signals.drive_delay * signals.rate + 0.5
        times = np.arange(len(self.q)) * self.stretch.step - late
        at = np.arange(len(tau))
        tau = np.stack([np.interp(times, at, own) for own in tau.T], axis=1)
        regressor = regressor_of(loop.robot, loop.parameters)
        model = regressor.torque(self.q - bias, self.dq, self.ddq, loop.theta)
        used = slice(self.stretch.first, None)
        return (tau - model)[used], tau[used]


def equation_start(stretches: Sequence[Stretch], unknowns: Sequence[Unknown]) -> np.ndarray:
    """Values of the unknowns, within their bounds, shape (unknowns,).

    ``stretches``: records beside loops with values from which the equations are solved; the law and
    what drives it are those of the loops.
    """
    from scipy.optimize import least_squares

    low, high = (np.array([getattr(u, side) for u in unknowns]) for side in ("low", "high"))
    motions = [_Motion.of(own) for own in stretches]
    begin = np.clip(values_of(stretches[0].loop, unknowns), low, high)
    torque = np.concatenate([own.residual(unknowns, begin)[1] for own in motions])
    scale = np.maximum(torque.std(axis=0), 1e-9 * max(torque.std(), 1e-300))
    reach = np.where(np.isfinite(high - low), 0.5 * (high - low), 1.0)
    size = np.where(begin != 0.0, np.abs(begin), reach) / (PRIOR * np.sqrt(torque.size))

    def equations(values: np.ndarray) -> np.ndarray:
        left = [own.residual(unknowns, values)[0] / scale for own in motions]
        return np.concatenate([*(own.ravel() for own in left), (values - begin) / size])

    found = least_squares(
        equations, begin, bounds=(low, high), x_scale="jac", ftol=DECREASE_OF_EQUATIONS,
        max_nfev=MAX_EVALUATIONS,
    )  # fmt: skip
    return np.clip(found.x, low, high)


def _law_torque(loop: ParametrisedLoop, read: np.ndarray) -> np.ndarray:
    """Torque that a loop's law commands where its encoders show ``read``, of its shape."""
    signals: LoopSignals = loop.signals
    added = np.zeros((1, loop.robot.size)) if signals.inputs is None else signals.inputs
    output = controller_outputs(
        loop.robot, loop.controller, read, signals.q_ref, signals.dq_ref,
        np.broadcast_to(added, read.shape), signals.limit, signals.rate,
    )  # fmt: skip
    return signals.drive_gain * output


def _starts(
    stretches: Sequence[Stretch], sought: Sequence[JointQuantity]
) -> Iterator[list[Stretch]]:
    """Records beside loops from which a search may start, the most promising first."""
    unknowns = [own.unknown for own in sought]
    yield _with(stretches, unknowns, equation_start(stretches, unknowns))
    heavy = [own.unknown for own in sought if own.quantity == "armature"]
    armature = values_of(stretches[0].loop, heavy)
    for factor in HEAVIER if heavy else HEAVIER[:1]:
        yield _with(stretches, heavy, factor * armature)


def _with(
    stretches: Sequence[Stretch], unknowns: Sequence[Unknown], values: np.ndarray
) -> list[Stretch]:
    """Stretches beside loops with other values."""
    return [own.with_loop(with_values(own.loop, unknowns, values)) for own in stretches]


def _offsets(stretch: Stretch, unknowns: Sequence[Unknown]) -> np.ndarray:
    """What the fit counts an unknown from: encoder offsets from those of the loop."""
    noise, offsets = stretch.loop.signals.noise, np.zeros(len(unknowns))
    for k, unknown in enumerate(unknowns):
        if unknown.direction.kind == "encoder_offset" and noise is not None:
            offsets[k] = noise[0, unknown.direction.joint]
    return offsets
