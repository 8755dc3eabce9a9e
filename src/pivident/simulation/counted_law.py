"""A control law that reads rounded positions, as behind an encoder with few counts.

The compiled loop adds noise to the position that its law reads, but does not round it; this one
is called once per control sample, at the speed of Python.
"""

from __future__ import annotations

import numpy as np

from pivident.simulation.controllers import Controller, PythonController
from pivident.simulation.gravity_compensation import GravityCompensated
from pivident.simulation.noise import Noise


def counted(
    controller: Controller, noise: Noise, rate: float, q_ref: np.ndarray, dq_ref: np.ndarray
) -> PythonController:
    """The law u = r - B(z)/A(z) q + I + g(q) of ``SampledLaw``, with q rounded to counts.

    Its integrator does not know the limit of the output.

    ``q_ref``: reference positions [rad or m], shape (samples, joints).
    """
    law = controller.law(rate, q_ref, dq_ref)
    weight = controller.measured if isinstance(controller, GravityCompensated) else None
    past = np.zeros((3, q_ref.shape[1]))  # w with A w = q, at this and the two samples before
    integral = np.zeros(q_ref.shape[1])
    b, a, c = law.feedback.T, law.pole.T, law.integrand.T

    def reset() -> None:
        past[:] = noise.quantised(q_ref[0]) / a.sum(axis=0)
        integral[:] = 0.0

    def output(k: int, q: np.ndarray, q_ref: np.ndarray, dq_ref: np.ndarray) -> np.ndarray:
        past[1:] = past[:-1].copy()
        rounded = noise.quantised(q)
        past[0] = rounded - a[1] * past[1] - a[2] * past[2]
        wanted = law.integrand_reference[k] - np.sum(c * past, axis=0)
        integral[:] += law.integral_gain / rate * wanted
        u = law.reference[k] - np.sum(b * past, axis=0) + integral
        return u if weight is None else u + weight.torque(rounded[None])[0]

    return PythonController(output, reset, controller)  # type: ignore[arg-type]
