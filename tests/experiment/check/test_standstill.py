"""Joints that no record moves: the check says so, and that an identification stops at it."""

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.data.logs.log import Log
from pivident.judgement.audit.steps import check_steps
from tests.questions.conftest import lay_out
from tests.questions.material import Case, csv, log
from tests.questions.test_signals import still


def slowly():
    """The second joint creeps by 20 mrad in all, far below the mask."""
    made = log()
    t = made["time"]
    made["q2"] = made["r2"] = 0.3 + 0.02 * t / t[-1]
    return made


def everything_still():
    made = log()
    noise = np.random.default_rng(0)
    for name in ("q1", "q2"):
        made[name] = 0.3 + 1e-5 * noise.standard_normal(len(made["time"]))
    return made


@pytest.mark.parametrize(
    ("made", "words"),
    [
        (lambda: still("2"), "Standstill: elbow moves by"),
        (everything_still, "Standstill: the whole arm"),
        (slowly, "Too slow: elbow never moves faster than the low-speed mask"),
    ],
    ids=["one", "all", "slow"],
)
def test_check_and_identify_stop_at_the_same_joint(made, words, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lay_out(Case("", (words,), log=made()), tmp_path)
    assert main(["check", "experiment.toml"]) == 1
    said = capsys.readouterr().out
    assert "an identification would stop" in said
    assert words in said
    assert "To be estimated" not in said
    assert "off equal intervals" not in said
    assert main(["identify", "experiment.toml"]) == 1
    assert "has 0 usable rows" in capsys.readouterr().err


def test_a_joint_that_moves_in_another_record_stops_nothing(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    lay_out(Case("", (), log=still("2")), tmp_path)
    text = (tmp_path / "experiment.toml").read_text()
    (tmp_path / "other.csv").write_text(csv(log()))
    first = text[text.index("[recording]") : text.index("[controller]")]
    both = [first, first.replace("log.csv", "other.csv")]
    runs = "".join(run.replace("[recording]", "[[recording]]") for run in both)
    (tmp_path / "experiment.toml").write_text(text.replace(first, runs))
    main(["check", "experiment.toml"])
    said = capsys.readouterr().out
    assert "Standstill: elbow" in said
    assert "an identification would run" in said


def test_no_sample_of_an_arm_at_rest_is_early():
    noise = 1e-5 * np.random.default_rng(0).standard_normal((2000, 2))
    rest = Log("log", ("a", "b"), {}, {}, 500.0, logged={"q": noise}, channels={"q": noise})
    assert check_steps(rest, 500.0, True) == []
