"""The page on symbolic models: its Python runs, its commands and its figures are true."""

import re
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.app.cli.console import DONE
from pivident.models.symbolic.robot_models import LOOP_MODELS, MODELS, symbolic_models
from pivident.robot.gallery import load_robot

TEXT = (Path(__file__).resolve().parents[3] / "docs" / "symbolic.md").read_text("utf-8")


def test_python_runs(capsys):
    first, second = re.findall(r"```python\n(.*?)```", TEXT, flags=re.DOTALL)
    names: dict = {}
    exec(compile(first, "symbolic.md", "exec"), names)
    assert names["tau"].shape == (1000, 6) and names["phi"].shape[1] == 6
    assert "multiplications" in capsys.readouterr().out
    exec(compile(second, "symbolic.md", "exec"), names)
    shown = capsys.readouterr().out
    assert "q3 - (q2 + 3.14" in shown and "153 multiplications" in shown
    assert "0 multiplications, 6 additions, 0 sines" in shown
    assert np.isfinite(names["tau"]).all() and names["tau"].shape == (1, 2)
    assert np.abs(names["gap"]).max() < 1e-12 and names["jacobian"].shape == (2, 4)


def test_commands_exist(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    commands = re.findall(r"^pivident (symbolic \S+(?: --\S+ \w+)*)", TEXT, flags=re.MULTILINE)
    assert len(commands) == 5
    for command in commands:
        words = re.sub(r"my_robot\.\w+", "planar_2r", command).split()
        assert main(words) == DONE


def test_every_model_has_its_row():
    rows = re.findall(r"^\| `(\w+)` \| `(\w+)`", TEXT, flags=re.MULTILINE)
    programs = symbolic_models(load_robot("five_bar"))
    every = [*MODELS, *LOOP_MODELS]
    assert rows == [(name, program.name) for name, program in zip(every, programs, strict=True)]


@pytest.mark.parametrize(
    ("row", "robot", "what"),
    [
        ("TX40: inverse model", "staubli_tx40", "inverse"),
        ("TX40: observation matrix", "staubli_tx40", "regressor"),
        ("TX40: mass matrix", "staubli_tx40", "mass"),
        ("TX40: gravity", "staubli_tx40", "gravity"),
        ("RV-2SQ: inverse model", "mitsubishi_rv2sq", "inverse"),
        ("five-bar: inverse model", "five_bar", "inverse"),
        ("five-bar: observation matrix", "five_bar", "regressor"),
        ("palletizer: inverse model", "parallelogram_palletizer", "inverse"),
        ("palletizer: gravity", "parallelogram_palletizer", "gravity"),
        ("SCARA with ball screw: inverse model", "scara", "inverse"),
        ("Delta: inverse model", "delta", "inverse"),
        ("Orthoglide: inverse model", "orthoglide", "inverse"),
    ],
)
def test_costs_are_those_of_the_table(row, robot, what):
    (line,) = [line for line in TEXT.splitlines() if line.startswith(f"| {row} |")]
    (program,) = symbolic_models(load_robot(robot), [what])
    count = program.operation_count
    numbers = [int(cell) for cell in line.split("|")[2:5]]
    assert numbers == [count.multiplications, count.additions, count.sines]
