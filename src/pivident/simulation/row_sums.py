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

#: Vectors that are summed side by side, as long as the row has so many left: each product waits
#: for the sum before it, and all of them share one weight.
_VECTORS = 4

_INDEX, _VECTOR = ir.IntType(64), ir.VectorType(ir.DoubleType(), LANES)
_NUMBER = types.intp
_FUSED = ("contract",)  # a product and a sum may be one instruction

_in_vectors: Any = intrinsic  # without types: compiled code calls it with one argument less


def row_array(*shape: int) -> np.ndarray:
    """Zeros whose last axis is padded to whole vectors, and that begin where a vector may."""
    *others, width = shape
    width = -(-width // LANES) * LANES
    size = int(np.prod(others, dtype=int)) * width
    memory = np.zeros(size + LANES)
    skipped = -(memory.ctypes.data // memory.itemsize) % LANES
    return memory[skipped : skipped + size].reshape(*others, width)


@_in_vectors
def add_rows(_context, out, to, base, at, scale, count, weights, first, source, row, stride):
    """Row ``to`` of ``out`` = row ``at`` of ``base`` + scale · Σ_k w_k · row (row + k stride).

    The rows of an array are counted through all of its axes but the last, which is as long in all
    three arrays and a multiple of ``LANES``. The ``count`` weights begin at number ``first`` of the
    array ``weights``; rows of ``source`` must not be what is written to.
    """
    signature = types.void(
        out, _NUMBER, base, _NUMBER, types.float64, _NUMBER,
        weights, _NUMBER, source, _NUMBER, _NUMBER,
    )  # fmt: skip
    return signature, _build


@_in_vectors
def add_rows_twice(
    _context, out, to, base, at, scale, count,
    weights, first, source, row, stride, weights_2, first_2, source_2, row_2, stride_2,
):  # fmt: skip
    """As ``add_rows``, with two sums of as many rows."""
    signature = types.void(
        out, _NUMBER, base, _NUMBER, types.float64, _NUMBER,
        weights, _NUMBER, source, _NUMBER, _NUMBER,
        weights_2, _NUMBER, source_2, _NUMBER, _NUMBER,
    )  # fmt: skip
    return signature, _build


def _build(context: Any, builder: Any, signature: Any, arguments: Any) -> Any:
    """The loops over the vectors of a row, with those over k inside."""

    def array(k: int) -> Any:
        return context.make_array(signature.args[k])(context, builder, arguments[k])

    out, base, scale, count = array(0), array(2), arguments[4], arguments[5]
    width = builder.extract_value(out.shape, signature.args[0].ndim - 1)

    def begin_of(memory: Any, row: Any) -> Any:
        return builder.gep(memory.data, [builder.mul(row, width)])

    target, begin = begin_of(out, arguments[1]), begin_of(base, arguments[3])
    sums = [
        (
            builder.gep(array(k).data, [arguments[k + 1]]),
            begin_of(array(k + 2), arguments[k + 3]),
            builder.mul(arguments[k + 4], width),
        )
        for k in range(6, len(arguments), 5)
    ]

    scaled = _everywhere(builder, scale)

    def sum_up(start: Any, vectors: int) -> None:
        places = [builder.add(start, _INDEX(LANES * k)) for k in range(vectors)]
        totals = [cgutils.alloca_once(builder, _VECTOR) for _ in places]

        def vector(pointer: Any, place: Any) -> Any:
            return builder.bitcast(builder.gep(pointer, [place]), _VECTOR.as_pointer())

        for total in totals:
            builder.store(ir.Constant(_VECTOR, [0.0] * LANES), total)
        with cgutils.for_range(builder, count) as loop:
            for weights, rows, step in sums:
                factor = _everywhere(builder, builder.load(builder.gep(weights, [loop.index])))
                here = builder.gep(rows, [builder.mul(loop.index, step)])
                for place, total in zip(places, totals, strict=True):
                    x = builder.load(vector(here, place), align=8)
                    term = builder.fmul(factor, x, flags=_FUSED)
                    builder.store(builder.fadd(builder.load(total), term, flags=_FUSED), total)
        for place, total in zip(places, totals, strict=True):
            start_of_row = builder.load(vector(begin, place), align=8)
            term = builder.fmul(scaled, builder.load(total), flags=_FUSED)
            made = builder.fadd(start_of_row, term, flags=_FUSED)
            builder.store(made, vector(target, place), align=8)

    done = _INDEX(0)
    for vectors in (_VECTORS, 1):
        length = _INDEX(vectors * LANES)
        times = builder.sdiv(builder.sub(width, done), length)
        with cgutils.for_range(builder, times) as over:
            sum_up(builder.add(done, builder.mul(over.index, length)), vectors)
        done = builder.add(done, builder.mul(times, length))
    return context.get_dummy_value()


def _everywhere(builder: Any, number: Any) -> Any:
    """A vector that holds one number in all lanes."""
    nothing, lane = ir.Constant(_VECTOR, ir.Undefined), ir.IntType(32)
    one = builder.insert_element(nothing, number, lane(0))
    return builder.shuffle_vector(one, nothing, ir.VectorType(lane, LANES)([0] * LANES))
