"""Which measurement's error does what to an estimate of a quadruped on a cable; MuJoCo's records.

python benchmarks/floating_channels.py [--runs 4] [--seconds 12] [--method iv-full-rate]

The error of an estimate is linear in the residual that the true parameters leave,

    θ̂ - θ = (Σ Zᵀ Φ/λ)⁻¹ Σ Zᵀ (τ - Φ(q̂) θ)/λ

so that the residual can be taken apart: what the noise of the wrenches adds to τ, and what Φ θ
changes where position or attitude of the base, or their derivatives, are the estimated ones and not
the true ones. What is left belongs to the legs and to the model. Each part is shown in standard
errors of the estimate, mean over records of one reference, for the parameters that are most off.
"""

from __future__ import annotations

import argparse

import numpy as np
from benchmarks.mujoco_base import Accuracy, truth_of
from benchmarks.quadruped import hanging_record, quadruped

from pivident.data.recording.recording import Recording
from pivident.estimation.equation_record import accumulate
from pivident.estimation.identification import Identification
from pivident.estimation.identify import identify
from pivident.estimation.methods import METHODS
from pivident.estimation.normal_equations import solve
from pivident.estimation.problem import Problem
from pivident.loop.motion.motion import residual_of
from pivident.robot.description import Robot
from pivident.robot.measured_base import with_wrench_sensors
from pivident.signals.instants import differences_at_instants

#: Channels of the base, by the joints that they are.
CHANNELS = {"position": slice(0, 3), "attitude": slice(3, 6)}

#: Parameters that are shown.
SHOWN = 8


def parts_of(
    found: Identification, recording: Recording, exact: Recording, theta: np.ndarray
) -> dict[str, np.ndarray]:
    """Parts of the residual of θ, each (joints, samples), the whole first."""
    assert found.equations is not None
    record, regressor = found.equations.records[0], found.equations.regressor
    kin = record.kinematics
    assert recording.wrench_torque is not None and exact.wrench_torque is not None
    parts = {"whole": residual_of(regressor, kin, theta)}
    parts["wrenches"] = (recording.wrench_torque - exact.wrench_torque).T

    def model(*motion: np.ndarray) -> np.ndarray:
        return regressor.torque(*(x.T for x in motion), theta).T

    true = np.ascontiguousarray(exact.q.T)
    speed, acceleration = np.empty((2, *true.shape))
    differences_at_instants(true, exact.rate, 0, speed, acceleration)
    estimated, exactly = (kin.q, kin.dq, kin.ddq), (true, speed, acceleration)
    as_found = model(*estimated)
    for channel, own in CHANNELS.items():
        for k, derivative in enumerate(("", "speed", "acceleration")):
            changed = [x.copy() for x in estimated]
            changed[k][own] = exactly[k][own]
            parts[f"{channel} {derivative}".strip()] = model(*changed) - as_found
    parts["legs, model"] = parts["whole"] - sum(p for k, p in parts.items() if k != "whole")
    return parts


def errors_of(found: Identification, parts: dict[str, np.ndarray]) -> dict[str, np.ndarray]:
    """What each part does to the estimate, in its standard errors, shape (parameters,)."""
    equations = found.equations
    assert equations is not None
    made = {}
    for name, part in parts.items():
        records = [equations.records[0].with_torque(part)]
        sums = accumulate(equations.regressor, records, equations.filters, by_window=False)
        solution = solve(sums, equations.variance, found.names, equations.weight_power)
        made[name] = solution.theta / found.std
    return made


def run(robot: Robot, method: str, seed: int, seconds: float) -> dict[str, np.ndarray]:
    """One record."""
    recording = hanging_record(robot, seed, seconds)
    exact = hanging_record(robot, seed, seconds, Accuracy(force=0.0, position=0.0, rotation=0.0))
    own = with_wrench_sensors(robot, [w.sensor for w in recording.wrenches])
    found = identify(Problem(own, (recording,)), METHODS[method])
    truth = truth_of(robot)
    theta = np.array([truth[name] for name in found.names])
    made = errors_of(found, parts_of(found, recording, exact, theta))
    return made | {"names": np.array(found.names)}


def main() -> None:
    """Run as a script."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--runs", type=int, default=4)
    parser.add_argument("--seconds", type=float, default=12.0)
    parser.add_argument("--method", choices=("iv-full-rate", "piv"), default="iv-full-rate")
    chosen = parser.parse_args()
    robot = quadruped()
    made = [run(robot, chosen.method, seed, chosen.seconds) for seed in range(chosen.runs)]
    names = made[0].pop("names")
    mean = {k: np.mean([own[k] for own in made], axis=0) for k in made[0]}
    print(" " * 28 + "".join(f"{k:>23}" for k in mean))
    for i in np.argsort(-np.abs(mean["whole"]))[:SHOWN]:
        print(f"{names[i]:28}" + "".join(f"{own[i]:23.2f}" for own in mean.values()))
    print(f"{'rms':28}" + "".join(f"{np.sqrt(np.mean(own**2)):23.2f}" for own in mean.values()))


if __name__ == "__main__":
    main()
