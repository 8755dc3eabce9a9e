"""Files are read once, and again where they have changed."""

import os

from pivident.data.logs.tables.tables import read_table


def test_a_table_is_read_again_where_its_file_has_changed(tmp_path):
    """Small files are read once; what is made of their columns changes nothing of the next."""
    path = tmp_path / "log.csv"
    path.write_text("a,b\n1,2\n3,4\n", encoding="utf-8")
    first = read_table(path, ["a"])["a"]
    first[0] = 7.0
    assert read_table(path, ["a"])["a"].tolist() == [1.0, 3.0]
    path.write_text("a,b\n5,2\n3,4\n", encoding="utf-8")
    os.utime(path, (2e9, 2e9))
    assert read_table(path, ["a"])["a"].tolist() == [5.0, 3.0]
