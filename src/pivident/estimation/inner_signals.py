"""Inner signals of a motion: columns that need the path so far or the load, made once per record.

Most friction laws have none. Where there are some, they belong to the motion as its positions do,
and go with it through the blocks in which a record is walked through.
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, TypeVar

import numpy as np

from pivident.dynamics.regressor import Regressor
from pivident.estimation.motion import Motion

if TYPE_CHECKING:
    from pivident.estimation.kinematics import Kinematics
    from pivident.estimation.simulated_motion import SimulatedMotion

AnyMotion = TypeVar("AnyMotion", "Kinematics", "SimulatedMotion")


def with_inner(
    regressor: Regressor, motion: AnyMotion, theta: np.ndarray | None = None
) -> AnyMotion:
    """The motion with its inner signals; itself where the friction law has none.

    Args:
        regressor: the observation matrix.
        motion: a whole record, time last.
        theta: parameters that make the load, shape (parameters,); None: no load.
    """
    if regressor.inner_entries.size == 0:
        return motion
    return replace(motion, inner=regressor.inner(motion.q, motion.dq, motion.ddq, theta))


def packed_stretch(
    regressor: Regressor,
    motion: Motion,
    span: slice,
    out: np.ndarray | None = None,
    place: np.ndarray | None = None,
) -> np.ndarray:
    """Packed columns of a stretch of a record, shape (entries, samples).

    Args:
        regressor: the observation matrix.
        motion: the whole record with its inner signals, time last.
        span: samples of the record.
        out: see :meth:`~pivident.dynamics.regressor.Regressor.packed`; likewise the next one.
        place: row of ``out`` for each entry.

    Raises:
        ValueError: the friction law has memory or load, and the motion no inner signals.
    """
    inner = None if motion.inner is None else motion.inner[:, span]
    if inner is None and regressor.inner_entries.size:
        raise ValueError(
            "a stretch does not know the path before it: give the motion its inner signals "
            "(with_inner) before it is cut into blocks"
        )
    return regressor.packed(*motion.stretch(span), out=out, inner=inner, place=place)
