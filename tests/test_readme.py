"""The README's Python runs as it stands, its experiment file loads, its commands exist."""

import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from pivident.cli import main
from pivident.cli.app import app
from pivident.experiment.experiment import load_experiment
from pivident.export.urdf import to_urdf
from pivident.models.runnable_model import runnable_model
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_truth, write_log

README = (Path(__file__).resolve().parents[1] / "README.md").read_text(encoding="utf-8")


def blocks(language: str) -> list[str]:
    return re.findall(rf"```{language}\n(.*?)```", README, flags=re.DOTALL)


def test_python_block_identifies_a_log(tmp_path, monkeypatch, capsys):
    code, _ = blocks("python")
    assert 10 <= len([line for line in code.splitlines() if line]) <= 12
    write_log(tmp_path / "log.csv")
    monkeypatch.chdir(tmp_path)
    names: dict = {}
    exec(compile(code, "README.md", "exec"), names)
    assert "IDIM-PIV" in capsys.readouterr().out
    assert (tmp_path / "report.html").stat().st_size > 10_000
    for name, value in planar_truth().items():
        assert names["results"][-1].value(name) == pytest.approx(value, rel=0.05, abs=0.01), name


def test_first_commands_lead_from_urdf_and_log_to_a_result(tmp_path, monkeypatch):
    first = next(b for b in re.findall(r"```\n(.*?)```", README, flags=re.DOTALL) if " init " in b)
    lines = [shlex.split(line, comments=True) for line in first.splitlines()]
    assert [line[1] for line in lines] == ["init", "check", "identify"]
    write_log(tmp_path / "log.csv")
    arm = to_urdf(runnable_model(load_robot("planar_2r")))
    (tmp_path / "arm.urdf").write_bytes(arm.content)
    monkeypatch.chdir(tmp_path)
    for _, *words in lines:
        quick = ["--folds", "0", "--method", "ls"] if words[0] == "identify" else []
        assert main([*words, *quick]) in ((0, 4) if words[0] == "check" else (0,)), words
    assert (tmp_path / "experiment-results" / "report.html").is_file()


def test_experiment_block_loads_and_describes_the_same_problem(tmp_path):
    text = blocks("toml")[0]
    write_log(tmp_path / "log.csv")
    path = tmp_path / "my_robot.toml"
    path.write_text(text, encoding="utf-8")
    experiment = load_experiment(path)
    assert tuple(experiment.methods()) == ("ls", "iv-full-rate", "piv")
    assert experiment.problem().recordings[0].samples == 8000


def test_friction_block_chooses_another_law(tmp_path):
    text, _, friction = blocks("toml")
    write_log(tmp_path / "log.csv")
    path = tmp_path / "my_robot.toml"
    head, table = re.split(r"^robot = .*\n", text, flags=re.MULTILINE)
    path.write_text(head + friction + table, encoding="utf-8")
    shoulder, elbow = load_experiment(path).robot.joints
    assert str(shoulder.friction) == "fvp max(dq, 0) + fvn min(dq, 0) + fc sign(dq) + off"
    assert "+ fs tanh(γ dq) exp(-|dq/0.05|^2) + fl |load|" in str(elbow.friction)
    assert elbow.friction.slopes[0] == 400.0


def test_block_for_an_unknown_loop_loads(tmp_path):
    path = tmp_path / "unknown.toml"
    path.write_text(blocks("toml")[1], encoding="utf-8")
    controller = load_experiment(path).content.controller
    assert controller.type == "identify" and controller.reference == "reconstruct"


def test_block_on_linear_models_prints_one(capsys):
    names: dict = {}
    exec(compile(blocks("python")[1], "README.md", "exec"), names)
    assert "SRIVC" in capsys.readouterr().out
    np.testing.assert_allclose(names["model"].denominator, [1.0, 2.0], rtol=0.03)
    np.testing.assert_allclose(names["model"].numerator, [4.0], rtol=0.03)


def test_commands_of_the_readme_exist():
    fences = re.findall(r"^```(\w*)\n(.*?)^```", README, flags=re.DOTALL | re.MULTILINE)
    code = [text for language, text in fences if not language]
    code += re.findall(r"`(pivident [^`]*)`", README)
    named = {name for text in code for name in re.findall(r"\bpivident ([a-z]\w+)", text)}
    assert {"demo", "init", "check", "identify", "robots", "datasets", "compare"} <= named
    for command in named:
        assert app[command]


def test_every_method_is_in_the_table():
    from pivident.estimation.methods import METHODS

    for name in METHODS:
        assert f"`{name}`" in README, name
