"""All columns of a law of friction."""

import numpy as np

from pivident.dynamics.friction import friction_column
from pivident.robot.friction import FrictionLaw


def friction_columns(
    law: FrictionLaw,
    dq: np.ndarray,
    q: np.ndarray | None = None,
    load: np.ndarray | None = None,
    *,
    simulated: bool = False,
) -> np.ndarray:
    """Columns of the law: shape ``dq.shape + (terms,)``."""
    dq = np.asarray(dq, dtype=float)
    out = np.empty((*dq.shape, len(law.terms)))
    for k, term in enumerate(law.terms):
        out[..., k] = friction_column(term, dq, q, load, simulated)
    return out
