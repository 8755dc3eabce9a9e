"""Text tables as controllers and their tools write them."""

import numpy as np
import pytest

from pivident.errors import BadCell, FileFormatError
from pivident.logs.file_columns import read_columns
from pivident.logs.tables.read_csv import csv_names, read_csv
from pivident.recording.load import load_recording

SAMPLES = 40
T = np.arange(SAMPLES) * 0.008
Q, TAU = np.sin(20 * T), np.cos(20 * T)


def rows(separator=",", form="{:.9g}", end="\n", *columns):
    table = np.column_stack(columns or (T, Q, TAU))
    return end.join(separator.join(form.format(x) for x in row) for row in table) + end


def decimal_comma(text):
    return text.replace(".", ",")


HABITS = {
    "ur_rtde_blanks": (
        "timestamp actual_q_0 actual_current_0\n" + rows(" "),
        {"t": "timestamp", "q": ["actual_q_0"], "tau": ["actual_current_0"]},
        None,
    ),
    "aligned_blanks": (
        "   time      q       tau\n" + rows("   ", "{:12.9f}"),
        {"t": "time", "q": ["q"], "tau": ["tau"]},
        None,
    ),
    "franka": (
        "time,q[0],tau_J[0]\n" + rows(),
        {"t": "time", "q": ["q[0]"], "tau": ["tau_J[0]"]},
        None,
    ),
    "rostopic_echo": (
        "%time,field.header.frame_id,field.position0,field.effort0\n"
        + "".join(
            f"{1700000000000000000 + round(t * 1e9)},base,{q:.9g},{tau:.9g}\n"
            for t, q, tau in zip(T, Q, TAU, strict=True)
        ),
        {"t": "%time", "q": ["field.position0"], "tau": ["field.effort0"]},
        {"t": "ns"},
    ),
    "plotjuggler": (
        "__time,/joint_states/position[0],/joint_states/elbow/effort\n" + rows(),
        {
            "t": "__time",
            "q": ["/joint_states/position[0]"],
            "tau": ["/joint_states/elbow/effort"],
        },
        None,
    ),
    "kuka_trace": (
        "Zeit;A1_Ist;M1_Ist\ns;Grad;Nm\n"
        + decimal_comma(rows(";", "{:.9f}", "\n", T, np.rad2deg(Q), TAU)),
        {"t": "Zeit", "q": ["A1_Ist"], "tau": ["M1_Ist"]},
        {"q": "deg"},
    ),
    "spreadsheet": (
        "sep=;\r\nt;q;tau\r\n" + decimal_comma(rows(";", "{:.9f}", "\r\n")),
        {"t": "t", "q": ["q"], "tau": ["tau"]},
        None,
    ),
    "title": (
        "Trace of robot 12\n\nrecorded by service\nt\tq\ttau\n[s]\t[rad]\t[Nm]\n" + rows("\t"),
        {"t": "t", "q": ["q"], "tau": ["tau"]},
        None,
    ),
    "tabs_and_commas": (
        "t\tq\ttau\n" + decimal_comma(rows("\t", "{:.9f}")),
        {"t": "t", "q": ["q"], "tau": ["tau"]},
        None,
    ),
}


@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
@pytest.mark.parametrize("habit", HABITS)
def test_the_numbers_come_back(tmp_path, habit, encoding):
    text, columns, units = HABITS[habit]
    path = tmp_path / "log.txt"
    path.write_bytes(text.encode(encoding))
    made = load_recording(path, columns, units=units)
    np.testing.assert_allclose(made.q[:, 0], Q, atol=2e-9)
    np.testing.assert_allclose(made.tau[:, 0], TAU, atol=2e-9)
    assert made.rate == 125.0


@pytest.mark.parametrize("habit", HABITS)
def test_the_audit_reads_them_too_and_forgives_a_bad_cell(tmp_path, habit):
    text, columns, _ = HABITS[habit]
    lines = text.splitlines()
    separator = next((s for s in (";", "\t", ",") if s in lines[-2]), " ")
    cells = lines[-2].split(separator)
    lines[-2] = separator.join([*cells[:-1], "x"])
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    table = read_columns(path)
    tau = table[columns["tau"][0]]
    assert np.isnan(tau[-2]) and np.isfinite(tau).sum() == SAMPLES - 1
    np.testing.assert_allclose(tau[-1], TAU[-1], atol=2e-9)
    with pytest.raises(BadCell) as caught:
        read_csv(path)
    assert caught.value.column is not None


def test_a_column_of_text_with_blanks_is_no_table_of_blanks(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("joint angle\n1\n2\n")
    assert csv_names(path) == ("joint angle",)


def test_a_file_of_comments_above_a_long_title_is_read_from_its_header(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("# a, b\n" * 5000 + "t,q\n1,2\n3,4\n")
    assert csv_names(path) == ("t", "q")


def test_a_mark_between_thousands_is_not_taken_for_a_point(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("a;b\n0,5;1.500\n0,6;1.501\n")
    with pytest.raises(FileFormatError, match=r"'1\.500' that may be a thousand"):
        read_csv(path)


def test_prose_is_refused(tmp_path):
    path = tmp_path / "log.txt"
    path.write_text("This is no table.\nIt has words, and a comma.\nAnd an end.\n")
    with pytest.raises(FileFormatError):
        read_csv(path)


@pytest.mark.parametrize("separator", [";", "\t"])
def test_decimal_commas_without_a_header_are_not_separators(tmp_path, separator):
    path = tmp_path / "log.csv"
    rows = [("0,004", "12,5", "-90,0"), ("0,008", "12,6", "-90,1")]
    path.write_text("\n".join(map(separator.join, rows)) + "\n")
    columns = read_csv(path)
    assert list(columns) == ["column_1", "column_2", "column_3"]
    np.testing.assert_array_equal(columns["column_3"], [-90.0, -90.1])


def test_commas_in_the_names_of_columns_are_not_separators(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text("t;force (A, right, low, up);q\n0,0;1,5;2\n0,1;2,5;3\n")
    assert csv_names(path) == ("t", "force (A, right, low, up)", "q")
