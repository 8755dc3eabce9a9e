"""`init` on a log of positions and references: the law's gains are the question to answer."""

import io

import numpy as np
import pytest

from pivident.app.cli import main
from pivident.app.cli.init import _are_positive, run_init
from pivident.estimation.methods import WITHOUT_TORQUE
from pivident.experiment.check.experiment_check import check_experiment
from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import UNKNOWN, DraftError
from pivident.experiment.init.draft import draft_experiment
from tests.planar_log import planar_log
from tests.positions_only import write_positions


@pytest.fixture
def log(tmp_path):
    write_positions(tmp_path)
    return tmp_path / "log.csv"


def draft(log, **answers):
    return draft_experiment([log], "planar_2r", out=log.parent / "first.toml", answers=answers)


def test_without_gains_the_file_says_what_is_missing(log):
    made = draft(log)
    (trouble,) = made.troubles
    assert "no control law" in trouble
    assert "# kp = " in made.text
    assert "# tau = " in made.text
    path = log.parent / "first.toml"
    path.write_text(made.text)
    (remark,) = check_experiment(path).remarks
    assert remark.refused
    assert remark.place[:1] == ("recording",)


def test_the_gains_are_asked_for(log):
    (kp,) = draft(log).questions
    assert kp.about == "kp"
    assert kp.numbers == 2
    (kd,) = draft(log, kp="6000, 2500").questions
    assert kd.about == "kd"
    assert draft(log, kp="6000, 2500", kd=UNKNOWN).questions == ()


def test_with_gains_the_file_runs(log):
    made = draft(log, kp="6000, 2500", kd="180 60")
    assert made.questions == ()
    assert made.troubles == ()
    path = log.parent / "first.toml"
    path.write_text(made.text)
    experiment = load_experiment(path)
    assert tuple(experiment.methods()) == WITHOUT_TORQUE
    (recording,) = experiment.problem().recordings
    np.testing.assert_allclose(recording.tau[1:], planar_log()[1:, 5:7], atol=2e-3)


def test_neither_torque_nor_reference_is_no_log(log):
    table = planar_log()[:, :3]
    np.savetxt(log, table, delimiter=",", header="time,q1,q2", comments="")
    with pytest.raises(DraftError, match=r"torques of joints.*nor references"):
        draft(log)


def test_the_command_writes_it_with_its_to_do(log, monkeypatch, capsys):
    monkeypatch.chdir(log.parent)
    assert main(["init", "log.csv", "--robot", "planar_2r", "--yes", "--out", "first.toml"]) == 4
    assert "to do: " in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "fits"), [("5", True), ("5, 6", True), ("5 6 7", False), ("5 x", False), ("", False)]
)
def test_an_answer_is_one_number_or_one_for_each_joint(text, fits):
    assert _are_positive(text, 2) == fits


def test_a_person_may_not_know_the_gains(log, monkeypatch, capsys):
    """Wrong answers are asked for again; what is not known is left to be written."""
    monkeypatch.setattr("sys.stdin", io.StringIO("1 2 3\nunknown\n"))
    out = log.parent / "first.toml"
    assert not run_init([log], "planar_2r", out, ask=True)
    said = capsys.readouterr().err
    assert said.count("[2 numbers or one for all, or unknown]") == 2
    assert "# kp = " in out.read_text()


def test_a_column_that_reads_like_a_torque_is_named(log):
    """One effort for two joints is no channel, and worth a look."""
    table = np.column_stack([planar_log()[:, :5], planar_log()[:, 5]])
    names = "time,q1,q2,r1,r2,effort"
    np.savetxt(log, table, fmt="%.9g", delimiter=",", header=names, comments="")
    text = draft(log, kp=UNKNOWN).text
    assert "These read like torques: effort" in " ".join(text.replace("# ", "").split())
