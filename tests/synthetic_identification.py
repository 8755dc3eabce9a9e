"""A made-up identification of a gallery robot: known parameters, sines, coloured noise."""

from dataclasses import replace

import numpy as np
from scipy.signal import lfilter

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.parameters import nominal_values
from pivident.dynamics.regressor import Regressor
from pivident.estimation.control_law.identified_law import ControllerIdentification
from pivident.estimation.control_law.joint_law import JointLaw
from pivident.estimation.control_law.reference_reconstruction import (
    Move,
    PointToPoint,
    ReconstructedReference,
)
from pivident.estimation.control_law.unknown_loop import Feedback
from pivident.estimation.equation_record import FittedRecording
from pivident.estimation.identification import (
    Identification,
    Iteration,
    JointFit,
)
from pivident.loop.simulation.control_loop import Loop
from pivident.loop.simulation.linear_law import LinearLaw
from pivident.robot.gallery import load_robot


def true_parameters(robot_name: str = "planar_2r") -> dict[str, float]:
    base = base_parameters(load_robot(robot_name))
    theta = base.values(nominal_values(base.robot, base.standard))
    return dict(zip(base.names, theta.tolist(), strict=True))


def synthetic_identification(
    method: str = "IDIM-PIV",
    robot_name: str = "planar_2r",
    *,
    samples: int = 2000,
    rate: float = 1000.0,
    relative_std: float = 0.004,
    bias: float = 0.0,
    seed: int = 1,
    **changes: object,
) -> Identification:
    """An identification whose errors are `bias` plus normal ones of its own covariance."""
    rng = np.random.default_rng(seed)
    robot = load_robot(robot_name)
    base = base_parameters(robot)
    truth = base.values(nominal_values(robot, base.standard))
    std = relative_std * np.maximum(np.abs(truth), 0.02) * rng.uniform(0.3, 3.0, truth.size)
    theta = truth + std * (bias + rng.standard_normal(truth.size))
    recording, whitened_share = synthetic_recording(robot, base, theta, samples, rate, rng)
    iterations = 5 if "IV" in method else 1
    identification = Identification(
        method=method,
        robot=robot,
        parameters=base.parameters,
        names=base.names,
        expressions=base.expressions,
        theta=theta,
        covariance=np.diag(std**2),
        robust_covariance=np.diag((1.3 * std) ** 2),
        formula_covariance=np.diag(std**2),
        converged=True,
        history=tuple(
            Iteration(
                theta=theta * (1.0 - 0.8 * 0.1**k),
                change=0.8 * 0.1**k,
                residual=0.05 * (1.0 + 0.5**k),
                halvings=int(k == 0),
                ar_orders=(20,) * robot.size,
            )
            for k in range(1, iterations + 1)
        ),
        joints=tuple(
            JointFit(
                name=joint.name,
                torque_unit="N m" if joint.kind == "revolute" else "N",
                relative_error=0.03 + 0.01 * i,
                rms_error=0.12,
                noise_std=2.4e-5,
                noise_unit="rad",
                ar_order=20 + i,
                ar_at_bound=False,
                rows=samples,
                masked=whitened_share[i],
                f50=87.3,
                encoder_std=3.1e-6,
            )
            for i, joint in enumerate(robot.joints)
        ),
        relative_error=0.034,
        condition=61.2,
        recordings=(recording,),
        options={"signals": {"order": 3, "f50_max": None}, "tolerance": 0.01},
        warnings=(),
        sources={"run1.csv": "5cc1cecc1024ef0e331d0caba06f689456ab789ec3f1e904599c0a8be5c27bc8"},
        version="0.1.0",
    )
    return replace(identification, **changes)


def synthetic_recording(robot, base, theta, samples, rate, rng):
    """Sines on all joints, coloured torque noise; and the share of low-speed rows per joint."""
    t = np.arange(samples) / rate
    w = 2 * np.pi * (0.4 + 0.3 * np.arange(1, robot.size + 1))
    q, dq, ddq = (
        np.sin(w * t[:, None]),
        w * np.cos(w * t[:, None]),
        -(w**2) * np.sin(w * t[:, None]),
    )
    tau_model = Regressor.build(robot, base.parameters).torque(q, dq, ddq, theta)
    white = rng.standard_normal((samples, robot.size))
    noise = lfilter([0.1], [1.0, -0.9], white, axis=0) * 0.1 * np.abs(tau_model).max(axis=0)
    mask = np.abs(dq) < 0.1 * w
    recording = FittedRecording(
        name="run1",
        t=t,
        q=q,
        dq=dq,
        ddq=ddq,
        q_measured=q + 3e-6 * white,
        tau=tau_model + noise,
        tau_model=tau_model,
        used=~mask,
        whitened=white,
        whitened_rate=rate,
        q_ref=q + 1e-4 * dq,
    )
    return recording, mask.mean(axis=0)


def synthetic_loop(found: str, names: tuple[str, str] = ("shoulder", "elbow")) -> Loop:
    """A loop of two joints of which something was found.

    Args:
        found: ``law``: its law; ``moves``: reference and feedback; ``spline``: the reference.
        names: of the joints.
    """
    two, zero = np.ones(2), np.zeros(2)
    law = LinearLaw(5000.0 * two, 120.0 * two, 30.0 * two, zero, zero, zero, 2e-3 * two)
    if found == "law":
        output = np.sin(np.arange(2000)[:, None] / 200.0 + np.arange(2))
        first = JointLaw(
            name=names[0],
            terms=("kp", "kd", "ki"),
            gains=np.array([5000.0, 120.0, 30.0]),
            std=np.array([2.0, 0.1, 0.5]),
            derivative_time=2e-3,
            derivative_time_std=1e-5,
            averaged=False,
            rms=0.0028,
            relative_error=0.004,
            f_tests={"ki": 900.0, "offset": 1.5},
            samples=1985,
            saturated=12,
        )
        second = replace(first, name=names[1], derivative_time=0.0, averaged=True, f_tests={})
        identified = ControllerIdentification(
            law, (first, second), ("run1",), output, 0.996 * output, 1000.0, ()
        )
        return Loop(law, identified=identified)
    moves = None
    if found == "moves":
        steps = tuple(Move(start, 0.2, 0.3, 0.05) for start in (0.1, 1.1))
        moves = PointToPoint(steps, np.zeros((3, 2)))
    reference = ReconstructedReference(
        kind="spline" if moves is None else "point_to_point",
        q=np.zeros((2000, 2)),
        dq=np.zeros((2000, 2)),
        ddq=np.zeros((2000, 2)),
        moves=moves,
        rms=np.array([1e-4, 2e-4]),
        relative=np.array([5e-5, 1e-4]),
        freedom=0.006,
    )
    feedback = tuple(
        Feedback(name, 5000.0, 2.0, 120.0, 0.1, averaged, 45.0, 0.97)
        for name, averaged in zip(names, (True, False), strict=True)
    )
    return Loop(law, reconstructed=(reference,), feedback=feedback if moves else ())
