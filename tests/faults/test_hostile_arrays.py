"""Archives of arrays, MATLAB and Parquet files made to harm: code, lying headers, odd types."""

import io
import os
import pickle
import struct

import numpy as np
import pytest

from pivident.data.logs.tables.read_npz import read_npz
from pivident.data.logs.tables.tables import read_table, unread_in
from pivident.foundation.errors import FileFormatError, PividentError
from tests.faults.hostile import archive, npy, written


class Harm:
    """What a pickle could do when it is loaded."""

    def __reduce__(self):
        return os.mkdir, ("harmed",)


def test_pickled_arrays_are_never_loaded(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    header = b"{'descr': '|O', 'fortran_order': False, 'shape': (1,), }\n"
    path = archive(tmp_path, x=npy(header, pickle.dumps([Harm()])))
    for reading in (lambda: read_table(path), lambda: read_npz(path, ["x"])):
        try:
            assert reading() == {}
        except FileFormatError as error:
            assert "pickled objects" in str(error)
    bare = written(tmp_path, "b.npz", pickle.dumps(Harm()))
    with pytest.raises(FileFormatError, match=r"not an \.npz archive"):
        read_table(bare)
    assert not (tmp_path / "harmed").exists()


@pytest.mark.parametrize(
    "header",
    [
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (99999999999,), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (-1,), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (True, 3), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': (" + b"9" * 5000 + b",), }\n",
        b"{'descr': '<f8', 'fortran_order': False, 'shape': ((((3,),),),), }\n",
        b"{'descr': __import__('os').system('true'), 'fortran_order': False, 'shape': (3,), }\n",
        b"(" * 5000,
        b"{" * 9000,
        b"-" * 9000 + b"1",
        b"'" * 3,
        b"\xff\xfe\n",
    ],
)
@pytest.mark.parametrize("version", [(1, 0), (2, 0), (3, 0), (9, 9)])
def test_headers_of_arrays_that_lie(tmp_path, header, version):
    path = archive(tmp_path, x=npy(header, bytes(24), version))
    with pytest.raises(FileFormatError, match=r"array 'x'"):
        read_table(path)


def test_a_header_of_a_gigabyte_is_not_unpacked(tmp_path):
    """NumPy reads a header of any length before it looks at it."""
    content = b"\x93NUMPY" + bytes((2, 0)) + struct.pack("<I", 2**30) + bytes(2**22)
    path = archive(tmp_path, x=content)
    with pytest.raises(FileFormatError, match="header has 1073741824 bytes"):
        read_table(path)


def test_names_in_archives_are_no_paths(tmp_path, monkeypatch):
    """Members are read, never unpacked to disk, whatever they are called."""
    monkeypatch.chdir(tmp_path)
    stream = io.BytesIO()
    np.save(stream, np.arange(3.0))
    path = archive(tmp_path, **{"..__..__evil": stream.getvalue(), "__abs": stream.getvalue()})
    assert set(read_table(path)) == {"../../evil", "/abs"}
    assert [p.name for p in tmp_path.iterdir()] == ["a.npz"]


def test_encrypted_and_unknown_members(tmp_path):
    stream = io.BytesIO()
    np.savez(stream, x=np.arange(3.0))
    whole = bytearray(stream.getvalue())
    central = whole.rindex(b"PK\x01\x02")
    for offset, value in ((8, 1), (10, 99)):  # flag: encrypted; method: unknown
        content = bytearray(whole)
        content[central + offset] = value
        content[6 if offset == 8 else 8] = value
        with pytest.raises(FileFormatError, match="array 'x' is damaged"):
            read_table(written(tmp_path, "a.npz", bytes(content)))


def test_objects_of_matlab_files_are_not_made(tmp_path):
    from scipy.io import savemat

    path = tmp_path / "a.mat"
    savemat(path, {"o": np.array([{"a": 1}], dtype=object), "x": [[1.0, 2.0]]})
    assert list(read_table(path)) == ["x"]


def test_parquet_with_nested_and_other_types(tmp_path):
    from datetime import date

    import polars as pl

    path = tmp_path / "a.parquet"
    content = {
        "x": [1.0],
        "n": [{"a": {"b": [1]}}],
        "l": [[1.0] * 1000],
        "d": [date(2020, 1, 1)],
        "s": ["="],
    }
    pl.DataFrame(content).write_parquet(path)
    numbers = ["x", "n.a.b[0]", *(f"l[{k}]" for k in range(1000))]
    assert list(read_table(path)) == numbers
    assert set(unread_in(path)) == {"d", "s"}
    pl.DataFrame({f"c{k}": [1.0] for k in range(2000)}).write_parquet(path)
    assert len(read_table(path)) == 2000


def test_parquet_that_makes_its_library_panic(tmp_path):
    """Whatever the metadata says, the library's panic is no Python error that passes."""
    import polars as pl

    path = tmp_path / "a.parquet"
    pl.DataFrame({"x": [1.0, 2.0]}).write_parquet(path)
    whole = path.read_bytes()
    size = struct.unpack("<I", whole[-8:-4])[0]
    for k in range(0, size, 3):
        at = len(whole) - 8 - size + k
        path.write_bytes(whole[:at] + b"\xff\xff" + whole[at + 2 :])
        try:
            read_table(path)
        except PividentError:
            continue
