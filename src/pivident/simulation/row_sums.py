"""Weighted sums of rows, kept in vector registers until they are complete.

Tangents of all directions lie side by side in a row, and most of the work on them are products of
a small matrix with some rows, Σ_k w_k x_k. Numba's compiler makes vector instructions of a loop
over the directions only: it would load and store the sum once for each k. So this one loop nest is
written in the compiler's intermediate language, which knows vectors; the processor's own width is
for the compiler to choose.
"""

from __future__ import annotations

from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.extending import intrinsic

#: Numbers in a vector: rows are padded to a multiple of it.
LANES = 8

#: Vectors that are summed at a time, as long as the row has so many left.
_VECTORS = 4

_INDEX, _VECTOR = ir.IntType(64), ir.VectorType(ir.DoubleType(), LANES)
_FUSED = ("contract",)  # a product and a sum may be one instruction


def row_array(*shape: int) -> np.ndarray:
    """Zeros whose last axis is padded to whole vectors, and that begin where a vector may."""
    *others, width = shape
    width = -(-width // LANES) * LANES
    size = int(np.prod(others, dtype=int)) * width
    memory = np.zeros(size + LANES)
    skipped = -(memory.ctypes.data // memory.itemsize) % LANES
    return memory[skipped : skipped + size].reshape(*others, width)


@intrinsic
def add_rows(_context, out, to, base, at, scale, weights, first, count, source, row, stride):  # type: ignore[no-untyped-def]
    """Row ``to`` of ``out`` = row ``at`` of ``base`` + scale · Σ_k w_k · row (row + k stride).

    The rows of an array are counted through all of its axes but the last, which is as long in all
    three arrays and a multiple of ``LANES``. The ``count`` weights begin at number ``first`` of the
    array ``weights``; rows of ``source`` must not be what is written to.
    """
    signature = types.void(
        out, types.intp, base, types.intp, types.float64, weights, types.intp, types.intp, source,
        types.intp, types.intp,
    )  # fmt: skip
    return signature, _build


def _build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """The loops over the vectors of a row, with those over k inside."""
    arrays = {
        k: context.make_array(signature.args[k])(context, builder, arguments[k])
        for k in (0, 2, 5, 8)
    }
    to, at, first, count, row, stride = (arguments[k] for k in (1, 3, 6, 7, 9, 10))
    width = builder.extract_value(arrays[0].shape, signature.args[0].ndim - 1)
    target, begin, rows = (
        builder.gep(arrays[k].data, [builder.mul(number, width)])
        for k, number in ((0, to), (2, at), (8, row))
    )
    weights, step = builder.gep(arrays[5].data, [first]), builder.mul(stride, width)

    def sums(start: Any, vectors: int) -> None:
        places = [builder.add(start, _INDEX(LANES * k)) for k in range(vectors)]
        totals = [cgutils.alloca_once(builder, _VECTOR) for _ in places]

        def vector(pointer: Any, place: Any) -> Any:
            return builder.bitcast(builder.gep(pointer, [place]), _VECTOR.as_pointer())

        for place, total in zip(places, totals, strict=True):
            builder.store(builder.load(vector(begin, place), align=8), total)
        with cgutils.for_range(builder, count) as loop:
            weight = builder.load(builder.gep(weights, [loop.index]))
            factor = _everywhere(builder, builder.fmul(arguments[4], weight))
            here = builder.gep(rows, [builder.mul(loop.index, step)])
            for place, total in zip(places, totals, strict=True):
                x = builder.load(vector(here, place), align=8)
                term = builder.fmul(factor, x, flags=_FUSED)
                builder.store(builder.fadd(builder.load(total), term, flags=_FUSED), total)
        for place, total in zip(places, totals, strict=True):
            builder.store(builder.load(total), vector(target, place), align=8)

    done = _INDEX(0)
    for vectors in (_VECTORS, 1):
        length = _INDEX(vectors * LANES)
        times = builder.sdiv(builder.sub(width, done), length)
        with cgutils.for_range(builder, times) as loop:
            sums(builder.add(done, builder.mul(loop.index, length)), vectors)
        done = builder.add(done, builder.mul(times, length))
    return context.get_dummy_value()


def _everywhere(builder: Any, number: Any) -> Any:
    """A vector that holds one number in all lanes."""
    nothing, lane = ir.Constant(_VECTOR, ir.Undefined), ir.IntType(32)
    one = builder.insert_element(nothing, number, lane(0))
    return builder.shuffle_vector(one, nothing, ir.VectorType(lane, LANES)([0] * LANES))
