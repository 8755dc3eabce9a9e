"""MATLAB files: .mat of versions 5 to 7.2, element by element, and 7.3 (HDF5) through h5py.

Arrays of real numbers are read, also in fields of structures (``log.axis(2).q``). HDF5 stores
MATLAB's columns first, so that arrays are transposed back into the shape they have in MATLAB.

Arrays of MATLAB files of version 5 to 7.2, read element by element.

The format is MathWorks' "MAT-File Level 5": a header of 128 bytes, then elements of a tag (type and
length) and content, those of variables packed by zlib since version 7. SciPy reads more of it, but
a damaged file can end the process; here every length is compared with what is there before it is
followed. Fields of structures are variables of their own, ``log.axis(2).q``; cells, objects, texts,
sparse and complex arrays are named with the reason why they are not read.
"""

from __future__ import annotations

import math
import os
import struct
import zlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, BinaryIO

import numpy as np

from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import HARMLESS_SIZE, MAX_EXPANSION, refuse_bomb
from pivident.foundation.errors import FileFormatError, UnusableValue
from pivident.foundation.extras import MissingExtra, require

#: MATLAB's classes of numbers.
NUMERIC = {"double", "single", "logical"} | {
    f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)
}
#: First bytes of an HDF5 file; MATLAB puts 512 bytes of its own before them.
HDF5 = b"\x89HDF\r\n\x1a\n"
#: Length of the header, and of the longest head of a variable: flags, sizes and name [bytes].
HEADER, HEAD = 128, 4096
_MATRIX, _PACKED = 14, 15
#: Kinds of numbers in an element, by their code, as numpy names them.
_STORED = {
    1: "i1", 2: "u1", 3: "i2", 4: "u2", 5: "i4", 6: "u4", 7: "f4", 9: "f8", 12: "i8", 13: "u8",
}  # fmt: skip
#: Classes of arrays of numbers: double, single, and whole numbers of 1 to 8 bytes; of others.
_NUMBERS, _STRUCTURE, _OBJECT, _OPAQUE = range(6, 16), 2, 3, 17
#: What a class that is not read is called.
_OTHERS = {
    1: "a cell array", 3: "an object", 4: "text", 5: "a sparse array", 16: "a function",
    17: "an object",
}  # fmt: skip
_COMPLEX = 0x0800
#: Most elements of an array of structures, levels of structures inside each other, and variables.
MAX_ELEMENTS, MAX_LEVELS, MAX_VARIABLES = 64, 8, 10_000


def mat_names(path: Path) -> tuple[str, ...]:
    """Names of the variables of real numbers, without loading them."""
    return tuple(_variables(path))


def read_mat(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Variables of a MATLAB file in their MATLAB shapes: vectors are (n, 1) or (1, n)."""
    shapes = _variables(path)
    wanted = tuple(shapes) if names is None else tuple(names)
    refuse_bomb(path, sum(8 * math.prod(shapes.get(name, ())) for name in wanted))
    try:
        return _read_hdf5(path, wanted) if _is_hdf5(path) else _read_v5(path, wanted)
    except FileFormatError:
        raise
    # Readers of a damaged binary file fail in many ways; all of them mean the same to a user.
    except Exception as error:
        raise FileFormatError(f"{path.name} is a damaged MATLAB file ({error})") from error


def mat_unread(path: Path) -> dict[str, str]:
    """Why variables that hold something else are not read, by their names."""
    return {name: why for name, (_, why) in _described(path).items() if why}


def _is_hdf5(path: Path) -> bool:
    """Whether the file is of version 7.3."""
    with path.open("rb") as file:
        beginning = file.read(512 + len(HDF5))
    return beginning.startswith(HDF5) or beginning[512:] == HDF5


def _variables(path: Path) -> dict[str, tuple[int, ...]]:
    """Shapes of the numeric variables by name."""
    return {name: shape for name, (shape, why) in _described(path).items() if not why}


@dataclass(frozen=True)
class Variable:
    """A variable of a file, or a field of a structure."""

    name: str
    shape: tuple[int, ...]  # its shape in MATLAB
    class_number: int  # its class
    why_not: str  # why it is not read, empty for real numbers
    place: int  # where the element of the file begins that it lies in [bytes]
    inside: int = 0  # where a field's content begins in that of the structure [bytes]


def variables(path: Path) -> list[Variable]:
    """All variables with a name, without their numbers."""
    found: list[Variable] = []
    with path.open("rb") as stream:
        order, size = _opened(stream)
        for place, kind, length in _elements(stream, order, size):
            if kind not in (_MATRIX, _PACKED):
                continue
            variable, at = _variable(_content(stream, order, kind, length, HEAD), order, place)
            if variable.class_number == _STRUCTURE and variable.name:
                stream.seek(place + 8)
                content = _content(stream, order, kind, length, _largest(length))
                found += _fields(content, at, order, variable, MAX_LEVELS)
            elif variable.name:
                found.append(variable)
            if len(found) > MAX_VARIABLES:
                raise ValueError(f"it has more than {MAX_VARIABLES} variables")
    return found


def _largest(length: int) -> int:
    """Bytes that a packed structure may have."""
    return max(HARMLESS_SIZE, MAX_EXPANSION * length)


def _fields(
    content: memoryview, at: int, order: str, own: Variable, levels: int
) -> Iterator[Variable]:
    """The fields of a structure; ``at``: where their names begin in the content of ``own``."""
    elements = math.prod(own.shape)
    if elements > MAX_ELEMENTS or not levels:
        why = (
            f"has {elements} structures" if levels else "has too many structures inside each other"
        )
        yield replace(own, why_not=why)
        return
    width, at = _part(content, at, order)
    text, at = _part(content, at, order)
    size = struct.unpack(order + "i", width)[0] if len(width) == 4 else 0
    if size <= 0 or len(text) % size or len(text) // size * elements > MAX_VARIABLES:
        raise ValueError(f"the structure {own.name!r} has no names of its fields")
    names = [bytes(text[k : k + size]).partition(b"\0")[0] for k in range(0, len(text), size)]
    for element in range(elements):
        owner = own.name if elements == 1 else f"{own.name}({element + 1})"
        for name in names:
            begin, (field, after) = at + 8, _part(content, at, order)
            at = after
            if not field:  # an empty array
                continue
            one, behind = _variable(
                field, order, own.place, f"{owner}.{name.decode('utf-8', 'replace')}"
            )
            one = replace(one, inside=own.inside + begin)
            if one.class_number == _STRUCTURE:
                yield from _fields(field, behind, order, one, levels - 1)
            else:
                yield one


def array_of(path: Path, variable: Variable) -> np.ndarray:
    """The numbers of a variable in the shape it has in MATLAB."""
    count = math.prod(variable.shape)
    with path.open("rb") as stream:
        order, _ = _opened(stream)
        stream.seek(variable.place)
        kind, length, _ = _tag(stream.read(8), order)
        most = _largest(length) if variable.inside else HEAD + 8 * count
        content = _content(stream, order, kind, length, most)[variable.inside :]
    _, at = _variable(content, order, variable.place)
    kind, length, begin = _tag(content[at : at + 8], order)
    stored = _STORED.get(kind)
    if stored is None:
        raise ValueError(f"the numbers of {variable.name!r} are of the unknown type {kind}")
    numbers = np.dtype(order + stored)
    if length != count * numbers.itemsize or len(content) < at + begin + length:
        raise ValueError(f"{variable.name!r} has {length} bytes for {count} numbers")
    return np.frombuffer(content, numbers, count, at + begin).reshape(variable.shape, order="F")


def _opened(stream: BinaryIO) -> tuple[str, int]:
    """Order of the bytes, ``<`` or ``>``, and the length of the file [bytes]."""
    header = stream.read(HEADER)
    order = {b"IM": "<", b"MI": ">"}.get(header[126:128])
    if order is None:
        raise UnusableValue("it is not of version 5, 6, 7 or 7.3", advice="save it with -v7")
    if struct.unpack(order + "H", header[124:126])[0] != 0x0100:
        raise UnusableValue("its header names an unknown version", advice="save it with -v7")
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


def _tag(data: bytes | memoryview, order: str) -> tuple[int, int, int]:
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


def _content(stream: BinaryIO, order: str, kind: int, length: int, most: int) -> memoryview:
    """At most so many bytes of a variable's content; the stream is behind its tag."""
    if kind == _MATRIX:
        return memoryview(stream.read(min(length, most)))
    try:
        content = zlib.decompressobj().decompress(stream.read(length), most + 8)
    except zlib.error as error:
        raise ValueError(f"a packed variable is damaged ({error})") from error
    inner, length, begin = _tag(content[:8], order)
    if inner != _MATRIX or begin != 8:
        raise ValueError("a packed element holds no variable")
    return memoryview(content)[8 : 8 + length]


def _variable(
    content: memoryview, order: str, place: int, called: str = ""
) -> tuple[Variable, int]:
    """What the first three elements say, and where the numbers begin; ``called``: of a field."""
    flags, at = _part(content, 0, order)
    if len(flags) != 8:
        raise ValueError(f"the variable at byte {place} has no class")
    flag = struct.unpack(order + "I", flags[:4])[0]
    number = flag & 0xFF
    sizes = memoryview(struct.pack(order + "ii", 1, 1))
    if number != _OPAQUE:  # an object of a newer class has no size
        sizes, at = _part(content, at, order)
    text, at = _part(content, at, order)
    if len(sizes) < 8 or len(sizes) % 4:
        raise ValueError(f"the variable at byte {place} has no size")
    shape = struct.unpack(f"{order}{len(sizes) // 4}i", sizes)
    if min(shape) < 0:
        raise ValueError(f"the variable at byte {place} has the size {shape}")
    why_not = "" if number in _NUMBERS else _OTHERS.get(number, "of an unknown class")
    if number in (_OBJECT, _OPAQUE):
        names = [_part(content, at, order)]
        if number == _OPAQUE:  # "MCOS" stands before its name
            names.append(_part(content, names[0][1], order))
        why_not += f" of class {bytes(names[-1][0]).decode('utf-8', 'replace')}"
    elif flag & _COMPLEX and not why_not:
        why_not = "complex; save its real part"
    name = called or bytes(text).decode("utf-8", "replace")
    return Variable(name, shape, number, why_not, place), at


def _part(content: memoryview, at: int, order: str) -> tuple[memoryview, int]:
    """Content of the element at a place of a variable's content, and where the next one begins."""
    _, length, begin = _tag(content[at : at + 8], order)
    end = at + begin + length
    if end > len(content):
        raise ValueError("an element goes on behind the end of its variable")
    return content[at + begin : end], _padded(end)


def _described(path: Path) -> dict[str, tuple[tuple[int, ...], str]]:
    """Shape of every variable, and why it is not read or empty, by name."""
    try:
        if _is_hdf5(path):
            return _hdf5_datasets(path)
        return {v.name: (v.shape, v.why_not) for v in variables(path)}
    except MissingExtra:
        raise
    except Exception as error:
        raise FileFormatError(f"{path.name} is not a readable MATLAB file ({error})") from error


def _hdf5_datasets(path: Path) -> dict[str, tuple[tuple[int, ...], str]]:
    """All datasets, those in groups (structures) by the names of both."""
    h5py = _h5py(path)
    found: dict[str, tuple[tuple[int, ...], str]] = {}
    visited = set()  # groups can hold themselves

    def walk(group: Any, before: str, levels: int) -> None:
        for name in group:
            own = f"{before}{name}"
            if name.startswith("#"):  # what references and objects refer to
                continue
            if len(found) > MAX_VARIABLES:
                raise ValueError(f"it has more than {MAX_VARIABLES} variables")
            if not isinstance(group.get(name, getlink=True), h5py.HardLink):
                found[own] = ((), "in another file; save it in one file")
            elif isinstance(item := group[name], h5py.Group) and levels:
                if (place := h5py.h5o.get_info(item.id).addr) in visited:
                    continue
                visited.add(place)
                walk(item, f"{own}.", levels - 1)
            elif not isinstance(item, h5py.Dataset):
                found[own] = ((), "too many structures inside each other")
            else:
                found[own] = (item.shape[::-1], _why_no_numbers(item))

    with h5py.File(path, "r") as file:
        walk(file, "", MAX_LEVELS)
    return found


def _h5py(path: Path) -> Any:
    return require("h5py", extra="matlab", purpose=f"{path.name}, of MATLAB 7.3,")


def _why_no_numbers(dataset: Any) -> str:
    """Why an HDF5 dataset holds no numbers of its own, but text or references; empty: it does."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    kind = kind.decode("utf-8", "replace") if isinstance(kind, bytes) else str(kind)
    if dataset.attrs.get("MATLAB_empty", 0):  # stored as the list of its dimensions
        return "empty"
    if kind in NUMERIC and dataset.dtype.kind in "biuf":
        return ""
    return f"of class {kind}" if kind not in NUMERIC else "no array of real numbers"


def _read_v5(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    known = {v.name: v for v in variables(path)}
    for name in names:
        if known[name].why_not:
            raise FileFormatError(f"{path.name}: {name!r} is {known[name].why_not}")
    return {name: array_of(path, known[name]) for name in names}


def _read_hdf5(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    h5py = _h5py(path)
    arrays = {}
    with h5py.File(path, "r") as file:
        for name in names:
            dataset = file[name if name in file else name.replace(".", "/")]
            if dataset.external or dataset.is_virtual:
                raise FileFormatError(
                    f"{path.name} keeps {name!r} in another file", advice="save it in one file"
                )
            arrays[name] = np.ascontiguousarray(dataset[()].T)
    return arrays


#: The reader of MATLAB files.
MAT = Reader((".mat",), mat_names, read_mat, mat_unread)
