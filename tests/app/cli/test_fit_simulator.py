"""``pivident fit-simulator``: files of all formats, and what is refused."""

import csv
import json
import sys

import mujoco
import pytest

from pivident.app.cli import main
from tests.studies.simulators.leg import write_leg


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    made = tmp_path_factory.mktemp("leg")
    write_leg(made)
    return made


def changed(folder, old="", new=""):
    text = (folder / "leg.toml").read_text()
    assert old in text
    path = folder / "changed.toml"
    path.write_text(text.replace(old, new))
    return str(path)


def test_a_log_of_positions_gives_a_simulator(folder, capsys):
    assert main(["fit-simulator", str(folder / "leg.toml")]) == 0
    printed = capsys.readouterr().out
    assert "13 values from 1700 samples of 3 joints" in printed and "N m s/rad" in printed
    out = folder / "leg-simulator"
    model = mujoco.MjModel.from_xml_path(str(out / "robot.xml"))
    with open(out / "simulator.csv", encoding="utf-8") as stream:
        rows = {(r["quantity"], r["joint"]): r for r in csv.DictReader(stream)}
    assert float(rows["armature", "hip"]["value"]) == pytest.approx(model.dof_armature[1], rel=1e-5)
    values = json.loads((out / "simulator.json").read_text())
    assert values["converged"] and values["file"] == "robot.xml"
    assert max(values["held_out"]["rms"]["after"]) < 1e-3
    page = (out / "simulator.html").read_text()
    assert "Fitted values" in page and "Errors on log" in page


def test_actuators_for_isaac(folder, tmp_path, capsys):
    code = main(["fit-simulator", str(folder / "leg.toml"), "--to", "isaac", "--held-out", "0",
                 "--out", str(tmp_path / "out")])  # fmt: skip
    assert code == 0 and "DelayedPDActuatorCfg(" in (tmp_path / "out" / "actuators.py").read_text()


@pytest.mark.parametrize(
    ("old", "new", "options", "says"),
    [
        ('type = "pd"', 'type = "virtual_pd"', (), "has none; give [controller]"),
        ('q_ref = ["target_abduction", "target_hip", "target_knee"]', "", (), "q_ref"),
        ("kp = 40.0", "kp = 0.0", (), "position gain of joint 'abduction' is zero"),
        ("control_rate = 400.0", "control_rate = 300.0", (), "no whole multiple"),
        ("", "", ("--free", "mass"), "free names 'mass'"),
        ("", "", ("--held-out", "0.9"), "share from 0 to 0.8"),
        ('robot = "leg.xml"', 'robot = {model = "leg.xml", joints = ["toe"]}', (), "'toe'"),
        ("", "", ("--to", "urdf"), "no URDF"),
    ],
)
def test_what_is_wrong_is_said_in_one_line(folder, tmp_path, capsys, old, new, options, says):
    path = changed(folder, old, new)
    if "virtual_pd" in new:
        text = (folder / "changed.toml").read_text()
        text = text[: text.index("kp =")]
        (folder / "changed.toml").write_text(text)
    code = main(["fit-simulator", path, *options, "--out", str(tmp_path / "out")])
    assert code == 1
    assert says in capsys.readouterr().err.replace("\n", " ")


def test_without_mujoco_the_extra_is_named(folder, capsys, monkeypatch):
    monkeypatch.setitem(sys.modules, "mujoco", None)
    assert main(["fit-simulator", str(folder / "leg.toml")]) == 1
    assert "pip install 'pivident[mujoco]'" in capsys.readouterr().err
