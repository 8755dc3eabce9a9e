"""Second derivatives of friction of speed: by the speed, and by the constants of its shape.

The simulator integrates friction f(v; p) with its slope ∂f/∂v, so a tangent of the simulation needs
∂²f/∂v², and along a constant p (γ, v_s and δ of Stribeck friction, the exponent of a power) both
∂f/∂p and ∂²f/∂v∂p.
"""

from __future__ import annotations

from pivident.dynamics.friction_generated import position_derivatives, speed_derivatives
from pivident.dynamics.friction_kernels import (
    BY_GAMMA,
    CURVATURE,
    FIRST_ADDRESS,
    call_column,
    sign_partials,
)
from pivident.foundation.compiled import inlined as _inline
from pivident.foundation.compiled import inner
from pivident.robot.friction_terms.coulomb import COULOMB

_COULOMB = int(COULOMB)

#: Column of ``FrictionTable.term_value`` that holds γ.
_GAMMA = 1


@inner
def speed_partials(column, sign, gamma, first, second, v, which):
    """∂²f/∂v², ∂f/∂p and ∂²f/∂v∂p of one nonlinear term of speed for the constant ``which``.

    ``first second``: v_s and δ; ``which``: a column of ``term_value`` after the parameter: γ, v_s
    or δ.
    """
    s, s_v, s_vv, s_g, s_vg = sign_partials(sign, gamma, v)
    at = BY_GAMMA + 2 * (which - _GAMMA)
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, CURVATURE, s, s_v, s_vv, s_g, s_vg, first, second, v),
            call_column(column, at, s, s_v, s_vv, s_g, s_vg, first, second, v),
            call_column(column, at + 1, s, s_v, s_vv, s_g, s_vg, first, second, v),
        )
    found = speed_derivatives(column, s, s_v, s_vv, s_g, s_vg, first, second, v)
    return found[CURVATURE], found[at], found[at + 1]


@inner
def position_partials(column, first, second, q, which):
    """∂²f/∂q², ∂f/∂p and ∂²f/∂q∂p of one term of position for the constant ``which``."""
    at = BY_GAMMA + 2 * (which - _GAMMA)
    if column >= FIRST_ADDRESS:
        return (
            call_column(column, CURVATURE, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
            call_column(column, at, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
            call_column(column, at + 1, 0.0, 0.0, 0.0, 0.0, 0.0, first, second, q),
        )
    found = position_derivatives(column, first, second, q)
    return found[CURVATURE], found[at], found[at + 1]


@_inline
def speed_curvature(column, sign, gamma, first, second, v):
    """∂²f/∂v² of one nonlinear term of speed, see ``speed_partials``."""
    if column == _COULOMB:
        return sign_partials(sign, gamma, v)[2]
    return speed_partials(column, sign, gamma, first, second, v, _GAMMA)[0]
