"""Columns of friction that other distributions declare, called by their address.

Kernels that are kept compiled cannot name functions that they do not know. So what a kernel is
given as the code of such a column is the address of its compiled function, which any kernel can
call; addresses are larger than any code.
"""

from __future__ import annotations

from typing import Any

from llvmlite import ir
from numba import cfunc, types
from numba.extending import intrinsic

#: Codes below are those of pivident.
FIRST_ADDRESS = 1000

#: What functions of columns count: value, slope by the quantity, curvature, and for γ and two
#: constants of shape the derivatives of value and slope by it.
VALUE, SLOPE, CURVATURE, BY_GAMMA = 0, 1, 2, 3
COUNT = 9

#: Numbers that it is given: s, ∂s/∂v, ∂²s/∂v², ∂s/∂γ and ∂²s/∂v∂γ, two constants and its quantity.
NUMBERS = 8

_SIGNATURE = types.float64(types.int64, *[types.float64] * NUMBERS)

#: Decorator of a column's function.
column_function = cfunc(_SIGNATURE, cache=True, error_model="numpy")


def _call_column(context, address, which, s, s_v, s_vv, s_g, s_vg, first, second, x):
    """Call the function of a column at an address."""

    def called(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
        double = ir.DoubleType()
        kind = ir.FunctionType(double, [ir.IntType(64), *[double] * NUMBERS])
        return builder.call(builder.inttoptr(arguments[0], kind.as_pointer()), arguments[1:])

    wanted = (types.int64, types.int64, *[types.float64] * NUMBERS)
    return types.float64(*wanted), called


#: The value of a column's function at an address, in compiled code.
call_column: Any = intrinsic(_call_column)
