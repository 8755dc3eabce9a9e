import json

import numpy as np
import polars as pl
import pyarrow as pa
import pyarrow.parquet as pq
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from pivident.data.logs import source_files as files
from pivident.data.logs.tables.read_parquet import parquet_names, parquet_unread, read_parquet
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.foundation.errors import BadCell, FileFormatError

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


def lists(rng):
    """Lists of fixed and of variable length, and a structure; the truth by names."""
    q, tau, speed = rng.normal(size=(50, 3)), rng.normal(size=(50, 2)), rng.normal(size=50)
    table = pa.table({
        "t": np.arange(50) / 100.0,
        "q": pa.FixedSizeListArray.from_arrays(pa.array(q.ravel(), pa.float32()), 3),
        "tau": pa.array(tau.tolist()),
        "motor": pa.array([{"speed": x, "on": {"mode": 1}} for x in speed]),
        "seen": pa.array([[1.0] * (k % 3) for k in range(50)]),
        "names": pa.array([["a"]] * 50),
    })  # fmt: skip
    truth = {f"q[{k}]": np.float32(q[:, k]) for k in range(3)}
    truth |= {f"tau[{k}]": tau[:, k] for k in range(2)} | {"motor.speed": speed}
    return table, truth | {"motor.on.mode": np.ones(50), "t": np.arange(50) / 100.0}


def test_lists_and_structures_are_columns(tmp_path):
    path = tmp_path / "log.parquet"
    table, truth = lists(np.random.default_rng(3))
    pq.write_table(table, path, row_group_size=16)
    found = read_table(path)
    assert set(found) == set(truth)
    for name, values in truth.items():
        np.testing.assert_array_equal(found[name], values, err_msg=name)
        np.testing.assert_array_equal(read_table(path, [name])[name], values, err_msg=name)
    assert parquet_unread(path) == {
        "seen": "lists of 0 to 2 numbers", "names": "of type list<element: string>",
    }  # fmt: skip


def test_names_of_lists_stand_in_the_description_beside_the_table(tmp_path):
    folder = tmp_path / "data" / "chunk-000"
    folder.mkdir(parents=True)
    (tmp_path / "meta").mkdir()
    pq.write_table(lists(np.random.default_rng(3))[0], folder / "log.parquet")
    names = {"q": {"names": [["hip", "knee", "ankle"]]}, "tau": {"names": {"motors": ["hip"]}}}
    (tmp_path / "meta" / "info.json").write_text(json.dumps({"features": names}))
    found = parquet_names(folder / "log.parquet")
    assert found[1:6] == ("q.hip", "q.knee", "q.ankle", "tau[0]", "tau[1]")


@pytest.mark.parametrize("empty", [[1.0, None], None])
def test_an_empty_entry_of_a_list_is_named(tmp_path, empty):
    rows = [[1.0, 2.0]] * 7
    kind = pa.list_(pa.float64(), 2)
    pq.write_table(pa.table({"q": pa.array([*rows, empty, *rows], kind)}), tmp_path / "log.parquet")
    with pytest.raises(BadCell) as caught:
        read_parquet(tmp_path / "log.parquet")
    assert (caught.value.line, caught.value.column) == (8, "q[0]")


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


def test_a_bomb_of_lists_is_refused_before_they_are_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    table = pa.table({"t": [0.0, 1.0], "q": pa.array([[0.0] * 2**19] * 2)})
    pq.write_table(table, tmp_path / "log.parquet")
    with pytest.raises(FileFormatError, match="200 times"):
        parquet_names(tmp_path / "log.parquet")
