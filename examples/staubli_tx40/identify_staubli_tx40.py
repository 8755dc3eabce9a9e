"""Identify a Stäubli TX40 from a real record, without knowing its controller.

Three steps. (1) The laboratory's weighted least squares with all 61 base parameters, beside the
values that it published. (2) The methods of experiment.toml on the essential parameters; the log
holds no reference, so IV and PIV follow the smoothed measurement with a declared virtual law.
(3) Does it hold? Each method is fitted once more on the first 6 s and judged on the rest of the
motion, which it has not seen, by the relative error of the torque below 20 Hz.

    PIVIDENT_DATA=FOLDER python identify_staubli_tx40.py [--folder FOLDER]
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident import (
    Bandpass,
    Identification,
    LeastSquares,
    Problem,
    Recording,
    Robot,
    identify,
    load_experiment,
)
from pivident.data import load_staubli_tx40
from pivident.foundation.errors import IdentificationError
from pivident.robot import FrictionLaw, coulomb, offset, viscous
from pivident.signals import bandpass, butterworth

HERE = Path(__file__).parent

#: Some of the values listed by the laboratory, with their standard deviations [%].
PUBLISHED = {
    "zz1": (1.24, 1.11), "fv1": (8.05, 0.68), "fc1": (7.14, 2.24), "xx2": (-0.466, 2.59),
    "zz2": (1.08, 1.01), "mx2": (2.22, 2.43), "fv2": (5.53, 1.04), "fc2": (8.26, 1.69),
    "my3": (-0.601, 2.11), "ia3": (0.0988, 7.21), "fv3": (1.97, 1.66), "fc3": (6.34, 1.71),
    "ia4": (0.0313, 7.15), "ia5": (0.0468, 7.90), "ia6": (0.0105, 11.9), "iam6": (0.00964, 13.0),
}  # fmt: skip

#: The laboratory's filters.
LABORATORY = Bandpass(cutoff=100, median=3, decimation=(10, 10), edge=20)

#: Time up to which the motion is fitted, to be judged on the rest [s].
FITTED = 6.0


def laboratory(robot: Robot, method: LeastSquares) -> Identification:
    """Weighted least squares on the whole record, with the hard sign for Coulomb friction."""
    law = FrictionLaw((viscous(), coulomb("sign"), offset()))
    problem = Problem(robot.with_friction(law), (load_staubli_tx40(),), mask=0.01)
    result = identify(problem, method)
    print(f"{len(result.names)} parameters, relative residual {100 * result.relative_error:.2f} %")
    for name, (value, percent) in PUBLISHED.items():
        here = result.value(name)
        distance = (here - value) / abs(percent / 100 * value)
        print(f"  {name:5s} laboratory {value:9.4g}   here {here:9.4g}   {distance:+.1f} σ")
    return result


def unseen_error(result: Identification, recording: Recording) -> float:
    """‖τ - Φθ‖/‖τ‖ of the unseen part over all joints, both sides below 20 Hz [%]."""
    motion = bandpass(recording.q, recording.rate, cutoff=100.0, median=3)
    model = result.predict(motion.q, motion.dq, motion.ddq)
    error, torque = (
        butterworth(x, recording.rate, cutoff=20.0)[recording.t >= FITTED]
        for x in (recording.tau - model, recording.tau)
    )
    return 100 * float(np.linalg.norm(error) / np.linalg.norm(torque))


def main(folder: Path = HERE) -> dict[str, tuple[Identification, float]]:
    """Run the example.

    Args:
        folder: where experiment.toml is.

    Returns:
        Results on the whole record and error on the unseen part [%], by the method's short name.
    """
    experiment = load_experiment(folder / "experiment.toml")
    problem = experiment.problem()
    methods = experiment.methods()
    (recording,) = problem.recordings
    beginning = replace(problem, recordings=(recording.slice(0.0, FITTED),))
    reference = laboratory(problem.robot, LeastSquares(signals=LABORATORY))
    results = {"laboratory": (reference, float("nan"))}
    for name, method in methods.items():
        try:
            result = identify(problem, method)
            unseen = unseen_error(identify(beginning, method), recording)
        except IdentificationError as error:
            print(f"{name}: {error}")
            continue
        results[name] = (result, unseen)
        friction = " ".join(f"{result.value(f'fc{j}'):6.2f}" for j in range(1, 7))
        print(f"{result.method:22s} unseen {unseen:5.2f} %   fc1 … fc6 {friction}")
    return results


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=HERE)
    main(**vars(parser.parse_args()))
