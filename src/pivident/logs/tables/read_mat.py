"""MATLAB files: .mat of versions 5 to 7.2, see `mat_elements`, and 7.3 (HDF5) through h5py.

Only top-level variables of real numbers are read. HDF5 stores MATLAB's columns first, so that
arrays are transposed back into the shape they have in MATLAB.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from pivident.errors import FileFormatError
from pivident.extras import MissingExtra, require
from pivident.logs.source_files import existing_file, refuse_bomb
from pivident.logs.tables.mat_elements import array_of, variables

#: MATLAB's classes of numbers.
NUMERIC = {"double", "single", "logical"} | {
    f"{u}int{n}" for u in ("", "u") for n in (8, 16, 32, 64)
}


#: First bytes of an HDF5 file; MATLAB puts 512 bytes of its own before them.
HDF5 = b"\x89HDF\r\n\x1a\n"


def mat_names(path: str | Path) -> tuple[str, ...]:
    """Names of the variables of real numbers, without loading them."""
    return tuple(_variables(existing_file(path)))


def read_mat(path: str | Path, names: Sequence[str] | None = None) -> dict[str, np.ndarray]:
    """Variables of a MATLAB file in their MATLAB shapes: vectors are (n, 1) or (1, n)."""
    path = existing_file(path)
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


def _is_hdf5(path: Path) -> bool:
    """Whether the file is of version 7.3."""
    with path.open("rb") as file:
        beginning = file.read(512 + len(HDF5))
    return beginning.startswith(HDF5) or beginning[512:] == HDF5


def _variables(path: Path) -> dict[str, tuple[int, ...]]:
    """Shapes of the numeric variables by name."""
    try:
        return _variables_hdf5(path) if _is_hdf5(path) else _variables_v5(path)
    except MissingExtra:
        raise
    except Exception as error:
        raise FileFormatError(f"{path.name} is not a readable MATLAB file ({error})") from error


def _variables_v5(path: Path) -> dict[str, tuple[int, ...]]:
    return {v.name: v.shape for v in variables(path) if v.numeric and not v.is_complex}


def _variables_hdf5(path: Path) -> dict[str, tuple[int, ...]]:
    h5py = _h5py(path)
    with h5py.File(path, "r") as file:
        links = {name: file.get(name, getlink=True) for name in file}
        inside = [name for name, link in links.items() if isinstance(link, h5py.HardLink)]
        return {
            name: file[name].shape[::-1]
            for name in inside
            if isinstance(file[name], h5py.Dataset) and _is_numeric(file[name])
        }


def _h5py(path: Path) -> Any:
    return require("h5py", extra="matlab", purpose=f"{path.name}, of MATLAB 7.3,")


def _is_numeric(dataset: Any) -> bool:
    """Whether an HDF5 dataset holds numbers of its own: no text, no references."""
    kind = dataset.attrs.get("MATLAB_class", b"double")
    kind = kind.decode() if isinstance(kind, bytes) else str(kind)
    # An empty MATLAB array is stored as the list of its dimensions.
    empty = bool(dataset.attrs.get("MATLAB_empty", 0))
    return kind in NUMERIC and dataset.dtype.kind in "biuf" and not empty


def _read_v5(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    known = {v.name: v for v in variables(path)}
    for name in names:
        if known[name].is_complex:
            raise FileFormatError(f"{path.name}: {name!r} is complex; save its real part")
    return {name: array_of(path, known[name]) for name in names}


def _read_hdf5(path: Path, names: Sequence[str]) -> dict[str, np.ndarray]:
    h5py = _h5py(path)
    arrays = {}
    with h5py.File(path, "r") as file:
        for name in names:
            dataset = file[name]
            if dataset.external or dataset.is_virtual:
                raise FileFormatError(
                    f"{path.name} keeps {name!r} in another file; save it in one file"
                )
            arrays[name] = np.ascontiguousarray(dataset[()].T)
    return arrays
