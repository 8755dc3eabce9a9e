"""Least squares on logs of irregular clocks: which clock, which cut-off, and what each costs.

    python benchmarks/irregular_clocks.py [first seed] [last seed]

Logs come from Pinocchio's inverse dynamics (`tests.other_arms`): six axes, encoders of 14 bits at
the joint or before the gear, jittery stamps at 94 to 100 Hz, stops. An estimate is judged by the
torque of another motion without noise: ‖τ - Φθ‖/‖τ‖ over all joints. The same motion with the same
noise on a regular clock is the yardstick of the clock, the best of a grid of cut-offs and bands
that of the recipe.
"""

from __future__ import annotations

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.other_arms import ArmLog, Setting, make_log, predicted_motion

from pivident.data.recording.load import load_recording
from pivident.estimation.identify import identify
from pivident.estimation.least_squares import LeastSquares
from pivident.estimation.problem import Problem
from pivident.estimation.signal_recipes import Bandpass, RandomWalk
from pivident.foundation.errors import PividentError
from pivident.robot.urdf import read_urdf

#: Bands [Hz], and cut-offs over them.
BANDS, RATIOS = (5.0, 8.0, 12.0, 16.0, 20.0), (1.0, 1.5, 2.5)


def setting(seed: int) -> Setting:
    """A log of 94 to 100 Hz with jitter."""
    rng = np.random.default_rng([seed, 94])
    return Setting(
        clock="jitter",
        rate=float(rng.uniform(94.0, 100.0)),
        seconds=40.0,
        stops=float(rng.choice([0.0, 1.0])),
        torque_noise=float(rng.choice([0.001, 0.005, 0.02])),
        speed="none",
        fastest=float(rng.choice([0.8, 2.0])),
    )


def problem_of(log: ArmLog, folder: Path) -> Problem:
    """What an identification is given."""
    table, description = log.write(folder)
    robot, names = read_urdf(description), log.arm.joint_names
    columns = {"t": "t", "q": [f"q_{n}" for n in names], "tau": [f"tau_{n}" for n in names]}
    read = load_recording(table, columns, robot=robot, resample=True, torque_timing="sampled")
    return Problem(robot, (read,))


def error(problem: Problem, method: LeastSquares, truth: tuple[np.ndarray, ...]) -> float:
    """Torque error of another motion [%], NaN where nothing can be estimated."""
    try:
        predicted = identify(problem, method).predict(*truth[:3])
    except PividentError:
        return np.nan
    return 100.0 * float(np.linalg.norm(predicted - truth[3]) / np.linalg.norm(truth[3]))


def main(first: int, last: int) -> None:
    recipes = {
        "from the record": Bandpass(),
        "45 Hz, band 20 Hz": Bandpass(cutoff=45.0, bandwidth=20.0),
        "random walk": RandomWalk(),
    }
    grid = {(b, r): Bandpass(cutoff=r * b, bandwidth=b) for b in BANDS for r in RATIOS}
    rows = []
    print("torque error of another motion [%]: jittery clock / regular clock")
    print("seed  " + "  ".join(f"{name:>19s}" for name in recipes) + "   best of the grid")
    for seed in range(first, last):
        given, cells, best = setting(seed), [], np.inf
        with tempfile.TemporaryDirectory() as folder:
            problems = [
                problem_of(make_log(seed, s), Path(folder))
                for s in (given, replace(given, clock="regular"))
            ]
            truth = predicted_motion(seed, given)
        for recipe in recipes.values():
            cells += [error(problem, LeastSquares(signals=recipe), truth) for problem in problems]
        found = {
            key: error(problems[0], LeastSquares(signals=recipe), truth)
            for key, recipe in grid.items()
            if recipe.cutoff < 0.5 * problems[0].recordings[0].rate
        }
        key = min(found, key=found.__getitem__)
        best = found[key]
        rows.append([*cells, best])
        both = zip(cells[::2], cells[1::2], strict=True)
        pairs = "  ".join(f"{a:8.3f} / {b:8.3f}" for a, b in both)
        print(
            f"{seed:4d}  {pairs}   {best:.3f} ({key[0]:g} Hz, {key[0] * key[1]:g} Hz)", flush=True
        )
    table = np.array(rows)
    mean = np.exp(np.nanmean(np.log(table), axis=0))
    print("geometric means: " + ", ".join(f"{x:.3f}" for x in mean))
    print(f"jittery over regular clock: {mean[0] / mean[1]:.3f}")
    print(f"recipe from the record over the best of the grid: {mean[0] / mean[-1]:.3f}")


if __name__ == "__main__":
    bounds = [int(x) for x in sys.argv[1:3]] or [0, 20]
    main(*bounds)
