"""First steps of a fit, from where the search starts to near the minimum.

    (H + μ diag H) δ = g,    H = Σ JᵀJ/s²,   g = Σ Jᵀe/s²        (Levenberg 1944, Marquardt 1963)

with the scale s of each joint's error fixed at the start. The fit proper makes its weights from the
errors that a step leaves, which is right close to the minimum; far away such weights change from
pass to pass, and steps that one of them promises another refuses.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.errors import MassMatrixNotPositiveDefinite, SimulationDiverged
from pivident.estimation.output_error.simulated_errors import (
    POSITIONS,
    SimulatedErrors,
    simulated_errors,
)
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.unknowns import Unknown, values_of, with_values

#: Damping μ of the first step, and its factor after a good and after a bad one.
DAMPING, EASIER, HARDER = 1e-2, 0.1, 10.0

#: Least relative decrease of the squared errors that makes a further step worth its simulation.
DECREASE = 0.05

#: Steps at most, and bad ones in a row.
MAX_STEPS, MAX_REFUSED = 25, 6


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
