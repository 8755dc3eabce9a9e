"""Search for the coefficients of a motion: several random starts side by side, the best kept.

Each start descends by sequential quadratic programming (SciPy's SLSQP, Kraft 1988). It passes
through motions that break limits a little, so each one that it tries is a candidate only if no
sample breaks a limit, and the best candidate is kept: the search can be ended at any time. Where
limits bend (collisions do), a step may lead to where no linear model of them holds, and the program
ends there. It then begins anew at the best candidate, in a smaller box around it.

Random motions as large as the limits allow: starts of a search.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import Future, ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np
from scipy.optimize import minimize

from pivident.foundation.text.numbers import percent
from pivident.foundation.threads import linear_algebra_in_one_thread, thread_count
from pivident.studies.excitation.constraints import Constraints
from pivident.studies.excitation.criteria import Objective

#: Largest coefficient, over that with which its function alone reaches a limit.
FARTHEST = 3.0
#: Factor of the criterion: the first step goes along the gradient, whose size means nothing.
GAIN = 0.02
#: Iterations of one program, and the progress of the criterion at which it has ended.
MAX_ITERATIONS, PROGRESS = 400, 1e-5
#: Progress in a program that is worth another one in the same box; the factor and the least size of
#: a smaller one.
WORTH, SMALLER, SMALLEST = 0.02, 0.3, 0.02
#: Progress of the criterion, a logarithm of variances, after which a motion is remembered.
STEP = 0.1
#: Times that a random motion is made smaller until it keeps clear of what is around it, and how.
SHRINKINGS, SHRINKING = 14, 0.75
#: Share of a joint's range in which a random motion begins.
INNER_RANGE = 0.7
#: Further postures among which a free one is looked for if the first one is not, and their range.
FURTHER_POSTURES, WHOLE_RANGE = 200, 0.95


class _SearchEnded(Exception):
    """The time is over, or the user has seen enough."""


@dataclass(eq=False)
class Best:
    """The best motion so far, of all starts."""

    deadline: float  # by `time.perf_counter`
    value: float = np.inf  # smoothed criterion
    coefficients: np.ndarray | None = None
    first: float = np.inf  # criterion of the best random motion, before any descent
    first_coefficients: np.ndarray | None = None
    evaluations: int = 0
    #: Motions on the way, each better than the one before it by ``STEP``: one of them may keep a
    #: limit between the samples that the best one breaks there.
    earlier: list[np.ndarray] = field(default_factory=list)
    ended: threading.Event = field(default_factory=threading.Event)
    interrupted: bool = False  # by the user
    _listed: float = np.inf  # criterion of the last of them
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def is_over(self) -> bool:
        """Whether the search has to end."""
        return self.ended.is_set() or time.perf_counter() > self.deadline

    def offer(self, value: float, coefficients: np.ndarray, first: bool = False) -> None:
        """Keep a motion if it is better."""
        with self._lock:
            if first and value < self.first:
                self.first, self.first_coefficients = value, coefficients.copy()
            if value < self.value:
                if self.coefficients is None or value < self._listed - STEP:
                    self._listed = value
                    self.earlier.append(coefficients.copy())
                self.value, self.coefficients = value, coefficients.copy()


def coefficient_box(constraints: Constraints) -> tuple[np.ndarray, np.ndarray]:
    """Middle of each coefficient, and the size at which its function alone reaches a limit.

    In these units the search is well scaled, and steps that leave every limit far behind are not
    tried. Shapes (size, joints).
    """
    limits = constraints.limits
    largest = np.abs(constraints.functions[:3]).max(axis=1)
    with np.errstate(divide="ignore"):
        sizes = [
            limit / size[:, None]
            for limit, size in zip(
                (limits.half, limits.speed, limits.acceleration), largest, strict=True
            )
        ]
    middle = np.zeros_like(sizes[0])
    middle[0] = limits.middle
    return middle, np.min(sizes, axis=0)


def random_coefficients(
    constraints: Constraints, rng: np.random.Generator, home: np.ndarray | None
) -> np.ndarray | None:
    """A random motion as large as the limits allow; None where even a small one breaks them.

    It is made smaller about its posture at the ends until it keeps all limits.
    """
    _, scale = coefficient_box(constraints)
    drawn = scale * rng.uniform(-1.0, 1.0, scale.shape)
    posture = _free_posture(constraints, rng) if home is None else home
    if not _keeps(constraints, np.vstack([posture, np.zeros_like(drawn[1:])])):
        return None
    drawn[1:] *= _kinematic_scale(constraints, drawn, posture)
    drawn[0] = posture
    for _ in range(SHRINKINGS):
        if _keeps(constraints, drawn):
            return drawn
        drawn[1:] *= SHRINKING
    return None


def _free_posture(constraints: Constraints, rng: np.random.Generator) -> np.ndarray:
    """A random posture, clear of everything if one of some hundred is."""
    limits, clearances = constraints.limits, constraints.clearances

    def drawn(count: int, within: float) -> np.ndarray:
        share = rng.uniform(-within, within, (count, limits.half.size))
        return limits.middle + share * limits.half

    def is_free(postures: np.ndarray) -> np.ndarray:
        assert clearances is not None
        return ~np.any(clearances.distances(postures) < clearances.needed[:, None], axis=0)

    (first,) = drawn(1, INNER_RANGE)
    if clearances is None or is_free(first[None])[0]:
        return first
    others = drawn(FURTHER_POSTURES, WHOLE_RANGE)
    return others[int(np.argmax(is_free(others)))]


def _keeps(constraints: Constraints, coefficients: np.ndarray) -> bool:
    return constraints.largest_ratio(coefficients) <= 1.0


def _kinematic_scale(
    constraints: Constraints, drawn: np.ndarray, posture: np.ndarray
) -> np.ndarray:
    """Factor of each joint with which its motion just keeps the limits that it has alone."""
    limits = constraints.limits
    ways = drawn.copy()
    ways[0] = 0.0
    used = np.abs(constraints.motion(ways)).max(axis=1)
    room = np.minimum(limits.high - posture, posture - limits.low)
    allowed = np.array([room, limits.speed, limits.acceleration, limits.jerk])
    return 0.98 * (allowed / np.maximum(used, 1e-12)).min(axis=0)


@dataclass(eq=False)
class Descent:
    """A descent in scaled coefficients z, x = middle + z · scale."""

    objective: Objective
    best: Best
    fixed: np.ndarray  # coefficients at the start, shape (size, joints)
    free: slice  # those of the flat coefficients that the search may change
    middle: np.ndarray
    scale: np.ndarray
    own: float  # criterion of the best candidate of this start
    z: np.ndarray  # and its scaled coefficients
    _kept: dict[str, tuple[bytes, tuple]] = field(default_factory=dict)

    @classmethod
    def of(cls, objective: Objective, start: np.ndarray, at_home: bool, best: Best) -> Descent:
        """A descent from coefficients; ``at_home``: the posture at both ends stays."""
        middle, scale = (x.ravel() for x in coefficient_box(objective.constraints))
        free = slice(start.shape[1] if at_home else 0, None)
        middle, scale = middle[free], scale[free]
        z = np.clip((start.ravel()[free] - middle) / scale, -FARTHEST, FARTHEST)
        made = cls(objective, best, start, free, middle, scale, np.inf, z)
        value = objective.value(made.unpacked(z))
        made.own = value if np.isfinite(value) else np.inf
        return made

    def unpacked(self, z: np.ndarray) -> np.ndarray:
        """Coefficients, shape (size, joints), of scaled ones."""
        x = self.fixed.ravel().copy()
        x[self.free] = self.middle + z * self.scale
        return x.reshape(self.fixed.shape)

    def run(self) -> None:
        """One program after the other, until nothing gets better or the search has to end."""
        box = 2.0 * FARTHEST
        try:
            while box > SMALLEST:
                before = self.own
                self._program(box)
                if not self.own < before - WORTH:
                    box = SMALLER * min(box, 1.0)
        except _SearchEnded:
            return

    def _program(self, box: float) -> None:
        """SLSQP from the best candidate, in a box around it."""
        low = np.maximum(self.z - box, -FARTHEST)
        high = np.minimum(self.z + box, FARTHEST)
        minimize(
            self._cost,
            self.z,
            jac=True,
            method="SLSQP",
            bounds=np.column_stack([low, high]),
            constraints={"type": "ineq", "fun": self._room, "jac": self._room_slope},
            options={"maxiter": MAX_ITERATIONS, "ftol": GAIN * PROGRESS},
        )

    def _remembered(
        self, kind: str, z: np.ndarray, compute: Callable[[np.ndarray], tuple]
    ) -> tuple:
        """A result at z, which SLSQP asks for in two calls."""
        if self.best.is_over:
            raise _SearchEnded
        key = z.tobytes()
        if kind not in self._kept or self._kept[kind][0] != key:
            self._kept[kind] = (key, compute(self.unpacked(z)))
        return self._kept[kind][1]

    def _cost(self, z: np.ndarray) -> tuple[float, np.ndarray]:
        """The criterion and its gradient; a motion without information costs more than any."""
        value, gradient = self._remembered("cost", z, self.objective.value_and_gradient)
        self.best.evaluations += 1
        if not np.isfinite(value):
            return GAIN * 1e4, np.zeros(z.size)
        if value < self.own and self.objective.constraints.largest_ratio(self.unpacked(z)) <= 1.0:
            self.own, self.z = value, z.copy()
            self.best.offer(value, self.unpacked(z))
        return GAIN * value, GAIN * gradient.ravel()[self.free] * self.scale

    def _room(self, z: np.ndarray) -> np.ndarray:
        """What is left of each limit, as a share of it."""
        ratios, _ = self._limits(z)
        return 1.0 - ratios

    def _room_slope(self, z: np.ndarray) -> np.ndarray:
        _, gradients = self._limits(z)
        return -gradients.reshape(len(gradients), -1)[:, self.free] * self.scale

    def _limits(self, z: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
        compute = self.objective.constraints.ratios_and_gradients
        ratios, gradients = self._remembered("limits", z, compute)
        return ratios, gradients


#: Random motions of which the best begins a search.
DRAWS = 16
#: Share by which standard errors must have fallen, and seconds passed, for another line.
REPORTED_SHARE, REPORTED_SECONDS = 0.95, 2.0


@dataclass(frozen=True, eq=False)
class Search:
    """A search with several starts side by side."""

    objective: Objective
    home: np.ndarray | None  # posture at both ends; None: free
    seed: int
    seconds: float
    say: Callable[[str], None]

    def run(self, first: np.ndarray | None = None) -> Best:
        """Search until the time is over; an interruption ends it with the best so far.

        ``first``: coefficients of a motion to begin with, shape (size, joints).
        """
        best, workers = Best(time.perf_counter() + self.seconds), thread_count()
        # threads of this name do not share their work with others: each has a start of its own
        threads = ThreadPoolExecutor(workers + 1, thread_name_prefix="pivident-search")
        with linear_algebra_in_one_thread(), threads as pool:
            jobs: list[Future[None]] = []
            try:
                pool.submit(self._report, best)
                jobs += [
                    pool.submit(self._starts, worker, workers, first, best)
                    for worker in range(workers)
                ]
                for job in jobs:
                    job.result()
            except KeyboardInterrupt:
                self.say("interrupted: the best motion so far is kept")
                best.interrupted = True
                best.ended.set()
                for job in jobs:
                    job.result()
            finally:  # the pool waits for its threads, and they for this
                best.ended.set()
        return best

    def _starts(self, worker: int, workers: int, first: np.ndarray | None, best: Best) -> None:
        """One start after the other until the time is over."""
        number = worker
        while not best.is_over:
            start = first if number == 0 and first is not None else self._random(number, best)
            if start is not None:
                Descent.of(self.objective, start, self.home is not None, best).run()
            number += workers

    def _random(self, number: int, best: Best) -> np.ndarray | None:
        """The best of some random motions as large as the limits allow; None if none is allowed."""
        rng = np.random.default_rng([self.seed, number])
        chosen, least = None, np.inf
        for _ in range(DRAWS):
            drawn = random_coefficients(self.objective.constraints, rng, self.home)
            if best.is_over:
                break
            if drawn is None:
                continue
            value = self.objective.value(drawn)
            if value < least or chosen is None:
                chosen, least = drawn, value
        if chosen is not None and np.isfinite(least):
            best.offer(least, chosen, first=True)
        return chosen

    def _report(self, best: Best) -> None:
        """Progress, now and then."""
        reported = 1.0
        while not best.ended.wait(REPORTED_SECONDS) and not best.is_over:
            if not np.isfinite(best.first):
                continue
            share = float(np.exp(0.5 * (best.value - best.first)))
            if share < REPORTED_SHARE * reported:
                reported = share
                cond = self.objective.criterion.name == "cond"
                whose = "the condition number is" if cond else "standard errors are"
                self.say(
                    f"{whose} down to {percent(100 * share)} of the best random motion's "
                    f"({best.evaluations} motions tried)"
                )
