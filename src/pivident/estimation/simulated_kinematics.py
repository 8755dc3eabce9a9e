"""The motion of the simulated loop in place of the measured, once it has forgotten its start."""

from __future__ import annotations

import copy
import dataclasses
from collections.abc import Sequence

import numpy as np

from pivident.errors import IdentificationError
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.motion.kinematics import Kinematics
from pivident.motion.motion import SimulatedMotion

#: The start is forgotten once its trace in the torque is this share of the torque's standard
#: deviation.
FORGOTTEN = 1e-4


def simulated_kinematics(kinematics: Kinematics, motion: SimulatedMotion, start: int) -> Kinematics:
    """The simulated motion in place of the smoothed one, with the measured torque."""
    unsmoothed = np.full(kinematics.f50.shape, np.nan)
    return dataclasses.replace(
        kinematics, q=motion.q, dq=motion.dq, ddq=motion.ddq, start=start, f50=unsmoothed
    )


def settled_starts(
    auxiliary: AuxiliaryModel,
    theta: np.ndarray,
    motions: Sequence[SimulatedMotion],
    kinematics: Sequence[Kinematics],
) -> list[int]:
    """First sample of each recording at which the simulated loop has forgotten its start.

    The loop is simulated once more from another start, at rest on its reference. What differs
    comes from the start.
    """
    other = copy.copy(auxiliary)
    other.signals = [(s, (s.q_ref[0].copy(), np.zeros_like(s.q_ref[0]))) for s, _ in other.signals]
    starts = []
    for here, there, kin in zip(motions, other.simulate(theta), kinematics, strict=True):
        assert here.tau is not None and there.tau is not None
        trace = np.abs(here.tau - there.tau) > FORGOTTEN * here.tau.std(axis=1, keepdims=True)
        seen = np.flatnonzero(trace.any(axis=0))
        start = max(kin.start, int(seen[-1]) + 1 if seen.size else 0)
        if start > 0.5 * (kin.start + kin.stop):
            raise IdentificationError(
                f"in recording {kin.recording.name!r} the simulated loop still shows where it "
                f"started after {start / kin.recording.rate:.2g} s, more than half the record",
                advice="the gains are soft or the record is short. Use piv, or a longer record",
            )
        starts.append(start)
    return starts
