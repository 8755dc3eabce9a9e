"""The 31 numbered equations of the paper, and the code that computes each."""

from __future__ import annotations

from dataclasses import dataclass


@dataclass(frozen=True)
class Equation:
    """One numbered equation."""

    number: int
    says: str  # what it gives, in our words
    code: tuple[str, ...]  # dotted names of what computes it


_DYNAMICS, _SIMULATION, _SIGNALS = (
    "pivident.dynamics",
    "pivident.loop.simulation",
    "pivident.signals",
)
_ESTIMATION = "pivident.estimation"

#: (number, what it gives, code).
_ROWS: tuple[tuple[int, str, tuple[str, ...]], ...] = (
    (1, "torque of the inverse dynamic model", (f"{_DYNAMICS}.regressor.Regressor.torque",)),
    (2, "standard parameters of a joint", (f"{_DYNAMICS}.parameters.standard_parameters",)),
    (
        3,
        "observation matrix, linear in the base parameters",
        (
            f"{_DYNAMICS}.regressor.Regressor.matrix",
            f"{_DYNAMICS}.base_parameters.base_parameters",
        ),
    ),
    (
        4,
        "equation with its error: measured torque, observation matrix and instruments",
        (f"{_ESTIMATION}.full_rate.FullRateRecord",),
    ),
    (5, "accelerations of the direct dynamic model", (f"{_SIMULATION}.integration.evaluate",)),
    (
        6,
        "control law from reference and measured position",
        (f"{_SIMULATION}.controllers.PID.law",),
    ),
    (7, "torque from the control signal, by the drive gain", (f"{_SIMULATION}.control_loop.Loop",)),
    (8, "measured position with its noise", (f"{_SIMULATION}.simulated_record.Noise",)),
    (
        9,
        "noise of all encoders behind its filter",
        (f"{_SIMULATION}.simulated_record.Noise.in_loop",),
    ),
    (10, "the same of one joint", (f"{_SIMULATION}.simulated_record.Noise.in_loop",)),
    (11, "linear part of one joint's dynamics", (f"{_SIMULATION}.joint_loop.JointLoop.plant",)),
    (
        12,
        "largest inertia of a joint",
        ("pivident.judgement.validation.identified_loop.inertia_ranges",),
    ),
    (
        13,
        "what the other joints, gravity and dry friction add: all that is not linear",
        (f"{_DYNAMICS}.kernels.mass_matrix_and_bias",),
    ),
    (
        14,
        "sensitivity functions S and T of the loop",
        (
            f"{_SIMULATION}.joint_loop.JointLoop.sensitivity",
            f"{_SIMULATION}.joint_loop.JointLoop.complementary",
        ),
    ),
    (15, "measured position in closed loop", (f"{_SIMULATION}.closed_loop.simulate",)),
    (16, "true position in closed loop", (f"{_SIMULATION}.closed_loop.simulate",)),
    (17, "torque in closed loop", (f"{_SIMULATION}.closed_loop.simulate",)),
    (
        18,
        "torque and observation matrix behind the parallel filter",
        (f"{_SIGNALS}.decimation.parallel_decimation", f"{_SIGNALS}.bandpass.bandpass"),
    ),
    (
        19,
        "least squares",
        (
            f"{_ESTIMATION}.least_squares.LeastSquares",
            f"{_ESTIMATION}.normal_equations.weighted_solution",
        ),
    ),
    (20, "refined instrumental variables", (f"{_ESTIMATION}.normal_equations.solve",)),
    (21, "noise of the torque behind its filter", (f"{_SIGNALS}.noise_models.fit_ar",)),
    (22, "optimal prefilter and instruments", (f"{_SIGNALS}.prefilter.Prefilter",)),
    (23, "smallest covariance", ("pivident.studies.many.study.bound.efficiency_bounds",)),
    (
        24,
        "residual of the instrumental variable estimate",
        (f"{_ESTIMATION}.full_rate.FullRateRecord.residual",),
    ),
    (
        25,
        "encoder noise that the control law turns into torque",
        ("pivident.studies.many.study.bound.loop_noise",),
    ),
    (26, "its filter, and the inverse of it", (f"{_SIMULATION}.controllers.inverse_controller",)),
    (27, "integrated random walk and its smoother", (f"{_SIGNALS}.random_walk.irwsm",)),
    (
        28,
        "prefiltered instrumental variables",
        (f"{_ESTIMATION}.prefiltered_iv.piv", f"{_ESTIMATION}.iteration.solve"),
    ),
    (
        29,
        "encoder noise from the residual, by the inverse control law",
        (f"{_ESTIMATION}.noise_identification.Whitening.fitted",),
    ),
    (
        30,
        "residual of the last estimate",
        (f"{_ESTIMATION}.full_rate.FullRateRecord.residual",),
    ),
    (
        31,
        "covariance of the estimate",
        (f"{_ESTIMATION}.covariance.white_noise_covariance",),
    ),
)

#: All of them, in order.
EQUATIONS = tuple(Equation(*row) for row in _ROWS)
