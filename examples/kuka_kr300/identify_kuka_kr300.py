"""Identify axes 1 to 3 of a KUKA KR300 from two motions with recorded reference and feed-forward.

Three steps. (1) The controller: how much of the torque the recorded feed-forward explains, the law
that follows from the recorded reference (its drives take a speed setpoint), and beside it the gains
that the authors of the records state and those that the noise in the loop tells. (2) The methods of
experiment.toml on both motions. (3) One motion alone does not excite the arm enough: its condition
number, and its error on the other motion below 4 Hz. README.md has the figures.

    PIVIDENT_DATA=FOLDER python identify_kuka_kr300.py [--folder FOLDER]
"""

import argparse
from dataclasses import replace
from pathlib import Path

import numpy as np

from pivident import (
    Identification,
    Problem,
    RandomWalk,
    Recording,
    identify,
    load_experiment,
    verdict,
)
from pivident.estimation import ControllerIdentification, estimate_kinematics, feedback_from_noise
from pivident.foundation.errors import IdentificationError
from pivident.signals import butterworth

HERE = Path(__file__).parent

#: Gains of the authors' model of the drives: position [1/s] and speed [N m s/rad of the motor].
STATED = ((0.548, 0.504, 0.534), (1046.4, 1137.6, 1073.4))


def feed_forward_share(recordings: tuple[Recording, ...], gain: np.ndarray) -> np.ndarray:
    """Share of the torque's variance that the feed-forward explains, shape (joints,)."""
    torque = np.concatenate([r.tau / gain for r in recordings])
    held = [r.tau / gain - r.inputs["feed_forward"] for r in recordings]
    left = np.concatenate([x - x.mean(axis=0) for x in held])  # but for the torque at rest
    return 1.0 - left.var(axis=0) / torque.var(axis=0)


def controller(
    recordings: tuple[Recording, ...], gain: np.ndarray, found: ControllerIdentification
) -> dict[str, np.ndarray]:
    """What can be said about the control law: shares and speed gains, each of shape (joints,)."""
    share = feed_forward_share(recordings, gain)
    print(f"feed-forward explains {', '.join(f'{100 * s:.0f} %' for s in share)} of the torque")
    print(f"{found}\n")
    told = [feedback_from_noise(recording, gain) for recording in recordings]
    speed_gains = np.mean([[axis.kd for axis in own] for own in told], axis=0)
    explained = np.mean([[axis.explained for axis in own] for own in told], axis=0)
    for j, (law, position, speed) in enumerate(zip(found.joints, *STATED, strict=True)):
        print(
            f"axis {j + 1}: position gain {law.gain('position_gain'):.3f}, stated {position:.3f}; "
            f"speed gain {law.gain('speed_gain'):.0f}, stated {speed:.0f}, noise "
            f"{speed_gains[j]:.0f} ({100 * explained[j]:.0f} % of the torque beyond the motion)"
        )
    return {"share": share, "speed_gains": speed_gains, "explained": explained}


def unseen_error(result: Identification, recording: Recording) -> np.ndarray:
    """‖τ - Φθ‖/‖τ‖ of each axis, both sides below 4 Hz [%], shape (joints,)."""
    motion = estimate_kinematics(recording, RandomWalk())
    model = result.predict(motion.q.T, motion.dq.T, motion.ddq.T)
    error, torque = (
        np.linalg.norm(butterworth(x, recording.rate, cutoff=4.0), axis=0)
        for x in (motion.tau.T - model, motion.tau.T)
    )
    return 100 * error / torque


def main(folder: Path = HERE) -> dict[str, object]:
    """Run the example.

    Args:
        folder: where experiment.toml is.

    Returns:
        The controller's figures and law, results on both motions by method, and the result and the
        errors of motion A alone.
    """
    experiment = load_experiment(folder / "experiment.toml")
    problem = experiment.problem()
    first, second = problem.recordings
    gain = np.diag(problem.robot.transmission.reduction)
    assert problem.loop is not None and problem.loop.identified is not None
    figures = controller(experiment.recordings(), gain, problem.loop.identified)
    results = {name: identify(problem, own) for name, own in experiment.methods().items()}
    for result in results.values():
        friction = " ".join(f"{result.value(f'fc{j}'):4.0f}" for j in (1, 2, 3))
        print(f"{result.method:22s} {result.iterations} it   fc1 … fc3 {friction} N m")
    alone = identify(Problem(problem.robot, (first,)), "ls")
    errors = unseen_error(alone, second)
    print(f"motion A alone, on motion B: {', '.join(f'{e:.0f} %' for e in errors)}")
    print(verdict(alone))
    try:
        identify(replace(problem, recordings=(first,), parameters=None), experiment.methods()["iv"])
    except IdentificationError as error:
        print(f"  IV: {error}")
    law = problem.loop.identified
    return {"controller": figures, "law": law, "results": results, "alone": alone, "errors": errors}


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--folder", type=Path, default=HERE)
    main(**vars(parser.parse_args()))
