"""Methods that fit a simulation on the command line: identify, predict, compare, export."""

import json

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from pivident.robot.urdf import read_urdf
from tests.planar_log import EXPERIMENT, write_experiment

METHODS = """
methods = ["piv", "cloe", "oloe"]

[identify.cloe]
free = ["kp"]
bounds = {kp1 = [1000, 9000]}

[identify.oloe]
horizon = 1.0

[output]
report = false
"""


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Results of three methods on the log of the planar arm."""
    folder = tmp_path_factory.mktemp("simulations")
    text = EXPERIMENT.replace('methods = ["ls"]', METHODS)
    path = write_experiment(folder, text)
    assert run("identify", path, "--folds", 4, "--out", folder / "result") in (0, 4)
    return folder


def test_gains_and_held_out_positions_are_stored(folder):
    content = json.loads((folder / "result" / "cloe" / "identification.json").read_text("utf-8"))
    own = {p["name"]: p for p in content["simulation"]["loop_parameters"]}
    for name, true in (("kp1", 6000.0), ("kp2", 2500.0)):
        assert abs(own[name]["value"] - true) < 3.0 * own[name]["std"]
    verdict = json.loads((folder / "result" / "verdict.json").read_text("utf-8"))
    held_out = verdict["held_out"]
    assert {name: e["loop"] for name, e in held_out.items()} == {
        "piv": "closed", "cloe": "closed", "oloe": "open",
    }  # fmt: skip


def test_an_open_loop_needs_no_control_law(tmp_path):
    text = EXPERIMENT.replace('methods = ["ls"]', 'methods = ["oloe"]')
    before, _, after = text.partition("[controller]")
    path = write_experiment(tmp_path, before + after[after.index("[identify]") :])
    assert load_experiment(path).methods()["oloe"].loop == "open"
    path.write_text(path.read_text().replace("oloe", "cloe"))
    with pytest.raises(ExperimentError, match="no table \\[controller\\]"):
        load_experiment(path)


def test_tables_are_printed(folder, capsys):
    path = folder / "experiment.toml"
    options = ("--method", "oloe", "--folds", 2, "--out", folder / "one", "--details")
    assert run("identify", path, *options) in (0, 4)
    out = capsys.readouterr().out
    assert "Simulation in open loop, driven by the recorded torques" in out
    assert "Rms error of the simulated positions on 2 held-out blocks" in out


@pytest.mark.parametrize("name", ["cloe", "oloe"])
def test_torques_of_a_log_are_predicted(folder, name, capsys, tmp_path):
    csv = tmp_path / "torques.csv"
    assert run("predict", folder / "result" / name, folder / "log.csv", "--csv", csv) in (0, 4)
    head, *_ = csv.read_text("utf-8").splitlines()
    names = [column.split(" ")[0] for column in head.split(",")]
    values = dict(zip(names, np.loadtxt(csv, delimiter=",", skiprows=1).T, strict=True))
    for joint in ("shoulder", "elbow"):
        error = values[f"tau_{joint}"] - values[f"tau_model_{joint}"]
        assert np.std(error) < 0.05 * np.std(values[f"tau_{joint}"])
    assert "%" in capsys.readouterr().out


def test_results_are_compared(folder, capsys):
    places = [folder / "result" / name for name in ("piv", "cloe", "oloe")]
    assert run("compare", *places) in (0, 4)
    out = capsys.readouterr().out
    assert "CLOE" in out and "OLOE" in out and "zz1r" in out


def test_a_model_is_exported(folder, tmp_path):
    target = tmp_path / "arm.urdf"
    assert run("export", folder / "result" / "cloe", "--to", "urdf", "--out", target) in (0, 4)
    robot = read_urdf(target)
    assert robot.size == 2
