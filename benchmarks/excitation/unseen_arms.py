"""Designed motions of arms that pivident has never seen, on logs of another simulator.

    python -m benchmarks.excitation.unseen_arms [--arms cobot6 link7] [--seeds 1 2] --out FOLDER

The user has a vendor's URDF with wrong masses, and a log of the machine that MuJoCo moves under a
hidden law (`benchmarks.unknown_arms`). The motion is a sum of sines, as users run them, or designed
from that URDF for the same duration, room, largest speeds and accelerations; both are identified by
the same commands. Printed: standard errors over those of the sines (geometric mean over the
parameters, and the largest), errors in standard errors, torque error on a held-out motion, and
what the design predicted of its standard errors, whose noise is assumed.
"""

from __future__ import annotations

import argparse
import shutil
from pathlib import Path

import numpy as np
from benchmarks.unknown_arms.judge import Judged, judge
from benchmarks.unknown_arms.logs import control_rate, write_log
from benchmarks.unknown_arms.motion import REST, Motion
from benchmarks.unknown_arms.record import make_motion, users_robot, write_record, write_trace
from benchmarks.unknown_arms.simulator import simulate
from benchmarks.unknown_arms.truth import Machine
from benchmarks.unknown_arms.user import use

from pivident.studies import Design, DesignRequest, design_motion, joint_limits, write_design

METHODS = ("ls", "iv-full-rate", "piv")


def designed(made: Machine, folder: Path, seconds: float, seed: int) -> Design:
    """The design for what the sines use: duration, room, speeds and accelerations."""
    sines, robot = make_motion(made, "sines"), users_robot(folder, made)
    duration = len(sines.q) / sines.rate - 2.0 * REST
    home, reach = np.array(made.arm.home), np.array(made.arm.reach)
    given = {
        joint.name: {
            "position": (float(home[j] - reach[j]), float(home[j] + reach[j])),
            "speed": float(np.abs(sines.dq[:, j]).max()),
            "acceleration": float(np.abs(sines.ddq[:, j]).max()),
        }
        for j, joint in enumerate(robot.joints)
    }
    limits = joint_limits(robot, given, torque_share=0.9)
    request = DesignRequest(duration=np.floor(10 * duration) / 10, seconds=seconds, seed=seed)
    return design_motion(robot, request, limits=limits)


def reference(design: Design, rate: float) -> Motion:
    """The designed motion at the ticks of the controller, at rest before and after."""
    t = np.arange(round((design.motion.duration + 2.0 * REST) * rate)) / rate - REST
    q, dq, ddq, _ = design.motion.at(t)
    resting = (t < 0.0) | (t > design.motion.duration)
    dq[resting], ddq[resting] = 0.0, 0.0
    return Motion("designed", rate, q, dq, ddq)


def records(name: str, seed: int, out: Path, seconds: float) -> dict[str, list[Judged]]:
    """Both records of one machine, and what their user gets."""
    found = {}
    for run in ("sines", "designed"):
        folder = out / name / f"seed-{seed}" / run
        shutil.rmtree(folder, ignore_errors=True)
        made = write_record(folder, name, seed, ("sines", "held_out"))
        if run == "designed":
            design = designed(made, folder, seconds, seed)
            write_design(design, folder, 100.0)
            trace = simulate(made, reference(design, control_rate(made)))
            write_log(folder / "designed.csv", made, trace)
            write_trace(folder / "truth_designed.npz", made, trace)
        session = use(folder, name, [run])
        found[run] = [judge(folder, made, [run], m, s) for m, s in session.reached.items()]
        for method, why in session.missed.items():
            print(f"{name} {seed} {run}: {method} gave no result: {why}", flush=True)
    return found


def line(name: str, seed: int, method: str, found: dict[str, list[Judged]]) -> str:
    """One method on both records."""
    both = [next((j for j in found[run] if j.method == method), None) for run in found]
    if None in both:
        return f"{name} {seed} {method}: not on both records"
    sines, made = both
    places = {n: k for k, n in enumerate(made.names)}
    common = [(k, places[n]) for k, n in enumerate(sines.names) if n in places]
    a, b = (np.array(x) for x in zip(*common, strict=True))
    ratio = made.std[b] / sines.std[a]
    covered = [np.nanmean(np.abs(j.z_attainable) < 1.96) for j in both]
    return (
        f"{name} {seed} {method:12}: σ over that of the sines {np.exp(np.log(ratio).mean()):.2f}, "
        f"largest {ratio.max():.2f} ({len(common)} parameters); held-out error "
        f"{sines.held_out:.1f} % and {made.held_out:.1f} %; median |error|/σ "
        f"{np.nanmedian(np.abs(sines.z)):.1f} and {np.nanmedian(np.abs(made.z)):.1f}; attainable "
        f"inside 95 %: {100 * covered[0]:.0f} % and {100 * covered[1]:.0f} %"
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--arms", nargs="+", default=["cobot6", "link7"])
    parser.add_argument("--seeds", nargs="+", type=int, default=[1, 2])
    parser.add_argument("--seconds", type=float, default=15.0, help="of each search")
    parser.add_argument("--out", type=Path, default=Path("benchmarks/results/unseen_arms"))
    options = parser.parse_args()
    for name in options.arms:
        for seed in options.seeds:
            found = records(name, seed, options.out, options.seconds)
            for method in METHODS:
                print(line(name, seed, method, found), flush=True)


if __name__ == "__main__":
    main()
