"""Identify the EMPS and try the model on a run that it has not seen.

The validation run repeats the reference while pulses are added to the drive's input. With the
identified parameters the whole loop (controller, saturation, pulses, robot) is simulated; what
counts is how well force and position of the unseen run come out. The least-squares recipe is the
authors', so their published values come out to the last digit.

    PIVIDENT_DATA=FOLDER python identify_emps.py [--folder FOLDER]
"""

import argparse
from pathlib import Path

import numpy as np

from pivident import Bandpass, Identification, LeastSquares, Problem, identify, load_experiment
from pivident.errors import IdentificationError
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.recording.public_records import load_emps_pulses

HERE = Path(__file__).parent

#: Published values of the benchmark's authors (IDIM-LS): mass, viscous, Coulomb, offset.
PUBLISHED = {"m1": 95.1089, "fv1": 203.5034, "fc1": 20.3935, "off1": -3.1648}

#: Their preprocessing: 100 Hz, 49 samples dropped at the ends, decimation by 10, all rows vote.
AUTHORS = LeastSquares(weighted=False, signals=Bandpass(cutoff=100, decimation=10, edge=49))


def unseen_error(problem: Problem, result: Identification) -> tuple[float, float]:
    """Simulate the validation run with the identified parameters.

    Returns:
        Relative error of the force [%], rms error of the position [µm].
    """
    pulses = load_emps_pulses()
    simulation = AuxiliaryModel(Problem(problem.robot, (pulses,), problem.loop), differences=False)
    (motion,) = simulation.simulate(result.theta)
    force = np.linalg.norm(motion.tau.T - pulses.tau) / np.linalg.norm(pulses.tau)
    position = np.sqrt(np.mean((motion.q.T - pulses.q) ** 2))
    return 100 * float(force), 1e6 * float(position)


def main(folder: Path = HERE) -> dict[str, Identification]:
    """Run the example.

    Args:
        folder: where experiment.toml is.

    Returns:
        Results by name: the experiment's methods, and the authors' recipe as ``authors``.
    """
    experiment = load_experiment(folder / "experiment.toml")
    problem = experiment.problem()
    everywhere = Problem(problem.robot, problem.recordings, problem.loop, mask=0)
    results = {"authors": identify(everywhere, AUTHORS)}
    for name, method in experiment.methods().items():
        try:
            results[name] = identify(problem, method)
        except IdentificationError as error:
            print(f"{name}: {error}")
    print(f"{'':14s} {'m1':>9s} {'fv1':>9s} {'fc1':>8s} {'off1':>8s}   unseen force, position")
    print(f"{'published':14s} " + " ".join(f"{value:8.4f}" for value in PUBLISHED.values()))
    for name, result in results.items():
        values = " ".join(f"{result.value(parameter):8.4f}" for parameter in PUBLISHED)
        force, position = unseen_error(problem, result)
        print(f"{name:14s} {values}   {force:5.2f} %, {position:5.2f} µm")
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=HERE)
    main(**vars(parser.parse_args()))
