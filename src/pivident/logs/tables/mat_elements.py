"""Arrays of MATLAB files of version 5 to 7.2, read element by element.

The format is MathWorks' "MAT-File Level 5": a header of 128 bytes, then elements of a tag (type and
length) and content, those of variables packed by zlib since version 7. SciPy reads more of it, but
a damaged file can end the process; here every length is compared with what is there before it is
followed. Cells, structures, texts, sparse and complex arrays are passed over.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

import numpy as np

#: Length of the header, and of the longest head of a variable: flags, sizes and name [bytes].
HEADER, HEAD = 128, 4096

_MATRIX, _PACKED = 14, 15

#: Kinds of numbers in an element, by their code, as numpy names them.
_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip

#: Classes of arrays of numbers: double, single, and whole numbers of 1 to 8 bytes.
_NUMBERS = range(6, 16)

_COMPLEX = 0x0800


@dataclass(frozen=True)
class Variable:
    """A variable of a file."""

    name: str
    shape: tuple[int, ...]  # its shape in MATLAB
    numeric: bool  # whether it is an array of numbers
    is_complex: bool  # whether these have imaginary parts
    place: int  # where its element begins [bytes]


def variables(path: Path) -> list[Variable]:
    """All variables with a name, without their numbers."""
    with path.open("rb") as stream:
        order, size = _opened(stream)
        found = []
        for place, kind, length in _elements(stream, order, size):
            if kind in (_MATRIX, _PACKED):
                head = _content(stream, order, kind, length, HEAD)
                variable = _variable(head, order, place)[0]
                if variable.name:
                    found.append(variable)
        return found


def array_of(path: Path, variable: Variable) -> np.ndarray:
    """The numbers of a variable in the shape it has in MATLAB."""
    count = math.prod(variable.shape)
    with path.open("rb") as stream:
        order, _ = _opened(stream)
        stream.seek(variable.place)
        kind, length, _ = _tag(stream.read(8), order)
        content = _content(stream, order, kind, length, HEAD + 8 * count)
    _, at = _variable(content, order, variable.place)
    kind, length, begin = _tag(content[at : at + 8], order)
    stored = _STORED.get(kind)
    if stored is None:
        raise ValueError(f"the numbers of {variable.name!r} are of the unknown type {kind}")
    numbers = np.dtype(order + stored)
    if length != count * numbers.itemsize or len(content) < at + begin + length:
        raise ValueError(f"{variable.name!r} has {length} bytes for {count} numbers")
    values = np.frombuffer(content, numbers, count, at + begin)
    return values.reshape(variable.shape, order="F")


def _opened(stream: BinaryIO) -> tuple[str, int]:
    """Order of the bytes, ``<`` or ``>``, and the length of the file [bytes]."""
    header = stream.read(HEADER)
    order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
    if order is None:
        raise ValueError("it is not of version 5, 6, 7 or 7.3; save it with -v7")
    if struct.unpack(order + "H", header[124:126])[0] != 0x0100:
        raise ValueError("its header names an unknown version; save it with -v7")
    return order, os.fstat(stream.fileno()).st_size


def _elements(stream: BinaryIO, order: str, size: int) -> Iterator[tuple[int, int, int]]:
    """Place, type and length of each element of the file."""
    place = HEADER
    while place < size:
        stream.seek(place)
        kind, length, begin = _tag(stream.read(8), order)
        end = place + begin + length
        if end > size:
            raise ValueError(f"an element at byte {place} goes on behind the end of the file")
        yield place, kind, length
        place = end if kind == _PACKED else _padded(end)


def _tag(data: bytes, order: str) -> tuple[int, int, int]:
    """Type and length of an element, and where its content begins."""
    if len(data) < 8:
        raise ValueError("it ends in the middle of an element")
    kind, length = struct.unpack(order + "II", data)
    if kind >> 16:  # a short element: the length stands beside the type, four bytes follow
        kind, length = kind & 0xFFFF, kind >> 16
        if length > 4:
            raise ValueError(f"a short element has {length} bytes")
        return kind, length, 4
    return kind, length, 8


def _padded(place: int) -> int:
    """The next place that elements may begin at."""
    return -(-place // 8) * 8


def _content(stream: BinaryIO, order: str, kind: int, length: int, most: int) -> bytes:
    """At most so many bytes of a variable's content; the stream is behind its tag."""
    if kind == _MATRIX:
        return stream.read(min(length, most))
    try:
        content = zlib.decompressobj().decompress(stream.read(length), most + 8)
    except zlib.error as error:
        raise ValueError(f"a packed variable is damaged ({error})") from error
    inner, length, begin = _tag(content[:8], order)
    if inner != _MATRIX or begin != 8:
        raise ValueError("a packed element holds no variable")
    return content[8 : 8 + length]


def _variable(content: bytes, order: str, place: int) -> tuple[Variable, int]:
    """What the first three elements say, and where the numbers begin."""
    flags, at = _part(content, 0, order)
    sizes, at = _part(content, at, order)
    name, at = _part(content, at, order)
    if len(flags) != 8 or len(sizes) < 8 or len(sizes) % 4:
        raise ValueError(f"the variable at byte {place} has no class or no size")
    flag = struct.unpack(order + "I", flags[:4])[0]
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if min(shape) < 0:
        raise ValueError(f"the variable at byte {place} has the size {shape}")
    text = name.decode("utf-8", "replace")
    return Variable(text, shape, flag & 0xFF in _NUMBERS, bool(flag & _COMPLEX), place), at


def _part(content: bytes, at: int, order: str) -> tuple[bytes, int]:
    """Content of the element at a place of a variable's content, and where the next one begins."""
    _, length, begin = _tag(content[at : at + 8], order)
    end = at + begin + length
    if end > len(content):
        raise ValueError("an element goes on behind the end of its variable")
    return content[at + begin : end], _padded(end)
