"""Standard errors that a design predicts beside those that PIV reports on records of its motion.

    python -m benchmarks.excitation.predicted_errors [--records 4] [--seconds 10] [--designed]

A TX40 in closed loop with encoder noise. PIV of one record, of point-to-point moves or of a
designed motion, gives the noise; five designs follow that result (three families, three criteria),
and each is run with new noise. Printed: the median and the largest of |reported/predicted - 1| over
the parameters, the geometric mean of reported/predicted, and the coverage of the 95 % intervals.
"""

from __future__ import annotations

import argparse

import numpy as np

import pivident as pv
from pivident.experiment.simulated_tx40 import _KD, _KP, _KTAU
from pivident.robot.gallery import load_robot
from pivident.studies import DesignRequest, design_motion

DESIGNS = (
    ("fourier", "a", 10.0),
    ("fourier", "worst", 20.0),
    ("splines", "a", 15.0),
    ("postures", "a", 20.0),
    ("splines", "d", 10.0),
)

RATE, ENCODER, TORQUE = 1000.0, 2e-6, 0.02


def simulated(robot, reference, seed: int, truth_values=None):
    """A record of a reference, and its truth."""
    loop = pv.Loop(pv.PD(_KP * _KTAU, _KD * _KTAU))
    made = pv.simulate(
        robot, loop, reference, rate=RATE, duration=30.0, encoder=ENCODER, torque=TORQUE, seed=seed
    )
    return made, pv.Problem(robot, (made.recording,), loop)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--records", type=int, default=4, help="of each design")
    parser.add_argument("--seconds", type=float, default=10.0, help="of each search")
    parser.add_argument("--designed", action="store_true", help="first record: a designed motion")
    options = parser.parse_args()
    robot = load_robot("staubli_tx40")
    moves = None
    if options.designed:
        request = DesignRequest(duration=30.0, seconds=options.seconds, seed=7)
        moves, *_ = design_motion(robot, request).motion.sampled(RATE)
    _, problem = simulated(robot, moves, 1)
    first = pv.identify(problem, "piv")
    print(f"first record: {first.method}, {first.iterations} iterations")
    logarithms, worst = [], []
    for number, (motion, criterion, duration) in enumerate(DESIGNS):
        request = DesignRequest(
            duration=duration, motion=motion, criterion=criterion, seconds=options.seconds,
            seed=number,
        )  # fmt: skip
        design = design_motion(robot, request, after=[first])
        predicted = np.array([p.alone for p in design.predicted])
        reference, *_ = design.motion.sampled(RATE)
        ratios, covered = [], []
        for seed in range(options.records):
            made, problem = simulated(robot, reference, 100 + 10 * number + seed)
            found = pv.identify(problem, "piv")
            ratios.append(found.std / predicted)
            error = np.abs(found.theta - np.array([made.truth[n] for n in found.names]))
            covered.append(error < 1.96 * found.std)
        ratio = np.exp(np.log(ratios).mean(axis=0))
        worst.append(np.abs(ratio - 1.0).max())
        logarithms.append(np.log(ratio))
        k = int(np.argmax(np.abs(ratio - 1.0)))
        print(
            f"{motion:9} {criterion:6} {duration:4.0f} s: |reported/predicted - 1| median "
            f"{100 * np.median(np.abs(ratio - 1)):.1f} %, largest {100 * worst[-1]:.1f} % "
            f"({found.names[k]}), mean ratio {np.exp(np.log(ratio).mean()):.3f}, coverage "
            f"{100 * np.mean(covered):.1f} %",
            flush=True,
        )
    ratios = np.exp(np.ravel(logarithms))
    within = np.mean(np.abs(ratios - 1.0) < 0.15)
    by_parameter = np.exp(np.mean(logarithms, axis=0))
    print(
        f"all designs: {100 * within:.0f} % of the parameters within 15 %, mean ratio "
        f"{np.exp(np.log(ratios).mean()):.3f}, largest {100 * max(worst):.1f} %; mean over the "
        f"designs by parameter {by_parameter.min():.2f} to {by_parameter.max():.2f}"
    )


if __name__ == "__main__":
    main()
