"""The equations of a control law: one column for each term, for a given differentiator.

    u = kp e - kd D q + [kv_ref D q_ref] + [ki ∫e] + [ka_ref D D q_ref] + [offset],   e = q_ref - q

and, of a law that compensates gravity, [g(q)] or [g(q_ref)], one column for each parameter of its
gravity model (``law_gravity``). They are linear in the gains. Their QR factors are formed once per
differentiator; every choice of columns is then a small problem on the triangle.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from pivident.data.recording.checks import clipped_samples
from pivident.data.recording.recording import Recording
from pivident.foundation.distributions import fisher
from pivident.loop.simulation.linear_law import differentiated, reference_derivatives

Term = Literal[
    "kp", "kd", "speed_reference", "ki", "acceleration_reference", "offset",
    "position_gain", "speed_gain", "integral_gain", "delay",
]  # fmt: skip

#: Terms of every law, and those that must earn their place.
ALWAYS: tuple[Term, ...] = ("kp", "kd")
EXTRA: tuple[Term, ...] = ("speed_reference", "ki", "acceleration_reference", "offset")
TERMS = ALWAYS + EXTRA

#: A column of the equations: that of a term, or, by its number, one of the law's gravity model.
Column = Term | int

#: What a drive that follows a speed setpoint has instead (``speed_setpoint``).
SETPOINT: tuple[Term, ...] = ("position_gain", "speed_gain", "integral_gain", "delay")

#: Probability of the F-test's bound, and the share of the residual that a term must take: with
#: tens of thousands of samples everything is significant.
F_PROBABILITY = 0.999
WORTHWHILE = 0.01

#: Residual relative to the output, squared, that is rounding: nothing follows from it.
ROUNDING = 1e-20

#: Lags T searched, in sampling periods.
LAGS = (0.1, 0.3, 1.0, 3.0, 10.0, 30.0)

#: Samples at the start that a differentiator needs, samples until one with the longest lag has
#: forgotten its start, and the largest share of a record that may be given for it.
START = 3
FORGOTTEN = 1200
MAX_START = 0.05


@dataclass(frozen=True, eq=False)
class Channel:
    """One joint of one recording: output, reference and positions, and which samples count.

    ``gravity`` holds the columns of its law's gravity model, shape (samples, parameters).
    """

    u: np.ndarray
    q: np.ndarray
    q_ref: np.ndarray
    dq_ref: np.ndarray | None
    rate: float
    use: np.ndarray
    saturated: int
    gravity: np.ndarray = field(default_factory=lambda: np.zeros((0, 0)))


def channel_of(recording: Recording, j: int, gain: float, limit: float) -> Channel:
    """One joint's signals; the output is the torque over the gain, less the known inputs."""
    total = recording.tau[:, j] / gain
    inputs = sum((x[:, j] for x in recording.inputs.values()), np.zeros(recording.samples))
    use = (np.abs(total) < limit * (1.0 - 1e-9)) & ~clipped_samples(
        recording.tau[:, j], recording.q[:, j]
    )
    saturated = int((~use).sum())
    use[: max(START, min(FORGOTTEN, int(MAX_START * use.size)))] = False
    assert recording.q_ref is not None
    dq_ref = None if recording.dq_ref is None else recording.dq_ref[:, j]
    return Channel(
        total - inputs,
        recording.q[:, j],
        recording.q_ref[:, j],
        dq_ref,
        recording.rate,
        use,
        saturated,
    )


@dataclass(frozen=True, eq=False)
class Equations:
    """All columns and the output for one differentiator, as the triangle of their QR factors."""

    time: float  # lag T [s]
    averaged: bool  # whether two-sample means are differenced
    triangle: np.ndarray  # R of (columns of unit length, output), shape (columns + 1, columns + 1)
    scale: np.ndarray  # length of each column
    rows: int  # number of equations

    @classmethod
    def build(cls, channels: Sequence[Channel], time: float, averaged: bool) -> Equations:
        """Form the columns and factor them."""
        every = (*TERMS, *range(channels[0].gravity.shape[1]))
        phi, u = system_of(channels, every, time, averaged)
        scale = np.sqrt(np.sum(phi**2, axis=0))
        scale[scale == 0.0] = 1.0
        triangle = np.asarray(np.linalg.qr(np.column_stack([phi / scale, u]), mode="r"))
        return cls(time, averaged, triangle, scale, u.size)

    @property
    def total(self) -> float:
        """Sum of squares of the output."""
        return float(np.sum(self.triangle[:, -1] ** 2))

    def fit(self, chosen: Sequence[Column]) -> tuple[np.ndarray, float]:
        """Gains of some columns and the residual sum of squares."""
        columns = [len(TERMS) + c if isinstance(c, int) else TERMS.index(c) for c in chosen]
        phi, u = self.triangle[:, columns], self.triangle[:, -1]
        gains = np.linalg.lstsq(phi, u, rcond=1e-13)[0]
        return gains / self.scale[columns], float(np.sum((u - phi @ gains) ** 2))


def select_terms(
    equations: Equations,
    wanted: Sequence[Term] | None,
    begin: tuple[Column, ...] = ALWAYS,
) -> tuple[tuple[Column, ...], dict[str, float]]:
    """Columns of the law by forward selection, and the F statistic of each extra term."""
    if wanted is not None:
        return tuple(wanted), {}
    terms = begin
    tests: dict[str, float] = {}
    left = list(EXTRA)
    rss = equations.fit(terms)[1]
    while left:
        trials = {t: equations.fit((*terms, t))[1] for t in left}
        freedom = equations.rows - len(terms) - 1
        tests |= {t: (rss - own) / max(own / freedom, 1e-300) for t, own in trials.items()}
        best = min(trials, key=lambda t: trials[t])
        gained = rss - trials[best] > WORTHWHILE * rss and rss > ROUNDING * equations.total
        if not gained or tests[best] < fisher.ppf(F_PROBABILITY, 1, freedom):
            break
        terms, rss = (*terms, best), trials[best]
        left.remove(best)
    return terms, tests


def best_equations(
    channels: Sequence[Channel],
    begin: tuple[Column, ...] = ALWAYS,
    wanted: Sequence[Term] | None = None,
) -> tuple[Equations, tuple[Column, ...], dict[str, float]]:
    """Equations for the best differentiator, their columns and the F statistics of extra terms.

    ``wanted``: terms of the law; None: those of ``begin``, and others that an F-test wants.
    """
    candidates = [Equations.build(channels, 0.0, True), Equations.build(channels, 0.0, False)]
    terms, _ = select_terms(candidates[1], wanted, begin)
    lag = best_lag(channels, terms)
    if lag is not None:
        candidates.append(lag)
    chosen = [(equations, *select_terms(equations, wanted, begin)) for equations in candidates]
    best = min(chosen, key=lambda c: c[0].fit(c[1])[1])
    plain = chosen[1]  # the backward difference, where nothing is better
    if best[0].fit(best[1])[1] * (1.0 + WORTHWHILE) > plain[0].fit(plain[1])[1]:
        return plain
    return best


def best_lag(channels: Sequence[Channel], terms: Sequence[Column]) -> Equations | None:
    """Equations of the lag T with the smallest residual; None where no lag is better than none."""
    from scipy.optimize import minimize_scalar

    h = 1.0 / channels[0].rate

    def cost(log_lag: float) -> float:
        return Equations.build(channels, h * float(np.exp(log_lag)), False).fit(terms)[1]

    grid = [cost(np.log(lag)) for lag in LAGS]
    best = int(np.argmin(grid))
    bounds = np.log(LAGS[max(best - 1, 0)]), np.log(LAGS[min(best + 1, len(LAGS) - 1)])
    if Equations.build(channels, 0.0, False).fit(terms)[1] <= grid[best] and best == 0:
        return None
    found = minimize_scalar(cost, bounds=bounds, method="bounded", options={"xatol": 1e-7})
    return Equations.build(channels, h * float(np.exp(found.x)), False)


def column_of(channel: Channel, term: Column, time: float, averaged: bool) -> np.ndarray:
    """What a gain multiplies, shape (samples,)."""
    c = channel
    if isinstance(term, int):
        return c.gravity[:, term]
    if term == "kp":
        return c.q_ref - c.q
    if term == "kd":
        return -differentiated(c.q, time, averaged, c.rate)
    if term == "ki":
        return np.cumsum(c.q_ref - c.q) / c.rate
    if term == "offset":
        return np.ones(c.q.size)
    speed, acceleration = reference_derivatives(c.q_ref, c.dq_ref, time, averaged, c.rate)
    return speed if term == "speed_reference" else acceleration


def system_of(
    channels: Sequence[Channel], terms: Sequence[Column], time: float, averaged: bool
) -> tuple[np.ndarray, np.ndarray]:
    """Columns and output on the samples that count."""
    phi = [
        np.stack([column_of(c, t, time, averaged)[c.use] for t in terms], axis=1) for c in channels
    ]
    return np.concatenate(phi), np.concatenate([c.u[c.use] for c in channels])
