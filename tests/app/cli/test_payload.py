"""``pivident payload``: from two logs, or an arm known before and one log, to a load in files."""

import csv
import json
import re
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.estimation.identification_file import save_identification
from pivident.estimation.identify import identify
from pivident.experiment.experiment import load_experiment
from tests.app.cli.test_gains import PAYLOAD, write_log

RECORD = """files = "{}.csv"
columns = {{t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["i1", "i2"]}}
units = {{q = "deg", q_ref = "deg", tau = [{{unit = "A", gain = 12}}, {{unit = "A", gain = 5}}]}}
"""

HEAD = """
robot = "planar_2r"

[recording]
{}
[controller]
type = "pd"
kp = [500, 500]
kd = [15, 12]
drive_gain = [12, 5]
"""

WITHOUT = HEAD.format(RECORD.format("empty"))
BOTH = WITHOUT + "\n[[payload.recording]]\n" + RECORD.format("loaded")


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("payload")
    write_log(made / "empty.csv", loaded=False)
    write_log(made / "loaded.csv", loaded=True)
    return made


def run(folder, text, *options) -> int:
    path = folder / "arm.toml"
    path.write_text(text, encoding="utf-8")
    return main(["payload", *map(str, options), str(path), "--out", str(folder / "out")])


def numbers(folder) -> dict[str, list[str]]:
    with open(folder / "out" / "payload.csv", encoding="utf-8") as stream:
        rows = list(csv.reader(stream))
    assert rows[0] == ["name", "value", "std", "lower", "upper", "unit"]
    return {row[0]: row[1:] for row in rows[1:]}


def test_two_logs_give_the_load_with_intervals_and_units(folder, capsys):
    assert run(folder, BOTH) == 0
    printed = capsys.readouterr().out
    assert "Load on link 'forearm' by IDIM-PIV" in printed and "kg m²" in printed
    assert "determine 4 of 10 combinations" in printed
    # what no torque of a planar arm tells has no value, and is named
    assert "centre of mass z, " in printed.split("Not determined: ")[1]
    found = numbers(folder)
    true = dict(zip(("cx", "cy"), PAYLOAD.center_of_mass, strict=False)) | {"mass": PAYLOAD.mass}
    for name, value in true.items():
        error, std = float(found[name][0]) - value, float(found[name][1])
        assert abs(error) < 4 * std, name
        assert float(found[name][2]) < float(found[name][0]) < float(found[name][3])
    assert found["mass"][-1] == "kg" and found["cz"] == ["", "", "", "", "m"]
    values = json.loads((folder / "out" / "payload.json").read_text("utf-8"))
    assert values["rank"] == 4 and values["link"] == "forearm" and values["converged"]
    assert np.shape(values["covariance"]) == (10, 10) and np.shape(values["undetermined"]) == (
        6,
        10,
    )
    assert {"empty.csv", "loaded.csv"} <= set(values["sources"]["without_load"]) | set(
        values["sources"]["with_load"]
    )
    assert (folder / "out" / "payload.txt").read_text("utf-8").strip() in printed


def test_a_known_mass_and_the_frame_of_the_tool(folder, capsys):
    table = '\n[payload]\nmethod = "ls"\nmass = 1.2\nframe = {xyz = [0.3, 0, 0]}\n'
    text = WITHOUT + table + "\n[[payload.recording]]\n" + RECORD.format("loaded")
    assert run(folder, text) == 0
    assert "tool with origin (0.3, 0, 0) m" in capsys.readouterr().out
    found = numbers(folder)
    assert float(found["mass"][0]) == pytest.approx(1.2, abs=1e-4)
    assert float(found["cx"][0]) == pytest.approx(0.05, abs=4 * float(found["cx"][1]) + 1e-4)


def test_an_arm_identified_before(folder, capsys):
    (folder / "arm.toml").write_text(WITHOUT, encoding="utf-8")
    save_identification(identify(load_experiment(folder / "arm.toml").problem(), "ls"), folder)
    text = HEAD.format(RECORD.format("loaded"))
    assert run(folder, text, "--method", "ls", folder / "identification.json") == 0
    assert "by IDIM-WLS" in capsys.readouterr().out
    mass = numbers(folder)["mass"]
    assert float(mass[0]) == pytest.approx(1.2, abs=4 * float(mass[1]) + 0.005)


def test_wrong_input_is_one_line_that_says_what_to_do(folder, capsys):
    def said(text, *options):
        assert run(folder, text, *options) == 1
        return capsys.readouterr().err.splitlines()[-1]

    assert "add [[payload.recording]]" in said(WITHOUT)
    assert "did you mean 'elbow'" in said(
        BOTH.replace("[[payload", '[payload]\nlink = "elbwo"\n[[payload')
    )
    assert "give that too" in said(
        BOTH.replace("[[payload", "[payload]\ninertia = [1, 0, 0, 1, 0, 1]\n[[payload")
    )
    swapped = HEAD.format(RECORD.format("loaded")) + "\n[[payload.recording]]\n"
    assert "Swap the two records" in said(swapped + RECORD.format("empty"), "--method", "ls")
    assert "mass" in said(BOTH.replace("[[payload", "[payload]\nmass = -2.0\n[[payload"))
    assert "there is no method" in said(BOTH, "--method", "pivv")
    assert main(["payload", str(folder / "identification.json")]) == 1
    assert "LOADED.toml" in capsys.readouterr().err


def test_blocks_of_the_documentation_run(folder, tmp_path, monkeypatch, capsys):
    text = (Path(__file__).resolve().parents[3] / "docs" / "payload.md").read_text("utf-8")
    (table,) = re.findall(r"```toml\n(.*?)```", text, flags=re.DOTALL)
    (code,) = re.findall(r"```python\n(.*?)```", text, flags=re.DOTALL)
    (tmp_path / "documented.toml").write_text(table, encoding="utf-8")
    documented = load_experiment(tmp_path / "documented.toml").content
    assert documented.payload.link == "forearm" and documented.payload.frame.xyz[0] == 0.3
    for name in ("empty", "loaded"):
        (folder / f"{name}.toml").write_text(HEAD.format(RECORD.format(name)), encoding="utf-8")
    monkeypatch.chdir(folder)
    names: dict = {}
    exec(compile(code, "payload.md", "exec"), names)
    assert names["load"].mass == pytest.approx(1.2, abs=0.01)
    assert "Load on link 'forearm'" in capsys.readouterr().out
