"""What an encoder of few counts in the loop does to the estimates: machines moved by MuJoCo.

    python -m benchmarks.counted_loop [--records 4] [--counts 3600 20000]

The law reads positions in whole counts per revolution (per tenth of a metre of a sliding joint);
the log holds these positions and the torques that the law asked for. Columns: median error, share
of the parameters within two standard errors, largest error over standard error, seconds.
"""

from __future__ import annotations

import argparse
import time
from dataclasses import replace

import numpy as np
from benchmarks.model_faults.cases import users_robot
from benchmarks.model_faults.machines import LOOPS, Setup, draw
from benchmarks.model_faults.simulator import simulate
from benchmarks.unknown_arms import motion as motions
from benchmarks.unknown_arms.truth import true_base_parameters

import pivident as pv


def counted_setup(arm: str, seed: int, counts: float) -> Setup:
    """A machine without fault behind encoders of so many counts and no other noise."""
    drawn = draw(arm, seed, 1000.0)
    turns = [2.0 * np.pi if j.kind == "revolute" else 0.1 for j in drawn.arm.joints]
    own = replace(
        drawn.arm,
        counts=tuple(counts / turn for turn in turns),
        encoder_noise=(0.0,) * drawn.arm.size,
    )
    return replace(drawn, made=replace(drawn.made, arm=own))


def problem_of(setup: Setup, seconds: float) -> tuple[pv.Problem, dict[str, float]]:
    """One record of sines, with the law and its counts, and the truth."""
    rng = np.random.default_rng([setup.made.seed, 14, 0])
    motion = motions.sum_of_sines("record 1", setup.arm, rng, setup.rate, seconds)
    trace = simulate(setup, motion, 0, 1)
    robot = users_robot(setup)
    recording = pv.Recording.from_arrays(
        trace.q,
        trace.tau,
        setup.rate,
        joint_names=robot.joint_names,
        name=motion.name,
        q_ref=motion.q,
        dq_ref=motion.dq,
        ddq_ref=motion.ddq,
        torque_timing="held",
        saturation="allow",
    )
    loop = pv.Loop(
        pv.PD(setup.kp, setup.kd),
        feed_forward=setup.feed_forward,
        count=1.0 / np.array(setup.arm.counts),
    )
    truth = true_base_parameters(setup.made, robot)
    return pv.Problem(robot, (recording,), loop), truth


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--records", type=int, default=4)
    parser.add_argument("--first", type=int, default=0, help="the first seed")
    parser.add_argument("--counts", type=float, nargs="*", default=[3600.0, 20000.0])
    parser.add_argument("--arms", nargs="*", default=list(LOOPS))
    parser.add_argument("--seconds", type=float, default=8.0)
    options = parser.parse_args()
    for counts in options.counts:
        for arm in options.arms:
            rows: dict[str, list] = {}
            for seed in range(options.first, options.first + options.records):
                problem, truth = problem_of(counted_setup(arm, seed, counts), options.seconds)
                fine = replace(problem, loop=replace(problem.loop, count=0.0))
                for label, own, method in (
                    ("piv", problem, "piv"),
                    ("didim, counts not told", fine, "didim"),
                    ("didim", problem, "didim"),
                ):
                    begin = time.perf_counter()
                    try:
                        found = pv.identify(own, method)
                    except pv.PividentError as error:
                        print(f"{arm} {counts:g} {label} {seed}: {error}")
                        continue
                    took = time.perf_counter() - begin
                    right = np.array([truth[name] for name in found.names])
                    rows.setdefault(label, []).append((found.theta - right, found.std, right, took))
            for label, own in rows.items():
                error, std, right = (np.concatenate([r[k] for r in own]) for k in range(3))
                apart = np.abs(error) / std
                relative = np.abs(error / right)[right != 0.0]
                print(
                    f"{arm:7s} {counts:7g} {label:24s} {100 * np.median(relative):7.3f} % "
                    f"{100 * np.mean(apart <= 2):5.1f} % {apart.max():6.1f} σ "
                    f"{np.mean([r[3] for r in own]):5.1f} s  ({len(own)} records)",
                    flush=True,
                )


if __name__ == "__main__":
    main()
