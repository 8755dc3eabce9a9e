"""Blocks of numbers in vector registers: a number type of compiled code.

Tangents of all directions lie side by side in the rows of arrays, and the same is done to each.
Numba's compiler makes vector instructions of innermost loops only, loads and stores a sum once for
each of its terms, and guards every loop against rows that overlap and ends that are left over. A
block of ``LANES`` numbers that counts as one number needs none of this, and code that treats single
numbers reads as before:

    total = nothing()
    for k in range(n):
        total += weight[k] * load(source, (k,), at)
    store(target, (row,), at, total)

The processor's own width is for the compiler to choose.
"""

from __future__ import annotations

import operator
from typing import Any

import numpy as np
from llvmlite import ir
from numba import types
from numba.core import cgutils
from numba.core.typing.templates import ConcreteTemplate, infer_global, signature
from numba.extending import intrinsic, lower_builtin, models, register_model

#: Numbers that one instruction treats at most, and vectors of a block: several share the scalars
#: and the addresses of a loop, and do not wait for one another.
_WIDTH, _VECTORS = 4, 3

#: Numbers in a block: rows are padded to a multiple of it.
LANES = _WIDTH * _VECTORS

_VECTOR = ir.VectorType(ir.DoubleType(), _WIDTH)
_BLOCK = ir.LiteralStructType([_VECTOR] * _VECTORS)
_INDEX = ir.IntType(64)
_FUSED = ("contract",)  # a product and a sum may be one instruction

_made_in_code: Any = intrinsic  # without types: compiled code calls it with one argument less


def row_array(*shape: int) -> np.ndarray:
    """Zeros whose last axis is padded to whole blocks, and that begin where a vector may."""
    *others, width = shape
    width = -(-width // LANES) * LANES
    size = int(np.prod(others, dtype=int)) * width
    memory = np.zeros(size + LANES)
    skipped = -(memory.ctypes.data // memory.itemsize) % LANES
    return memory[skipped : skipped + size].reshape(*others, width)


class LanesType(types.Type):
    """Type of a block in compiled code."""

    def __init__(self) -> None:
        super().__init__(name="lanes")


_lanes = LanesType()


@register_model(LanesType)
class _LanesModel(models.PrimitiveModel):
    def __init__(self, manager: Any, kind: LanesType) -> None:
        super().__init__(manager, kind, _BLOCK)


def _define(operators: tuple[Any, ...], name: str) -> None:
    """An operator between blocks, and between a block and a number that stands for all lanes."""
    number = types.float64
    pairs = ((_lanes, _lanes), (_lanes, number), (number, _lanes))

    def build(_context: Any, builder: Any, made: Any, arguments: Any) -> Any:
        left, right = (
            _parts(builder, value) if kind == _lanes else [_everywhere(builder, value)] * _VECTORS
            for kind, value in zip(made.args, arguments, strict=True)
        )
        combine = getattr(builder, name)
        pairs = zip(left, right, strict=True)
        return _together(builder, [combine(a, b, flags=_FUSED) for a, b in pairs])

    for function in operators:
        cases = [signature(_lanes, *pair) for pair in pairs]
        infer_global(function)(type(f"_{name}", (ConcreteTemplate,), {"cases": cases}))
        for pair in pairs:
            lower_builtin(function, *pair)(build)


def _everywhere(builder: Any, number: Any) -> Any:
    """A vector that holds one number everywhere."""
    empty, lane = ir.Constant(_VECTOR, ir.Undefined), ir.IntType(32)
    one = builder.insert_element(empty, number, lane(0))
    return builder.shuffle_vector(one, empty, ir.VectorType(lane, _WIDTH)([0] * _WIDTH))


def _parts(builder: Any, block: Any) -> list[Any]:
    """The vectors of a block."""
    return [builder.extract_value(block, k) for k in range(_VECTORS)]


def _together(builder: Any, vectors: list[Any]) -> Any:
    """The block of vectors."""
    block = ir.Constant(_BLOCK, ir.Undefined)
    for k, vector in enumerate(vectors):
        block = builder.insert_value(block, vector, k)
    return block


_define((operator.add, operator.iadd), "fadd")
_define((operator.sub, operator.isub), "fsub")
_define((operator.mul, operator.imul), "fmul")


@_made_in_code
def nothing(_context):
    """A block of zeros."""

    def build(_context: Any, builder: Any, _made: Any, _arguments: Any) -> Any:
        return _together(builder, [ir.Constant(_VECTOR, [0.0] * _WIDTH)] * _VECTORS)

    return _lanes(), build


@_made_in_code
def load(_context, array, index, at):
    """The block from number ``at`` of a row, ``index`` a tuple of all indices but the last.

    ``at``: None, decided by its type, in arrays whose rows are single blocks.
    """

    def build(context: Any, builder: Any, made: Any, arguments: Any) -> Any:
        places = _places(context, builder, made, arguments)
        return _together(builder, [builder.load(place, align=8) for place in places])

    return _lanes(array, index, _start(at)), build


@_made_in_code
def store(_context, array, index, at, block):
    """Put a block where ``load`` would find it."""

    def build(context: Any, builder: Any, made: Any, arguments: Any) -> Any:
        places = _places(context, builder, made, arguments)
        for vector, place in zip(_parts(builder, arguments[3]), places, strict=True):
            builder.store(vector, place, align=8)
        return context.get_dummy_value()

    return types.void(array, index, _start(at), _lanes), build


def _start(at: Any) -> Any:
    """Type of the number that a block begins at."""
    return at if isinstance(at, types.NoneType) else types.intp


def _places(context: Any, builder: Any, made: Any, arguments: Any) -> list[Any]:
    """Where the vectors of a block lie in an array, whose numbers are counted row after row."""
    array = context.make_array(made.args[0])(context, builder, arguments[0])
    lengths = cgutils.unpack_tuple(builder, array.shape)
    number = _INDEX(0)
    for k, length in enumerate(lengths[:-1]):
        index = builder.extract_value(arguments[1], k)
        index = context.cast(builder, index, made.args[1][k], types.intp)
        number = builder.add(builder.mul(number, length), index)
    if isinstance(made.args[2], types.NoneType):
        number = builder.mul(number, _INDEX(LANES))
    else:
        number = builder.add(builder.mul(number, lengths[-1]), arguments[2])
    first = builder.bitcast(builder.gep(array.data, [number]), _VECTOR.as_pointer())
    return [builder.gep(first, [_INDEX(k)]) for k in range(_VECTORS)]
