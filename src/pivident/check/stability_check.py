"""Whether the sampled loop around the described robot is stable with the gains of the file."""

from __future__ import annotations

import numpy as np

from pivident.check.gains_check import CONTROLLER, of_joint
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values
from pivident.experiment.schema import ControllerEntry
from pivident.robot.description import Robot
from pivident.text.finding import Finding, FindingKind

UNSTABLE = FindingKind(CONTROLLER, "unstable")

#: Growth per control period from which a loop is called unstable.
GROWTH = 1.002


def check_stability(
    robot: Robot, entry: ControllerEntry, rate: float, posture: np.ndarray
) -> list[Finding]:
    """Whether the sampled loop around the described robot holds a posture.

    With M the mass matrix, x = (δq, δdq) and a torque held for a period h,

        δq⁺ = δq + h δdq + ½h² M⁻¹δτ,  δdq⁺ = δdq + h M⁻¹δτ,  δτ = -Kp δq - Kd (δq - δq⁻)/h,

    without gravity and friction, which are slow beside the loop. The loop is unstable where an
    eigenvalue of this map exceeds one.
    """
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    known = all(np.any(k.inertia) for k in robot.tree.links if k.is_body)
    if not np.any(theta) or entry.kp is None or not known:
        return []
    n, h = robot.size, 1.0 / rate
    inverse = np.linalg.inv(mass_matrix(robot, base.parameters, theta, posture[None])[0])
    gain = np.array([of_joint(entry.gain, j) for j in range(n)])
    kp = gain * [of_joint(entry.kp, j) for j in range(n)]
    kd = gain * [of_joint(entry.kd if entry.kv is None else entry.kv, j) for j in range(n)]
    if entry.type == "cascade":
        kp = kp * [of_joint(entry.kv, j) for j in range(n)]
    one, zero = np.eye(n), np.zeros((n, n))
    law = np.hstack([-np.diag(kp + kd / h), zero, np.diag(kd / h)])  # on δq, δdq, δq⁻
    step = np.block([[one, h * one, zero], [zero, one, zero], [one, zero, zero]])
    step[:n] += 0.5 * h**2 * inverse @ law
    step[n : 2 * n] += h * inverse @ law
    values, vectors = np.linalg.eig(step)
    k = int(np.argmax(np.abs(values)))
    growth = float(abs(values[k]))
    if growth <= GROWTH or not np.all(kd):
        return []
    worst = robot.joint_names[int(np.argmax(np.abs(vectors[:n, k])))]
    causes = "Check the units of kp and kd (N m per rad and per rad/s on the joint side), "
    causes += "drive_gain, control_rate, and the masses of the description."
    bare = not np.any(robot.rotor_inertia)
    if bare:
        causes = "The description has no rotor inertias, which count in full behind a gear: give "
        causes += "rotor_inertia under [robot]. Else check the units of kp and kd."
    return [
        UNSTABLE.finding(
            "warning" if bare else "error",
            f"The loop of {worst} is unstable with these gains at {rate:.5g} Hz: errors grow by a "
            f"factor of {growth:.3g} in each control period.",
            worst,
            causes,
            place=("controller", "kd" if entry.type != "cascade" else "kv"),
        )
    ]
