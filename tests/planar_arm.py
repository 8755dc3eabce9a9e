"""The planar arm of the tests in its loop: its true parameters, a motion, and what it records."""

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.base_parameters import BaseParameters, base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.loop.simulation.closed_loop import LoopSignals, simulate
from pivident.loop.simulation.controllers import PD
from pivident.loop.simulation.reference import point_to_point
from pivident.robot.gallery import load_robot

NAME = "planar_2r"

#: The law of its controller, as it stands in the experiment files of `planar_log`.
LAW = PD(np.array([6000.0, 2500.0]), np.array([180.0, 60.0]))


def nominal_parameters() -> tuple[BaseParameters, np.ndarray]:
    """Base parameters of the arm and the values that the gallery gives it."""
    base = base_parameters(load_robot(NAME))
    return base, base.values(nominal_values(base.robot, base.standard))


def planar_motion(
    rng: np.random.Generator, rate: float, samples: int, postures: int = 30, reach: float = 1.5
) -> np.ndarray:
    """Reference that goes from posture to posture within ± reach [rad], shape (samples, 2)."""
    speeds = 0.8 * load_robot(NAME).rated_speeds
    angles = rng.uniform(-reach, reach, (postures, 2))
    return point_to_point(angles, speeds, rate, samples)[0]


def planar_record(
    base: BaseParameters,
    theta: np.ndarray,
    q_ref: np.ndarray,
    rate: float,
    rng: np.random.Generator,
    *,
    law: PD = LAW,
    drive_gain: Sequence[float] = (1.0, 1.0),
    encoder_noise: float = 2e-6,
) -> tuple[np.ndarray, np.ndarray]:
    """Measured position [rad] and torque [N m] of the loop, each of shape (samples, 2).

    Args:
        base: base parameters of the arm.
        theta: their values.
        q_ref: reference [rad], shape (samples, 2).
        rate: of samples and controller [Hz].
        rng: what the encoders' noise is drawn from.
        law: of the controller.
        drive_gain: torque for each unit of the law's output [N m].
        encoder_noise: its deviation [rad].
    """
    noise = encoder_noise * rng.standard_normal(q_ref.shape)
    signals = LoopSignals(
        rate=rate,
        q_ref=q_ref,
        dq_ref=None,
        inputs=None,
        noise=noise,
        drive_gain=np.asarray(drive_gain, dtype=float),
        limit=np.full(2, np.inf),
        bound=np.full(2, 0.5),
        speed_bound=np.full(2, 50.0),
    )
    model = make_model(base.robot, base.parameters, theta)
    made = simulate(model, law, signals, base.robot.joint_names)
    return made.q + noise, made.tau
