"""Signals and findings of a project: as its file describes them, also where that is wrong."""

import json
import os
import time

import numpy as np
import pytest

from pivident.app.studio.looks import Looks, look, look_key, robot_picture
from pivident.app.studio.signals import SIGNALS, window
from pivident.app.studio.tasks import Tasks
from pivident.experiment.experiment import load_experiment
from pivident.judgement.report.motion import MAX_POSITIONS
from tests.planar_log import EXPERIMENT, HEADER, planar_log, write_experiment


def described(folder):
    """Recordings, joints and channels of a folder of signals."""
    return json.loads((folder / SIGNALS).read_text("utf-8"))


def looked(experiment, folder):
    """The signals' description and the check of a look."""
    look(experiment, folder, lambda line: None)
    check = json.loads((folder / "findings" / "check.json").read_text("utf-8"))
    return described(folder / "signals"), check


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    folder = tmp_path_factory.mktemp("planar")
    experiment = write_experiment(folder)
    return experiment, folder / "look", looked(experiment, folder / "look")


def test_signals_are_those_of_the_recording(planar):
    experiment, folder, (about, _) = planar
    recording = load_experiment(experiment).recordings()[0]
    assert [joint["name"] for joint in about["joints"]] == list(recording.joint_names)
    assert [c["name"] for c in about["channels"]] == ["q", "tau", "q_ref"]
    for channel, values in (("q", recording.q), ("tau", recording.tau)):
        found = window(folder / "signals", 0, channel, [0, 1], 1.0, 1.5)
        start = round(found["t"][0][0] * recording.rate)
        for j, line in enumerate(found["y"]):
            expected = values[start : start + len(line), j]
            np.testing.assert_allclose(line, expected, rtol=1e-5, atol=1e-5)
    assert about["recordings"][0]["rate"] == pytest.approx(1000.0)


def test_the_arm_moves_as_it_was_logged(planar):
    _, folder, _ = planar
    motion = json.loads((folder / "signals" / "motion.json").read_text("utf-8"))
    assert len(motion["joints"]) == 2
    assert np.max(np.abs(motion["recordings"][0]["q"])) < 3.0  # radians, not degrees


def test_findings_are_those_of_check_and_audit(planar):
    _, folder, (_, check) = planar
    assert check["severity"] in ("ok", "note", "warning")
    assert check["plan"]["robot"] == "planar 2R"
    audit = json.loads((folder / "findings" / "audit.json").read_text("utf-8"))
    assert [a["name"] for a in audit["audits"]] == ["log.csv"]
    page = (folder / "findings" / "audit.html").read_text("utf-8")
    assert "log.csv" in page


def test_remarks_have_places(tmp_path):
    text = EXPERIMENT.replace('tau = "N m"', 'tau = "kN m"').replace("[identify]", "[identity]")
    _, check = looked(write_experiment(tmp_path, text), tmp_path / "look")
    places = {remark["kind"]: remark["place"] for remark in check["remarks"]}
    assert places["unknown key"] == ["identity"]
    assert places["gain"][:3] == ["recording", 0, "units"] or "controller" in places["gain"]


def test_a_log_with_holes(tmp_path):
    """NaN and a gap are shown as they are; the check says that they are left out."""
    rows = planar_log().copy()
    rows[100:110, 1] = np.nan
    rows = np.delete(rows, np.s_[3000:3500], axis=0)
    experiment = write_experiment(tmp_path)
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=HEADER, comments="")
    about, check = looked(experiment, tmp_path / "look")
    (recording,) = about["recordings"]
    assert recording["missing"]["q"] == [10, 0]
    np.testing.assert_allclose(recording["gaps"], [[2.999, 3.5]])
    values = window(tmp_path / "look" / "signals", 0, "q", [0], 0.09, 0.12)["y"][0]
    assert values.count(None) == 10
    assert not check["refused"]
    said = " ".join(r["message"] + r["next_step"] for r in check["remarks"])
    assert "left out of the equations" in said and "2 stretch(es) between gaps are used" in said


def test_what_is_excluded(tmp_path):
    text = EXPERIMENT.replace("[controller]", "part = [1.0, 6.0]\n[controller]")
    about, _ = looked(write_experiment(tmp_path, text), tmp_path / "look")
    np.testing.assert_allclose(about["recordings"][0]["excluded"], [[0.0, 1.0], [6.0, 7.999]])
    assert about["recordings"][0]["samples"] == 8000


@pytest.mark.parametrize(
    ("old", "new", "note"),
    [('"q2"]', '"q9"]', "q9"), ("recording]\n", "recording]\nrates = 3\n", ""),
     ('robot = "planar_2r"', "robot = 3", "cannot be read yet")],
)  # fmt: skip
def test_bare_columns_where_the_description_does_not_hold(tmp_path, old, new, note):
    experiment = write_experiment(tmp_path, EXPERIMENT.replace(old, new, 1))
    about, check = looked(experiment, tmp_path / "look")
    assert check["remarks"]
    if not note:  # an unknown key alone leaves the channels known
        assert [c["name"] for c in about["channels"]] == ["q", "tau", "q_ref"]
        return
    assert [c["title"] for c in about["channels"]] == HEADER.split(",")
    assert note in about["recordings"][0]["note"]
    second = window(tmp_path / "look" / "signals", 0, about["channels"][1]["name"], [0], None, 0.1)
    assert second["y"][0][0] == pytest.approx(planar_log()[0, 1], rel=1e-5)


@pytest.mark.parametrize("text", ["robot = ", 'robot = "planar_2r"\n', "", "[[recording]]\n" * 3])
def test_bad_files_are_messages(tmp_path, text):
    about, check = looked(write_experiment(tmp_path, text), tmp_path / "look")
    assert about.get("error") or about["recordings"] == []
    assert check.get("error") or check["remarks"]


def test_a_log_that_is_not_there(tmp_path):
    experiment = write_experiment(tmp_path)
    (tmp_path / "log.csv").unlink()
    about, _ = looked(experiment, tmp_path / "look")
    assert about["recordings"][0]["samples"] == 0 and "log.csv" in about["recordings"][0]["note"]


def test_the_key_follows_text_and_files(tmp_path):
    experiment = write_experiment(tmp_path)
    keys = [look_key(experiment)]
    os.utime(tmp_path / "log.csv", ns=(1, 1))
    keys.append(look_key(experiment))
    experiment.write_text(EXPERIMENT + "# a word\n", encoding="utf-8")
    keys.append(look_key(experiment))
    (tmp_path / "notes.txt").write_text("not an input", encoding="utf-8")
    assert len(set(keys)) == 3 and look_key(experiment) == keys[-1]
    experiment.unlink()
    assert look_key(experiment) not in keys


def test_the_arm_before_there_is_a_log(tmp_path):
    picture = robot_picture("planar_2r", tmp_path)
    q = np.array(picture["recordings"][0]["q"])
    assert q.shape[0] == 2 and q.size < MAX_POSITIONS
    assert ((np.ptp(q, axis=1) > 0.5) & (np.abs(q).max(axis=1) < np.pi)).all()
    assert "error" in robot_picture("no_such_arm", tmp_path)
    assert "error" in robot_picture("no_such_arm.urdf", tmp_path)


@pytest.fixture(scope="module")
def looks():
    tasks = Tasks()
    yield Looks(tasks)
    tasks.close()


def wait(looks, project, stage="findings", seconds=240.0):
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        state = looks.state(project)
        if state[stage] in ("ready", "failed"):
            return state
        time.sleep(0.01)
    raise AssertionError(f"still {looks.state(project)}")


def test_looks_follow_the_file(looks, tmp_path):
    experiment = write_experiment(tmp_path)
    assert looks.state(tmp_path)["signals"] == "none"
    first = looks.want(tmp_path)
    assert looks.want(tmp_path) == first  # the one that runs goes on
    state = wait(looks, tmp_path)
    assert (state["signals"], state["findings"], state["error"]) == ("ready", "ready", "")
    assert described(looks.folder(tmp_path) / "signals")["recordings"][0]["samples"] == 8000

    experiment.write_text(EXPERIMENT + "\n[validation]\nfolds = 3\n", encoding="utf-8")
    assert looks.state(tmp_path)["signals"] == "none"
    assert looks.want(tmp_path) != first
    wait(looks, tmp_path)
    old, new = (tmp_path / ".pivident-studio" / "looks" / key / "signals" / "000-q.npy"
                for key in (first, looks.want(tmp_path)))  # fmt: skip
    assert old.samefile(new)  # nothing that the signals depend on has changed


def test_a_stale_look_leaves_nothing_behind(looks, tmp_path):
    experiment = write_experiment(tmp_path)
    first = looks.want(tmp_path)
    place = tmp_path / ".pivident-studio" / "looks"
    while not any((place / first).glob(".pivident-*")):
        time.sleep(0.001)
    experiment.write_text(EXPERIMENT.replace('"N m"', '"mN m"'), encoding="utf-8")
    second = looks.want(tmp_path)
    left = sorted(p.name for p in (place / first).rglob("*")) if (place / first).exists() else []
    assert not left or (place / first / "signals" / "signals.json").is_file()
    assert not any((place / first).glob(".pivident-*"))
    assert wait(looks, tmp_path)["key"] == second
    for k in range(3):  # older ones go
        experiment.write_text(EXPERIMENT + f"# {k}\n", encoding="utf-8")
        looks.want(tmp_path)
        wait(looks, tmp_path)
    assert len(list(place.iterdir())) <= 2
