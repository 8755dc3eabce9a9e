import gzip

import numpy as np
import pytest
from hypothesis import HealthCheck, given, settings, strategies as st
from hypothesis.extra.numpy import arrays

from pivident.data.logs import source_files as files
from pivident.data.logs.tables.read_csv import csv_names, read_csv
from pivident.data.logs.tables.tables import names_in, read_table
from pivident.foundation.errors import BadCell, FileFormatError, UnknownColumn

FINITE = st.floats(allow_nan=False, allow_infinity=False)


def written(folder, text, name="log.csv"):
    path = folder / name
    path.write_bytes(gzip.compress(text.encode()) if name.endswith(".gz") else text.encode())
    return path


@settings(suppress_health_check=[HealthCheck.function_scoped_fixture], max_examples=40)
@given(arrays(float, st.tuples(st.integers(1, 30), st.just(3)), elements=FINITE))
@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_numbers_come_back_bit_for_bit(tmp_path, name, values):
    lines = [",".join(repr(float(x)) for x in row) for row in values]
    table = read_csv(written(tmp_path, "\n".join(["a,b,c", *lines]) + "\n", name))
    np.testing.assert_array_equal(np.column_stack([table[key] for key in "abc"]), values)


@pytest.mark.parametrize("separator", [",", ";", "\t"])
@pytest.mark.parametrize("end", ["\n", "\r\n"])
def test_separators_and_line_ends_are_found_out(tmp_path, separator, end):
    text = end.join([separator.join(row) for row in ("ab", "12", "34")])
    table = read_csv(written(tmp_path, text))
    assert {key: values.tolist() for key, values in table.items()} == {"a": [1, 3], "b": [2, 4]}


def test_only_wanted_columns_are_read_so_others_may_hold_text(tmp_path):
    path = written(tmp_path, "a,state,b\n1,idle,2\n3,moving,4\n")
    assert csv_names(path) == names_in(path) == ("a", "state", "b")
    assert list(read_table(path, ["b"])) == ["b"]
    assert list(read_csv(path, ["b", "a"])) == ["b", "a"]


def test_whole_numbers_first_do_not_decide_the_type(tmp_path):
    text = "a\n" + "0\n" * 2000 + "2.4713\n"
    assert read_csv(written(tmp_path, text))["a"][-1] == 2.4713


def test_a_table_without_header_has_numbered_columns(tmp_path):
    table = read_csv(written(tmp_path, "1,2\n3,4\n"))
    assert table["column_2"].tolist() == [2.0, 4.0]


def test_comments_blanks_and_byte_order_marks_are_skipped(tmp_path):
    text = '\ufeff# made by a logger\n a , "b"\n1, 2\n# pause\n3,4\n\n\n'
    table = read_csv(written(tmp_path, text))
    assert {key: values.tolist() for key, values in table.items()} == {"a": [1, 3], "b": [2, 4]}


def test_nan_is_a_number_which_the_recording_judges(tmp_path):
    assert np.isnan(read_csv(written(tmp_path, "a\n1\nnan\n"))["a"][1])


@pytest.mark.parametrize(
    ("text", "line", "column", "found"),
    [
        ("a,b\n1,2\n3,x7\n", 3, "b", "x7"),
        ("# note\na,b\n1,2\n,4\n", 4, "a", ""),
        ("a,b\n1;5,2\n", 2, "a", "1;5"),
        ("a,b\n1,2\n3,4,5\n", 3, None, "3,4,5"),
        ("a,b\n1,2\n3\n4,5\n", 3, None, "3"),
        ("a,b\n1,2\n\n4,5\n", 3, None, ""),
    ],
)
@pytest.mark.parametrize("name", ["log.csv", "log.csv.gz"])
def test_a_bad_line_is_named(tmp_path, name, text, line, column, found):
    with pytest.raises(BadCell) as caught:
        read_csv(written(tmp_path, text, name))
    assert (caught.value.line, caught.value.column, caught.value.text) == (line, column, found)
    assert str(caught.value).startswith(f"{name}, line {line}")


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("", "empty"),
        ("\n\n# nothing\n", "no table"),
        ("a,b\n", "no samples"),
        ("a,b\n\n\n", "no samples"),
        ("a,b,a\n1,2,3\n", "more than one column 'a'"),
        ("PK\0\1binary", "binary"),
    ],
)
def test_a_file_without_a_table_is_refused(tmp_path, text, message):
    with pytest.raises(FileFormatError, match=message):
        read_table(written(tmp_path, text))


def test_a_missing_file_a_folder_and_an_unknown_kind_are_refused(tmp_path):
    with pytest.raises(FileFormatError, match="cannot be opened"):
        read_table(tmp_path / "none.csv")
    with pytest.raises(FileFormatError, match="folder"):
        read_table(tmp_path)
    for name in ("log.xlsx", "log.npz.gz", "log"):
        with pytest.raises(FileFormatError, match="no reader"):
            read_table(tmp_path / name)


def test_a_column_that_is_not_there_is_answered_with_near_ones(tmp_path):
    with pytest.raises(UnknownColumn, match="did you mean tau1"):
        read_table(written(tmp_path, "q1,tau1\n1,2\n"), ["tua1"])


def test_a_file_of_one_endless_line_is_not_swallowed(tmp_path):
    path = tmp_path / "log.csv.gz"
    path.write_bytes(gzip.compress(b"\0" * 2**26))
    with pytest.raises(FileFormatError, match="binary"):
        csv_names(path)


def test_a_broken_gzip_file_is_refused(tmp_path):
    whole = gzip.compress(b"a,b\n" + b"1.5,2.5\n" * 1000)
    for content in (whole[: len(whole) // 2], b"a,b\n1,2\n"):
        path = tmp_path / "log.csv.gz"
        path.write_bytes(content)
        with pytest.raises(FileFormatError, match="whole gzip file"):
            read_csv(path)


def test_a_gzip_bomb_is_refused_while_it_is_unpacked(tmp_path, monkeypatch):
    monkeypatch.setattr("pivident.data.logs.tables.read_csv.HARMLESS_SIZE", 2**20)
    monkeypatch.setattr(files, "HARMLESS_SIZE", 2**20)
    path = written(tmp_path, "a,b\n" + "0,0\n" * 2**20, "log.csv.gz")
    with pytest.raises(FileFormatError, match="200 times"):
        read_csv(path)
