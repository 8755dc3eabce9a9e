"""NumPy archives: .npz. Pickled objects are never loaded."""

from __future__ import annotations

import zipfile
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path

import numpy as np
from numpy.lib import format as npy

from pivident.errors import FileFormatError
from pivident.recording.files import existing_file, refuse_bomb


#: Longest header of an array [bytes]. NumPy would read whatever length is promised.
LONGEST_HEADER = 2**16


def npz_names(path: str | Path) -> tuple[str, ...]:
    """Names of the arrays, without loading them.

    Raises:
        FileFormatError: the file is missing, empty or no archive.
    """
    with _archive(existing_file(path)) as archive:
        return tuple(
            member.removesuffix(".npy") for member in archive.namelist() if member.endswith(".npy")
        )


def read_npz(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Arrays of a NumPy archive.

    Args:
        path: the file.
        names: the arrays wanted, which are in the file; all numeric ones where it is not given.

    Returns:
        Each array by its name, in the shape it has in the file.

    Raises:
        FileFormatError: the file is missing, damaged, expands beyond reason, or a wanted array
            holds text or pickled objects.
    """
    path = existing_file(path)
    arrays = {}
    for name in npz_names(path) if names is None else names:
        with _archive(path) as archive:
            dtype, size = _promise(path, archive, name)
            if dtype.kind not in "biuf":
                if names is None:
                    continue
                kind = "pickled objects" if dtype.hasobject else f"{dtype}"
                raise FileFormatError(
                    f"{path.name} holds {kind} in {name!r}; save it as an array of numbers"
                )
            refuse_bomb(path, size)
            arrays[name] = _load(path, archive, name)
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
        version = npy.read_magic(member)
        length = int.from_bytes(member.read(2 if version == (1, 0) else 4), "little")
        if length > LONGEST_HEADER:
            raise ValueError(f"its header has {length} bytes")
    with _damage_named(path, name), archive.open(f"{name}.npy") as member:
        npy.read_magic(member)
        read = npy.read_array_header_1_0 if version == (1, 0) else npy.read_array_header_2_0
        shape, _, dtype = read(member)
        if any(type(length) is not int or length < 0 for length in shape):
            raise ValueError(f"its shape is {shape}")
    size = int(np.prod(shape, dtype=object)) * dtype.itemsize
    stored = archive.getinfo(f"{name}.npy").file_size
    if dtype.kind in "biuf" and size > stored:
        raise FileFormatError(
            f"{path.name}: array {name!r} promises {size} bytes but the archive holds {stored}"
        )
    return dtype, size


def _load(path: Path, archive: zipfile.ZipFile, name: str) -> np.ndarray:
    """One array, without ever unpickling."""
    with _damage_named(path, name), archive.open(f"{name}.npy") as member:
        return npy.read_array(member, allow_pickle=False)


@contextmanager
def _damage_named(path: Path, name: str) -> Iterator[None]:
    """One error for the many that unpacking and reading a damaged array end with."""
    try:
        yield
    except Exception as error:
        reason = str(error).partition("\n")[0]
        raise FileFormatError(f"{path.name}: array {name!r} is damaged ({reason})") from error
