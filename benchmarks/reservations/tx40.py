"""Records of the TX40 whose motion comes from Pinocchio, with the noise of `tx40_scenario`.

Pinocchio's chain is built from the robot's table (`torque_bound`). Bodies of unit mass whose other
parameters make up for it have the 28 essential base parameters of the scenario and no others.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pinocchio as pin
from benchmarks.model_faults.simulator import COULOMB, GAMMA, SPEED, VISCOUS, speeds_after
from benchmarks.torque_bound import ORDER, model_of, table

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.experiment import simulated_tx40 as scenarios

#: Joint 5, and joint 6, whose motor turns with both.
WRIST, HAND = 4, 5


def tx40_record(scenario: str, seed: int) -> tuple[pv.Problem, dict[str, float]]:
    """A scenario's problem with another simulator's record, and the true parameters by name."""
    problem, truth = scenarios.tx40_scenario(scenario, seed)
    noise, (recording,) = scenarios.NOISES[scenario], problem.recordings
    in_loop = noise.in_loop(seed, recording.q.shape)
    q, tau = simulate(problem, truth, in_loop)
    made = replace(
        recording,
        q=noise.quantised(q + in_loop),
        tau=tau + noise.of_torque(seed, tau.shape),
    )
    return replace(problem, recordings=(made,)), truth


def simulate(
    problem: pv.Problem, truth: dict[str, float], noise: np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """Positions and torques at the ticks of the loop, each (samples, joints).

    Args:
        problem: robot, law and reference.
        truth: true base parameters by name.
        noise: of the positions that the law reads [rad], shape (samples, joints).
    """
    (recording,), law = problem.recordings, problem.loop.controller
    kp, kd, h = np.asarray(law.kp), np.asarray(law.kd), 1.0 / scenarios.RATE
    model = pin_model(problem.robot, truth)
    data, rotor = model.createData(), np.diag([truth.get(f"ia{j + 1}", 0.0) for j in range(6)])
    rows, levels = friction(truth)
    q, v, last = recording.q_ref[0].copy(), np.zeros(6), recording.q_ref[0]
    positions, torques = np.zeros_like(noise), np.zeros_like(noise)
    for k in range(len(noise)):
        measured = q + noise[k]
        speed, last = (measured - last) / h, measured
        tau = kp * (recording.q_ref[k] - measured) + kd * (recording.dq_ref[k] - speed)
        positions[k], torques[k] = q, tau
        middle, w = q + 0.5 * h * v, v
        upper = np.triu(pin.crba(model, data, middle))
        inertia = upper + np.triu(upper, 1).T + rotor
        for _ in range(2):
            bias = pin.nonLinearEffects(model, data, middle, w)
            after = speeds_after(inertia, v, tau - bias, h, rows, levels, False)
            w = 0.5 * (v + after)
        q, v = middle + 0.5 * h * after, after
    return positions, torques


def pin_model(robot: pv.Robot, truth: dict[str, float]) -> pin.Model:
    """Bodies of unit mass with given base parameters; rotors are not among them."""
    base = base_parameters(robot)
    place = {parameter.name: k for k, parameter in enumerate(base.standard)}
    standard = np.zeros(len(place))
    standard[[place[f"m{j + 1}"] for j in range(6)]] = 1.0
    lacks = np.array([truth.get(p.name, 0.0) for p in base.parameters]) - base.values(standard)
    for parameter, value in zip(base.parameters, lacks, strict=True):
        standard[place[parameter.name]] += value
    model = model_of(table()["joints"])
    for j in range(6):
        own = np.array([standard[place[f"{stem}{j + 1}"]] for stem in ORDER])
        model.inertias[j + 1] = pin.Inertia.FromDynamicParameters(own)
    return model


def friction(truth: dict[str, float]) -> tuple[np.ndarray, np.ndarray]:
    """Directions of friction, shape (7, 6), and its table for `speeds_after`."""
    rows, levels = np.vstack([np.eye(6), np.zeros(6)]), np.zeros((6, 7))
    rows[6, [WRIST, HAND]] = 1.0
    for j in range(6):
        levels[VISCOUS, j] = truth.get(f"fv{j + 1}", 0.0)
        levels[COULOMB, j] = truth.get(f"fc{j + 1}", 0.0)
    # what both wrist joints have of the motor's viscous friction belongs to their own fv
    levels[VISCOUS, [WRIST, HAND, 6]] += np.array([-1.0, -1.0, 1.0]) * truth["fvm6"]
    levels[COULOMB, 6] = truth["fcm6"]
    levels[GAMMA], levels[SPEED] = table()["friction"][1]["gamma"], 1.0
    return rows, levels
