"""Text tables as controllers and their tools write them."""

import numpy as np
import pytest

from pivident.data.logs.file_columns import read_columns
from pivident.data.logs.tables.read_csv import csv_names, read_csv
from pivident.data.recording.load import load_recording
from pivident.foundation.errors import BadCell, FileFormatError

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
    "trace_with_a_preamble": (
        "Trace;KR C4, robot 12\nFile;C:/traces/one.dat;2026-04-01\nRate;125\nChannels;3\n\n"
        "Zeit;A1_Ist;M1_Ist\ns;Grad;Nm\nREAL;REAL;LREAL\n"
        + decimal_comma(rows(";", "{:.9f}", "\n", T, np.rad2deg(Q), TAU)),
        {"t": "Zeit", "q": ["A1_Ist"], "tau": ["M1_Ist"]},
        {"q": "deg"},
    ),
    "preamble_of_as_many_cells": (
        "Project,arm,,\nAuthor,service,v2,b\nCycle,8,ms,\nTime,Mode,Position,Torque\n[s],[-],[rad],[Nm]\n"
        + rows(",", "{:.9g}", "\n", T, T * 0 + 3, Q, TAU),
        {"t": "Time", "q": ["Position"], "tau": ["Torque"]},
        None,
    ),
    "beckhoff_time_beside_each_channel": (
        "Name\tScope 1\nFile\tC:/one.svdx\nStarttime of export\t133000000000000000\t1. April\n\n"
        "Name\tMAIN.ActPos\tName\tMAIN.ActTrq\nSymbolComment\t\tSymbolComment\t\n"
        "Data-Type\tREAL64\tData-Type\tREAL64\nSampleTime[ms]\t8\tSampleTime[ms]\t8\n"
        "Unit\tdeg\tUnit\tNm\n\n"
        + decimal_comma(rows("\t", "{:.9f}", "\n", 1e3 * T, np.rad2deg(Q), 1e3 * T, TAU))
        + "EOF\n",
        {"t": "time MAIN.ActPos", "q": ["MAIN.ActPos"], "tau": ["MAIN.ActTrq"]},
        {"t": "ms", "q": "deg"},
    ),
    "beckhoff_one_time": (
        "Name,Scope 1\nFile,C:/one.svdx\n\nName,MAIN.ActPos,MAIN.ActTrq\nSymbolComment,,\n"
        "Data-Type,REAL64,REAL64\nSampleTime[ms],8,8\n"
        + rows(",", "{:.9g}", "\n", 1e3 * T, Q, TAU),
        {"t": "time", "q": ["MAIN.ActPos"], "tau": ["MAIN.ActTrq"]},
        {"t": "ms"},
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
    separator = next((s for s in (";", "\t", ",") if s in lines[-3]), " ")
    place = -3 if lines[-1] == "EOF" else -2
    cells = lines[place].split(separator)
    lines[place] = separator.join([*cells[:-1], "x"])
    path = tmp_path / "log.txt"
    path.write_text("\n".join(lines) + "\n")
    table = read_columns(path)
    tau = table[columns["tau"][0]]
    assert np.isnan(tau[-2]) and np.isfinite(tau).sum() == SAMPLES - 1
    np.testing.assert_allclose(tau[-1], TAU[-1], atol=2e-9)
    with pytest.raises(BadCell) as caught:
        read_csv(path)
    assert caught.value.column is not None


@pytest.mark.parametrize("bad", ["1,x,3", "1,,3", "x,y,z"])
@pytest.mark.parametrize("place", [1, 2, 4, 9])
def test_a_bad_line_among_the_first_is_no_preamble(tmp_path, bad, place):
    """It is named with its number, however early it comes; nothing above it is passed over."""
    lines = ["t,q,tau", *(f"{k},{2 * k},{3 * k}" for k in range(60))]
    lines.insert(place, bad)
    path = tmp_path / "log.csv"
    path.write_text("\n".join(lines) + "\n")
    assert csv_names(path) == ("t", "q", "tau")
    if bad == "x,y,z" and place == 1:  # a line of units
        assert len(read_csv(path)["t"]) == 60
        return
    with pytest.raises(BadCell) as caught:
        read_csv(path)
    assert caught.value.line == place + 1


def test_a_bad_line_below_a_preamble_is_named(tmp_path):
    path = tmp_path / "log.csv"
    numbers = [f"{k};{2 * k};{3 * k}" for k in range(60)]
    path.write_text("\n".join(["Robot;12", "t;q;tau", "0;-;0", *numbers]) + "\n")
    assert csv_names(path) == ("t", "q", "tau")
    with pytest.raises(BadCell) as caught:
        read_csv(path)
    assert (caught.value.line, caught.value.column) == (3, "q")


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
