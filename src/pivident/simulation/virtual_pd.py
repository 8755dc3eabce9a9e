"""A declared PD law for records whose controller is not known.

Such a loop is virtual: it only has to carry the simulated robot along the measured motion, so its
gains follow from a bandwidth and the robot's nominal inertia instead of from the real drive.
"""

from __future__ import annotations

import numpy as np

from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.errors import ExperimentError
from pivident.robot.description import Robot
from pivident.simulation.controllers import PD, PID


def virtual_pd(
    robot: Robot, posture: np.ndarray, bandwidth: float = 10.0, damping: float = 0.7
) -> PID:
    """PD gains kp = J ω², kd = 2 ζ J ω with ω = 2π · bandwidth and J = diag M(posture).

    A joint's inertia is that of the robot's nominal parameters, or one where they are not known.

    Args:
        robot: the robot.
        posture: joint positions at which the inertia is taken [rad or m], shape (joints,); the
            mean of the motion is a good one.
        bandwidth: of each joint's loop [Hz]. A soft loop lets the model show in the simulated
            motion, a stiff one makes it repeat the measured motion.
        damping: ζ, 1 for critical damping.

    Returns:
        The law, its output in joint torques [N m or N].

    Raises:
        ExperimentError: bandwidth or damping is not positive.
    """
    if not (bandwidth > 0 and damping > 0):
        raise ExperimentError(
            f"a virtual PD law needs a positive bandwidth and damping, not {bandwidth:g} Hz and "
            f"{damping:g}"
        )
    inertia = nominal_inertia(robot, posture)
    omega = 2.0 * np.pi * bandwidth
    return PD(inertia * omega**2, 2.0 * damping * inertia * omega)


def nominal_inertia(robot: Robot, posture: np.ndarray) -> np.ndarray:
    """Diagonal of M(posture) at the nominal parameters, one where that is not positive.

    ``posture``: joint positions [rad or m], shape (joints,). Result: inertia of each joint
    [kg m² or kg], shape (joints,).
    """
    parameters = standard_parameters(robot)
    values = nominal_values(robot, parameters)
    mass = mass_matrix(robot, parameters, values, np.atleast_2d(np.asarray(posture, float)))[0]
    inertia = np.diag(mass).copy()
    return np.where(np.isfinite(inertia) & (inertia > 0.0), inertia, 1.0)
