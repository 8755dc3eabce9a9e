"""The README's Python runs as it stands, its experiment file loads, its commands exist."""

import re
from pathlib import Path

import pytest

from pivident.cli.app import app
from pivident.experiment import load_experiment
from tests.planar_log import planar_truth, write_log

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_python_block_identifies_a_log(tmp_path, monkeypatch, capsys):
    (code,) = blocks("python")
    assert 10 <= len([line for line in code.splitlines() if line]) <= 12
    write_log(tmp_path / "log.csv")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    assert "IDIM-PIV" in capsys.readouterr().out
    assert (tmp_path / "report.html").stat().st_size > 10_000
    for name, value in planar_truth().items():
        assert names["results"][-1].value(name) == pytest.approx(value, rel=0.05, abs=0.01), name


def test_experiment_block_loads_and_describes_the_same_problem(tmp_path):
    (text,) = blocks("toml")
    write_log(tmp_path / "log.csv")
    path = tmp_path / "my_robot.toml"
    path.write_text(text, encoding="utf-8")
    experiment = load_experiment(path)
    assert tuple(experiment.methods()) == ("ls", "iv-full-rate", "piv")
    assert experiment.problem().recordings[0].samples == 8000


def test_commands_of_the_readme_exist():
    named = set(re.findall(r"\bpivident (demo|identify|robots|datasets|\w+)\b(?= )", README))
    for command in {"demo", "identify", "robots", "datasets"}:
        assert command in named
        assert app[command]


def test_every_method_is_in_the_table():
    from pivident.estimation.methods import METHODS

    for name in METHODS:
        assert f"`{name}`" in README, name
