"""Joints of a simulator from positions alone: 49 parameters of twelve joints, against MuJoCo.

The case of PACE (armature, viscous and dry friction and encoder bias of twelve joints, one delay):
20 s at 200 Hz of four legs on a held base (`suspended_legs`), known PD gains, counts of 14 bits in
the log and in what the law reads, no torque. Each run has a robot and a motion of its own. The
description that the fit starts from has links, but no armature and no friction.

Printed: time of the fit on two threads, share of the true values in the intervals of 95 %, by
quantity, error of the delay in samples of the log, and errors over standard errors.

    python -m benchmarks.position_only --runs 50
"""

from __future__ import annotations

import argparse
import tempfile
from dataclasses import dataclass
from pathlib import Path
from time import perf_counter, process_time

import numpy as np
from benchmarks.suspended_legs import (
    CONTROL_RATE,
    KD,
    KP,
    LOG_RATE,
    NAMES,
    Joints,
    LegsLog,
    legs_log,
    write_legs,
)

from pivident.data.recording.recording import Recording
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.mjcf import read_mjcf
from pivident.studies.simulators.fit_simulator import fit_simulator
from pivident.studies.simulators.simulator_fit import SimulatorFit

QUANTITIES = ("armature", "damping", "frictionloss", "bias")


def recording_of(log: LegsLog) -> Recording:
    """The log as a recording without torque."""
    return Recording(
        "legs", NAMES, log.q, np.zeros_like(log.q), LOG_RATE, log.q_ref,
        control_rate=CONTROL_RATE, allow_constant=True, saturation="allow",
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class Outcome:
    """One run beside its truth."""

    fit: SimulatorFit
    truth: Joints
    wall: float  # [s]
    processor: float  # [s]

    def errors(self, quantity: str) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Errors, standard errors, and whether the interval covers the truth."""
        true = np.atleast_1d(getattr(self.truth, quantity))
        found = list(self.fit.of(quantity).values())
        error = np.array([v.value for v in found]) - true
        covered = [v.low <= x <= v.high for v, x in zip(found, true.tolist(), strict=True)]
        return error, np.array([v.std for v in found]), np.array(covered)


def one_run(seed: int, duration: float = 20.0) -> Outcome:
    """A robot, its log and the fit."""
    rng = np.random.default_rng(seed)
    truth = Joints.drawn(rng)
    recording = recording_of(legs_log(truth, rng, duration))
    with tempfile.TemporaryDirectory() as folder:
        robot = read_mjcf(write_legs(Path(folder) / "legs.xml"))
    wall, processor = perf_counter(), process_time()
    fit = fit_simulator(robot, Loop(PD(KP, KD)), recording)
    return Outcome(fit, truth, perf_counter() - wall, process_time() - processor)


def main() -> None:
    """Run and print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--first", type=int, default=1, help="seed of the first run")
    parser.add_argument("--seconds", type=float, default=20.0)
    given = parser.parse_args()
    one_run(0, 4.0)  # compiles
    outcomes, failed = [], 0
    for seed in range(given.first, given.first + given.runs):
        try:
            own = one_run(seed, given.seconds)
        except PividentError as error:
            failed += 1
            print(f"run {seed:3}: {type(error).__name__}: {str(error)[:100]}", flush=True)
            continue
        outcomes.append(own)
        covered = np.concatenate([own.errors(q)[2] for q in (*QUANTITIES, "delay")])
        late = own.errors("delay")[0][0] * LOG_RATE
        print(
            f"run {seed:3}: {own.wall:5.1f} s ({own.processor:5.1f} s of processor), "
            f"{own.fit.passes} passes, covered {covered.mean():6.1%}, delay off by "
            f"{late:+.1e} samples{'' if own.fit.converged else ', NOT SETTLED'}",
            flush=True,
        )
    print(f"\n{len(outcomes)} runs of {given.seconds:g} s at {LOG_RATE:g} Hz, 49 parameters each")
    wall, processor = (np.array([getattr(o, k) for o in outcomes]) for k in ("wall", "processor"))
    print(
        f"time of a fit: median {np.median(wall):.1f} s, longest {wall.max():.1f} s; of the "
        f"processor: median {np.median(processor):.1f} s, longest {processor.max():.1f} s"
    )
    everything = []
    for quantity in (*QUANTITIES, "delay"):
        error, std, covered = (
            np.concatenate(x) for x in zip(*(o.errors(quantity) for o in outcomes), strict=True)
        )
        everything.append(covered)
        print(
            f"{quantity:13} covered {covered.mean():6.1%} of {covered.size:4}; rms error "
            f"{np.sqrt(np.mean(error**2)):.3g}, mean standard error {np.mean(std):.3g}, "
            f"rms of error/standard error {np.sqrt(np.mean((error / std) ** 2)):.2f}"
        )
    whole = np.concatenate(everything)
    print(f"all           covered {whole.mean():6.1%} of {whole.size}")
    late = np.abs([o.errors("delay")[0][0] for o in outcomes]) * LOG_RATE
    print(f"delay: largest error {late.max():.2e} samples of the log")
    settled = [o for o in outcomes if o.fit.converged]
    inside = np.concatenate([o.errors(q)[2] for o in settled for q in (*QUANTITIES, "delay")])
    print(f"settled: {len(settled)} of {given.runs}, {failed} ended with an error")
    print(f"of the settled ones covered {inside.mean():6.1%} of {inside.size}")


if __name__ == "__main__":
    main()
