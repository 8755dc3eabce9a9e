"""The residual that is tested: one joint's, over all recordings, with its gaps.

Rows that were not used are NaN. A correlation at lag k is made of the pairs of samples k apart of
which both are used and which lie in the same recording; their number n_k takes the place of n - k.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.noise_options import Arma, AutoRegressive

#: Results with a smaller probability count as significant. There are as many tests as joints, so
#: one in twenty would be too often a false alarm.
SIGNIFICANCE = 0.01

#: Fewest samples that are tested, and fewest pairs that a lag needs.
MIN_SAMPLES = 50
MIN_PAIRS = 20


@dataclass(frozen=True, eq=False)
class JointResidual:
    """Whitened residual of one joint."""

    name: str  # joint
    #: Residual of each recording on consecutive rows, NaN where a row was not used.
    pieces: tuple[np.ndarray, ...]
    order: int = 0  # number of coefficients of the noise model that was fitted to it; 0 without one
    rate: float = 1.0  # rate of its rows [Hz]
    prefiltered: bool = False  # whether the equations were filtered before they were solved
    #: What each coefficient costs in the criterion that chose the order (AIC: 2, BIC: ln n); None:
    #: the order was given.
    penalty: float | None = None

    @property
    def values(self) -> np.ndarray:
        """The residual on the rows in use, one recording behind the other."""
        joined = np.concatenate(self.pieces) if self.pieces else np.empty(0)
        return joined[np.isfinite(joined)]


def joint_residuals(identification: Identification) -> tuple[JointResidual, ...]:
    """Whitened residuals of all joints."""
    if not identification.recordings:
        return tuple(JointResidual(fit.name, ()) for fit in identification.joints)
    return tuple(
        JointResidual(
            fit.name,
            tuple(r.whitened[:, j] for r in identification.recordings),
            fit.ar_order,
            float(identification.recordings[0].whitened_rate),
            fit.ar_order > 0 or fit.noise_unit != fit.torque_unit,
            None if fit.ar_at_bound else _penalty(identification, fit.rows),
        )
        for j, fit in enumerate(identification.joints)
    )


def _penalty(identification: Identification, rows: int) -> float | None:
    """Penalty per coefficient of the noise model's order; None where no order was searched."""
    method = identification.method_used
    return None if method is None else penalty_of(method.noise, rows)


def penalty_of(noise: AutoRegressive | Arma | None, rows: int) -> float | None:
    """The same of a recipe of noise models."""
    criterion = noise.criterion if isinstance(noise, AutoRegressive) else None
    if criterion in ("aic", "aicc"):
        return 2.0
    return round(math.log(max(rows, 8)), 1) if criterion == "bic" else None


def probability(p: float) -> str:
    """``p = 0.034`` or ``p < 0.001``."""
    return "p < 0.001" if p < 1e-3 else f"p = {p:.2g}"


def reading(significant: bool, matters: bool) -> str:
    """Significance and practical size, in words."""
    if not significant:
        return "not significant"
    return f"significant{' and of' if matters else ', but of no'} practical size"
