"""NumPy arrays: archives (.npz) and single ones (.npy). Pickled objects are never loaded.

An array that is large is read part by part into a working array; a single one is mapped.
"""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import IO

import numpy as np
from numpy.lib import format as npy

from pivident.data.logs.reader import Reader
from pivident.data.logs.source_files import refuse_bomb
from pivident.foundation.errors import FileFormatError
from pivident.foundation.scratch import largest_in_memory, working_array

#: Name of the array in a file that holds one only.
ONLY = "data"

#: Bytes that are read at a time of a large array.
PART = 2**24

#: Longest header of an array [bytes]. NumPy would read whatever length is promised.
MAX_HEADER = 2**16


def npz_names(path: Path) -> tuple[str, ...]:
    """Names of the arrays, without loading them."""
    with _archive(path) as archive:
        return tuple(
            member.removesuffix(".npy") for member in archive.namelist() if member.endswith(".npy")
        )


def read_npz(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Arrays of a NumPy archive."""
    arrays = {}
    for name in npz_names(path) if names is None else names:
        with _archive(path) as archive:
            dtype, size = _promise(path, archive, name)
            if dtype.kind not in "biuf":
                if names is None:
                    continue
                kind = "pickled objects" if dtype.hasobject else f"{dtype}"
                raise FileFormatError(
                    f"{path.name} holds {kind} in {name!r}", advice="save it as an array of numbers"
                )
            refuse_bomb(path, size)
            arrays[name] = _load(path, archive, name, size)
    return arrays


def _archive(path: Path) -> zipfile.ZipFile:
    """The archive, opened."""
    try:
        return zipfile.ZipFile(path)
    # An archive can be damaged in many ways; all of them mean the same to a user.
    except Exception as error:
        raise FileFormatError(f"{path.name} is not an .npz archive ({error})") from error


def _promise(path: Path, archive: zipfile.ZipFile, name: str) -> tuple[np.dtype, int]:
    """Type and bytes that an array's header promises, before anything is allocated."""
    with _damage_named(path, name), archive.open(f"{name}.npy") as member:
        _check_header_length(member)
    with _damage_named(path, name), archive.open(f"{name}.npy") as member:
        shape, _, dtype = _header(member)
        if any(type(length) is not int or not 0 <= length < 2**63 for length in shape):
            raise ValueError("its shape is not that of an array")
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    stored = archive.getinfo(f"{name}.npy").file_size
    if dtype.kind in "biuf" and size > stored:
        raise FileFormatError(
            f"{path.name}: array {name!r} promises {size} bytes but the archive holds {stored}"
        )
    return dtype, size


def _check_header_length(member: IO[bytes]) -> None:
    """Refuse a header that NumPy would read whatever its length."""
    version = npy.read_magic(member)
    length = int.from_bytes(member.read(2 if version == (1, 0) else 4), "little")
    if length > MAX_HEADER:
        raise ValueError(f"its header has {length} bytes")


def _load(path: Path, archive: zipfile.ZipFile, name: str, size: int) -> np.ndarray:
    """One array, without ever unpickling."""
    with _damage_named(path, name), archive.open(f"{name}.npy") as member:
        if size <= largest_in_memory():
            return npy.read_array(member, allow_pickle=False)
        shape, fortran, dtype = _header(member)
        flat = working_array((int(np.prod(shape)),))
        items = max(1, PART // dtype.itemsize)
        for first in range(0, flat.size, items):
            part = flat[first : first + items]
            part[:] = np.frombuffer(member.read(part.size * dtype.itemsize), dtype)
        return flat.reshape(shape, order="F" if fortran else "C")


def _header(member: IO[bytes]) -> tuple[tuple[int, ...], bool, np.dtype]:
    """Shape, order and type of an array, the stream then stands at its first item."""
    version = npy.read_magic(member)
    read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
    return read(member)


def read_npy(path: Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """The array of a .npy file, as ``data``; mapped, not read."""
    with _damage_named(path, ONLY), path.open("rb") as file:
        _check_header_length(file)
        file.seek(0)
        dtype = _header(file)[2]
    if dtype.kind not in "biuf":
        kind = "pickled objects" if dtype.hasobject else f"{dtype}"
        raise FileFormatError(f"{path.name} holds {kind}", advice="save it as an array of numbers")
    with _damage_named(path, ONLY):
        return {ONLY: np.asarray(np.load(path, mmap_mode="r", allow_pickle=False))}


@contextmanager
def _damage_named(path: Path, name: str) -> Iterator[None]:
    """One error for the many that unpacking and reading a damaged array end with."""
    try:
        yield
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise FileFormatError(f"{path.name}: array {name!r} is damaged ({reason})") from error


#: The readers of archives of arrays and of single ones.
NPZ, NPY = Reader((".npz",), npz_names, read_npz), Reader((".npy",), lambda path: (ONLY,), read_npy)
