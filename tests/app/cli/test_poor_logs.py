"""Logs that hold too little, from ``init`` to ``identify`` and ``audit``: each gets its answer."""

import tomllib

import numpy as np
import pytest

from pivident.app.cli import main
from tests.other_arms import Moves, Setting, log_of_motion, random_arm

ARM = random_arm(np.random.default_rng(5))


def moving(t):
    """A motion of all joints with stops."""
    moves = Moves(np.random.default_rng([5, 1]), ARM, Setting(seconds=60.0, stops=1.0))
    return moves.at(t)[:3]


def write(folder, t, motion):
    log_of_motion(ARM, t, motion).write(folder)


@pytest.fixture
def answer(tmp_path, monkeypatch, capsys):
    """Exit code and output of a command in the folder of the log."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "400")

    def run(line):
        code = main(line.split())
        said = capsys.readouterr()
        assert "Traceback" not in said.out + said.err
        return code, said.out + said.err

    return run


INIT, AUDIT = "init log.csv --robot arm.urdf --yes", "audit log.csv --robot arm.urdf"


def only(motion, joints):
    """The motion of some joints, while the others stand where they are."""
    q, dq, ddq = (np.zeros_like(x) for x in motion)
    q += motion[0][0]
    for part, whole in zip((q, dq, ddq), motion, strict=True):
        part[:, joints] = whole[:, joints]
    return q, dq, ddq


def test_a_log_of_standstill(tmp_path, answer):
    t = np.arange(2000) / 100
    write(tmp_path, t, only(moving(t), []))
    code, said = answer(INIT)
    assert code == 1 and not (tmp_path / "experiment.toml").exists()
    assert "axis_1: it does not move" in said and "log a motion" in said
    code, said = answer(AUDIT)
    assert code == 4 and "1 error, 0 warnings" in said
    assert "Standstill: the whole arm moves by" in said and "in which the arm moves" in said
    write(tmp_path, t, moving(t))
    assert answer(INIT)[0] == 0
    write(tmp_path, t, only(moving(t), []))
    code, said = answer("check experiment.toml")
    assert code == 1 and "Standstill: the whole arm" in said and "poorly excited" not in said
    code, said = answer("identify experiment.toml -m ls")
    assert code == 1 and "axis_1" in said and "hardly moves" in said


def test_a_log_in_which_one_joint_moves(tmp_path, answer):
    t = np.arange(2000) / 100
    write(tmp_path, t, only(moving(t), [2]))
    code, said = answer(INIT)
    assert code == 0 and "axis_1 (it does not move)" in said
    robot = tomllib.loads((tmp_path / "experiment.toml").read_text())["robot"]
    assert robot["joints"] == ["axis_3"] and set(robot["frozen"]) == set(ARM.joint_names) - {
        "axis_3"
    }
    assert answer("check experiment.toml")[0] == 0
    assert answer("identify experiment.toml -m ls")[0] == 0
    code, said = answer(AUDIT)
    assert code == 4 and "1 error, 0 warnings" in said
    assert "Standstill: axis_1, axis_2, axis_4, axis_5, axis_6" in said and "freeze" in said


def test_a_log_at_ten_hertz(tmp_path, answer):
    t = np.arange(600) / 10
    write(tmp_path, t, moving(t))
    code, said = answer(INIT)
    assert code == 0 and "10 Hz" in said
    file = tomllib.loads((tmp_path / "experiment.toml").read_text())
    assert file["recording"]["units"]["t"] == "s"  # not milliseconds, which are 10 kHz
    assert file["validation"]["folds"] == 0  # blocks of 300 samples are 30 s
    code, said = answer("check experiment.toml")
    assert code == 0 and "The rate of 10 Hz is low for this motion" in said
    assert answer("identify experiment.toml -m ls,iv-full-rate")[0] == 0
    text = (tmp_path / "experiment.toml").read_text().replace("folds = 0", "folds = 5")
    (tmp_path / "experiment.toml").write_text(text)
    code, said = answer("check experiment.toml")
    assert code == 0 and "Nothing is held out: the motion of" in said and "Set folds = 0" in said
    code, said = answer("identify experiment.toml -m ls")
    assert code == 0 and "Nothing could be held out: the motion of" in said


def test_a_clock_that_changes_its_rate(tmp_path, answer):
    t = np.r_[np.arange(1000) / 100, 10.0 + np.arange(2000) / 200]
    write(tmp_path, t, moving(t))
    sentence = "The clock changes its rate at sample 1000 (t = 10 s)"
    code, said = answer(AUDIT)
    assert code == 4 and sentence in said and "part = [0, 10] and part = [10, 20]" in said
    assert answer(INIT)[0] == 0
    code, said = answer("check experiment.toml")
    assert code == 0 and sentence in said and "warning" in said


def test_a_file_in_a_folder_that_does_not_exist_yet(tmp_path, answer):
    t = np.arange(2000) / 100
    write(tmp_path, t, moving(t))
    code, said = answer(f"{INIT} --out new/folder/experiment.toml")
    assert code == 0 and "to do" not in said
    assert answer("check new/folder/experiment.toml")[0] == 0
