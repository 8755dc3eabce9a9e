"""A repair that the verdict has tried is written into the file, once, and helps."""

import json
import shutil

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.app.cli.console import WRONG_INPUT, WRONG_USAGE
from tests.other_arms import Setting, make_log

SETTING = Setting("regular", 200.0, 20.0, 0.0, 0.005, "none", 0.8)

#: The second torque has the other sign.
EXPERIMENT = """# an arm
robot = "arm.urdf"

[recording]
files = "log.csv"
torque_timing = "sampled"
columns = {t = "t", q = ["q_1", "q_2", "q_3"], tau = ["tau_1", "tau_2", "tau_3"]}
units = {tau = ["N m", -1.0, "N m"]}   # as the logger says

[identify]
methods = ["ls"]
"""


def run(*tokens) -> int:
    return main([str(token) for token in tokens])


def error_of(folder) -> float:
    held_out = json.loads((folder / "verdict.json").read_text("utf-8"))["held_out"]
    return held_out["ls"]["total"]


@pytest.fixture(scope="module")
def project(tmp_path_factory):
    folder = tmp_path_factory.mktemp("apply")
    log = make_log(4, SETTING, joints=3)
    (folder / "arm.urdf").write_text(log.arm.urdf)
    names = ["t", *(f"{c}_{k}" for c in ("q", "tau") for k in (1, 2, 3))]
    table = np.column_stack([log.t, log.q, log.tau])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=",".join(names), comments="")
    return folder


@pytest.fixture(scope="module")
def results(project):
    """What `identify` writes beside the file."""
    path = project / "experiment.toml"
    path.write_text(EXPERIMENT)
    with pytest.MonkeyPatch.context() as patch:
        patch.chdir(project)
        assert run("identify", path) == 0
    return (project / "experiment-results").rename(project / "kept")


@pytest.fixture
def judged(project, results, monkeypatch):
    monkeypatch.chdir(project)
    path = project / "experiment.toml"
    path.write_text(EXPERIMENT)
    shutil.copytree(results, project / "experiment-results")
    yield path
    shutil.rmtree(project / "experiment-results")


def test_what_is_applied_is_what_was_tried(judged, capsys):
    results = judged.parent / "experiment-results"
    content = json.loads((results / "verdict.json").read_text("utf-8"))
    (repair,) = content["repairs"]
    before = error_of(results)
    assert content["uses"]["torque"]["answer"] == "no"
    assert content["summary"]["next_step"] == f"pivident apply {judged} 1"
    capsys.readouterr()
    assert run("apply", judged, 1) == 0
    assert "other sign" in capsys.readouterr().out
    text = judged.read_text("utf-8")
    assert text.startswith("# an arm") and "# as the logger says" in text
    assert 'tau = ["N m", 1.0, "N m"]' in text
    assert run("identify", judged) == 0
    content = json.loads((results / "verdict.json").read_text("utf-8"))
    assert content["repairs"] == [] and content["uses"]["torque"]["answer"] != "no"
    assert error_of(results) < before and repair["after"] < repair["before"]


def test_no_command_is_shown_that_would_be_refused(project, monkeypatch):
    """Columns of one array have no names of their own to be exchanged."""
    monkeypatch.chdir(project)
    table = np.loadtxt(project / "log.csv", delimiter=",", skiprows=1)
    np.savez(project / "log.npz", t=table[:, 0], q=table[:, 1:4], tau=table[:, [5, 4, 6]])
    text = EXPERIMENT.replace("log.csv", "log.npz").replace('tau = ["N m", -1.0, "N m"]', "")
    for channel in ("q", "tau"):
        names = f'["{channel}_1", "{channel}_2", "{channel}_3"]'
        text = text.replace(names, f'"{channel}"')
    path = project / "arrays.toml"
    path.write_text(text)
    assert run("identify", path) == 0
    content = json.loads((project / "arrays-results" / "verdict.json").read_text("utf-8"))
    assert content["repairs"][0]["repair"]["edits"][0]["edit"] == "Reordered"
    assert content["summary"]["items"][0]["command"] == ""
    assert run("apply", path, 1) == WRONG_INPUT


def test_no_command_is_shown_of_a_repair_that_cannot_be_written(project, monkeypatch, capsys):
    """Tables of a list with others between them would be written in another order."""
    monkeypatch.chdir(project)
    table = EXPERIMENT[EXPERIMENT.index("[recording]") : EXPERIMENT.index("[identify]")]
    again = table.replace("[recording]", "[[recording]]")
    path = project / "apart.toml"
    path.write_text(EXPERIMENT.replace(table, again) + f"\n{again}")
    assert run("identify", path) == 0
    summary = json.loads((project / "apart-results" / "verdict.json").read_text("utf-8"))["summary"]
    assert summary["items"][0]["effect"] and summary["items"][0]["command"] == ""
    assert "pivident apply" not in capsys.readouterr().out
    assert run("apply", path, 1) == WRONG_INPUT
    assert "cannot be changed here" in capsys.readouterr().err


def test_units_with_tables_of_their_own(project, monkeypatch, capsys):
    """What `pivident apply` is shown for, it can do."""
    monkeypatch.chdir(project)
    units = 'units = {tau = ["N m", -1.0, "N m"]}   # as the logger says\n'
    assert units in EXPERIMENT
    gains = (1.5, -1.0, 0.75)
    tables = [f'[[recording.units.tau]]\nunit = "A"\ngain = {gain}  # of it\n' for gain in gains]
    path = project / "tables.toml"
    path.write_text(EXPERIMENT.replace(units, "".join(tables)))
    assert run("identify", path) == 0
    assert f"pivident apply {path} 1" in capsys.readouterr().out
    before = path.read_text()
    assert run("apply", path, 1) == 0
    changed = "# Set by hand. Before: -1.0.\ngain = 1.0  # of it"
    assert path.read_text() == before.replace("gain = -1.0  # of it", changed)


def test_every_other_byte_stays(project, monkeypatch):
    monkeypatch.chdir(project)
    path = project / "windows.toml"
    path.write_bytes(EXPERIMENT.replace("\n", "\r\n").encode())
    assert run("identify", path) == 0 and run("apply", path, 1) == 0
    content = path.read_bytes()
    assert content.count(b"\n") == content.count(b"\r\n") and b"# as the logger says" in content


def test_a_file_that_has_changed_is_left_alone(judged, capsys):
    judged.write_text(EXPERIMENT + "\n# a note\n")
    assert run("apply", judged, 1) == WRONG_INPUT
    assert "has changed since the verdict" in capsys.readouterr().err
    assert judged.read_text("utf-8").endswith("# a note\n")


@pytest.mark.parametrize("number", [0, 2])
def test_a_repair_that_is_not_there(judged, capsys, number):
    assert run("apply", judged, number) == WRONG_USAGE
    assert "has no repair" in capsys.readouterr().err
    assert judged.read_text("utf-8") == EXPERIMENT


def test_without_a_verdict_nothing_is_applied(project, capsys, monkeypatch):
    monkeypatch.chdir(project)
    path = project / "fresh.toml"
    path.write_text(EXPERIMENT)
    assert run("apply", path, 1) == WRONG_INPUT
    assert "verdict.json" in capsys.readouterr().err
