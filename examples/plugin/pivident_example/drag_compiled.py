"""Functions of friction terms.

Written by ``python -m pivident.dynamics.generate_friction`` from declarations, not by hand.
"""

# fmt: off
# ruff: noqa
from __future__ import annotations

from math import atan, exp, log, pi, sqrt, tanh

from pivident.dynamics.friction_kernels import column_function
from pivident.dynamics.elementary import cos, direction, power, sin, size


@column_function
def drag(which, s, s_v, s_vv, s_g, s_vg, first, second, dq):
    """dq*abs(dq)"""
    x0 = size(dq)
    x1 = direction(dq)
    return (dq*x0, dq*x1 + x0, 2*x1, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0)[which]
