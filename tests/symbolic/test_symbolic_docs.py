"""The page on symbolic models: its Python runs, its commands and its figures are true."""

import re
from pathlib import Path

import pytest

from pivident.cli.app import DONE, main
from pivident.robot.gallery import load_robot
from pivident.symbolic.robot_models import MODELS, symbolic_models

TEXT = (Path(__file__).resolve().parents[2] / "docs" / "symbolic.md").read_text("utf-8")


def test_python_runs(capsys):
    (code,) = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    names: dict = {}
    exec(compile(code, "symbolic.md", "exec"), names)
    assert names["tau"].shape == (1000, 6) and names["phi"].shape[1] == 6
    assert "multiplications" in capsys.readouterr().out


def test_commands_exist(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^pivident (symbolic \S+(?: --\S+ \w+)*)", TEXT, flags=re.MULTILINE)
    assert len(commands) == 4
    for command in commands:
        words = re.sub(r"my_robot\.\w+", "planar_2r", command).split()
        assert main(words) == DONE


def test_every_model_has_its_row():
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)`", TEXT, flags=re.MULTILINE)
    programs = symbolic_models(load_robot("planar_2r"))
    assert rows == [(name, program.name) for name, program in zip(MODELS, programs, strict=True)]


@pytest.mark.parametrize(
    ("row", "robot", "what"),
    [
        ("TX40: inverse model", "staubli_tx40", "inverse"),
        ("TX40: observation matrix", "staubli_tx40", "regressor"),
        ("TX40: mass matrix", "staubli_tx40", "mass"),
        ("TX40: gravity", "staubli_tx40", "gravity"),
        ("RV-2SQ: inverse model", "mitsubishi_rv2sq", "inverse"),
    ],
)
def test_costs_are_those_of_the_table(row, robot, what):
    (line,) = [line for line in TEXT.splitlines() if line.startswith(f"| {row} |")]
    (program,) = symbolic_models(load_robot(robot), [what])
    count = program.operation_count
    numbers = [int(cell) for cell in line.split("|")[2:5]]
    assert numbers == [count.multiplications, count.additions, count.sines]
