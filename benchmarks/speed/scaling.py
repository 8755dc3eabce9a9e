"""How cost grows: with samples, joints, parameters and threads."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.loop.simulation.closed_loop import simulate

from .timing import side_by_side
from .workloads import arm, base_regressor, loop_of, motion_of, values_of

#: Folder from which the child processes find this package.
HOME = Path(__file__).resolve().parents[1]

#: Joints of the arms, and of the tree with three branches.
JOINTS = (2, 3, 4, 6, 7, 9, 12)

#: Samples of the runs over joints: their columns stay in the caches, as blocks do.
STRETCH = 1_000

#: Iterations of the runs over lengths: the same work at each length.
ITERATIONS = 3


@dataclass(frozen=True)
class LengthPoint:
    """An estimator on a simulated TX40 record of some length, in a process of its own.

    Attributes:
        samples: length.
        parameters: how many are estimated.
        threads: given to the process.
        seconds: on the clock; compilation and simulation of the record not included.
        cpu_seconds: of all threads.
        iterations: of the estimator.
        peak_mib: most memory of the process during the identification, the record included.
        before_mib: memory before it, the record included.
        raw_mib: of the record's positions and torques.
    """

    samples: int
    parameters: int
    threads: int
    seconds: float
    cpu_seconds: float
    iterations: int
    peak_mib: float
    before_mib: float
    raw_mib: float

    @property
    def microseconds(self) -> float:
        """Processor time per sample and iteration, smoother shared out [µs]."""
        return 1e6 * self.cpu_seconds / self.samples / self.iterations


@dataclass(frozen=True)
class JointPoint:
    """A robot of so many joints.

    Attributes:
        joints: how many.
        branches: 1 of an arm; chains of a tree.
        matrix_us: observation matrix of the base parameters, per sample [µs], one thread.
        simulation_us: closed loop, per sample [µs].
        base_ms: base parameters from the description [ms].
        columns: base parameters.
        entries: of the observation matrix that are not zero by structure.
    """

    joints: int
    branches: int
    matrix_us: float
    simulation_us: float
    base_ms: float
    columns: int
    entries: int


def in_child(
    samples: int,
    parameters: int = 28,
    threads: int = 2,
    repeats: int = 1,
    iterations: int = 0,
    method: str = "piv",
) -> LengthPoint:
    """An estimator in a process of its own, so that its peak memory is its own.

    Args:
        samples: length of the record.
        parameters: how many are estimated.
        threads: given to the process.
        repeats: the median of so many counts.
        iterations: exactly so many, of PIV; 0: until it converges.
        method: the estimator.
    """
    wanted = {
        "samples": samples, "parameters": parameters, "method": method, "repeats": repeats,
        "iterations": iterations,
    }  # fmt: skip
    environment = os.environ | {"PIVIDENT_THREADS": str(threads)}
    ran = subprocess.run(
        [sys.executable, "-m", "speed.child", json.dumps(wanted)],
        cwd=HOME, env=environment, capture_output=True, text=True,
    )  # fmt: skip
    if ran.returncode:
        raise RuntimeError(f"{method} of {samples} samples failed: {ran.stderr.strip()[-500:]}")
    return LengthPoint(samples, parameters, threads, **json.loads(ran.stdout.splitlines()[-1]))


def over_samples(longest: int, threads: int) -> list[LengthPoint]:
    """34 parameters, from 30,000 samples to ``longest``, about a half decade a step.

    Short records are repeated until they have met as much of the machine's moods as a long one.
    """
    lengths = [n for n in (30_000, 100_000, 300_000, 1_000_000, 3_000_000) if n <= longest]
    return [in_child(n, 34, threads, max(1, 1_000_000 // n), ITERATIONS) for n in lengths]


def touch_memory(share: float = 0.8) -> float:
    """Write once to every page of a share of the free memory, and give it back.

    A virtual machine gets a page from its host when it first writes to it, which can take longer
    than what is done with it afterwards (4 s a GiB have been seen); that is no time of ours.

    Returns:
        What the first touch took [s/GiB].
    """
    import psutil

    piece = 2**27  # bytes
    started, kept = time.perf_counter(), []
    for _ in range(int(share * psutil.virtual_memory().available / piece)):
        page_by_page = np.empty(piece // 8)
        page_by_page[::512] = 1.0
        kept.append(page_by_page)
    return (time.perf_counter() - started) / max(1, len(kept)) * 2**30 / piece


def over_parameters() -> list[LengthPoint]:
    """From the 28 essential parameters to all base parameters."""
    return [in_child(30_000, parameters=n, repeats=3) for n in (28, 34, 44, 54)]


def over_threads() -> list[LengthPoint]:
    """One thread, two, up to those of the machine."""
    most = len(os.sched_getaffinity(0)) if hasattr(os, "sched_getaffinity") else os.cpu_count() or 1
    wanted = sorted({1, 2, most}) if most > 1 else [1]
    return [in_child(100_000, threads=n, repeats=3) for n in wanted]


def over_joints(repeats: int) -> list[JointPoint]:
    """Arms of 2 to 12 joints, and a tree of 12 with three branches."""
    kinds = [(n, 1) for n in JOINTS] + [(12, 3)]
    return [_joint_point(n, branches, repeats) for n, branches in kinds]


def _joint_point(joints: int, branches: int, repeats: int) -> JointPoint:
    robot = arm(joints, branches)
    regressor = base_regressor(robot)
    q, dq, ddq = (np.ascontiguousarray(x.T) for x in motion_of(robot, STRETCH))
    out = regressor.packed(q, dq, ddq)
    law, signals = loop_of(robot, STRETCH)
    model = values_of(robot)
    matrix, loop, base = side_by_side(
        [
            lambda: regressor.packed(q, dq, ddq, out),
            lambda: simulate(model, law, signals, robot.joint_names),
            lambda: base_parameters(robot),
        ],
        repeats,
    )
    per_sample = 1e3 / STRETCH
    return JointPoint(
        joints,
        branches,
        matrix.cpu_ms * per_sample,
        loop.cpu_ms * per_sample,
        base.cpu_ms,
        len(regressor.parameters),
        regressor.entries,
    )


def exponent(points: list[JointPoint], what: str, least: int = 4) -> float:
    """Slope of the logarithms over the joints of serial arms with ``least`` joints or more."""
    arms = [p for p in points if p.branches == 1 and p.joints >= least]
    x, y = np.log([p.joints for p in arms]), np.log([getattr(p, what) for p in arms])
    return float(np.polyfit(x, y, 1)[0])
