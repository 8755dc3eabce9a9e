"""Cut, merge, fix, bound, expect, leave a joint out, save, load and compare."""

from dataclasses import replace
from pathlib import Path

import pivident as pv


def main(folder: Path) -> tuple[dict[str, pv.Identification], str]:
    """The results by name, and the comparison of two that were read from their files."""
    robot, loop = pv.load_robot("planar_2r"), pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    runs = [
        pv.simulate(
            robot, loop, duration=6.0, encoder=1e-5, seed=seed, name=f"run {seed}"
        ).recording
        for seed in (1, 2)
    ]
    cut = [run.slice(0.5, 5.5) for run in runs]
    problem = pv.Problem(robot, tuple(cut), loop)  # both recordings share the parameters
    problems = {
        "plain": problem,
        "fixed": replace(problem, fixed={"ia2": 0.1}),
        "bounded": replace(problem, bounds={"my1": (0.0, None), "my2": (0.0, None)}),
        "expected": replace(problem, priors={"zz1r": (0.864, 1e-5)}),
        "tied": replace(problem, constraints=[({"fc1": 1.0, "fc2": -2.0}, 0.0)]),
        "elbow": replace(problem, without_equation=("shoulder",)),
    }
    results = {name: pv.identify(own, "piv") for name, own in problems.items()}
    for name, result in results.items():
        result.save(folder / name)
    back = [pv.load_identification(folder / name) for name in ("plain", "fixed")]
    return results, str(pv.compare(back, labels=["plain", "fixed"]))


if __name__ == "__main__":
    print(main(Path("results"))[1])
