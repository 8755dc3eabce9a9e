"""MATLAB files: .mat of versions 5 to 7.2, see `mat_elements`, and 7.3 (HDF5) through h5py.

Arrays of real numbers are read, also in fields of structures (``log.axis(2).q``). HDF5 stores
MATLAB's columns first, so that arrays are transposed back into the shape they have in MATLAB.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import FileFormatError
from pivident.extras import MissingExtra, require
from pivident.logs.reader import Reader
from pivident.logs.source_files import refuse_bomb
from pivident.logs.tables.mat_elements import MAX_LEVELS, MAX_VARIABLES, array_of, variables

#: MATLAB's classes of numbers.
NUMERIC = {"double", "single", "logical"} | {
    f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)
}


#: First bytes of an HDF5 file; MATLAB puts 512 bytes of its own before them.
HDF5 = b"\x89HDF\r\n\x1a\n"


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
