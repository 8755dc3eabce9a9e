"""Names from files that mean something to a terminal, a page, a spreadsheet or a file system."""

import csv
import io
import json
import os
from dataclasses import replace

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.app.cli.console import error_line, note
from pivident.data.logs.described_log import bare_log
from pivident.data.logs.tables.tables import read_table
from pivident.data.recording.load import load_recording
from pivident.data.recording.recording import Recording
from pivident.estimation.identification_file import to_csv, to_json
from pivident.foundation.errors import (
    FileFormatError,
    PividentError,
    RecordingError,
    RobotDescriptionError,
)
from pivident.foundation.text.identifiers import escaped, is_printable
from pivident.robot.modified_dh import parse_modified_dh
from pivident.robot.urdf import parse_urdf
from tests.synthetic_identification import synthetic_identification

STEERING = ["\x1b[2J", "\x9b2J", "a\nb", "\x07", "\x7f", "\u202eabc", "\u2028", "\u2066", "\x00"]

BREAKING = [
    "<script>alert(1)</script>", '"><img src=x onerror=alert(1)>', "*/ int x; /*", "$(reboot)",
    "`id`", "'; rm -rf .", "=cmd|' /C calc'!A0", "+1+1", "-1+1", "@SUM(1)", "../../x", "a\\b",
    "%s%n",
]  # fmt: skip


@pytest.mark.parametrize("name", STEERING)
def test_control_characters_are_refused_in_names(name):
    with pytest.raises(RobotDescriptionError, match=r"control characters|is not XML"):
        parse_urdf(
            f'<robot name="r"><link name="a"/><link name="b"/><joint name="&#{ord(name[0])};'
            '" type="revolute"><parent link="a"/><child link="b"/></joint></robot>'
            if len(name) == 1
            else '<robot name="&#x9b;"><link name="a"/><link name="b"/><joint name="j" '
            'type="revolute"><parent link="a"/><child link="b"/></joint></robot>'
        )
    with pytest.raises(RobotDescriptionError, match="control characters"):
        parse_modified_dh(f"name = {json.dumps(name)}\n[[joints]]\nname = 'j'")
    with pytest.raises(RobotDescriptionError, match="control characters"):
        parse_modified_dh(f"name = 'r'\n[[joints]]\nname = {json.dumps(name)}")
    wave = np.sin(np.arange(50.0))[:, None]
    for names in ({"name": name}, {"joint_names": (name,)}, {"inputs": {name: wave}}):
        with pytest.raises(RecordingError, match="control characters"):
            Recording(
                **{"name": "r", "joint_names": ("j",), "q": wave, "tau": wave, "rate": 1.0} | names
            )


@pytest.mark.parametrize("name", STEERING[:-1])
def test_errors_on_a_terminal_are_written_out(name, capsys):
    note(error_line(PividentError(f"the name {name}x")))
    shown = capsys.readouterr().err
    assert shown.count("\n") == 1 and is_printable(shown.rstrip("\n"))


def test_escaping_keeps_everything_else():
    text = "é ² σ – … \t\n \U0001f916 日本"
    assert escaped(text) == text
    assert escaped("\x1b[2J\u202e") == "\\x1b[2J\\u202e"


@pytest.mark.parametrize("ending", ["csv", "npz", "parquet"])
def test_columns_that_steer_a_terminal_are_refused(tmp_path, ending):
    import polars as pl

    path = tmp_path / f"a.{ending}"
    if ending == "csv":
        path.write_text("a\x1b[2J,b\n1,2\n")
    elif ending == "npz":
        np.savez(path, **{"a\x1b[2J": np.arange(3.0)})
    else:
        pl.DataFrame({"a\x1b[2J": [1.0]}).write_parquet(path)
    with pytest.raises(FileFormatError, match="control characters"):
        read_table(path)


def test_a_file_name_of_any_bytes(tmp_path, capsys):
    """It is printed and written as text that does nothing, in JSON too."""
    name = os.fsdecode(b"\x1b[2J\xff.csv")
    t = np.arange(400) / 100.0
    rows = "\n".join(f"{x:.2f},{np.sin(x):.6f},{np.cos(2 * x):.6f}" for x in t)
    path = tmp_path / name
    path.write_text(f"time,q1,tau1\n{rows}\n")
    recording = load_recording(path, {"t": "time", "q": ["q1"], "tau": ["tau1"]})
    assert is_printable(recording.name) and is_printable(bare_log(path).name)
    assert all(is_printable(source.name) for source in recording.sources)
    assert main(["audit", str(path), "--out", str(tmp_path / "out")]) in (0, 4)
    shown = capsys.readouterr()
    assert "\x1b" not in shown.out + shown.err
    assert json.loads((tmp_path / "out" / "audit.json").read_text("utf-8"))


@pytest.mark.parametrize("name", BREAKING)
def test_a_robot_with_any_printable_name(name):
    """It is a name and nothing else: no cell of the table begins like a formula."""
    identification = synthetic_identification()
    robot = identification.robot
    joints = tuple(
        replace(joint, name=f"{name}{k}", parent=-1) for k, joint in enumerate(robot.joints)
    )
    tree = replace(robot, name=name, joints=joints)
    labels = [f"fv{tree.label(k)}" for k in range(tree.size)]
    assert labels[0] == f"fv[{name}0]"
    names = (*labels, *identification.names[len(labels) :])
    made = replace(identification, robot=tree, names=names, recordings=())
    assert json.loads(to_json(made))["robot"] == name
    rows = list(csv.reader(io.StringIO(to_csv(made))))
    assert [row[0] for row in rows[1:3]] == labels
    assert all(len(row) == len(rows[0]) for row in rows)
    for row in rows:
        for cell in row:
            assert cell[:1] not in "=+@\t\r" or not cell
            assert cell[:1] != "-" or float(cell) < 0
