"""What encoder noise in the loop does to the mean motion: friction is no straight line.

The law answers to the noise n of its encoders, and the robot shakes. To first order the shaking has
no mean; to second order it has one, since E[f(dq + v)] ≠ f(dq): near reversals dry friction seems
smaller. A simulation without noise lacks that, and precise estimates of friction would be biased by
several standard errors. The mean comes from simulations with noise of the same size and of both
signs,

    Δy = ½ (y_s(n) + y_s(-n)) - y_s(0)

in which the first order cancels exactly, so that a few pairs suffice.

How large the noise is, the record says. With C the law, e_q and e_τ the simulation errors of
positions and torques at high frequencies, where the loop does not act,

    e_q = n,   e_τ = -C n,   σ² = -cov(e_τ, C e_q)/‖C‖²

A log that was rounded after the loop had run, or a noisy torque sensor, leave the covariance as it
is. Where it is lost in them, σ is at most what positions alone and torques alone show.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import pairwise

import numpy as np

from pivident.estimation.output_error.record_stretches import Stretch
from pivident.estimation.output_error.thinning import POSITIONS, TORQUES, Thinning
from pivident.foundation.scratch import working_array
from pivident.foundation.threads import run_in_threads
from pivident.loop.simulation.closed_loop import BLOCK, simulate_blocks
from pivident.loop.simulation.controllers import PythonController
from pivident.loop.simulation.direction import ParametrisedLoop
from pivident.loop.simulation.loop_kernel import TORQUE

#: Pairs of simulations with noise of both signs.
PAIRS = 4

#: Correlation of both errors, in standard errors of none, from which on the covariance counts.
SIGNIFICANT = 5.0

#: Parts of a record whose means are compared.
PARTS = 21

#: Channels of a simulated motion that are compared.
SIMULATED = {POSITIONS: 0, TORQUES: TORQUE}

#: Samples of the law's response that its gain for white noise is summed over.
RESPONSE = 2000


def loop_noise(stretch: Stretch) -> np.ndarray:
    """Standard deviation of the noise in what the law reads, shape (joints,) [rad or m].

    Zero where no torque was logged at each sample of the loop, and for a law in Python.
    """
    from scipy.signal import lfilter

    loop, n = stretch.loop, stretch.loop.robot.size
    signals = loop.signals
    if stretch.tau is None or stretch.step != 1 or isinstance(loop.controller, PythonController):
        return np.zeros(n)
    law = loop.controller.law(float(signals.rate), signals.q_ref, signals.dq_ref)
    late = int(np.ceil(float(signals.drive_delay) * float(signals.rate) - 1e-9)) + stretch.tau_late
    impulse, out = np.zeros(RESPONSE), np.zeros(n)
    impulse[0] = 1.0
    states = [np.zeros(law.feedback.shape[1] - 1) for _ in range(n)]
    means = _MeansOfParts(_logged(stretch) - late - 1, n)
    for q, tau in _differences(stretch, late):
        through = np.empty_like(q)
        for j in range(n):
            filtered, states[j] = lfilter(law.feedback[j], law.pole[j], q[:, j], zi=states[j])
            through[:, j] = signals.drive_gain[j] * filtered
        means.add(np.stack([through * tau, through**2, tau**2, q**2], axis=1))
    of_both, of_through, of_torque, of_position = means.medians()
    for j in range(n):
        response = signals.drive_gain[j] * lfilter(law.feedback[j], law.pole[j], impulse)
        gain = float(np.sum(np.diff(response, prepend=0.0) ** 2))
        if gain == 0.0:
            continue
        by_both, by_torque = -of_both[j] / gain, of_torque[j] / gain
        size = np.sqrt(of_through[j] * of_torque[j])
        seen = -of_both[j] * np.sqrt(means.samples) > SIGNIFICANT * size
        out[j] = np.sqrt(by_both if seen else min(by_torque, 0.5 * of_position[j]))
    return out


def _logged(stretch: Stretch) -> int:
    """Samples of the loop that were logged."""
    return min(stretch.samples, len(stretch.loop.signals.q_ref))


def _differences(stretch: Stretch, late: int) -> Iterator[tuple[np.ndarray, np.ndarray]]:
    """Differences of e_q and of e_τ from one instant to the next at which a torque was logged.

    Block by block, shape (samples, joints); ``late``: samples that a torque was logged before it
    acts.
    """
    n, samples = stretch.loop.robot.size, _logged(stretch)
    positions, torques = np.empty((0, n)), np.empty((0, n))  # whose partner is still to come
    assert stretch.tau is not None
    for span, made in _blocks(stretch.loop, BLOCK):
        logged = slice(span.start, min(span.stop, samples))
        q, tau = (made[SIMULATED[c]][: logged.stop - logged.start] for c in (POSITIONS, TORQUES))
        positions = np.concatenate([positions, stretch.q[logged] - q])
        acts = slice(max(logged.start, late), max(logged.stop, late))
        tau = tau[acts.start - span.start : acts.stop - span.start]
        before = slice(acts.start - late, acts.stop - late)
        torques = np.concatenate([torques, stretch.tau[before] - tau])
        if len(torques) > 1:
            yield np.diff(positions[: len(torques)], axis=0), np.diff(torques, axis=0)
            positions, torques = positions[len(torques) - 1 :], torques[-1:]
        if logged.stop == samples:
            return


class _MeansOfParts:
    """Means over parts of a record, whose median bursts do not count in."""

    def __init__(self, samples: int, joints: int) -> None:
        self.samples, self._done = samples, 0
        lengths = [len(part) for part in np.array_split(np.arange(samples), PARTS)]
        self._edges, self._lengths = np.cumsum([0, *lengths]), np.maximum(lengths, 1)
        self._sums = np.zeros((PARTS, 4, joints))

    def add(self, signals: np.ndarray) -> None:
        """The next samples, shape (samples, 4, joints)."""
        end = self._done + len(signals)
        for part, (first, last) in enumerate(pairwise(self._edges.tolist())):
            own = slice(max(first, self._done), min(last, end))
            if own.start < own.stop:
                here = slice(own.start - self._done, own.stop - self._done)
                self._sums[part] += signals[here].sum(axis=0)
        self._done = end

    def medians(self) -> np.ndarray:
        """Median of the parts' means, shape (4, joints)."""
        return np.median(self._sums / self._lengths[:, None, None], axis=0)


def shaking(
    stretches: Sequence[Stretch],
    noise: Sequence[np.ndarray],
    channels: Sequence[int],
    factors: Sequence[int],
) -> list[np.ndarray]:
    """Δy of each stretch, thinned, shape (channels, joints, rows).

    ``noise``: its standard deviation in each stretch's loop, shape (joints,).
    """
    motions: dict[tuple[int, float], np.ndarray] = {}

    def work(task: tuple[int, int, float]) -> None:
        k, pair, sign = task
        loop = stretches[k].loop
        if sign:
            shaken = working_array(np.shape(loop.signals.q_ref))
            np.random.default_rng([pair, k]).standard_normal(out=shaken)
            shaken *= sign * noise[k]
            shaken += 0.0 if loop.signals.noise is None else loop.signals.noise
            loop = replace(loop, signals=replace(loop.signals, noise=shaken))
        motions[k, sign] = _thinned(stretches[k], loop, channels, factors[k])

    noisy = [k for k in range(len(stretches)) if noise[k].any()]
    out = [
        np.zeros((len(channels), own.loop.robot.size, Thinning(factor).rows(own.samples)))
        for own, factor in zip(stretches, factors, strict=True)
    ]
    for pair in range(PAIRS):  # one after the other: motions are as long as the record
        run_in_threads(work, [(k, pair, sign) for k in noisy for sign in (1.0, -1.0)])
        for k in noisy:
            out[k] += motions.pop((k, 1.0))
            out[k] += motions.pop((k, -1.0))
    run_in_threads(work, [(k, 0, 0.0) for k in noisy])
    for k in noisy:
        out[k] /= 2.0 * PAIRS
        out[k] -= motions.pop((k, 0.0))
    return out


def _thinned(
    stretch: Stretch, loop: ParametrisedLoop, channels: Sequence[int], factor: int
) -> np.ndarray:
    """The compared channels of a simulated motion, thinned, shape (channels, joints, rows)."""
    thinning, step, done = Thinning(factor), stretch.step, 0
    out = np.empty((len(channels), loop.robot.size, thinning.rows(stretch.samples)))
    whole, width = stretch.samples // factor * factor, step * factor
    which = [SIMULATED[c] for c in channels]
    for span, made in _blocks(loop, max(1, round(BLOCK / width)) * width):
        first = span.start // step
        if first >= whole:
            break
        own = made[which, ::step][:, : whole - first]
        thin = thinning.process(np.ascontiguousarray(own.transpose(1, 0, 2)))
        out[:, :, done : done + len(thin)] = thin.transpose(1, 2, 0)
        done += len(thin)
    return out


def _blocks(loop: ParametrisedLoop, block: int) -> Iterator[tuple[slice, np.ndarray]]:
    """The channels of a loop's motion, (channels, stretch, joints), without tangents."""
    names = loop.robot.joint_names
    blocks = simulate_blocks(
        loop.model, loop.controller, loop.signals, names, loop.begin, None, block
    )
    for span, channels, _ in blocks:
        yield span, channels
