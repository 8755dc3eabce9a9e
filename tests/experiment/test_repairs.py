"""Repairs as keys of a file: every edit, as a file may say it, and what contradicts it."""

import json

import numpy as np
import pytest

from pivident.experiment.explained import plain_form
from pivident.experiment.repairs import FileContent, edits_of
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.finding import FindingKind, Topic, serious
from pivident.foundation.text.repair import (
    CHANGES,
    Edit,
    Gain,
    LeftOut,
    Multiplied,
    NotRead,
    Renamed,
    Reordered,
    Repair,
    Respelt,
    Retimed,
    Reversed,
    Scaled,
    Shifted,
    setting,
)

TABLE = ("recording", 0)
JOINTS = ("shoulder", "elbow")


def content(**recording):
    columns = {"t": "time", "q": ["q1", "q2"], "tau": ["u1", "u2"], "dq": ["v1", "v2"]}
    entry = {"files": "log.csv", "columns": columns, "units": {"tau": "N m"}} | recording
    controller = {"type": "pd", "kp": [10.0, 20.0], "kd": 3.0}
    robot = {"model": "arm.urdf"}
    return plain_form({"robot": robot, "recording": [entry], "controller": controller})


def edits(*changes, joints=JOINTS, **recording):
    repair = Repair(changes).below(TABLE)
    again = Repair.of_json(json.loads(json.dumps(repair.as_json())))
    assert again == repair  # as data it survives a file
    return edits_of(again, FileContent(content(**recording), joints))


DONE = {
    "a key": (Edit(("recording", "delay"), 0.01), [("delay", 0.01)], "Write delay = 0.01."),
    "a key less": (Edit(("recording", "files")), [("files", None)], "Remove files."),
    "a side for all": (
        Edit(("recording", "side", "tau"), "motor"), [("side", {"q": "joint", "tau": "motor"})],
        'Write tau = "motor".',
    ),
    "a key renamed": (
        Renamed(("recording", "files"), "file"), [("files", None), ("file", "log.csv")],
        "Call it file.",
    ),
    "a name": (
        Respelt(("recording", "columns", "tau"), "u2", "u_2"),
        [("columns", "tau", ["u1", "u_2"])], "Write u_2.",
    ),
    "a sign": (
        Reversed(channel="tau", joints=("elbow",)), [("units", "tau", ["N m", -1.0])],
        "Reverse the sign of the torque of elbow.",
    ),
    "all signs of a joint": (
        Reversed(channel="", joints=("shoulder",)),
        [("units", "q", [-1.0, 1.0]), ("units", "tau", [-1.0, "N m"]),
         ("units", "dq", [-1.0, 1.0])],
        "Reverse the signs of all channels of shoulder.",
    ),
    "a factor": (
        Multiplied(channel="tau", factors=(("elbow", 0.5),)), [("units", "tau", ["N m", 0.5])],
        "Multiply the torque by 0.5 for elbow.",
    ),
    "a clock": (
        Retimed(factor=2.0), [("units", "t", 2.0)], "Take 2 s for a unit of the stamps.",
    ),
    "an order of all": (
        Reordered(channel="", order=(1, 0)),
        [("columns", c, [f"{x}2", f"{x}1"]) for c, x in (("q", "q"), ("tau", "u"), ("dq", "v"))],
        "Name the columns of q as q2, q1 and of tau as u2, u1 and of dq as v2, v1.",
    ),
    "an order": (
        Reordered(channel="tau", order=(1, 0)), [("columns", "tau", ["u2", "u1"])],
        "Name the columns of tau as u2, u1.",
    ),
    "a zero": (
        Shifted(offsets=(("elbow", 1.5708),)), [("position_offset", [0.0, 1.5708])],
        "Move the zero of elbow by 1.5708 rad.",
    ),
    "a channel less": (
        NotRead(channel="dq"), [("columns", "dq", None)],
        "Do not read dq: the derivative of the position takes its place.",
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", DONE)
def test_an_edit_says_what_the_file_needs(name):
    change, expected, words = DONE[name]
    done = edits(change)
    assert done.edits == tuple(((*TABLE, *place), value) for *place, value in expected)
    assert done.words == words


def test_gains_of_the_controller_are_multiplied():
    done = edits(Scaled(("controller", "kp"), (("elbow", 1.5), ("shoulder", 0.5))))
    assert done.edits == ((("controller", "kp"), [5.0, 30.0]),)
    done = edits(Scaled(("controller", "kd"), (("elbow", 2.0),)))
    assert done.edits == ((("controller", "kd"), [3.0, 6.0]),)


def test_gains_stand_beside_the_units_of_commands():
    done = edits(Gain(gains=(("elbow", 12.5),)), units={"tau": "A"})
    assert done.edits == (((*TABLE, "units", "tau"), ["A", {"unit": "A", "gain": 12.5}]),)


def test_a_joint_is_left_out_with_its_columns():
    done = edits(LeftOut(at=(("shoulder", 0.3),)))
    assert dict(done.edits) == {
        ("robot", "joints"): ["elbow"],
        ("robot", "frozen", "shoulder"): 0.3,
        (*TABLE, "columns", "q"): ["q2"],
        (*TABLE, "columns", "tau"): ["u2"],
        (*TABLE, "columns", "dq"): ["v2"],
    }


def test_every_kind_of_edit_is_tried_here():
    tried = {type(change).__name__ for change, _, _ in DONE.values()}
    assert tried | {"Scaled", "Gain", "LeftOut"} == set(CHANGES)


CONTRADICTIONS = {
    "a key that is not there": (Edit(("recording", "rate")), "rate is not in the file"),
    "no such joint": (Reversed(channel="tau", joints=("wrist",)), "has no joint 'wrist'"),
    "both names": (Renamed(("recording", "files"), "columns"), "columns is there as well"),
    "another name": (Respelt(("recording", "files"), "b", "c"), "does not name 'b'"),
    "too few columns": (Reordered(channel="tau", order=(1, 0, 2)), "2 columns, not 3"),
    "no columns": (Reordered(channel="q_ref", order=(1, 0)), "not listed by name"),
    "no numbers": (Scaled(("controller", "ki"), (("elbow", 2.0),)), "no number for each joint"),
    "no command": (Gain(gains=(("elbow", 2.0),)), "is no command"),
    "no channel": (NotRead(channel="q_ref"), "has no columns"),
    "nothing left": (LeftOut(at=(("elbow", 0.0), ("shoulder", 0.0))), "no joint would be left"),
}


@pytest.mark.parametrize("name", CONTRADICTIONS)
def test_what_contradicts_the_file_is_refused(name):
    change, reason = CONTRADICTIONS[name]
    with pytest.raises(ExperimentError, match=reason) as refused:
        edits(change)
    assert refused.value.advice


def test_a_command_has_its_sign_in_the_drive_gain():
    with pytest.raises(ExperimentError, match="drive_gain under"):
        edits(Reversed(channel="tau", joints=("elbow",)), units={"tau": "A"})
    done = edits(
        Reversed(channel="tau", joints=("elbow",)), units={"tau": {"unit": "A", "gain": 2.0}}
    )
    assert done.edits[0][1] == [{"unit": "A", "gain": 2.0}, {"unit": "A", "gain": -2.0}]


def test_a_repair_belongs_to_the_recording_of_its_finding():
    repair = setting("delay", value=0.01).below(("validation", "recording", 2))
    assert repair.edits == (Edit(("validation", "recording", 2, "delay"), 0.01),)
    gravity = Repair((Edit(("robot", "gravity"), [0.0, 0.0, -9.81]),))
    assert gravity.below(TABLE) == gravity


def test_what_several_joints_share_is_one_repair():
    """Findings that are merged keep one repair for all of them."""
    kind = FindingKind(Topic("power"), "sign")
    findings = [
        kind.finding("error", f"{joint} is reversed.", joint, "Reverse it.",
                     repairs=[Repair((Reversed(channel="tau", joints=(joint,)),))])
        for joint in JOINTS
    ]  # fmt: skip
    (finding,) = serious(findings)
    assert finding.repairs == (Repair((Reversed(channel="tau", joints=JOINTS),)),)


def test_other_repairs_are_not_joined():
    one, other = setting("delay", value=0.1), setting("delay", value=0.2)
    assert one.joined(one) == one and one.joined(other) is None


@pytest.mark.parametrize(
    "stored",
    [
        {},
        {"words": "", "edits": [{"edit": "system", "place": []}]},
        {"words": "", "edits": [{"edit": "Edit", "place": [], "value": 1, "more": 2}]},
        {"words": "", "edits": "no"},
        {"words": "", "edits": [3]},
    ],
)
def test_what_is_no_repair_is_refused(stored):
    with pytest.raises(ValueError, match="no repair"):
        Repair.of_json(stored)


def test_numbers_of_numpy_are_plain_in_json():
    repair = Repair((Shifted(offsets=(("elbow", float(np.float64(0.5))),)),))
    assert json.loads(json.dumps(repair.as_json()))["edits"][0]["offsets"] == [["elbow", 0.5]]
