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

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from pivident.estimation.output_error.simulated_errors import POSITIONS
from pivident.estimation.output_error.stretch import Stretch
from pivident.estimation.output_error.thinning import means_at
from pivident.simulation.closed_loop import Trajectory, simulate
from pivident.simulation.controllers import PythonController
from pivident.simulation.direction import ParametrisedLoop
from pivident.threads import run_in_threads

#: Pairs of simulations with noise of both signs.
PAIRS = 4

#: Correlation of both errors, in standard errors of none, from which on the covariance counts.
SIGNIFICANT = 5.0

#: Parts of a record whose means are compared.
PARTS = 21

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
    made = _simulated(loop)
    law = loop.controller.law(float(signals.rate), signals.q_ref, signals.dq_ref)
    late = int(np.ceil(float(signals.drive_delay) * float(signals.rate) - 1e-9)) + stretch.tau_late
    samples = min(len(stretch.q), len(made.q))
    q = np.diff(stretch.q[:samples] - made.q[:samples], axis=0)
    tau = np.diff(stretch.tau[: samples - late] - made.tau[late:samples], axis=0)
    q = q[: len(tau)]
    out = np.zeros(n)
    impulse = np.zeros(RESPONSE)
    impulse[0] = 1.0
    for j in range(n):
        through = signals.drive_gain[j] * lfilter(law.feedback[j], law.pole[j], q[:, j])
        response = signals.drive_gain[j] * lfilter(law.feedback[j], law.pole[j], impulse)
        gain = float(np.sum(np.diff(response, prepend=0.0) ** 2))
        if gain == 0.0:
            continue
        by_both = -_mean(through * tau[:, j]) / gain
        by_torque = _mean(tau[:, j] ** 2) / gain
        by_position = 0.5 * _mean(q[:, j] ** 2)
        size = np.sqrt(_mean(through**2) * _mean(tau[:, j] ** 2))
        seen = by_both * gain * np.sqrt(len(tau)) > SIGNIFICANT * size
        out[j] = np.sqrt(by_both if seen else min(by_torque, by_position))
    return out


def _mean(x: np.ndarray) -> float:
    """The mean, as the median of those of parts of the record: bursts do not count."""
    return float(np.median([part.mean() for part in np.array_split(x, PARTS)]))


def shaking(
    stretches: Sequence[Stretch],
    noise: Sequence[np.ndarray],
    channels: Sequence[int],
    factors: Sequence[int],
) -> list[np.ndarray]:
    """Δy of each stretch, thinned, shape (channels, joints, rows).

    ``noise``: its standard deviation in each stretch's loop, shape (joints,).
    """
    base: list[Trajectory | None] = [None] * len(stretches)
    sums: dict[tuple[int, int, float], list[np.ndarray]] = {}

    def work(task: tuple[int, int, float]) -> None:
        k, pair, sign = task
        loop = stretches[k].loop
        if sign == 0.0:
            base[k] = _simulated(loop)
            return
        rng = np.random.default_rng([pair, k])
        n = rng.standard_normal(np.shape(loop.signals.q_ref)) * noise[k]
        before = 0.0 if loop.signals.noise is None else loop.signals.noise
        signals = replace(loop.signals, noise=before + sign * n)
        sums[task] = _channels(_simulated(replace(loop, signals=signals)), channels)

    shaken = [k for k in range(len(stretches)) if noise[k].any()]
    run_in_threads(
        work,
        [(k, 0, 0.0) for k in shaken]
        + [(k, pair, sign) for k in shaken for pair in range(PAIRS) for sign in (1.0, -1.0)],
    )
    out = []
    for k, stretch in enumerate(stretches):
        thin = len(means_at(stretch.moving, factors[k]))
        if k not in shaken:
            out.append(np.zeros((len(channels), stretch.loop.robot.size, thin)))
            continue
        own = base[k]
        assert own is not None
        means = []
        for c, still in enumerate(_channels(own, channels)):
            total = sum(sums[task][c] for task in sorted(sums) if task[0] == k)
            mean = total / (2.0 * PAIRS) - still
            means.append(means_at(mean[:: stretch.step][: stretch.samples], factors[k]).T)
        out.append(np.stack(means))
    return out


def _channels(made: Trajectory, channels: Sequence[int]) -> list[np.ndarray]:
    """The compared channels of a simulated motion, each (samples, joints)."""
    return [made.q if c == POSITIONS else made.tau for c in channels]


def _simulated(loop: ParametrisedLoop) -> Trajectory:
    """The motion of a loop, without tangents."""
    names = loop.robot.joint_names
    return simulate(loop.model, loop.controller, loop.signals, names, loop.begin)
