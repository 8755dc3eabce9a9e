"""The operating point of a record: offsets of its signals, and a start that is not at rest.

    y = Σ_i B_i(p)/A(p) u_i + c + x_0 + ξ

c is what the output keeps while all inputs are zero, x_0 the free response from the state at the
first sample. An input that is 1 from the first sample on and one that is a pulse there, through the
same 1/A, span both: the response to the first is c less a free response, and the pulse, with a
numerator of the denominator's degree, leaves any state behind and explains the first sample itself.
So they are estimated as two inputs more, jointly with the rest, of signals without their means: an
offset may be thousands of times larger than what moves.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from pivident.foundation.errors import IdentificationError
from pivident.linear.model import Structure
from pivident.linear.refined_iv import Refined, linearised
from pivident.linear.sampled_data import SampledData

#: Share of the residual's variance that an operating point must take away to be named.
NAMED_SHARE = 0.5


def with_operating_point(data: SampledData, structure: Structure) -> tuple[SampledData, Structure]:
    """Data and structure with the two inputs of the operating point, whose parameters come last.

    Raises:
        IdentificationError: the inputs have denominators of their own.
    """
    if not structure.common:
        raise IdentificationError(
            "an offset is estimated with one denominator for all inputs",
            advice="give common=True, or subtract the operating point from u and y",
        )
    (order,) = structure.denominator_orders
    more = np.zeros((2, data.y.size))
    more[0], more[1, 0] = 1.0, 1.0
    means = data.u.mean(axis=1, keepdims=True)
    wide = replace(
        data,
        u=np.vstack((data.u - means, more)),
        clean=np.vstack((data.clean - means, more)),
        y=data.y - data.y.mean(),
    )
    return wide, replace(
        structure,
        numerator_orders=(*structure.numerator_orders, 0, order),
        delays=(*structure.delays, 0, 0),
    )


def offset_of(data: SampledData, structure: Structure, refined: Refined) -> tuple[float, float]:
    """The offset c = ȳ + (b_c - Σ_i b_i ū_i)/a_n, of last coefficients, and its standard error.

    Args:
        data: without the operating point.
        structure: likewise.
        refined: the estimate with it.
    """
    last = structure.denominator_orders[0] - 1
    ends = last + np.cumsum([m + 1 for m in structure.numerator_orders])
    slope = np.zeros(refined.theta.size)
    slope[ends], slope[structure.parameters] = -data.u.mean(axis=1), 1.0
    slope /= refined.theta[last]
    moved = float(slope @ refined.theta)
    slope[last] = -moved / refined.theta[last]
    return moved + float(data.y.mean()), float(np.sqrt(slope @ refined.covariance @ slope))


def share_of_operating_point(data: SampledData, structure: Structure, refined: Refined) -> float:
    """Share of the residual's sum of squares that an operating point explains at this estimate."""
    if not structure.common or not np.any(refined.residual):
        return 0.0
    wide, wider = with_operating_point(data, structure)
    theta = np.concatenate([refined.theta, np.zeros(wider.parameters - refined.theta.size)])
    columns = linearised(wide, wider, theta).regressors[structure.parameters :]
    scaled = columns / np.linalg.norm(columns, axis=1, keepdims=True)
    solution = np.linalg.lstsq(scaled.T, refined.residual, rcond=None)[0]
    left = refined.residual - solution @ scaled
    return 1.0 - float(left @ left) / float(refined.residual @ refined.residual)
