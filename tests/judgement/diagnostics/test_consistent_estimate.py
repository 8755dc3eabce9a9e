"""The consistent stage in the product: experiment table, methods pc-…, command, files."""

import csv
import json

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.experiment.experiment import load_experiment
from pivident.foundation.errors import ExperimentError
from pivident.models.consistency.options import free_methods, made_consistent
from tests.planar_log import EXPERIMENT, write_experiment
from tests.synthetic_identification import synthetic_identification


@pytest.fixture
def folder(tmp_path):
    made = tmp_path / "in"
    made.mkdir()
    return made


def run(*tokens: object) -> int:
    return main([str(token) for token in tokens])


def load(folder, table: str):
    return load_experiment(write_experiment(folder, EXPERIMENT + table))


def refusal(folder, table: str) -> str:
    with pytest.raises(ExperimentError) as caught:
        load(folder, table).consistency()
    line = str(caught.value)
    assert "\n" not in line and line.startswith(str(folder / "experiment.toml"))
    return line


def files_in(folder) -> set[str]:
    return {str(p.relative_to(folder)) for p in folder.rglob("*") if p.is_file()}


def test_the_free_method_runs_once_where_both_are_asked():
    assert free_methods(["ls", "pc-ls", "pc-piv"]) == ["ls", "piv"]
    assert made_consistent(["ls", "pc-ls", "pc-piv"]) == ("ls", "piv")


def test_every_method_has_a_consistent_form():
    from pivident.estimation.methods import METHODS

    assert made_consistent([f"pc-{name}" for name in METHODS]) == tuple(METHODS)
    assert free_methods(["pc-ols", "pc-piv-as-printed"]) == ["ols", "piv-as-printed"]


def test_methods_of_the_file_and_a_table_alone(folder):
    text = EXPERIMENT.replace('methods = ["ls"]', 'methods = ["ls", "iv", "pc-iv"]')
    experiment = load_experiment(write_experiment(folder, text))
    assert list(experiment.methods()) == ["ls", "iv"]
    assert experiment.made_consistent() == ("iv",)
    assert experiment.made_consistent(["ls", "iv"]) == ()
    assert load(folder, "[consistency]").made_consistent() == ("ls",)
    assert load(folder, "[consistency]").made_consistent(["ols"]) == ("ols",)
    assert load(folder, "").made_consistent() == ()


def test_table_becomes_bounds(folder):
    table = """
[consistency]
prior = "euclidean"
margin = 0.02
total_mass = [5, 8]
reference = "planar_2r"
[consistency.bounds.upper_arm]
mass = [3, 5]
[consistency.bounds.elbow]
center_of_mass = [[0.0, 0.3], [-0.1, 0.1], [-0.1, 0.1]]
ellipsoid = [[0.15, 0, 0], [0.2, 0.05, 0.05]]
"""
    options = load(folder, table).consistency()
    assert options.prior == "euclidean" and options.margin == 0.02
    assert options.reference is not None and options.reference.name == "planar 2R"
    bounds = options.bounds
    assert bounds.mass == {"upper_arm": (3.0, 5.0)} and bounds.total_mass == (5.0, 8.0)
    assert bounds.center_of_mass == {"forearm": ((0.0, 0.3), (-0.1, 0.1), (-0.1, 0.1))}
    assert bounds.ellipsoid == {"forearm": ((0.15, 0.0, 0.0), (0.2, 0.05, 0.05))}
    found = options.make_consistent(synthetic_identification(relative_std=0.1, seed=2))
    inside = (found.link("forearm").center_of_mass - [0.15, 0.0, 0.0]) / [0.2, 0.05, 0.05]
    assert np.linalg.norm(inside) <= 1.0 + 1e-4


@pytest.mark.parametrize(
    ("table", "parts"),
    [
        ("[consistency]\nprior = 'entropy'", ["prior", "entropy", "'entropic'"]),
        ("[consistency]\nmargn = 1", ["margn", "margin"]),
        ("[consistency.bounds.forarm]\nmass = [1, 2]", ["'forarm'", "'forearm'"]),
        ("[consistency.bounds.forearm]\nmass = [-1, 2]", ["mass", "below zero", "begin at 0"]),
        ("[consistency.bounds.forearm]\nmass = [2, 1]", ["mass", "empty", "lower end"]),
        ("[consistency.bounds.forearm]\nmass = 2", ["mass", "two numbers"]),
        ("[consistency.bounds.forearm]", ["forearm", "bounds nothing"]),
        (
            "[consistency.bounds.forearm]\nellipsoid = [[0, 0, 0], [1, 1]]",
            ["ellipsoid", "half axes"],
        ),
        (
            "[consistency.bounds.forearm]\nellipsoid = [[0, 0, 0], [1, 0, 1]]",
            ["ellipsoid", "not positive"],
        ),
        (
            "[consistency.bounds.forearm]\nmass = [1, 2]\n[consistency.bounds.elbow]\nmass=[1, 3]",
            ["'forearm'", "'elbow'", "same link"],
        ),
        (
            "[consistency]\ntotal_mass = [1, 2]\n[consistency.bounds.forearm]\nmass = [3, 4]",
            ["add up to 3 kg", "2 kg", "one of these bounds is wrong"],
        ),
        (
            "[consistency]\ntotal_mass = [9, 10]\n[consistency.bounds.forearm]\nmass = [3, 4]\n"
            "[consistency.bounds.upper_arm]\nmass = [3, 4]",
            ["add up to 8 kg", "9 kg"],
        ),
        ("[consistency]\nreference = 'emps'", ["reference 'emps'", "carriage", "same arm"]),
    ],
)
def test_a_wrong_table_is_refused_in_one_line(folder, table, parts):
    line = refusal(folder, table)
    for part in parts:
        assert part in line


def test_a_reference_with_other_frames_is_refused(folder):
    from pathlib import Path

    from pivident.robot.gallery import __file__ as gallery

    text = (Path(gallery).parent / "planar_2r.toml").read_text("utf-8")
    assert "\nd = 0.4 " in text
    (folder / "other.toml").write_text(text.replace("\nd = 0.4 ", "\nd = 0.5 "), encoding="utf-8")
    line = refusal(folder, "[consistency]\nreference = 'other.toml'")
    assert "frame of joint" in line and "elbow" in line


def test_stage_after_one_method_keeps_the_free_result(folder, tmp_path, capsys):
    path = write_experiment(folder)
    assert run("identify", path, "--folds", 2, "--out", tmp_path / "free") == 0
    assert run("identify", path, "-m", "pc-ls", "--folds", 2, "--out", tmp_path / "both") == 0
    printed = capsys.readouterr()
    free, both = tmp_path / "free", tmp_path / "both"
    assert files_in(both) - files_in(free) == {"consistent.json", "consistent_parameters.csv"}
    for name in ("identification.json", "parameters.csv"):
        assert (free / name).read_bytes() == (both / name).read_bytes()
    content = json.loads((both / "consistent.json").read_text("utf-8"))
    assert content["method"] == "PC-IDIM-WLS"
    assert content["identification"]["method"] == "IDIM-WLS"
    assert content["held_out"]["stretches"] == 2 and content["held_out"]["cost"] < 0.01
    assert [link["name"] for link in content["links"]] == ["upper_arm", "forearm"]
    rows = list(csv.DictReader((both / "consistent_parameters.csv").open(encoding="utf-8")))
    standard = {entry["name"]: entry for entry in content["standard"]}
    assert [row["name"] for row in rows] == list(standard)
    for row in rows:
        entry = standard[row["name"]]
        assert float(row["value"]) == entry["value"] and row["unit"] == entry["unit"]
        assert (row["high"] == "") == (entry["high"] is None)
    assert "PC-IDIM-WLS" in printed.out and "held-out" in printed.out
    assert "mass [kg]" in printed.out
    statements = json.loads((both / "verdict.json").read_text("utf-8"))["statements"]
    (statement,) = [s for s in statements if s["topic"] == "physics"]
    assert statement["severity"] == "ok" and "physically possible" in statement["message"]
    assert "Physical consistency" in (both / "report.html").read_text("utf-8")


def test_command_gives_the_same_as_the_stage(folder, tmp_path, capsys):
    path = write_experiment(folder)
    out = tmp_path / "out"
    assert run("identify", path, "-m", "ls,pc-ls", "--folds", 0, "--out", out) == 0
    before = json.loads((out / "consistent.json").read_text("utf-8"))
    kept = (out / "identification.json").read_bytes()
    assert run("consistent", out / "identification.json", "--out", tmp_path / "again") == 0
    after = json.loads((tmp_path / "again" / "consistent.json").read_text("utf-8"))
    assert before["identification"] == after["identification"]
    for one, other in zip(before["standard"], after["standard"], strict=True):
        assert one["value"] == pytest.approx(other["value"], rel=1e-4, abs=1e-5)
    assert (out / "identification.json").read_bytes() == kept
    assert "PC-IDIM-WLS" in capsys.readouterr().out
    (out / "consistent.json").unlink()
    assert run("consistent", out) == 0  # the folder will do
    assert json.loads((out / "consistent.json").read_text("utf-8"))["base"] == after["base"]
    assert f"Results: {out}" in capsys.readouterr().out
    assert run("consistent", tmp_path) == 1
    assert "identification.json" in capsys.readouterr().err


def test_command_with_bounds_of_a_file(folder, tmp_path):
    write_experiment(folder)
    out = tmp_path / "out"
    assert run("identify", folder / "experiment.toml", "--folds", 0, "--out", out) == 0
    bounds = tmp_path / "bounds.toml"
    bounds.write_text("[consistency.bounds.upper_arm]\nmass = [2.0, 2.5]\n", encoding="utf-8")
    source = out / "identification.json"
    assert run("consistent", source, "--bounds", bounds, "--prior", "euclidean") == 0
    content = json.loads((out / "consistent.json").read_text("utf-8"))
    assert content["prior"] == "euclidean"
    assert content["options"]["bounds"] == {"mass": {"upper_arm": [2.0, 2.5]}}
    assert 2.0 - 1e-6 <= content["links"][0]["mass"] <= 2.5 + 1e-6
    low, high = content["links"][0]["mass_interval"]
    assert 2.0 - 1e-4 <= low and high <= 2.5 + 1e-4


@pytest.mark.parametrize(
    ("table", "parts"),
    [
        ("mass = [0, 1e-5]", ["no consistent parameters satisfy the bounds", "forearm"]),
        (
            "center_of_mass = [[-0.2, -0.1], [-0.1, 0.1], [-0.1, 0.1]]",
            ["no consistent parameters lie near", "σ", "torque error", "forearm"],
        ),
    ],
)
def test_bounds_that_no_machine_satisfies(folder, tmp_path, capsys, table, parts):
    """The free result is written, the consistent one is not, and the exit code tells."""
    text = f"{EXPERIMENT}[consistency.bounds.forearm]\n{table}\n"
    path = write_experiment(folder, text)
    out = tmp_path / "out"
    assert run("identify", path, "--folds", 0, "--out", out, "--details") == 1
    assert "identification.json" in files_in(out) and "consistent.json" not in files_in(out)
    printed = capsys.readouterr()
    for part in parts:
        assert part in printed.err and part in printed.out
    assert run("consistent", out / "identification.json", "--bounds", path) == 1
    line = capsys.readouterr().err.strip().splitlines()[-1]
    assert line.startswith("error:") and parts[0] in line
    assert "consistent.json" not in files_in(out)


def test_far_parameters_on_request(folder, tmp_path):
    text = f"""{EXPERIMENT}
[consistency]
accept_far = true
[consistency.bounds.forearm]
center_of_mass = [[-0.2, -0.1], [-0.1, 0.1], [-0.1, 0.1]]
"""
    out = tmp_path / "out"
    path = write_experiment(folder, text)
    assert run("identify", path, "--folds", 0, "--out", out) == 0
    content = json.loads((out / "consistent.json").read_text("utf-8"))
    assert content["torque_error"] > 1.1 * content["torque_error_free"]
    statements = json.loads((out / "verdict.json").read_text("utf-8"))["statements"]
    assert [s["severity"] for s in statements if s["topic"] == "physics"] == ["warning"]


@pytest.mark.parametrize(
    ("tokens", "code", "part"),
    [
        (["identify", "x.toml", "-m", "pc-pivv"], 2, "'pc-piv'"),
        (["consistent", "absent.json"], 1, "absent.json"),
        (["consistent", "absent.json", "--prior", "entropy"], 2, "entropy"),
    ],
)
def test_wrong_commands_are_one_line(tokens, code, part, capsys):
    assert run(*tokens) == code
    lines = capsys.readouterr().err.strip().splitlines()
    assert sum(line.startswith("error:") for line in lines) == 1
    assert part in lines[-1]


def test_bounds_file_without_its_table(folder, tmp_path, capsys):
    out = tmp_path / "out"
    assert run("identify", write_experiment(folder), "--folds", 0, "--out", out) == 0
    (tmp_path / "empty.toml").write_text("mass = 1\n", encoding="utf-8")
    source = out / "identification.json"
    assert run("consistent", source, "--bounds", tmp_path / "empty.toml") == 1
    assert "has no table [consistency]" in capsys.readouterr().err
