"""``pivident init``: from a log and a robot to an experiment file that runs."""

import importlib.util
import json
import re
import sys
import tomllib
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli.app import main
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.draft import draft_experiment
from pivident.foundation.errors import PividentError
from tests.planar_log import planar_log

ROOT = Path(__file__).resolve().parents[3]


def module(path: Path):
    spec = importlib.util.spec_from_file_location(path.stem, path)
    made = importlib.util.module_from_spec(spec)
    sys.modules[path.stem] = made  # dataclasses look their module up
    spec.loader.exec_module(made)
    return made


def write_csv(path: Path, header: list[str], columns: np.ndarray) -> None:
    text = ",".join(f'"{name}"' for name in header)
    np.savetxt(path, columns, delimiter=",", header=text, comments="", fmt="%.12g")


@pytest.fixture
def folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    return tmp_path


def test_a_log_in_degrees_is_recognised_and_runs(folder, capsys):
    names = ["time", "J1 act", "J2 act", "J1 cmd", "J2 cmd", "tau_1", "tau_2"]
    write_csv(folder / "log.csv", names, planar_log())
    assert main(["init", "log.csv", "--robot", "planar_2r"]) == 0
    said = capsys.readouterr().out
    assert 'recording.units.q = "deg"' in said and "pivident identify experiment.toml" in said
    experiment = load_experiment("experiment.toml")
    (entry,) = experiment.content.recording
    assert entry.columns.q == ["J1 act", "J2 act"]
    assert entry.columns.q_ref == ["J1 cmd", "J2 cmd"]
    assert entry.columns.tau == ["tau_1", "tau_2"]
    assert (entry.units.q, entry.units.q_ref, entry.units.tau) == ("deg", "deg", "N m")
    assert experiment.content.controller.type == "identify"
    assert "too far for rad" in Path("experiment.toml").read_text(encoding="utf-8")
    assert main(["identify", "experiment.toml", "-m", "ls", "--folds", "0", "--out", "r"]) == 0


def test_a_torque_of_unknown_scale_is_marked_down_to_the_verdict(folder):
    columns = planar_log().copy()
    columns[:, 5:] *= 50.0
    write_csv(folder / "log.csv", ["time", "q1", "q2", "r1", "r2", "tau1", "tau2"], columns)
    assert main(["init", "log.csv", "--robot", "planar_2r"]) == 0
    (entry,) = load_experiment("experiment.toml").content.recording
    assert [unit["scale"] for unit in entry.units.tau] == ["masses", "masses"]
    assert main(["identify", "experiment.toml", "-m", "ls", "--folds", "0", "--out", "r"]) == 0
    found = json.loads(Path("r/verdict.json").read_text(encoding="utf-8"))
    assert "taken from the description's masses" in found["headline"]
    assert sum(s["topic"] == "torque scale" for s in found["statements"]) == 1


def test_a_scale_that_nothing_tells_is_a_guess(folder):
    table = (ROOT / "src/pivident/robot/gallery/planar_2r.toml").read_text(encoding="utf-8")
    parts = re.split(r"(?m)^(?=\[)", table)
    bare = "".join(part for part in parts if not part.startswith("[joints.link]"))
    (folder / "arm.toml").write_text(bare, encoding="utf-8")
    write_csv(folder / "log.csv", ["time", "q1", "q2", "r1", "r2", "tau1", "tau2"], planar_log())
    draft = draft_experiment(["log.csv"], "arm.toml")
    assert tomllib.loads(draft.text)["recording"]["units"]["tau"]["scale"] == "assumed"
    asked = draft_experiment(["log.csv"], "arm.toml", answers={"unit of tau": "A"})
    units = tomllib.loads(asked.text)["recording"]["units"]["tau"]
    assert [unit["scale"] for unit in units] == ["assumed", "assumed"]
    known = draft_experiment(["log.csv"], "arm.toml", answers={"unit of tau": "N m"})
    assert tomllib.loads(known.text)["recording"]["units"]["tau"] == "N m"


def test_nothing_is_overwritten(folder, capsys):
    write_csv(folder / "log.csv", ["time", "q1", "q2", "r1", "r2", "tau1", "tau2"], planar_log())
    (folder / "experiment.toml").write_text("mine", encoding="utf-8")
    assert main(["init", "log.csv", "--robot", "planar_2r"]) == 1
    assert "exists already" in capsys.readouterr().err
    assert main(["init", "log.csv", "--robot", "planar_2r", "--out", "log.csv"]) == 1
    assert (folder / "experiment.toml").read_text(encoding="utf-8") == "mine"
    assert (folder / "log.csv").read_text(encoding="utf-8").startswith('"time"')
    assert main(["init"]) == 2
    assert main(["init", "log.csv", "--robot", "planar_" + "9" * 5000, "--force"]) == 1
    assert "the gallery has no robot 'planar_999" in capsys.readouterr().err  # no name of a file
    assert sorted(path.name for path in folder.iterdir()) == ["experiment.toml", "log.csv"]


def test_weird_names_and_several_runs(folder):
    columns = planar_log()
    keep = [0, 1, 2, 5, 6]
    names = ["time", "q [1] \"a'#", "q [2] \"a'#", "tau\\1", "tau\\2"]
    for run in ("run*1.csv", "run 2.csv"):
        text = ",".join('"' + name.replace('"', '""') + '"' for name in names)
        np.savetxt(
            folder / run, columns[:, keep], delimiter=",", header=text, comments="", fmt="%.12g"
        )
    draft = draft_experiment(["run*1.csv", "run 2.csv"], "planar_2r")
    Path("experiment.toml").write_text(draft.text, encoding="utf-8")
    assert not draft.troubles
    experiment = load_experiment("experiment.toml")
    first, second = experiment.content.recording
    assert first.files == {"log": "run*1.csv"} and second.files == "run 2.csv"
    assert first.columns.q == names[1:3]
    assert [r.samples for r in experiment.recordings()] == [len(columns)] * 2
    assert experiment.content.controller is None


def test_files_of_the_same_columns_hold_what_their_names_say(folder):
    columns = planar_log()
    header = ["stamp [ms]", "joint_1", "joint_2"]
    for name, own in (("arm_position", [1, 2]), ("arm_torque", [5, 6]), ("arm_cmd", [3, 4])):
        own_columns = np.column_stack([1e3 * columns[:, 0], columns[:, own]])
        write_csv(folder / f"{name}.csv", header, own_columns)
    logs = ["arm_position.csv", "arm_torque.csv", "arm_cmd.csv"]
    draft = draft_experiment(logs, "planar_2r")
    content = tomllib.loads(draft.text)["recording"]
    assert content["files"] == {
        "q": "arm_position.csv",
        "tau": "arm_torque.csv",
        "q_ref": "arm_cmd.csv",
    }
    assert content["units"]["t"] == "ms" and content["units"]["q"] == "deg"
    assert not draft.troubles and max(draft.explained.values()) < 0.05


def test_a_log_that_identification_refuses_gets_a_to_do(folder, capsys):
    columns = planar_log()[:, [0, 1, 2, 5, 6]].copy()
    columns[2000:7000, 2] = np.nan
    write_csv(folder / "log.csv", ["time", "A1", "A2", "I_A1", "I_A2"], columns)
    assert main(["init", "log.csv", "--robot", "planar_2r"]) == 4
    assert "to do: pivident identify ends with" in capsys.readouterr().err
    text = Path("experiment.toml").read_text(encoding="utf-8")
    assert "# TO DO: pivident identify ends with" in text
    (entry,) = load_experiment("experiment.toml").content.recording
    assert entry.columns.q == ["A1", "A2"] and entry.units.q == "deg"
    assert [unit["unit"] for unit in entry.units.tau] == ["A", "A"]
    assert np.allclose([unit["gain"] for unit in entry.units.tau], 1.0, atol=0.01)


def test_what_only_a_person_knows_is_asked(folder, monkeypatch, capsys):
    columns = planar_log()
    write_csv(folder / "log.csv", ["q1", "q2", "tau1", "tau2"], columns[:, [1, 2, 5, 6]])
    from pivident.app.cli import init

    answers = iter(["fast\n", "1000\n"])
    monkeypatch.setattr("sys.stdin", type("In", (), {"readline": lambda self: next(answers)})())
    assert init.run_init([Path("log.csv")], "planar_2r", Path("e.toml"), ask=True)
    assert "At what rate" in capsys.readouterr().err
    assert tomllib.loads(Path("e.toml").read_text(encoding="utf-8"))["recording"]["rate"] == 1000.0


def test_errors_say_what_there_is(folder):
    write_csv(folder / "log.csv", ["time", "apple", "pear"], planar_log()[:, :3])
    with pytest.raises(PividentError, match="positions of joints; there are time, apple, pear"):
        draft_experiment(["log.csv"], "planar_2r")
    with pytest.raises(PividentError, match="no URDF lies beside it"):
        draft_experiment(["log.csv"])


def test_a_ur10e_like_log_needs_three_commands(folder, capsys):
    pytest.importorskip("pinocchio")
    simulation = module(ROOT / "examples" / "ur10e_like" / "simulate_log.py")
    simulation.write(folder, seconds=15.0)
    assert main(["init", "rtde_log.csv", "--robot", "ur10e_like.urdf"]) == 0
    experiment = load_experiment("experiment.toml")
    (entry,) = experiment.content.recording
    assert entry.columns.q == [f"actual_q_{k}" for k in range(6)]
    assert entry.columns.q_ref == [f"target_q_{k}" for k in range(6)]
    assert entry.columns.dq_ref == [f"target_qd_{k}" for k in range(6)]
    # Gravity compensation, which nobody told, may hide the law; a declared one then takes over.
    assert experiment.content.controller.type in ("identify", "virtual_pd")
    # Gains follow from the masses of the URDF, which are wrong by several per cent.
    gains = np.array([unit["gain"] for unit in entry.units.tau])
    assert np.all(np.abs(gains[:3] / simulation.GAIN[:3] - 1.0) < 0.15)
    assert "ASSUMED  recording.units.tau" in capsys.readouterr().out
    arguments = ["identify", "experiment.toml", "-m", "ls", "--folds", "0", "--out", "results"]
    assert main(arguments) == 0
    assert (folder / "results" / "report.html").is_file()


def test_the_python_of_the_documentation_runs(folder, capsys):
    text = (ROOT / "docs" / "init.md").read_text(encoding="utf-8")
    exec(text.split("```python\n")[1].split("```")[0], {})
    assert "recording.units q deg" in capsys.readouterr().out
    assert load_experiment("experiment.toml").content.recording[0].units.t == "ms"


@pytest.mark.record
def test_tiago_from_three_files(data_dir, tmp_path):
    benchmark = module(ROOT / "benchmarks" / "tiago.py")
    outcome = benchmark.run(data_dir / "tiago", tmp_path)
    text = outcome.draft.text
    assert "exactly 0 in 88 % of the rows" in text
    assert "the sign of arm_3_joint, arm_4_joint is reversed" in " ".join(
        line.removeprefix("# ") for line in text.splitlines()
    )
    assert outcome.error.joint_names[1:] == benchmark.JUDGED
    assert outcome.in_logged_units() < 16.0
    assert outcome.error.relative[outcome.judged].max() < 27.0
    assert outcome.error.relative_in_band[outcome.judged].max() < 22.0
