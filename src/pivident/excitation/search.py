"""Search for the coefficients of a motion: several starts, exact gradients, the best kept.

Sequential quadratic programming (SciPy's SLSQP, Kraft 1988) makes the criterion small under the
constraints. It passes through motions that break them a little, so each one that it tries is a
candidate only if no sample breaks a limit, and the best candidate of all is kept: the search can be
ended at any time.
"""

from __future__ import annotations

import threading
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field

import numpy as np

from pivident.dynamics.regressor_derivatives import RegressorDerivatives
from pivident.excitation.constraints import Constraints
from pivident.excitation.criteria import Criterion
from pivident.excitation.information import Information
from pivident.threads import linear_algebra_in_one_thread, thread_count

#: Iterations of one start, and the relative progress at which it has ended.
MAX_ITERATIONS, PROGRESS = 400, 1e-5

#: Random motions of which the best begins a search.
DRAWS = 16

#: Largest coefficient, over that with which its function alone reaches a limit.
FARTHEST = 4.0

#: Halvings of a random motion's size until it keeps clear of what is around it.
HALVINGS = 8


class SearchEnded(Exception):
    """The time is over, or the user has seen enough."""


@dataclass(frozen=True, eq=False)
class Objective:
    """A criterion of the information of a motion, by its coefficients."""

    criterion: Criterion
    information: Information
    constraints: Constraints  # of the same samples

    def value(self, coefficients: np.ndarray) -> float:
        """The smoothed criterion."""
        motion = self.constraints.motion(coefficients)
        found = self.information.of((motion[0], motion[1], motion[2]))
        return self.criterion.value_and_slope(found)[0]

    def value_and_gradient(self, coefficients: np.ndarray) -> tuple[float, np.ndarray]:
        """The smoothed criterion and its gradient, shape (size, joints)."""
        moved = self.constraints.motion(coefficients)
        motion = (moved[0], moved[1], moved[2])
        found, rows = self.information.with_rows(motion)
        value, slope = self.criterion.value_and_slope(found)
        weights = self.information.row_weights(motion, rows, slope)
        by_motion = self.derivatives.weighted(*motion, weights).sum(axis=1)
        gradient = sum(
            self.constraints.functions[quantity].T @ by_motion[..., quantity]
            for quantity in range(3)
        )
        return value, gradient

    @property
    def derivatives(self) -> RegressorDerivatives:
        """Derivatives of the observation matrix."""
        return RegressorDerivatives.of(self.information.regressor)


@dataclass(eq=False)
class Best:
    """The best motion so far, of all starts."""

    value: float = np.inf
    coefficients: np.ndarray | None = None
    first: float = np.inf  # criterion of the best random motion, before the search
    first_coefficients: np.ndarray | None = None
    evaluations: int = 0
    _lock: threading.Lock = field(default_factory=threading.Lock)

    def offer(self, value: float, coefficients: np.ndarray, first: bool = False) -> bool:
        """Keep a motion if it is better; whether it was."""
        with self._lock:
            if first and value < self.first:
                self.first, self.first_coefficients = value, coefficients.copy()
            better = value < self.value
            if better:
                self.value, self.coefficients = value, coefficients.copy()
        return better


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
        best, stop = Best(), threading.Event()
        deadline = time.perf_counter() + self.seconds
        workers = thread_count()
        with linear_algebra_in_one_thread(), ThreadPoolExecutor(workers) as pool:
            jobs = [
                pool.submit(self._starts, worker, workers, first, best, stop, deadline)
                for worker in range(workers)
            ]
            try:
                for job in jobs:
                    job.result()
            except KeyboardInterrupt:
                self.say("interrupted: the best motion so far is kept")
                stop.set()
                for job in jobs:
                    job.result()
            finally:
                stop.set()
        return best

    def _starts(
        self,
        worker: int,
        workers: int,
        first: np.ndarray | None,
        best: Best,
        stop: threading.Event,
        deadline: float,
    ) -> None:
        """One start after the other until the time is over."""
        number = worker
        while not stop.is_set() and time.perf_counter() < deadline:
            start = first if number == 0 and first is not None else self._random(number, best)
            if start is not None:
                self._descend(start, best, stop, deadline)
            number += workers

    def _random(self, number: int, best: Best) -> np.ndarray | None:
        """The best of some random motions as large as the limits allow; None if none is allowed."""
        rng = np.random.default_rng([self.seed, number])
        chosen, least = None, np.inf
        for _ in range(DRAWS):
            drawn = random_coefficients(self.objective.constraints, rng, self.home)
            if drawn is None:
                continue
            value = self.objective.value(drawn)
            if value < least or chosen is None:
                chosen, least = drawn, value
        if chosen is not None and np.isfinite(least):
            best.offer(least, chosen, first=True)
        return chosen

    def _descend(
        self, start: np.ndarray, best: Best, stop: threading.Event, deadline: float
    ) -> None:
        """SLSQP from one start."""
        from scipy.optimize import minimize

        objective, constraints = self.objective, self.objective.constraints
        shape, free = start.shape, slice(0 if self.home is None else start.shape[1], None)
        middle, scale = (x.ravel() for x in coefficient_box(constraints))
        kept: dict[str, tuple[bytes, tuple]] = {}

        def unpacked(z: np.ndarray) -> np.ndarray:
            x = start.ravel().copy()
            x[free] = middle[free] + z * scale[free]
            return x.reshape(shape)

        def remembered(kind: str, z: np.ndarray, compute: Callable[[np.ndarray], tuple]) -> tuple:
            if stop.is_set() or time.perf_counter() > deadline:
                raise SearchEnded
            key = z.tobytes()
            if kind not in kept or kept[kind][0] != key:
                kept[kind] = (key, compute(unpacked(z)))
            return kept[kind][1]

        def cost(z: np.ndarray) -> tuple[float, np.ndarray]:
            value, gradient = remembered("cost", z, objective.value_and_gradient)
            best.evaluations += 1
            if not np.isfinite(value):
                return 1e6, np.zeros(z.size)
            if value < best.value and constraints.largest_ratio(unpacked(z)) <= 1.0:
                if best.offer(value, unpacked(z)):
                    self._report(best)
            return value, (gradient.ravel() * scale)[free]

        def ratios(z: np.ndarray) -> np.ndarray:
            return 1.0 - remembered("limits", z, constraints.ratios_and_gradients)[0]

        def ratio_gradients(z: np.ndarray) -> np.ndarray:
            gradients = remembered("limits", z, constraints.ratios_and_gradients)[1]
            return -(gradients.reshape(len(gradients), -1) * scale)[:, free]

        try:
            minimize(
                cost,
                np.clip((start.ravel() - middle) / scale, -FARTHEST, FARTHEST)[free],
                jac=True,
                method="SLSQP",
                bounds=[(-FARTHEST, FARTHEST)] * (start.size - (free.start or 0)),
                constraints={"type": "ineq", "fun": ratios, "jac": ratio_gradients},
                options={"maxiter": MAX_ITERATIONS, "ftol": PROGRESS},
            )
        except SearchEnded:
            return

    def _report(self, best: Best) -> None:
        """Progress in one line."""
        self.say(f"criterion {best.value:.4g} after {best.evaluations} motions")


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
    limits, family = constraints.limits, constraints.family
    posture = home
    if posture is None:
        share = rng.uniform(-0.7, 0.7, limits.low.size)
        posture = limits.middle + share * limits.half
    drawn = rng.standard_normal((family.size, limits.low.size)) * limits.half
    drawn[0] = 0.0
    moved = constraints.motion(drawn)
    with np.errstate(divide="ignore", invalid="ignore"):
        room = np.minimum(limits.high - posture, posture - limits.low)
        sizes = [room, limits.speed, limits.acceleration, limits.jerk]
        used = [np.abs(m).max(axis=0) for m in moved]
        scale = np.min([s / np.maximum(u, 1e-12) for s, u in zip(sizes, used, strict=True)], axis=0)
    drawn *= 0.98 * np.minimum(scale, 1e6)
    drawn[0] = posture
    for _ in range(HALVINGS):
        if constraints.largest_ratio(drawn) <= 1.0:
            return drawn
        drawn[1:] *= 0.7
    return None
