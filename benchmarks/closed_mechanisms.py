"""Coverage, bias and time of estimates on mechanisms with closed loops, records made by MuJoCo.

python benchmarks/closed_mechanisms.py [delta] [parallelogram_palletizer] [--runs 50]
[--duration 20] [--methods ls,iv,piv]
"""

from __future__ import annotations

import argparse
import time
from concurrent.futures import ProcessPoolExecutor
from functools import partial

import numpy as np
from benchmarks.mujoco_mechanism import mujoco_record, truth_of

from pivident.data.recording.recording import Recording
from pivident.dynamics.forward import mass_matrix
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.foundation.errors import PividentError
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.controllers import PD
from pivident.robot.gallery import load_robot

RATE = 1000.0

#: Encoder noise [rad], torque noise as a share of the torque limits, share of the range moved.
ENCODER, TORQUE, SHARE = 2e-5, 0.002, 0.35

#: Natural frequency of the loop [Hz].
BANDWIDTH = 8.0


def reference(robot, duration: float, seed: int = 11, share: float = SHARE) -> np.ndarray:
    """Sums of sines about the middle of each joint's range, at rest in the beginning."""
    rng = np.random.default_rng(seed)
    t = np.arange(round(duration * RATE)) / RATE
    wanted = np.zeros((len(t), robot.size))
    for j, joint in enumerate(robot.joints):
        low, high = joint.position_limits
        waves = np.zeros_like(t)
        for k in range(1, 7):
            w, phase = 2.0 * np.pi * k * 0.21 * rng.uniform(0.9, 1.1), rng.uniform(0.0, 2.0 * np.pi)
            waves += rng.uniform(0.4, 1.0) / k * np.sin(w * t + phase)
        waves *= share * (high - low) / np.abs(waves).max()
        wanted[:, j] = 0.5 * (low + high) + waves * np.clip(t / 1.0, 0.0, 1.0) ** 3 * (
            10 - 15 * np.clip(t, 0, 1) + 6 * np.clip(t, 0, 1) ** 2
        )
    return wanted


def gains_of(robot, q: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """PD gains of a second-order loop on each joint's own inertia."""
    base, truth = truth_of(robot)
    inertia = np.diagonal(mass_matrix(robot, base.parameters, truth, q[None])[0])
    w = 2.0 * np.pi * BANDWIDTH
    return inertia * w**2, inertia * 1.6 * w


def run(
    name: str, duration: float, methods: list[str], encoder: float, seed: int
) -> dict[str, tuple]:
    """One record, each method: estimates, standard errors, converged, seconds."""
    robot = load_robot(name)
    q_ref = reference(robot, duration)
    gains = gains_of(robot, q_ref[0])
    made = mujoco_record(robot, q_ref, RATE, gains, np.full(robot.size, encoder), seed)
    rng = np.random.default_rng(seed + 10_000)
    spread = TORQUE * np.array([joint.torque_limit for joint in robot.joints])
    tau = made.tau + spread * rng.normal(size=made.tau.shape)
    record = Recording(name, robot.joint_names, made.q, tau, RATE, q_ref=q_ref)
    problem = Problem(robot, (record,), Loop(PD(kp=gains[0], kd=gains[1])))
    found: dict[str, tuple] = {"gap": (made.gap,)}
    for method in methods:
        start = time.process_time()
        try:
            result = identify(problem, METHODS[method])
        except PividentError as error:
            found[method] = (None, None, str(error), 0.0)
            continue
        seconds = time.process_time() - start
        errors = np.sqrt(np.diag(result.covariance))
        found[method] = (result.theta, errors, result.converged, seconds)
    return found


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("robots", nargs="*", default=["delta", "parallelogram_palletizer"])
    parser.add_argument("--runs", type=int, default=50)
    parser.add_argument("--duration", type=float, default=20.0)
    parser.add_argument("--methods", default="ls,iv,piv")
    parser.add_argument("--workers", type=int, default=2)
    parser.add_argument("--encoder", type=float, default=ENCODER, help="standard deviation [rad]")
    chosen = parser.parse_args()
    methods = chosen.methods.split(",")
    for name in chosen.robots:
        base, truth = truth_of(load_robot(name))
        with ProcessPoolExecutor(chosen.workers) as pool:
            one = partial(run, name, chosen.duration, methods, chosen.encoder)
            found = list(pool.map(one, range(chosen.runs)))
        print(
            f"\n{name}: {len(base)} base parameters, {chosen.runs} records of "
            f"{chosen.duration:g} s, largest gap {max(f['gap'][0] for f in found):.2g} m"
        )
        for method in methods:
            good = [f[method] for f in found if f[method][0] is not None]
            if not good:
                print(f"  {method}: {found[0][method][2]}")
                continue
            theta = np.array([g[0] for g in good])
            errors = np.array([g[1] for g in good])
            off = (theta - truth) / errors
            bias = (theta.mean(axis=0) - truth) / errors.mean(axis=0)
            covered = np.abs(off) < 1.96
            by_run = covered.mean(axis=1)
            se = by_run.std(ddof=1) / np.sqrt(len(good)) if len(good) > 1 else np.nan
            known = truth != 0.0
            relative = np.median(np.abs(theta[:, known] / truth[known] - 1.0))
            worst = np.argsort(covered.mean(axis=0))[:4]
            print(
                f"  {method:6} covered {100 * covered.mean():.1f} ± {200 * se:.1f} %, error "
                f"{100 * relative:.3g} %, bias up to {np.abs(bias).max():.2f} σ "
                f"({base.names[int(np.abs(bias).argmax())]}), "
                f"{np.median([g[3] for g in good]):.2f} s, converged "
                f"{sum(bool(g[2]) for g in good)} of {len(found)}; least covered "
                + ", ".join(f"{base.names[k]} {100 * covered[:, k].mean():.0f}" for k in worst)
            )


if __name__ == "__main__":
    main()
