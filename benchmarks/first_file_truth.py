"""Coverage and errors of what the first file of `pivident init` leads to, on records of Pinocchio.

    python benchmarks/first_file_truth.py [RECORDS]

Random arms with stops, 14-bit encoders, sharp dry friction, 1 % torque noise and no reference
(`tests.other_arms`), 40 s each, by clock and rate: 95 % intervals that hold the truth, rms of error
over standard error, and geometric means of standard error and error. The parameters are those of
the file, the truth that of the arm.
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.other_arms import ArmLog, Setting, make_log

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.problem import Problem
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.text.numbers import plain_table

#: Clock and mean rate [Hz].
CLOCKS = (
    ("regular", 200.0),
    ("regular", 50.0),
    ("alternating", 1000.0 / 11.0),
    ("jitter", 200.0),
    ("jitter", 100.0),
)

ESTIMATORS = ("ls", "iv-full-rate", "piv")


def problem_of(made: ArmLog) -> Problem:
    """The experiment that `init` writes for a log."""
    with tempfile.TemporaryDirectory() as folder:
        log, robot = made.write(Path(folder))
        out = Path(folder) / "experiment.toml"
        out.write_text(draft_experiment([log], str(robot), out=out).text, encoding="utf-8")
        return load_experiment(out).problem()


def truth_of(made: ArmLog, problem: Problem) -> np.ndarray:
    """True base parameters of the arm."""
    base = base_parameters(problem.robot)
    standard = nominal_values(problem.robot, base.standard)
    arm = made.arm
    of_drives = {"ia": arm.rotor_inertia, "fv": arm.viscous, "fc": arm.coulomb, "off": arm.offset}
    for k, parameter in enumerate(base.standard):
        if parameter.stem in of_drives:
            standard[k] = of_drives[parameter.stem][parameter.joint]
    return base.values(standard)


def main() -> None:
    records = int(sys.argv[1]) if len(sys.argv) > 1 else 6
    rows = []
    for clock, rate in CLOCKS:
        setting = Setting(clock, rate, 40.0, 0.5, 0.01, "drive", 0.6)  # type: ignore[arg-type]
        z: dict[str, list[np.ndarray]] = {name: [] for name in ESTIMATORS}
        sizes: dict[str, list[np.ndarray]] = {name: [] for name in ESTIMATORS}
        for seed in range(22, 22 + records):
            made = make_log(seed, setting)
            problem = problem_of(made)
            truth = truth_of(made, problem)
            for name in ESTIMATORS:
                found = identify(problem, METHODS[name])
                error = found.theta - truth
                z[name].append(error / found.std)
                sizes[name].append(np.log([found.std, np.abs(error) + 1e-12]))
        for name in ESTIMATORS:
            own, size = np.array(z[name]), np.exp(np.mean(sizes[name], axis=(0, 2)))
            coverage, rms = 100.0 * np.mean(np.abs(own) < 1.96), np.sqrt(np.mean(own**2))
            place = f"{clock} {rate:.0f} Hz"
            rows.append(
                [place, name, f"{coverage:.0f}", f"{rms:.2f}", *(f"{1e3 * x:.3g}" for x in size)]
            )
        print(f"{clock} {rate:.0f} Hz: {records} records", flush=True)
    titles = ("clock", "method", "coverage %", "rms z", "1000 σ", "1000 |e|")
    print(
        plain_table(
            [(t, "<" if k < 2 else ".", [r[k] for r in rows]) for k, t in enumerate(titles)]
        )
    )


if __name__ == "__main__":
    main()
