import numpy as np
import polars as pl
import pytest
from hypothesis import HealthCheck, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from pivident.errors import BadCell, FileFormatError
from pivident.logs import source_files as files
from pivident.logs.tables.read_parquet import parquet_names, read_parquet
from pivident.logs.tables.tables import names_in, read_table

FINITE = st.floats(allow_nan=False, allow_infinity=False)


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=25)
@given(arrays(float, st.tuples(st.integers(1, 30), st.just(2)), elements=FINITE))
def test_numbers_come_back_bit_for_bit(tmp_path, values):
    pl.DataFrame({"a": values[:, 0], "b": values[:, 1]}).write_parquet(tmp_path / "log.parquet")
    table = read_parquet(tmp_path / "log.parquet")
    np.testing.assert_array_equal(np.column_stack([table["a"], table["b"]]), values)


def test_only_numeric_columns_are_offered(tmp_path):
    frame = pl.DataFrame({"q": [1, 2], "state": ["a", "b"], "on": [True, False]})
    frame.write_parquet(tmp_path / "log.parquet")
    assert parquet_names(tmp_path / "log.parquet") == names_in(tmp_path / "log.parquet")
    assert parquet_names(tmp_path / "log.parquet") == ("q", "on")
    assert read_table(tmp_path / "log.parquet", ["on"])["on"].tolist() == [1.0, 0.0]


def test_an_empty_cell_is_named(tmp_path):
    pl.DataFrame({"q": [1.0, 2.0, None]}).write_parquet(tmp_path / "log.parquet")
    with pytest.raises(BadCell) as caught:
        read_parquet(tmp_path / "log.parquet")
    assert (caught.value.line, caught.value.column) == (3, "q")


def test_what_is_no_parquet_file_is_refused(tmp_path):
    path = tmp_path / "log.parquet"
    for content in (b"", b"hello world", b"PAR1" + b"\0" * 40 + b"PAR1"):
        path.write_bytes(content)
        with pytest.raises(FileFormatError):
            read_parquet(path)


def test_a_file_with_damaged_pages_is_refused(tmp_path):
    path = tmp_path / "log.parquet"
    pl.DataFrame({"q": np.random.default_rng(0).standard_normal(5000)}).write_parquet(path)
    content = bytearray(path.read_bytes())
    content[4:400] = b"\xff" * 396
    path.write_bytes(content)
    with pytest.raises(FileFormatError, match="damaged"):
        read_parquet(path)


def test_a_bomb_is_refused_before_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    pl.DataFrame({"q": np.zeros(2**19)}).write_parquet(tmp_path / "log.parquet")
    with pytest.raises(FileFormatError, match="200 times"):
        read_parquet(tmp_path / "log.parquet")
