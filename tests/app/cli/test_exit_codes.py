"""Exit codes are true: every command that is documented ends with the code of what it did."""

import re
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli import main, workflow
from pivident.app.cli.app import app
from pivident.foundation.errors import IdentificationError
from tests.conftest import REPOSITORY
from tests.planar_log import EXPERIMENT, planar_log, write_experiment

PAGE = (REPOSITORY / "docs" / "reference" / "command_line.md").read_text(encoding="utf-8")


def run(*tokens) -> int:
    return main([str(token) for token in tokens])


def text_with(old: str, new: str) -> str:
    assert old in EXPERIMENT
    return EXPERIMENT.replace(old, new)


def test_every_command_is_in_the_table():
    rows = re.findall(r"^\| (`[a-z-]+`(?:, `[a-z-]+`)*) \| .* \|$", PAGE, flags=re.MULTILINE)
    listed = [name for row in rows for name in re.findall(r"`([\w-]+)`", row)]
    commands = [name for name in app if not name.startswith("-")]
    assert sorted(listed) == sorted(commands)


@pytest.mark.parametrize(
    ("text", "code"),
    [
        (EXPERIMENT, 0),
        (text_with('units = {q = "deg", q_ref = "deg", tau = "N m"}', ""), 1),  # far beyond limits
        (text_with("kp = [6000, 2500]", "kp = [60, 25]"), 4),  # a hundredth of what the log shows
    ],
)
def test_check(tmp_path, text, code):
    assert run("check", write_experiment(tmp_path, text)) == code


def test_check_with_warnings_alone_is_done(tmp_path, capsys):
    text = text_with("kp = [6000, 2500]", "kp = [4000, 2500]")
    assert run("check", write_experiment(tmp_path, text)) == 0
    assert "warning" in capsys.readouterr().out


def test_audit(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write_experiment(tmp_path)
    assert run("audit", path) == 0
    rows = planar_log().copy()
    rows[:, -1] *= -1.0  # the elbow gives energy
    head = "time,q1 [deg],q2 [deg],r1 [deg],r2 [deg],tau1,tau2"
    np.savetxt("turned.csv", rows, delimiter=",", header=head, comments="")
    assert run("audit", "turned.csv", "--robot", "planar_2r", "--out", "turned") == 4
    assert run("audit", "absent.csv") == 1


def test_init(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    write_experiment(tmp_path)
    assert run("init", "log.csv", "--robot", "planar_2r", "--yes", "--force") == 0
    assert run("init", "log.csv", "--robot", "planar_2r", "--yes") == 1, "the file exists"
    assert run("init") == 2
    slow = planar_log()[::200]  # 5 Hz: too few samples between the ends of the filters
    head = "time,q1 [deg],q2 [deg],r1 [deg],r2 [deg],tau1,tau2"
    np.savetxt("slow.csv", slow, delimiter=",", header=head, comments="")
    assert run("init", "slow.csv", "--robot", "planar_2r", "--yes", "--out", "slow.toml") == 4
    assert Path("slow.toml").is_file(), "what is to be done stands in it"


def test_a_method_that_fails_counts_in_the_demonstration_too(tmp_path, monkeypatch):
    real = workflow.identify

    def failing(problem, method, progress=None):
        if method.label == "IDIM-PIV":
            raise IdentificationError("it failed")
        return real(problem, method, progress)

    monkeypatch.setattr(workflow, "DEMO_METHODS", ("ls", "piv"))
    monkeypatch.setattr(workflow, "DEMO_FOLDS", 0)
    monkeypatch.setattr(workflow, "identify", failing)
    assert run("demo", "--out", tmp_path / "out") == 1
    assert (tmp_path / "out" / "report.html").is_file()


def test_results_that_did_not_converge(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    text = text_with(
        'methods = ["ls"]', 'methods = ["iv-full-rate"]\nmax_iterations = 1\ntolerance = 1e-9'
    )
    path = write_experiment(tmp_path, text)
    assert run("identify", path, "--folds", 0) == 3
    assert run("friction", path) == 3
    assert run("friction", path, "--method", "ls") == 0


def test_gains_without_a_known_one_have_nothing_to_write(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    path = write_experiment(tmp_path, text_with('tau = "N m"', 'tau = "A"'))
    assert run("identify", path) == 1
    assert run("gains", path) == 0
    assert run("gains", path, "--out", "gains.toml") == 1
    assert not Path("gains.toml").exists()


def test_what_is_not_there(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    absent = {
        "compare": ["a", "b"], "consistent": ["a"], "export": ["a", "--to", "urdf", "--out", "b"],
        "fleet": ["a"], "flexibility": ["a.toml"], "friction": ["a.toml"], "gains": ["a.toml"],
        "laws": ["a.toml"], "payload": ["a.toml"], "robots": ["a"], "study": ["a.toml"],
        "symbolic": ["a.toml"], "check": ["a.toml"], "identify": ["a.toml"], "audit": ["a.csv"],
        "init": ["a.csv", "--robot", "emps"], "fit-simulator": ["a.toml"],
    }  # fmt: skip
    assert {name: run(name, *words) for name, words in absent.items()} == dict.fromkeys(absent, 1)
