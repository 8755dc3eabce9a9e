"""Stages of an IDIM-PIV: their processor time, the operations and the bytes that they need."""

from __future__ import annotations

import threading
import time
from collections import defaultdict
from collections.abc import Callable, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass
from unittest.mock import patch

import numpy as np

from pivident.dynamics.entry_plan import INERTIAS, MOMENTS
from pivident.dynamics.regressor import Regressor
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.signals.random_walk_likelihood import _GRID_POINTS, _TOLERANCE

from .bounds import Bounds

#: Which function belongs to which stage; what is called from within another one counts there.
STAGES: tuple[tuple[str, str], ...] = (
    ("search for lines in the noise", "pivident.signals.random_walk.find_lines"),
    ("visible counts", "pivident.estimation.kinematics._nvr_of_counts"),
    ("smoother: NVR by maximum likelihood", "pivident.signals.random_walk.estimate_nvr"),
    ("smoother: trajectory", "pivident.signals.random_walk.diffuse_fit"),
    ("torque and derivatives at the instants", "pivident.estimation.kinematics.torque_at_instants"),
    ("simulation", "pivident.loop.simulation.closed_loop.run_loop"),
    ("columns", "pivident.estimation.full_rate.packed_stretch"),
    ("prefilters", "pivident.signals.prefilter.StreamingFilter.process"),
    ("normal equations", "pivident.estimation.normal_equations.JointSums.add_stack"),
    ("residuals", "pivident.estimation.noise_identification.residual_of"),
    ("noise models", "pivident.estimation.noise_identification.fit_ar"),
    ("residuals", "pivident.estimation.full_rate_answer.residual_of"),
    ("covariance and answer", "pivident.estimation.prefiltered_iv.full_rate_answer"),
)

REST = "everything else"


@dataclass(frozen=True)
class Profile:
    """Processor time of the stages.

    Attributes:
        seconds: median time of each stage in one identification [s], its own only.
        calls: how often each was entered.
        total: median of the whole [s].
        iterations: of the estimator.
        orders: of the AR noise models.
    """

    seconds: dict[str, float]
    calls: dict[str, int]
    total: float
    iterations: int
    orders: tuple[int, ...]


@dataclass(frozen=True)
class StageRow:
    """One stage beside its bound.

    Attributes:
        stage: name.
        ms: processor time [ms].
        share: of the whole.
        bound: what bounds it; empty where nothing was counted.
        floor_ms: least time that this bound allows [ms].
        distance: time over floor.
    """

    stage: str
    ms: float
    share: float
    bound: str
    floor_ms: float
    distance: float


class _Clock:
    """Own processor time of nested stages, thread by thread."""

    def __init__(self) -> None:
        self.seconds: dict[str, float] = defaultdict(float)
        self.calls: dict[str, int] = defaultdict(int)
        self._lock, self._local = threading.Lock(), threading.local()

    def wrapped(self, stage: str, work: Callable) -> Callable:
        """The function with a clock around it."""

        def call(*args, **kwargs):
            inside: list[float] = getattr(self._local, "inside", None) or []
            self._local.inside = inside
            inside.append(0.0)
            started = time.thread_time()
            try:
                return work(*args, **kwargs)
            finally:
                took = time.thread_time() - started
                own = took - inside.pop()
                if inside:
                    inside[-1] += took
                with self._lock:
                    self.seconds[stage] += own
                    self.calls[stage] += 1

        return call


@contextmanager
def _clocks() -> Iterator[_Clock]:
    """All stages under clocks."""
    from importlib import import_module

    clock = _Clock()
    with ExitStack() as stack:
        for stage, path in STAGES:
            module, name = path.rsplit(".", 1)
            try:
                owner = import_module(module)
            except ModuleNotFoundError:
                module, holder = module.rsplit(".", 1)
                owner = getattr(import_module(module), holder)
            work = getattr(owner, name)
            stack.enter_context(patch.object(owner, name, clock.wrapped(stage, work)))
        yield clock


def profile(problem: Problem, repeats: int) -> Profile:
    """Median times of all stages of warm identifications."""
    found = identify(problem, "piv")
    totals, runs = [], []
    for _ in range(repeats):
        with _clocks() as clock:
            started = time.process_time()
            identify(problem, "piv")
            totals.append(time.process_time() - started)
        runs.append(dict(clock.seconds))
        calls = dict(clock.calls)
    names = list(dict.fromkeys(stage for stage, _ in STAGES))
    seconds = {n: float(np.median([run.get(n, 0.0) for run in runs])) for n in names}
    total = float(np.median(totals))
    seconds[REST] = max(total - sum(seconds.values()), 0.0)
    return Profile(seconds, calls, total, found.iterations, tuple(j.ar_order for j in found.joints))


def against(found: Profile, problem: Problem, ceilings: Bounds) -> list[StageRow]:
    """Each stage beside the time that its bound allows, the longest first."""
    floors = _floors(found, problem, ceilings)
    rows = []
    for stage, seconds in found.seconds.items():
        kind, floor = max(floors.get(stage, [("", 0.0)]), key=lambda pair: pair[1])
        rows.append(
            StageRow(
                stage,
                1e3 * seconds,
                seconds / found.total,
                kind,
                1e3 * floor,
                seconds / floor if floor > 0 else float("nan"),
            )
        )
    return sorted(rows, key=lambda row: -row.ms)


def _floors(
    found: Profile, problem: Problem, ceilings: Bounds
) -> dict[str, list[tuple[str, float]]]:
    """Times that arithmetic, memory and latency allow at least, by stage [s].

    Counted per sample and channel: a likelihood has a recursion of one multiply-add that waits for
    the last (latency) and about 7 in all; the smoother twice that. The filter of order p costs
    p + 1 per column, a Gram matrix of k columns k (k + 1) / 2 where it is symmetric and k² where
    it is not. A step of the simulation is a chain through the tree and back, see ``docs/speed.md``.
    """
    samples = sum(r.samples for r in problem.recordings)
    joints, regressor = problem.robot.size, problem.regressor
    columns = [regressor.columns_of(j).size for j in range(joints)]
    passes = found.calls["normal equations"] / (joints * -(-samples // 4096))
    with_instruments = found.iterations
    alone = max(passes - with_instruments, 0.0)
    golden = np.log(_grid_width() / _TOLERANCE) / np.log(1.618)
    evaluations = _GRID_POINTS + golden + 2
    each, latency = ceilings.multiply_adds, ceilings.latency
    rows = [(2 * with_instruments + alone) * k + passes for k in columns]
    taps = sum(r * (p + 1) for r, p in zip(rows, found.orders, strict=True))
    products = sum(
        with_instruments * (2 * k * k + k * k + 3 * k) + alone * (k * k + k) for k in columns
    )
    sources = 2 * with_instruments + alone
    entries = sources * regressor.entries
    lags = sum(151 + (p + 1) for p in found.orders)  # of the search, and of the last model
    return {
        "smoother: NVR by maximum likelihood": [
            ("latency", evaluations * samples * joints * latency),
            ("arithmetic", 7 * evaluations * samples * joints / each),
        ],
        "smoother: trajectory": [("latency", 2 * samples * joints * latency)],
        "prefilters": [("arithmetic", taps * samples / each)],
        "normal equations": [("arithmetic", products * samples / each)],
        "columns": [
            ("memory", 8 * entries * samples / ceilings.bandwidth),
            ("arithmetic", _per_sample(regressor) * sources * samples / each),
        ],
        "noise models": [("arithmetic", lags * samples / each)],
        "simulation": [("latency", found.iterations * samples * _chain_of(joints) * latency)],
    }


def _per_sample(regressor: Regressor) -> float:
    """Multiply-adds of the columns of one sample: poses, motions, screws carried, blocks."""
    plan = regressor._plan
    carried = np.count_nonzero(plan.work[:, 1:])
    inertias, moments = (np.count_nonzero(plan.work & kind) for kind in (INERTIAS, MOMENTS))
    return 90.0 * plan.moved.sum() + 24.0 * carried + 24.0 * inertias + 18.0 * moments


def _grid_width() -> float:
    """Decades of the bracket in which the NVR is searched by golden sections."""
    from pivident.signals.random_walk_likelihood import MAX_NVR, MIN_NVR

    return 2 * np.log10(MAX_NVR / MIN_NVR[3]) / (_GRID_POINTS - 1)


def _chain_of(joints: int) -> float:
    """Multiply-adds of one simulated sample that wait for each other.

    Sine and cosine (12), two rotations per joint on the way out (speed, then acceleration: 6 links
    of the chain each), two on the way back (5 each), M⁻¹ times the torque (joints), the linear
    step (three products with M⁻¹ and D: 3 (joints + 3)), friction at its end (24).
    """
    return 12 + 12 * joints + 10 * joints + joints + 3 * (joints + 3) + 24
