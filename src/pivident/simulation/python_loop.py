"""The loop of a control law that is a Python function: the same compiled loop, a sample at a time."""

from __future__ import annotations

import threading
from collections.abc import Sequence

import numpy as np

from pivident.dynamics.forward import Model
from pivident.errors import ExperimentError
from pivident.simulation.controllers import TAPS, PythonController, SampledLaw
from pivident.simulation.integration import Q
from pivident.simulation.loop_kernel import DONE, initial_state, run_loop

#: A law may keep a state of its own: records that are simulated in parallel must not share it.
_ONE_RUN_AT_A_TIME = threading.Lock()


def run_python_loop(
    model: Model,
    controller: PythonController,
    start: tuple[np.ndarray, np.ndarray],
    rate: float,
    q_ref: np.ndarray,
    dq_ref: np.ndarray,
    inputs: np.ndarray,
    noise: np.ndarray,
    others: Sequence[object],
    channels: Sequence[np.ndarray],
    failure: np.ndarray,
) -> tuple[int, int, int]:
    """Simulate all samples of the reference; arguments and answer as ``run_loop``.

    Args:
        model: robot with parameter values.
        controller: the law.
        start: initial positions and speeds, each (joints,).
        rate: control rate [Hz].
        q_ref: reference positions, shape (samples, joints).
        dq_ref: reference speeds.
        inputs: added to the law's output, shape (samples, joints) or (1, joints).
        noise: added to the measured positions, likewise.
        others: gains, bounds and steps, handed through.
        channels: receive the motion, shape (samples, joints) each.
        failure: receives the value that ended the run, shape (1,).

    Raises:
        ExperimentError: the law's answer has a wrong shape or is not finite.
    """
    n = q_ref.shape[1]
    # a law without feedback whose reference is what the function says
    still, unit = np.zeros((n, TAPS)), np.tile(np.eye(1, TAPS), (n, 1))
    law = SampledLaw(still, unit, still, np.zeros(n), np.zeros((1, n)), np.zeros((1, n)))
    state = initial_state(model, law, *start)
    silence = np.zeros((1, n))
    with _ONE_RUN_AT_A_TIME:
        if controller.reset is not None:
            controller.reset()
        for k in range(len(q_ref)):
            here = slice(k, k + 1)
            measured = state.vectors[Q] + noise[k if len(noise) > 1 else 0]
            law.reference[0] = _checked(controller.function(k, measured, q_ref[k], dq_ref[k]), k, n)
            what, joint, _ = run_loop(
                model, law, state, rate, q_ref[here], inputs[here] if len(inputs) > 1 else inputs,
                silence, *others, *(channel[here] for channel in channels), failure,
            )  # fmt: skip
            if what != DONE:
                return what, joint, k
    return DONE, -1, -1


def _checked(answer: object, k: int, joints: int) -> np.ndarray:
    u = np.asarray(answer, dtype=float)
    if u.shape != (joints,) or not np.isfinite(u).all():
        raise ExperimentError(
            f"the Python control law answered {answer!r} at sample {k}; it must return "
            f"{joints} finite numbers, one for each joint"
        )
    return u
