import io
import zipfile

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from pivident.data.logs import source_files as files
from pivident.data.logs.tables.read_npz import read_npz
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.foundation.errors import FileFormatError

KINDS = st.sampled_from(["f8", "f4", "i4", "u1", "?"])


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(KINDS.flatmap(lambda kind: arrays(kind, array_shapes(max_dims=2))), st.booleans())
def test_arrays_come_back_bit_for_bit(tmp_path, values, compressed):
    path = tmp_path / "log.npz"
    (np.savez_compressed if compressed else np.savez)(path, q=values, other=np.zeros(3))
    table = read_npz(path, ["q"])
    assert list(table) == ["q"]
    np.testing.assert_array_equal(table["q"], values)
    assert table["q"].dtype == values.dtype


def test_columns_in_fortran_order_come_back(tmp_path):
    values = np.asfortranarray(np.arange(12.0).reshape(4, 3))
    np.savez(tmp_path / "log.npz", q=values)
    np.testing.assert_array_equal(read_table(tmp_path / "log.npz")["q"], values)


def test_text_beside_the_numbers_is_left_out(tmp_path):
    np.savez(tmp_path / "log.npz", q=np.zeros(3), remark=np.array("fast"))
    assert names_in(tmp_path / "log.npz") == ("q", "remark")
    assert list(read_npz(tmp_path / "log.npz")) == ["q"]
    with pytest.raises(FileFormatError, match="remark"):
        read_npz(tmp_path / "log.npz", ["remark"])


class Bomb:
    def __reduce__(self):
        return (pytest.fail, ("the pickle was loaded",))


def test_pickled_objects_are_refused_without_loading_them(tmp_path):
    np.savez(tmp_path / "log.npz", q=np.array([Bomb()], dtype=object))
    with pytest.raises(FileFormatError, match="pickled objects in 'q'"):
        read_npz(tmp_path / "log.npz", ["q"])
    assert read_npz(tmp_path / "log.npz") == {}


def test_what_is_no_archive_is_refused(tmp_path):
    path = tmp_path / "log.npz"
    for content, message in ((b"", "empty"), (b"hello", "not an .npz"), (b"PK\3\4", "not an")):
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match=message):
            names_in(path)


def archive_of(path, content):
    with zipfile.ZipFile(path, "w", zipfile.ZIP_DEFLATED) as archive:
        archive.writestr("q.npy", content)
    return path


def test_a_damaged_array_is_refused(tmp_path):
    buffer = io.BytesIO()
    np.save(buffer, np.arange(100.0))
    for content in (b"", b"\x93NUMPY", buffer.getvalue()[:30], b"not an array at all"):
        with pytest.raises(FileFormatError, match="'q' is damaged"):
            read_npz(archive_of(tmp_path / "log.npz", content), ["q"])


def test_an_array_that_promises_more_than_is_there_is_refused(tmp_path):
    buffer = io.BytesIO()
    header = {"descr": "<f8", "fortran_order": False, "shape": (10**12, 6)}
    np.lib.format.write_array_header_1_0(buffer, header)
    with pytest.raises(FileFormatError, match="promises"):
        read_npz(archive_of(tmp_path / "log.npz", buffer.getvalue()), ["q"])


def test_an_archive_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    np.savez_compressed(tmp_path / "log.npz", q=np.zeros(2**19))
    with pytest.raises(FileFormatError, match="200 times"):
        read_npz(tmp_path / "log.npz", ["q"])
