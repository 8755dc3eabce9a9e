"""Control laws that are Python functions: the compiled loop, called for one sample at a time."""

from __future__ import annotations

import threading

import numpy as np

from pivident.compiled import read_only
from pivident.dynamics.forward import Model
from pivident.errors import ExperimentError
from pivident.simulation.controllers import TAPS, PythonController, SampledLaw
from pivident.simulation.integration import Q
from pivident.simulation.loop_kernel import DONE, initial_state, path_arguments, run_loop

#: A law may keep a state of its own: records that are simulated in parallel must not share it.
_ONE_RUN_AT_A_TIME = threading.Lock()


def run_python_loop(
    model: Model,
    controller: PythonController,
    start: tuple[np.ndarray, np.ndarray],
    rate: float,
    delay: float,
    q_ref: np.ndarray,
    dq_ref: np.ndarray,
    inputs: np.ndarray,
    noise: np.ndarray,
    limits: np.ndarray,
    steps: int,
    oracle: int | None,
    channels: np.ndarray,
    failure: np.ndarray,
) -> tuple[int, int, int, np.ndarray | None]:
    """Simulate all samples of the reference; arguments and answer are those of ``run_loop``.

    The answer ends with the states of friction, see ``path_arguments``.

    Args:
        model: robot with parameter values.
        controller: the law.
        start: initial positions and speeds, each (joints,).
        rate: control rate [Hz].
        delay: time from a sample until the torque that answers it acts [s].
        q_ref: reference positions, shape (samples, joints).
        dq_ref: reference speeds.
        inputs: added to the law's output, shape (samples, joints) or (1, joints).
        noise: added to the measured positions, likewise.
        limits: gains and bounds.
        steps: integration steps of the fast scheme per control period.
        oracle: None, or Runge–Kutta substeps per control period.
        channels: receives the motion.
        failure: receives the value that ended the run.

    Raises:
        ExperimentError: the law's answer has a wrong shape or is not finite.
    """
    samples, n = q_ref.shape
    # a law without feedback: its reference is what the function says
    none, unit = np.zeros((n, TAPS)), np.tile(np.eye(1, TAPS), (n, 1))
    said = np.zeros((samples, n))
    law = SampledLaw(none, unit, none, np.zeros(n), said, said).protected()
    state = initial_state(model, law, start[0], start[1], int(delay * rate + 1e-9))
    on_path = path_arguments(model.friction, state, samples)
    heard = read_only(np.zeros((1, n)))
    q_wanted, dq_wanted = read_only(q_ref), read_only(dq_ref)
    with _ONE_RUN_AT_A_TIME:
        if controller.reset is not None:
            controller.reset()
        for k in range(samples):
            measured = state.vectors[Q] + noise[k if len(noise) > 1 else 0]
            said[k] = _checked(controller.function(k, measured, q_wanted[k], dq_wanted[k]), k, n)
            what, joint, _ = run_loop(
                model, law, state, rate, delay, q_ref, inputs, heard, limits, steps, oracle,
                k, k + 1, 0, channels, failure, *on_path,
            )  # fmt: skip
            if what != DONE:
                return what, joint, k, on_path[-1]
    return DONE, -1, -1, on_path[-1]


def _checked(answer: object, k: int, joints: int) -> np.ndarray:
    u = np.asarray(answer, dtype=float)
    if u.shape != (joints,) or not np.isfinite(u).all():
        raise ExperimentError(
            f"the Python control law answered {answer!r} at sample {k}; it must return "
            f"{joints} finite numbers, one for each joint"
        )
    return u
