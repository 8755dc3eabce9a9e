# ruff: noqa: E501  (one case, one line)
"""Mistakes in the log as a file: formats, separators, headers, cells, columns, time stamps."""

import gzip
import io

import numpy as np
import pytest
from scipy.interpolate import CubicSpline

from tests.questions.conftest import answered
from tests.questions.material import (
    EXPERIMENT,
    Case,
    changed,
    csv,
    log,
    renamed,
    replaced,
    short_log,
)

TEXT = csv(short_log())
LINES = TEXT.splitlines()
ROWS = "\n".join(LINES[1:]) + "\n"


def log_is(question: str, content, *answer: str, **more) -> Case:
    return Case(question, answer, log=content, **more)


def file_is(question: str, name: str, content, *answer: str, **more) -> Case:
    """The log has another name."""
    text = replaced(('"log.csv"', f'"{name}"'))
    return Case(question, answer, text=text, log=None, files={name: content}, **more)


def with_line(number: int, line: str) -> str:
    """The log with one line replaced; the header is line 1."""
    made = list(LINES)
    made[number - 1] = line
    return "\n".join(made) + "\n"


def npz(**arrays) -> bytes:
    stream = io.BytesIO()
    np.savez(stream, **arrays)
    return stream.getvalue()


def cell(number: int, column: int, text: str) -> str:
    """The log with one cell replaced."""
    cells = LINES[number - 1].split(",")
    cells[column] = text
    return with_line(number, ",".join(cells))


def stamped(change) -> dict:
    """The log with other time stamps."""
    return changed(time=change)


def every_so_often() -> dict:
    """The log at instants that are 1.5 and 2.5 ms apart in turn."""
    t = log()["time"]
    at = np.cumsum(np.tile([1.5e-3, 2.5e-3], len(t) // 4 - 2))
    return {n: at if n == "time" else CubicSpline(t, v)(at) for n, v in log().items()}


def jump(at: int, by: float):
    return lambda t: t + by * (np.arange(len(t)) >= at)


CASES = [
    # the file
    log_is("the log is empty", "", "line 4", "log.csv is empty"),
    log_is("the log has a header and nothing else", LINES[0] + "\n", "line 4", "log.csv", "no samples"),
    log_is("the log has no header", ROWS, "line 5", "log.csv", "no header", "column_1"),
    log_is("the log is a web page", "<!DOCTYPE html><html><body>Not found</body></html>", "log.csv", "web page"),
    log_is("the log is a picture", b"\x89PNG\r\n\x1a\n" + bytes(range(256)), "line 4", "log.csv", "binary"),
    log_is("the log is a Git LFS pointer", "version https://git-lfs.github.com/spec/v1\noid sha256:1\nsize 3\n", "log.csv", "Git LFS", "git lfs pull"),
    log_is("the last line is cut off", TEXT[:-30], "log.csv", "line 401", "cells instead of 7"),
    log_is("a line in the middle is cut off", with_line(60, "0.058,0.1"), "log.csv", "line 60", "2 cells instead of 7"),
    log_is("there is a line of text in the middle", with_line(60, "restarted"), "log.csv", "line 60", "1 cells instead of 7"),
    log_is("two logs are joined with both headers", TEXT + TEXT, "log.csv", "line 402", "not a number", "joined"),
    log_is("decimal commas between commas", TEXT.replace(".", ","), "log.csv", "line 2", "cells instead of 7", "decimal comma"),
    log_is("numbers have thousands separators", cell(50, 5, "1'234.5"), "log.csv", "line 50", "'tau1'", "1'234.5"),
    log_is("a cell is empty", cell(50, 5, ""), "log.csv", "line 50", "'tau1'", "cell is empty"),
    log_is("a cell says N/A", cell(50, 5, "N/A"), "log.csv", "line 50", "'tau1'", "'N/A' is not a number"),
    log_is("a cell contains its unit", cell(50, 5, "12.5 Nm"), "log.csv", "line 50", "'tau1'", "'12.5 Nm'"),
    log_is("two columns have the same name", TEXT.replace("q2", "q1", 1), "line 4", "log.csv", "more than one column 'q1'"),
    file_is("the log is an Excel workbook", "log.xlsx", b"PK\x03\x04", "line 4", "log.xlsx", "CSV", "export"),
    file_is("the log has no ending", "log", TEXT, "line 4", "log", "no reader", ".csv"),
    file_is("the log is a CSV named .npz", "log.npz", TEXT, "line 4", "log.npz", "text", ".csv"),
    file_is("the log is a CSV named .mat", "log.mat", TEXT, "line 4", "log.mat", "text", ".csv"),
    file_is("the log is a CSV named .parquet", "log.parquet", TEXT, "line 4", "log.parquet", "text", ".csv"),
    file_is("the archive is damaged", "log.csv.gz", gzip.compress(TEXT.encode())[:-40], "line 4", "log.csv.gz", "not a whole gzip file"),
    file_is("the archive is not an archive", "log.csv.gz", TEXT, "line 4", "log.csv.gz", "gzip"),
    file_is("the arrays of an archive are of different length", "log.npz", npz(**{k: v[: 400 - 5 * (k == "tau1")] for k, v in short_log().items()}), "tau", "differ in length", "395"),
    file_is("the log is pickled", "log.pkl", b"\x80\x04.", "line 4", "log.pkl", "no reader"),
    # columns
    log_is("a column is misspelt", renamed(short_log(), tau2="tua2"), "line 5", "log.csv", "'tau2'", "tua2"),
    log_is("a column differs in case", renamed(short_log(), tau2="Tau2"), "line 5", "'tau2'", "Tau2"),
    log_is("names in the header contain blanks", TEXT.replace("tau1", "tau 1", 1), "line 5", "'tau1'", "tau 1"),
    log_is("the joints are numbered from zero", renamed(short_log(), q2="q1", q1="q0"), "line 5", "'q2'", "q0"),
    Case("a joint has no column", ("line 5", "tau", "1 column(s) for 2 joint(s)", "shoulder, elbow"), text=replaced(('tau = ["tau1", "tau2"]', 'tau = ["tau1"]'))),
    Case("there is one column too many", ("line 5", "q lists 3 column(s) for 2 joint(s)"), text=replaced(('q = ["q1", "q2"]', 'q = ["q1", "q2", "time"]'))),
    Case("one column is named for both joints", ("line 5", "'q1'", "twice"), text=replaced(('q = ["q1", "q2"]', 'q = ["q1", "q1"]')), code=4, log=log()),
    Case("the position is named as the torque", ("line 5", "'q1'", "for q and for tau"), text=replaced(('tau = ["tau1", "tau2"]', 'tau = ["q1", "q2"]')), code=4, log=log()),
    Case("the measurement is named as the reference", ("line 5", "'q1'", "for q and for q_ref"), text=replaced(('q_ref = ["r1", "r2"]', 'q_ref = ["q1", "q2"]')), code=4, log=log()),
    Case("the columns are those of another log", ("line 5", "'joint_1'", "'time', 'q1'"), text=replaced(('q = ["q1", "q2"]', 'q = ["joint_1", "joint_2"]'))),
    Case("a part of an array that does not exist is named", ("line 5", "q", "data", "shape"), text=replaced(('"log.csv"', '"log.npz"'), ('q = ["q1", "q2"]', 'q = "data[:, 3:7]"')), files={"log.npz": npz(data=np.zeros((400, 4)), **short_log())}),
    # units
    Case("a unit is unknown", ("line 7", "'degres'", "deg"), text=replaced(("[controller]", 'units = {q = "degres"}\n[controller]'))),
    Case("a unit of time is given to a position", ("line 7", "'ms' of q"), text=replaced(("[controller]", 'units = {q = "ms"}\n[controller]'))),
    Case("a speed unit is given to a position", ("line 7", "'rpm' of q", "rad"), text=replaced(("[controller]", 'units = {q = "rpm"}\n[controller]'))),
    Case("a unit of length is given to a revolute joint", ("line 7", "'mm' of q", "revolute joint 'shoulder'"), text=replaced(("[controller]", 'units = {q = "mm"}\n[controller]'))),
    Case("counts have no scale", ("line 7", "counts", "per_revolution"), text=replaced(("[controller]", 'units = {q = "counts"}\n[controller]'))),
    Case("amperes have no gain", ("line 7", "'A' without a gain", "shoulder", "drive_gain"), text=replaced(("[controller]", 'units = {tau = "A"}\n[controller]'))),
    Case("a unit is given to a channel without columns", ("line 7", "dq_ref", "no columns"), text=replaced(("[controller]", 'units = {dq_ref = "deg/s"}\n[controller]'))),
    Case("there is a unit for one joint of two", ("line 7", "1 units for 2 joint(s)"), text=replaced(("[controller]", 'units = {tau = ["N m"]}\n[controller]'))),
    Case("the unit of the torque is per cent of the rated one", ("line 7", "'%' of tau", "N m"), text=replaced(("[controller]", 'units = {tau = "%"}\n[controller]'))),
    Case("a gain is zero", ("line 7", "gain of tau", "other than 0"), text=replaced(("[controller]", 'units = {tau = {unit = "A", gain = 0}}\n[controller]'))),
    log_is("a column's name says degrees", renamed(log(), q1="q1_deg", q2="q2_deg"), "'q1_deg'", "reads like deg", "rad", text=EXPERIMENT.replace("q1", "q1_deg").replace("q2", "q2_deg"), code=4),
    log_is("a column's name says milliseconds", renamed(log(), time="time_ms"), "'time_ms'", "reads like ms", text=EXPERIMENT.replace('"time"', '"time_ms"'), code=4),
    log_is("a column's name says current", renamed(log(), tau1="current1", tau2="current2"), "'current1'", "reads like A", "gain", text=EXPERIMENT.replace("tau1", "current1").replace("tau2", "current2"), code=0),
    log_is("a column's name says milliamperes", renamed(log(), tau1="i1_mA", tau2="i2_mA"), "'i1_mA'", "reads like mA", text=EXPERIMENT.replace("tau1", "i1_mA").replace("tau2", "i2_mA"), code=0),
    # the clock
    log_is("the time is in milliseconds", stamped(lambda t: 1e3 * t), "line 5", "1 Hz", "are they in ms", 't = "ms"'),
    log_is("the time is in microseconds", stamped(lambda t: 1e6 * t), "line 5", "are they in us", 't = "us"'),
    log_is("the time is in nanoseconds since 1970", stamped(lambda t: np.round(1e9 * t) + 1.7e18), "in ns", "in ns", 't = "ns"'),
    log_is("the time column counts samples", stamped(lambda t: np.arange(len(t)) * 1.0), "line 5", "1 Hz", "are they in ms"),
    Case("seconds are declared as milliseconds", ("line 7", "t", "1e+06 Hz", "any robot's log"), text=replaced(("[controller]", 'units = {t = "ms"}\n[controller]')), log=log()),
    log_is("the time goes backward", stamped(lambda t: np.where(t > 1.5, t - 0.7, t)), "go backward", "sample 1501", "joined"),
    log_is("a time stamp is repeated", stamped(lambda t: np.where(np.arange(len(t)) == 500, t[499], t)), "repeat that of the row before", "corrected", "sample 500", code=0),
    log_is("the time has too few digits", stamped(lambda t: np.floor(t * 250) / 250), "repeat", "coarse"),
    log_is("the time stands still", stamped(lambda t: 0 * t), "never advances", "time"),
    log_is("samples were lost", {k: np.delete(v, range(800, 810)) for k, v in log().items()}, "10 sample(s) are missing", "11 ms", "t = 0.799", "2 stretch(es) between gaps are used", code=0),
    log_is("the logger paused", stamped(jump(1000, 5.0)), "jumps ahead by 5.001 s", "the logger paused", "2 stretch(es) between gaps are used", code=0),
    log_is("only the stamps jitter", stamped(lambda t: t + 2.5e-4 * np.random.default_rng(1).uniform(-1, 1, len(t))), "differ by up to", "as if the samples were equally spaced", "rate = "),
    log_is("the clock jitters", every_so_often(), "differ by up to", "as the stamps say", "resample = true"),
    log_is("a time stamp is missing", stamped(lambda t: np.where(np.arange(len(t)) == 70, np.nan, t)), "time", "missing", "sample 70"),
    Case("the rate contradicts the time stamps", ("line 4", "500 Hz", "1000 Hz", "time stamps"), text=replaced(("files =", "rate = 500\nfiles =")), log=log()),
    Case("neither time nor rate is given", ("line 5", "time", "rate"), text=replaced(('t = "time", ', "")), log=log()),
    Case("the rate is a period", ("rate", "0.001 Hz"), text=replaced(('t = "time", ', ""), ("files =", "rate = 0.001\nfiles =")), log=log()),
    Case("the rate is in kilohertz", ("rate", "1 Hz", "any robot's log"), text=replaced(('t = "time", ', ""), ("files =", "rate = 1\nfiles =")), log=log()),
    log_is("a value is not a number for a while", changed(tau2=lambda x: np.where((np.arange(len(x)) > 700) & (np.arange(len(x)) < 720), np.nan, x)), "tau of elbow", "19 sample(s)", "sample 701", "left out of the equations", code=0),
    log_is("a value is infinite", changed(q1=lambda x: np.where(np.arange(len(x)) == 9, np.inf, x)), "q of shoulder", "infinite", "sample 9", "left out of the equations", code=0),
    log_is("a column is all NaN", changed(tau2=lambda x: x * np.nan), "tau of elbow", "3200 sample(s)"),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.question)
def test_the_answer_names_cause_and_place(ask, case):
    code, lines = ask(case)
    assert answered(lines, case.answer), "\n".join(lines)
    assert code == case.code, "\n".join(lines)
