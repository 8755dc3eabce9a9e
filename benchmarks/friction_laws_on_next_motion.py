"""Does the friction law that `pivident laws` chooses fit the next motion?

    python benchmarks/friction_laws_on_next_motion.py [plain] [rich] [kr300] [records] [--first 10]

Random arms of three to six axes (`tests.studies.friction_laws.friction_arms`: Pinocchio's inverse
dynamics, exact signs, encoders of 14 bits, three levels of torque noise). Laws are chosen from two
motions of 30 s, or from the first alone, and judged on a third with other speeds, postures and
temperature: error of the torque without noise below 20 Hz, over that of the present laws (viscous,
Coulomb, offset). *Plain*: nothing else is there, and a term that is added is wrong. *Rich*:
Stribeck friction, friction that grows with the load, and viscous friction that falls with the
temperature.

The rules were written with the arms 0 to 9; by default those from 10 on are judged.

KR300, axes 1 to 3, public record: chosen from motion A, judged on B, and the reverse, below 4 Hz.

*Records*: all public records of `default_band.py`, chosen from one half and judged on the other,
from the first 70 % and judged on the rest, and from the first two thirds as two recordings and
judged on the last; of two motions each is chosen from and the other judged on. Judged below the
band of held-out motion, in mean squares: the share of joints that the chosen law makes worse than
the law that they had, and by how much.
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from default_band import DRAFTED, EXAMPLE, problem_of
from kuka_kr300_blocks import EXAMPLE as KR300, START, STOP, squares
from tests.studies.friction_laws.friction_arms import RATE, FrictionArm, friction_arm, programmes

from pivident.data.recording.public_records import load_kuka_kr300
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import RandomWalk
from pivident.judgement.validation.held_out.prediction import Judge
from pivident.robot.gallery import load_robot
from pivident.signals.bandpass import butterworth
from pivident.studies.friction_laws.chosen_laws import LawChoice
from pivident.studies.friction_laws.law_choice import choose_laws

METHOD = LeastSquares(signals=RandomWalk())

#: Band in which torques are judged [Hz].
BAND = 20.0


def errors(made: FrictionArm, problem: Problem, truth: tuple[np.ndarray, ...]) -> np.ndarray:
    """Error of the torque on another motion, each joint over its own torque, shape (joints,)."""
    predicted = identify(problem, METHOD).predict(*truth[:3])
    left, size = (butterworth(x, RATE, BAND) for x in (truth[3] - predicted, truth[3]))
    return np.sqrt(np.mean(left**2, axis=0) / np.mean(size**2, axis=0))


def arm(seed: int, rich: bool, motions: int) -> tuple[LawChoice, np.ndarray]:
    """What was chosen, and errors with present and chosen laws [%], (2, joints)."""
    made = friction_arm(seed, rich, 3 + seed % 4)
    plan = programmes(seed)
    problem = made.problem({k: plan[k] for k in range(1, motions + 1)})
    choice = choose_laws(problem)
    truth = made.motion(3, plan[3])
    pair = np.array([errors(made, p, truth) for p in (problem, choice.problem)])
    return choice, 100 * pair


def adds_a_term(choice: LawChoice) -> bool:
    """Whether a chosen law has other terms than the present one; another sign is none."""
    return any(
        [t.column for t in j.chosen.law.terms] != [t.column for t in j.base.law.terms]
        for j in choice.joints
    )


def arms(first: int, count: int, rich: bool, motions: int) -> None:
    """One line for each arm, then how many fulfil what is asked."""
    kind = "rich" if rich else "plain"
    print(f"{kind} friction, laws chosen from {motions} motion{'s' * (motions > 1)}")
    added, ratios = 0, []
    for seed in range(first, first + count):
        start = time.perf_counter()
        choice, pair = arm(seed, rich, motions)
        total = np.sqrt(np.mean(pair**2, axis=1))
        worst = float((pair[1] / pair[0]).max())
        ratios.append(total[1] / total[0])
        added += adds_a_term(choice)
        changed = [f"{j.joint}: {j.chosen.name}" for j in choice.joints if j.is_changed]
        print(
            f"  {seed:3d}  error {total[0]:.3f} -> {total[1]:.3f} % ({ratios[-1]:.3f}), "
            f"worst joint {worst:.3f}, {time.perf_counter() - start:.0f} s; "
            f"{', '.join(changed) or 'no change'}",
            flush=True,
        )
    fine = sum(r <= 1.0 + 1e-9 for r in ratios)
    print(
        f"  {added} of {count} arms with a further term; not worse on the third motion: {fine}; "
        f"worst {100 * (max(ratios) - 1):+.1f} %, geometric mean "
        f"{100 * (np.exp(np.mean(np.log(ratios))) - 1):+.1f} %",
        flush=True,
    )


def kr300() -> None:
    """One motion chooses, the other one judges; and both choose."""
    robot = load_robot(KR300 / "kuka_kr300_axes_1_3.toml")
    runs = tuple(load_kuka_kr300(motion, robot=robot) for motion in ("A", "B"))
    print("KR300: error of axes 1, 2, 3 on the other motion below 4 Hz [%]")
    for k, name in enumerate(("A, judged on B", "B, judged on A")):
        problem = Problem(robot, (runs[k].slice(START, STOP),))
        choice = choose_laws(problem)
        motion = estimate_kinematics(runs[1 - k], RandomWalk())
        for label, own in (("present", problem), ("chosen", choice.problem)):
            error, torque = squares(identify(own, METHOD), motion, START, STOP)
            listed = "  ".join(f"{x:6.2f}" for x in 100 * np.sqrt(error / torque))
            print(f"  {name}, {label:8s} {listed}", flush=True)
        print("   ", ", ".join(f"{j.joint}: {j.chosen.name}" for j in choice.joints), flush=True)


def divided(problem: Problem) -> Iterator[tuple[str, Problem, int, slice]]:
    """What laws are chosen from, and the recording and its samples that they are judged on."""
    runs = problem.recordings
    if len(runs) > 1:
        for k, run in enumerate(runs):
            other = 1 - k
            yield (
                run.name,
                replace(problem, recordings=(run,)),
                other,
                slice(0, runs[other].samples),
            )
        return
    (run,), samples = runs, runs[0].samples
    for name, ends, (begin, end) in (
        ("first half", [(0.0, 0.5)], (0.52, 1.0)),
        ("second half", [(0.5, 1.0)], (0.0, 0.48)),
        ("first 70 %", [(0.0, 0.7)], (0.72, 1.0)),
        ("two thirds", [(0.0, 0.33), (0.33, 0.66)], (0.68, 1.0)),
    ):
        parts = [
            replace(run.slice(*(run.start_time + x * run.duration for x in part)), name=f"part {k}")
            for k, part in enumerate(ends)
        ]
        span = slice(round(begin * samples), round(end * samples))
        yield name, replace(problem, recordings=tuple(parts)), 0, span


def records() -> None:
    """Joints whose law changed, then how many became worse on the next motion."""
    print("public records: mean square of the error on the next motion, by the law that was chosen")
    joints, ratios = 0, []
    with tempfile.TemporaryDirectory() as folder:
        for record in (*EXAMPLE, *DRAFTED):
            problem = replace(problem_of(record, Path(folder)), loop=None)
            judges = [Judge(r) for r in problem.recordings]
            for name, own, judged, span in divided(problem):
                choice = choose_laws(own)
                present, chosen = (
                    judges[judged].score(identify(p, METHOD), [span])[0].rms_in_band
                    for p in (own, choice.problem)
                )
                joints += len(choice.joints)
                for k, joint in enumerate(choice.joints):
                    if joint.is_changed:
                        ratios.append((chosen[k] / present[k]) ** 2)
                        change = f"{100 * (ratios[-1] - 1):+.1f} %"
                        print(f"  {record}, {name}: {joint.joint} {joint.chosen.name}, {change}")
    worse = [100 * (r - 1) for r in ratios if r > 1]
    print(
        f"  {joints} joints, {len(ratios)} with another law, {len(worse)} of them worse on the "
        f"next motion, worst {max(worse, default=0.0):+.1f} %, mean of all "
        f"{100 * (np.mean(ratios) - 1):+.1f} %",
        flush=True,
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("parts", nargs="*", default=["plain", "rich", "kr300"])
    parser.add_argument("--arms", type=int, default=10)
    parser.add_argument("--first", type=int, default=10)
    parser.add_argument("--motions", type=int, nargs="*", default=[2, 1])
    options = parser.parse_args()
    for part in options.parts:
        if part in ("kr300", "records"):
            {"kr300": kr300, "records": records}[part]()
            continue
        for motions in options.motions:
            arms(options.first, options.arms, part == "rich", motions)


if __name__ == "__main__":
    main()
