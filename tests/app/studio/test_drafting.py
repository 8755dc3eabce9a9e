"""A draft for a project: the text of `pivident init`, its questions, or why there is none."""

import json

import numpy as np

from pivident.app.studio.drafting import DRAFT, draft
from pivident.app.studio.projects import HIDDEN
from pivident.experiment.init.draft import draft_experiment
from tests.planar_log import HEADER, planar_log, write_log


def drafted(project, *arguments):
    lines = []
    draft(project, *arguments, lines.append)
    content = json.loads((project / HIDDEN / DRAFT).read_text("utf-8"))
    return content, lines


def test_the_draft_is_that_of_init(tmp_path):
    write_log(tmp_path / "log.csv")
    content, lines = drafted(tmp_path, ["log.csv"], "planar_2r", {}, [], [])
    expected = draft_experiment(
        [tmp_path / "log.csv"], "planar_2r", out=tmp_path / "experiment.toml"
    )
    assert content["text"] == expected.text and 'files = "log.csv"' in content["text"]
    assert content["explained"] == expected.explained and content["error"] == ""
    assert len(content["assumptions"]) == len(expected.assumptions)
    assert "reading the log" in lines
    assert not (tmp_path / "experiment.toml").exists()


def test_questions_and_their_answers(tmp_path):
    """A log without time stamps."""
    header = HEADER.removeprefix("time,")
    np.savetxt(tmp_path / "log.csv", planar_log()[:, 1:], delimiter=",", header=header, comments="")
    content, _ = drafted(tmp_path, ["log.csv"], "planar_2r", {}, [], [])
    (question,) = content["questions"]
    assert question["about"] == "rate" and "Hz" in question["text"]
    assert (question["choices"], question["numbers"], question["optional"]) == ([], 1, False)
    answers = {"rate": "1000"}
    answered, _ = drafted(tmp_path, ["log.csv"], "planar_2r", answers, [], [])
    assert "rate = 1000.0" in answered["text"] and answered["questions"] == []


def test_why_there_is_no_draft(tmp_path):
    np.savetxt(tmp_path / "log.csv", planar_log()[:500], delimiter=",", header=HEADER, comments="")
    for logs, robot, words in (
        (["log.csv"], "planar_9r", "planar_2r"),
        (["no.csv"], "planar_2r", "no.csv"),
        ([], "planar_2r", "no log is given"),
        (["log.csv"], None, "robot"),
    ):
        content, _ = drafted(tmp_path, logs, robot, {}, [], [])
        assert words in content["error"] and content["text"] == ""


def test_a_log_that_cannot_be_read_does_not_stand_in_the_way(tmp_path):
    write_log(tmp_path / "log.csv")
    (tmp_path / "broken.npz").write_bytes(b"not an archive")
    content, _ = drafted(tmp_path, ["broken.npz", "log.csv"], "planar_2r", {}, [], [])
    alone, _ = drafted(tmp_path, ["log.csv"], "planar_2r", {}, [], [])
    assert content["text"] == alone["text"] != "" and content["error"] == ""
    assert list(content["left_out"]) == ["broken.npz"] and content["troubles"] == []
    content, _ = drafted(tmp_path, ["broken.npz"], "planar_2r", {}, [], [])
    assert "broken.npz" in content["error"] and content["text"] == ""
