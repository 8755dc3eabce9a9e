"""The signal recipe of a result, as its method was given it."""

from __future__ import annotations

from pivident.estimation.identification import Identification
from pivident.estimation.methods import SignalRecipe


def signal_recipe(identification: Identification) -> SignalRecipe | None:
    """How positions became derivatives, from the method of the result.

    None for a result loaded from a file: the options of a file are unverified.
    """
    if identification.equations is None or identification.method_used is None:
        return None
    return identification.method_used.signals


def sampling_rate(identification: Identification) -> float:
    """Rate of the recording before any decimation [Hz]; the equations must be there."""
    assert identification.equations is not None
    return float(identification.equations.records[0].kinematics.recording.rate)
