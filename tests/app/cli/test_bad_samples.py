"""Logs with bad rows go from bare file to result; every command names what is left out."""

import json
from pathlib import Path

import numpy as np
import pytest

from pivident.app.cli.app import main
from tests.planar_log import HEADER, planar_log, planar_truth
from tests.questions.material import URDF

ROWS = 8000


def zeros(log):
    log[[900, 2500, 4111], 1:] = 0.0
    return log, "is zero at every joint"


def huge(log):
    log[2000, 1] = 1e200
    return log, "q of {first} is no measurement at sample 2000"


def huge_torque(log):
    log[2000, 6] = -1e200
    return log, "tau of {second} is no measurement at sample 2000"


def twice(log):
    return np.insert(log, [1000, 2000, 5000], log[[999, 1999, 4999]], axis=0), "logged twice"


def frozen(log):
    log[2001:2060, 1] = log[2000, 1]
    return log, "q of {first} keeps its value while its joint moves on"


def held(log):
    again = np.random.default_rng(3).random(ROWS) < 0.22
    rows = np.maximum.accumulate(np.where(again, 0, np.arange(ROWS)))
    log[:, 1:] = log[rows, 1:]
    return log, "repeats the one before while the arm moves"


def slower(log):
    log[:, 1:] = log[np.arange(ROWS) // 10 * 10, 1:]
    return log, "only one in 10 has new values"


def chunk_twice(log):
    log[4000:, 1:] = np.r_[log[3600:4000, 1:], log[4000:-400, 1:]]
    return log, "jump"


def paused(log):
    return np.delete(log, np.s_[3000:3600], axis=0), "stretch"


FAULTS = (zeros, huge, huge_torque, twice, frozen, held, slower, chunk_twice, paused)


@pytest.fixture
def written(tmp_path, monkeypatch):
    """Writes a log with a fault, and the arm beside it; returns the words that name the fault."""
    monkeypatch.chdir(tmp_path)
    (tmp_path / "arm.urdf").write_text(URDF)

    def write(fault):
        log, words = fault(planar_log().copy())
        np.savetxt("log.csv", log, fmt="%.9g", delimiter=",", header=HEADER, comments="")
        return words.format(first="shoulder", second="elbow")

    return write


@pytest.mark.parametrize("fault", FAULTS)
def test_a_bare_log_ends_at_a_result(written, capsys, fault):
    words = written(fault)
    assert main(["init", "log.csv", "--robot", "planar_2r", "--yes"]) == 0
    assert words in capsys.readouterr().out
    assert main(["check", "experiment.toml"]) in (0, 4)
    out = capsys.readouterr().out
    assert words in out and "would stop" not in out
    assert main(["audit", "log.csv", "--robot", "planar_2r"]) in (0, 4)
    assert words in capsys.readouterr().out
    assert main(["identify", "experiment.toml", "-m", "ls", "--folds", "0"]) == 0
    said = capsys.readouterr()
    assert words in said.err
    (path,) = Path("experiment-results").rglob("identification.json")
    made = json.loads(path.read_text(encoding="utf-8"))
    found = {p["name"]: (p["value"], p["std"]) for p in made["parameters"]}
    truth = planar_truth()
    for name in ("zz1r", "zz2", "mx2", "fv1", "fv2"):
        value, std = found[name]
        assert abs(value - truth[name]) < 6.0 * std + 0.02 * abs(truth[name]), name


def test_a_slower_source_has_its_own_rate(written, capsys):
    written(slower)
    assert main(["init", "log.csv", "--robot", "planar_2r", "--yes"]) == 0
    capsys.readouterr()
    assert main(["check", "experiment.toml"]) in (0, 4)
    assert "800 samples at 100 Hz" in capsys.readouterr().out


def test_a_median_that_some_methods_do_not_have_is_named(written, capsys):
    written(zeros)
    assert main(["init", "log.csv", "--robot", "planar_2r", "--yes"]) == 0
    file = Path("experiment.toml")
    text = file.read_text(encoding="utf-8")
    file.write_text(text.replace("[identify]\n", "[identify]\nbandpass = {median = 3}\n"))
    capsys.readouterr()
    main(["check", "experiment.toml"])
    assert "acts on ls only" in capsys.readouterr().out
