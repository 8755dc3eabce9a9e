"""Torque samples brought to the instants of the position samples.

Central differences at t_k average the motion between t_{k-1} and t_{k+1}. A torque that is *held*
from its instant on acts half a period later than its samples; the average over the two adjoining
periods belongs to the instant. For a mass with a held torque, sampled every h, this is exact:

    J (q_{k+1} - 2 q_k + q_{k-1}) / h² = (τ_k + τ_{k-1}) / 2

Without alignment half a period times the jerk remains, J h/2 · d³q/dt³, which opposes the speed
and biases viscous friction: by ten standard errors at 5 kHz.

In general a torque that belongs s sampling periods after its sample is interpolated there,

    aligned_k = (1 - a) τ_{k-n} + a τ_{k-n-1},     n = ⌊s⌋,  a = s - n.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from pivident.foundation.errors import RecordingError

TorqueTiming = Literal["held", "averaged", "sampled"]

#: Shifts within this fraction of a period of a whole number count as whole.
_WHOLE = 1e-9


@dataclass(frozen=True, eq=False)
class AlignedTorque:
    """Torque at the instants of the positions [N m or N], same shape as the input.

    Samples that would need values from outside the record repeat the nearest one; their numbers at
    both ends are ``lost_start`` and ``lost_end``.
    """

    tau: np.ndarray
    lost_start: int
    lost_end: int
    is_average: bool = False  # over the two sampling periods that adjoin the instant


def align_torque(
    tau: np.ndarray,
    rate: float,
    timing: TorqueTiming = "held",
    *,
    control_rate: float | None = None,
    delay: float = 0.0,
) -> AlignedTorque:
    """Move the torque to the instants of central differences of the positions.

    A sample is ``held`` until the next control instant, ``averaged`` over the sampling period
    before it, or ``sampled`` at its instant. ``delay`` [s] is how much later the torque was logged
    than the positions: what is logged at t_k was true at t_k - delay, so a positive one advances
    the torque.
    """
    tau = np.asarray(tau, dtype=float)
    shift = torque_shift(rate, timing, control_rate=control_rate, delay=delay)
    whole = math.floor(shift)
    part = shift - whole
    lost_start, lost_end = max(0, whole + (part > 0)), max(0, -whole)
    if lost_start + lost_end >= len(tau):
        raise RecordingError(
            f"the torque would be moved by {shift:.1f} samples in a record of {len(tau)}",
            advice=f"check the delay ({delay:g} s) and its unit",
        )
    aligned = (1 - part) * _moved(tau, whole)
    if part > 0:
        aligned += part * _moved(tau, whole + 1)
    return AlignedTorque(
        aligned,
        lost_start,
        lost_end,
        timing != "sampled" and part == 0.5 and _covers(rate, control_rate),
    )


def torque_shift(
    rate: float,
    timing: TorqueTiming = "held",
    *,
    control_rate: float | None = None,
    delay: float = 0.0,
) -> float:
    """Sampling periods s by which the torque is later than its sample.

        held:      s = (min(Tc, h)/2 - delay) / h
        averaged:  s = -1/2 - delay / h
        sampled:   s = -delay / h

    with the sampling period h and that of the control loop Tc. A log that is faster than the loop
    (h < Tc) records the staircase itself, so a sample stands for one sampling period only; in a
    slower log it stands for one control period.
    """
    control_rate = rate if control_rate is None else control_rate
    if not (rate > 0 and control_rate > 0 and math.isfinite(delay)):
        raise RecordingError(
            f"torque timing with rate {rate:g} Hz, control rate {control_rate:g} Hz and delay "
            f"{delay:g} s",
            advice="rates must be positive and the delay finite",
        )
    halves = {"held": min(rate / control_rate, 1.0) / 2, "averaged": -0.5, "sampled": 0.0}
    if timing not in halves:
        raise RecordingError(
            f"torque timing {timing!r}", advice="expected held, averaged or sampled"
        )
    shift = halves[timing] - delay * rate
    return float(round(shift)) if abs(shift - round(shift)) < _WHOLE else shift


def _covers(rate: float, control_rate: float | None) -> bool:
    """Whether a sample stands for the whole sampling period: held by a loop that is not faster."""
    return control_rate is None or control_rate <= rate * (1.0 + _WHOLE)


def _moved(tau: np.ndarray, samples: int) -> np.ndarray:
    """τ_{k - samples}, the end samples repeated outwards."""
    return tau[np.clip(np.arange(len(tau)) - samples, 0, len(tau) - 1)]
