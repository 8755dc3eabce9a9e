"""Identify the EMPS and try the model on a run that it has not seen.

First the benchmark authors' own least squares: their published values come out to the last
digit. Then the methods of experiment.toml. All are judged on the validation run, which repeats the
reference while pulses are added to the drive's input: the whole loop (controller, saturation,
pulses, robot) is simulated with the identified parameters, and force and position are compared
with the log. Last the law of friction.toml: viscous friction for each direction, Stribeck friction,
and a drive that answers late.

    PIVIDENT_DATA=FOLDER python identify_emps.py [--folder FOLDER]
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident import Bandpass, LeastSquares, Problem, identify, load_experiment
from pivident.data import load_emps_pulses
from pivident.estimation import AuxiliaryModel
from pivident.foundation.errors import IdentificationError
from pivident.judgement import as_logged
from pivident.robot import FrictionLaw, coulomb, offset, viscous

HERE = Path(__file__).parent

#: Published values of the benchmark's authors (IDIM-LS): mass, viscous, Coulomb, offset.
PUBLISHED = {"m1": 95.1089, "fv1": 203.5034, "fc1": 20.3935, "off1": -3.1648}


#: The authors' preprocessing: filter at 100 Hz, first 49 samples dropped, decimation by 10.
AUTHORS = LeastSquares(
    weighted=False, signals=Bandpass(cutoff=100, padlen=12, edge=(49, 0), decimation=10)
)


def authors_estimate(problem: Problem) -> np.ndarray:
    """Least squares as the authors did it: the hard sign for Coulomb friction, no mask."""
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    robot = problem.robot.with_friction(law)
    return identify(Problem(robot, problem.recordings, mask=None), AUTHORS).theta


def unseen_error(problem: Problem, theta: np.ndarray) -> tuple[float, float]:
    """Simulate the validation run with the identified parameters.

    Returns:
        Relative error of the force [%], rms error of the position [µm].
    """
    drive_delay = problem.recordings[0].drive_delay
    pulses = replace(load_emps_pulses(), drive_delay=drive_delay)
    simulation = AuxiliaryModel(Problem(problem.robot, (pulses,), problem.loop), differences=False)
    (motion,) = simulation.simulate(theta)
    error = as_logged(motion.tau.T, pulses) - pulses.tau
    force = np.linalg.norm(error) / np.linalg.norm(pulses.tau)
    position = np.sqrt(np.mean((motion.q.T - pulses.q) ** 2))
    return 100 * float(force), 1e6 * float(position)


def main(folder: Path = HERE) -> dict[str, tuple[np.ndarray, float, float]]:
    """Run the example.

    Args:
        folder: where experiment.toml is.

    Returns:
        Parameters, unseen force error [%] and position error [µm], by the method's short name.
    """
    experiment = load_experiment(folder / "experiment.toml")
    problem = experiment.problem()
    estimates = {"published": np.array([*PUBLISHED.values()]), "authors": authors_estimate(problem)}
    for name, method in experiment.methods().items():
        try:
            estimates[name] = identify(problem, method).theta
        except IdentificationError as error:
            print(f"{name}: {error}")
    print(f"{'':12s} " + " ".join(f"{name:>9s}" for name in PUBLISHED) + "  unseen force, position")
    rows = {}
    for name, theta in estimates.items():
        force, position = unseen_error(problem, theta)
        rows[name] = (theta, force, position)
        values = " ".join(f"{value:9.4f}" for value in theta)
        print(f"{name:12s} {values}  {force:5.2f} %, {position:5.2f} µm")
    rows["friction"] = friction_that_fits(folder)
    return rows


def friction_that_fits(folder: Path) -> tuple[np.ndarray, float, float]:
    """PIV with the laws of friction.toml: parameters, unseen force [%] and position [µm]."""
    experiment = load_experiment(folder / "friction.toml")
    problem = experiment.problem()
    found = identify(problem, experiment.methods()["piv"])
    force, position = unseen_error(problem, found.theta)
    values = " ".join(
        f"{name} {value:.4g} ± {2 * std:.2g}"
        for name, value, std in zip(found.names, found.theta, found.std, strict=True)
    )
    print(f"piv, friction that fits (±2σ): {values}  {force:.2f} %, {position:.2f} µm")
    return found.theta, force, position


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=HERE)
    main(**vars(parser.parse_args()))
