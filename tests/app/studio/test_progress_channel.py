"""Progress of a command in a file, for the program that started it."""

import json

import pytest

from pivident.app.cli import main
from pivident.app.cli.console import Progress
from tests.conftest import REPOSITORY
from tests.planar_log import EXPERIMENT, write_experiment


@pytest.fixture
def channel(tmp_path, monkeypatch):
    monkeypatch.setenv("PIVIDENT_PROGRESS", str(tmp_path / "progress"))
    return tmp_path / "progress"


def lines(path) -> list[dict]:
    return [json.loads(line) for line in path.read_text("utf-8").splitlines()]


def test_lines_say_what_the_terminal_shows(channel, capsys):
    with Progress() as progress:
        progress.say("reading")
        progress.stages({"ls": 2.0, "report": 1.0})
        progress.say("between")
        progress.begin("ls")
        progress.say("σ\nof it")
        progress.keep("ls: done")
        progress.begin("report")
    said = lines(channel)
    left = [line.pop("left_s") for line in said if "left_s" in line]
    assert said == [
        {"say": "reading"},
        {"stages": {"ls": 2.0, "report": 1.0}},
        {"say": "between"},
        {"stage": "ls", "number": 1, "of": 2},
        {"say": "σ\nof it", "number": 1, "of": 2},
        {"keep": "ls: done"},
        {"stage": "report", "number": 2, "of": 2},
    ]
    assert left[0] == 3.0 and 2.0 < left[1] <= 3.0 and 0.0 < left[-1] <= 1.0
    assert capsys.readouterr().err.splitlines() == ["reading", "between", "σ", "of it", "ls: done"]


def test_identification_says_its_stages(channel, tmp_path, capsys):
    path = write_experiment(tmp_path, EXPERIMENT + "[output]\nreport = false\n")
    assert main(["identify", str(path), "--folds", "0", "--out", str(tmp_path / "out")]) == 0
    said = lines(channel)
    (stages,) = (line["stages"] for line in said if "stages" in line)
    begun = [(line["stage"], line["number"], line["of"]) for line in said if "stage" in line]
    assert begun == [(name, k, len(stages)) for k, name in enumerate(stages, start=1)]
    assert begun[0][0] == "ls" and all(line.get("left_s", 0.0) >= 0.0 for line in said)
    shown = [line[key] for line in said for key in ("say", "keep") if key in line]
    assert shown == capsys.readouterr().err.splitlines()


def test_a_file_that_cannot_be_written_ends_nothing(monkeypatch, tmp_path, capsys):
    monkeypatch.setenv("PIVIDENT_PROGRESS", str(tmp_path))
    with Progress() as progress:
        progress.say("still here")
    assert capsys.readouterr().err == "still here\n"


def test_without_the_variable_nothing_is_written(monkeypatch, tmp_path):
    monkeypatch.delenv("PIVIDENT_PROGRESS", raising=False)
    monkeypatch.chdir(tmp_path)
    with Progress() as progress:
        progress.say("x")
    assert list(tmp_path.iterdir()) == []


def test_the_reference_shows_the_lines():
    text = (REPOSITORY / "docs" / "reference" / "command_line.md").read_text("utf-8")
    assert all(f'`{{"{key}": ' in text for key in ("stages", "stage", "say", "keep"))
