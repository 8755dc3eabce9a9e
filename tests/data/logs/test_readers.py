"""Readers by name: the endings follow from them, and one more reader is one more entry."""

import numpy as np
import pytest

from pivident.data.logs.file_columns import file_columns
from pivident.data.logs.reader import Reader
from pivident.data.logs.recognition.log_file import file_reading
from pivident.data.logs.tables import tables
from pivident.data.logs.tables.tables import (
    READERS,
    endings,
    is_log,
    names_in,
    read_table,
    reader_of,
    unread_in,
)
from pivident.foundation.errors import BadCell, FileFormatError


def dump_names(path):
    return tuple(path.read_text("utf-8").splitlines()[0].split("|"))


def read_dump(path, names=None):
    head, *rows = (line.split("|") for line in path.read_text("utf-8").splitlines())
    if "lost" in rows[-1]:
        raise BadCell(path.name, len(rows) + 1, head[0], "lost", "it is no number")
    columns = dict(zip(head, np.array(rows, dtype=float).T, strict=True))
    return {name: columns[name] for name in (head if names is None else names)}


@pytest.fixture
def dump(monkeypatch):
    """One more reader, of columns between bars."""
    reader = Reader((".dump",), dump_names, read_dump, is_text=True)
    together = (*tables.readers(), reader)
    monkeypatch.setattr(tables, "readers", lambda: together)
    return reader


def test_endings_are_those_of_the_readers():
    assert endings() == (
        ".csv", ".txt", ".tsv", ".npz", ".npy", ".mat", ".parquet", ".bag", ".db3", ".mcap",
    )  # fmt: skip
    assert list(READERS) == ["csv", "npz", "npy", "mat", "parquet", "bag"]


@pytest.mark.parametrize(
    ("name", "is_read"),
    [
        ("a.csv", True), ("A.CSV.GZ", True), ("a.txt.gz", True), ("a.mcap.zst", True),
        ("a.db3.zstd", True), ("a.mat", True), ("a.mat.gz", False), ("a.csv.zst", False),
        ("a.gz", False), ("a.xlsx", False), ("csv", False), (".csv", False),
    ],
)  # fmt: skip
def test_a_name_says_whether_its_file_is_a_log(name, is_read):
    assert is_log(name) == is_read


def test_one_more_reader_reads(dump, tmp_path):
    path = tmp_path / "arm_effort.dump"
    path.write_text("time|q1\n0|1\n0.1|2\n", "utf-8")
    assert reader_of(path) is dump and is_log(path.name) and endings()[-1] == ".dump"
    assert names_in(path) == ("time", "q1") and unread_in(path) == {}
    np.testing.assert_array_equal(read_table(path, ["q1"])["q1"], [1.0, 2.0])
    assert list(file_columns(path).columns) == ["time", "q1"]
    assert file_reading(path).channel == "tau"  # its ending is no word about the columns


def test_cells_are_forgiven_only_where_the_reader_does(dump, tmp_path):
    """The reader of text tables would take such a file for one of its own."""
    path = tmp_path / "log.dump"
    path.write_text("time|q1\n0|1\n0.1|lost\n", "utf-8")
    with pytest.raises(BadCell, match="no number"):
        file_columns(path)


def test_a_reader_gets_only_files_with_content(dump, tmp_path):
    with pytest.raises(FileFormatError, match="cannot be opened"):
        names_in(tmp_path / "absent.dump")
    (tmp_path / "empty.dump").touch()
    with pytest.raises(FileFormatError, match="is empty"):
        names_in(tmp_path / "empty.dump")


def test_text_is_refused_where_the_reader_takes_none(dump, tmp_path):
    path = tmp_path / "log.mat"
    path.write_text("time,q1\n0,1\n0.1,2\n", "utf-8")
    with pytest.raises(FileFormatError, match=r"is text, not a \.mat file"):
        names_in(path)
