"""Whiteness of the errors of a fitted simulation, behind their noise models."""

from __future__ import annotations

from dataclasses import dataclass

from pivident.estimation.identification import Identification
from pivident.estimation.methods import OutputError
from pivident.validation.residuals.autocorrelation import EXTRA_LAGS, LjungBoxTest, ljung_box
from pivident.validation.residuals.whitened_residual import (
    MIN_SAMPLES,
    JointResidual,
    penalty_of,
)

#: Names of what is compared, by channel.
CHANNEL_WORDS = ("positions", "torques")


@dataclass(frozen=True)
class SimulationWhiteness:
    """The test of one channel of one joint."""

    joint: str  # its name
    what: str  # positions or torques
    test: LjungBoxTest


def simulation_whiteness(identification: Identification) -> tuple[SimulationWhiteness, ...]:
    """Ljung and Box's test of each joint and channel that a simulation was compared in.

    Empty where the fit is not there, as after reading a file, and where errors are too few.
    """
    simulation = identification.simulation
    fit = None if simulation is None else simulation.fit
    if simulation is None or fit is None:
        return ()
    method, joints, found = identification.method_used, identification.joints, []
    noise = method.noise if isinstance(method, OutputError) else None
    for c, channel in enumerate(fit.channels):
        for j, joint in enumerate(joints):
            place = c * len(joints) + j
            order = simulation.noise_orders[place] if simulation.noise_orders else 0
            pieces = tuple(white[c, j] for white in fit.white)
            residual = JointResidual(joint.name, pieces, order, fit.rates[0], order > 0)
            if residual.values.size >= max(MIN_SAMPLES, 2 * (order + EXTRA_LAGS)):
                known = JointResidual(
                    joint.name, pieces, order, fit.rates[0], order > 0,
                    penalty_of(noise, residual.values.size) if order else None,
                )  # fmt: skip
                found.append(
                    SimulationWhiteness(joint.name, CHANNEL_WORDS[channel], ljung_box(known))
                )
    return tuple(found)
