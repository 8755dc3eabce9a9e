"""Tables of text made to harm: endless lines, stray quotes, formulas, packed bombs."""

import gzip

import pytest

from pivident.data.logs.described_log import bare_log
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.foundation.errors import FileFormatError
from tests.faults.hostile import written


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (",".join(map(str, range(10**6))), "columns|characters"),
        ("a," * 20_000 + "b\n" + "1," * 20_000 + "1\n", "more than 10000 columns"),
        (b"1" * 3_000_000, "first line of"),
        ('a,b\n1,2\n"3,' + "4,5\n" * 100_000, "line|table"),
        ('"a,b\n' + "1,2\n" * 10, "no samples|a,b|cells|table"),
        (f"a,b\n1,{'x' * 200_000}\n", "is not a number"),
        (f'a,b\n1,"{"x" * 200_000}\n', "line 2|table"),
        (f"{'a' * 1000},b\n1,2\n", "1000 characters"),
        ("a\x1b[2J,b\n1,2\n", "control characters"),
        ("a,b\n1,\0\n", "not a number|binary"),
        (b"a,b\n1,\xff\xfe\n", "not a number"),
        ("a,a\n1,2\n", "more than one column"),
        ("a,b\n1,2\n3\n", "1 cells instead of 2"),
    ],
)
def test_tables_that_are_none(tmp_path, content, message):
    with pytest.raises(FileFormatError, match=message) as caught:
        read_table(written(tmp_path, "a.csv", content))
    assert len(str(caught.value)) < 1000


def test_a_byte_order_mark_is_no_part_of_a_name(tmp_path):
    assert names_in(written(tmp_path, "a.csv", "\ufeffa,b\n1,2\n")) == ("a", "b")


def test_formulas_are_names_and_no_numbers(tmp_path):
    path = written(tmp_path, "a.csv", "=cmd|' /C calc'!A0,b\n1,2\n")
    assert list(read_table(path)) == ["=cmd|' /C calc'!A0", "b"]
    with pytest.raises(FileFormatError, match="not a number"):
        read_table(written(tmp_path, "b.csv", "a,b\n=1+1,2\n"))


@pytest.mark.parametrize("reader", [read_table, bare_log])
def test_a_packed_table_that_grows_out_of_proportion(tmp_path, monkeypatch, reader):
    monkeypatch.setattr("pivident.data.logs.tables.read_csv.HARMLESS_SIZE", 2**20)
    monkeypatch.setattr("pivident.data.logs.source_files.HARMLESS_SIZE", 2**20)
    path = written(tmp_path, "a.csv.gz", gzip.compress(b"a,b\n" + b"1,\n" * 10_000_000))
    with pytest.raises(FileFormatError, match="expands from"):
        reader(path)
