"""What somebody says of log and machine: its rate, its joints, gravity, bodies on its links."""

import numpy as np
import pytest

from pivident.experiment.experiment import load_experiment
from pivident.experiment.init.assumption import DraftError
from pivident.experiment.init.draft import draft_experiment
from pivident.experiment.init.kept_joints import given_body, given_gravity
from pivident.foundation.errors import PividentError
from pivident.foundation.text.toml import parse_toml
from pivident.robot.gallery import load_robot
from tests.planar_log import planar_log


def log(folder, header, *columns):
    path = folder / "log.csv"
    np.savetxt(path, np.column_stack(columns), delimiter=",", header=header, comments="")
    return path


@pytest.fixture(scope="module")
def planar(tmp_path_factory):
    """Time, positions (rad) and torques of a run of the planar arm."""
    rows = planar_log()
    return rows[:, 0], np.radians(rows[:, 1:3]), rows[:, 5:7]


@pytest.mark.parametrize(
    ("text", "body"),
    [
        ("flange 2.75 kg", {"link": "flange", "mass": 2.75}),
        ("wrist_3 800 g at 0, 0, 0.05",
         {"link": "wrist_3", "mass": 0.8, "center_of_mass": [0.0, 0.0, 0.05]}),
        ("link 3 -0.67", {"link": "link 3", "mass": -0.67}),
    ],
)  # fmt: skip
def test_a_body_in_words(text, body):
    assert given_body(text) == body


@pytest.mark.parametrize(
    "text",
    [
        *("2.75 kg", "flange", "flange 2 lb", "flange 2 kg at 0,1"),
        *("flange 1e999 kg", "flange 2 kg at 0,0,1e999"),
    ],
)
def test_words_that_say_no_body_say_how(text):
    with pytest.raises(DraftError, match=r"flange 2\.75 kg|three numbers"):
        given_body(text)


def test_gravity_in_words():
    assert given_gravity("-y") == "-y" and given_gravity("none") == "none"
    assert given_gravity("0, 0,-9.81") == [0.0, 0.0, -9.81]
    for text in ("down", "1,2"):
        with pytest.raises(DraftError, match="--gravity"):
            given_gravity(text)


def test_what_is_given_stands_in_the_file_and_is_used(tmp_path, planar):
    t, q, tau = planar
    path = log(tmp_path, "t,q,tau", t, q[:, 1], tau[:, 1])
    out = tmp_path / "experiment.toml"
    draft = draft_experiment(
        [path], "planar_2r", out=out, joints=["elbow"], rate=1000.0, gravity="+x",
        bodies=["flange 2.75 kg"],
    )  # fmt: skip
    said = parse_toml(draft.text)
    assert said["robot"]["joints"] == ["elbow"] and said["robot"]["gravity"] == "+x"
    assert said["robot"]["bodies"] == [{"link": "flange", "mass": 2.75}]
    assert said["recording"]["rate"] == 1000.0 and said["recording"]["columns"]["q"] == ["q"]
    out.write_text(draft.text, encoding="utf-8")
    robot = load_experiment(out).robot
    assert robot.joint_names == ("elbow",) and robot.gravity[0] > 9.0
    alone = load_robot("planar_2r").links[1].inertia[9]
    assert robot.links[0].inertia[9] == pytest.approx(alone + 2.75)


def test_a_joint_of_a_table_that_the_log_lacks_is_frozen(tmp_path, planar):
    t, q, tau = planar
    path = log(tmp_path, "t,q_1,q_2,tau_1", t, q, tau[:, 0])
    said = parse_toml(draft_experiment([path], "planar_2r", out=tmp_path / "e.toml").text)
    assert said["robot"]["joints"] == ["shoulder"]
    assert said["robot"]["frozen"]["elbow"] == pytest.approx(np.median(q[:, 1]), abs=0.2)


def test_one_column_without_a_number_is_only_assumed_to_be_the_first_of_several(tmp_path, planar):
    t, q, tau = planar
    path = log(tmp_path, "t,q,tau", t, q[:, 0], tau[:, 0])
    draft = draft_experiment([path], "planar_2r", out=tmp_path / "e.toml")
    (line,) = (a for a in draft.assumptions if (a.table, a.key) == ("robot", "joints"))
    assert line.value == ["shoulder"] and line.sure == "assumed"
    assert "one position and no number: the first joint" in line.seen


def test_a_rate_that_the_stamps_contradict_is_refused(tmp_path, planar):
    t, q, tau = planar
    path = log(tmp_path, "t,q1,q2,tau1,tau2", t, q, tau)
    with pytest.raises(PividentError, match="given as 300 Hz, but the time stamps advance at 1000"):
        draft_experiment([path], "planar_2r", out=tmp_path / "e.toml", rate=300.0)


def test_a_rate_stands_for_stamps_that_are_not_there(tmp_path, planar):
    _, q, tau = planar
    path = log(tmp_path, "q1,q2,tau1,tau2", q, tau)
    draft = draft_experiment([path], "planar_2r", out=tmp_path / "e.toml", rate=1000.0)
    (line,) = (a for a in draft.assumptions if a.key == "rate")
    assert (line.value, line.sure, line.question) == (1000.0, "certain", None)


@pytest.mark.parametrize("name", ["arm.urdf.xacro", "arm.xacro"])
def test_a_xacro_says_how_it_is_expanded(tmp_path, name):
    with pytest.raises(PividentError, match=rf"xacro {name} > arm.urdf"):
        load_robot(name)
    with pytest.raises(PividentError, match="without ROS: pip install xacrodoc"):
        draft_experiment(["log.csv"], name, out=tmp_path / "e.toml")
