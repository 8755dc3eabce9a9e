import re
from dataclasses import replace

import numpy as np
import pytest
import yaml
from rosbags.interfaces import Nodetype
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML
from scipy.interpolate import BPoly

from pivident.robot.description import Joint, Robot
from pivident.studies.excitation.robot_programs import (
    LEAD_IN,
    UR_RATE,
    robot_programs,
    unwritten_programs,
)
from tests.studies.excitation.designs import made_design, named

#: Names that would end a text or a comment, begin a command, or be one.
HOSTILE = (
    'a"]\n; PTP {A1 0}',
    "b\\\" # '; halt()",
    "\u2028END\x85! stop",
    "</script><b>&amp;",
    "{{ 7 * 7 }}\r\nmovej([0,0,0,0,0,0])",
    "\u00e9\U0001f600" + "x" * 500,
)


def program(design, ending):
    """The first program of an ending; the slow ones are named ``_slow.yaml`` and so on."""
    return next(p.text for p in robot_programs(design) if p.name.endswith(ending))


def test_slow_programs_pass_the_same_path():
    """At a quarter of the speed: times longer by 4, speeds by 1/4, accelerations by 1/16."""
    design = made_design("staubli_tx40", "splines")
    fast, slow = (yaml.safe_load(program(design, e))["points"] for e in ("ry.yaml", "_slow.yaml"))
    assert len(fast) == len(slow)
    for key, factor in (("positions", 1.0), ("velocities", 0.25), ("accelerations", 0.0625)):
        one, other = (np.array([p[key] for p in points]) for points in (fast, slow))
        np.testing.assert_allclose(other, factor * one, atol=2e-9)
    one, other = (
        np.array([p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in x])
        for x in (fast, slow)
    )
    np.testing.assert_allclose(other - LEAD_IN, 4.0 * (one - LEAD_IN), atol=1e-8)
    assert "25 % OF THE DESIGNED SPEED" in program(design, "_slow.yaml")
    stream = [s for s in statements(program(design, "_slow.script")) if s[0] == "servoj"]
    assert {rest for _, _, rest in stream} == {"0, 0, 0.032, 0.05, 300"}
    moves = statements(program(made_design("staubli_tx40", "postures"), "_slow.script"))
    timed = statements(program(made_design("staubli_tx40", "postures"), "motion.script"))
    for (_, _, late), (name, _, soon) in zip(moves[2:], timed[2:], strict=True):
        factor = 4.0 if name == "movej" else 1.0
        assert float(late.removeprefix("t=")) == pytest.approx(
            factor * float(soon.removeprefix("t=")), abs=3e-4
        )


def test_the_interpolant_of_ros_keeps_the_jerk_of_the_moves():
    """The quintic through the points of a move is the move, between its breakpoints."""
    design = made_design("staubli_tx40", "postures")
    points = yaml.safe_load(program(design, "ry.yaml"))["points"]
    t = np.array(
        [p["time_from_start"]["sec"] + 1e-9 * p["time_from_start"]["nanosec"] for p in points]
    )
    q, dq, ddq = (
        np.array([p[n] for p in points]) for n in ("positions", "velocities", "accelerations")
    )
    spline = BPoly.from_derivatives(t - LEAD_IN, np.stack([q, dq, ddq], axis=1))
    fine = np.linspace(0.0, design.motion.duration, 20_001)
    expected = np.abs(design.motion.at(fine)[3]).max(axis=0)
    found = np.abs(spline(fine, nu=3)).max(axis=0)
    np.testing.assert_allclose(found, expected, rtol=0.02)


def unchecked(design, *names):
    """Other names of joints, past the checks of a `Robot`."""
    printable = [f"joint {k}" for k in range(len(names))]
    changed = named(design, *printable)
    by_name = dict(zip(printable, names, strict=True))
    joints = []
    for joint in changed.robot.joints:
        own = replace(joint)
        object.__setattr__(own, "name", by_name[joint.name])
        joints.append(own)
    robot = replace(changed.robot)
    object.__setattr__(robot, "joints", tuple(joints))
    object.__setattr__(robot, "name", names[0])
    assert isinstance(robot, Robot) and isinstance(joints[0], Joint)
    limits = tuple(replace(use, joint=by_name[use.joint]) for use in changed.limits)
    return replace(changed, robot=robot, limits=limits)


# ROS


@pytest.mark.parametrize("robot", ["planar_2r", "staubli_tx40"])
@pytest.mark.parametrize("kind", ["fourier", "splines", "postures"])
def test_ros_points_are_the_motion(robot, kind):
    design = made_design(robot, kind)
    message = yaml.safe_load(program(design, ".yaml"))
    assert set(message) == {"header", "joint_names", "points"}
    assert message["header"] == {"stamp": {"sec": 0, "nanosec": 0}, "frame_id": ""}
    assert message["joint_names"] == list(design.robot.joint_names)
    times = [p["time_from_start"] for p in message["points"]]
    assert all(type(t["sec"]) is int and 0 <= t["nanosec"] < 10**9 for t in times)
    t = np.array([x["sec"] + 1e-9 * x["nanosec"] for x in times]) - LEAD_IN
    assert (np.diff(t) > 0.0).all() and abs(t[0]) < 1e-9
    assert t[-1] == pytest.approx(design.motion.duration, abs=1e-9)
    expected = design.motion.at(t)
    for k, name in enumerate(("positions", "velocities", "accelerations")):
        values = np.array([p[name] for p in message["points"]])
        assert values.dtype == float  # none was read as a text
        np.testing.assert_allclose(values, expected[k], atol=5e-7)  # times are whole ns
        if k:
            assert not values[[0, -1]].any()  # at rest, exactly
    assert all(p["effort"] == [] for p in message["points"])


def message_of(store, name, values):
    """A message of a type from plain values, every field of the definition and no other."""
    fields = dict(store.get_msgdef(name).fields)
    assert set(fields) == set(values), name
    made = {}
    for key, (kind, own) in fields.items():
        value = values[key]
        if kind == Nodetype.NAME:
            value = message_of(store, own, value)
        elif kind == Nodetype.SEQUENCE and own[0][0] == Nodetype.NAME:
            value = [message_of(store, own[0][1], x) for x in value]
        elif kind == Nodetype.SEQUENCE and own[0][1][0] != "string":
            value = np.array(value, dtype=own[0][1][0])
        made[key] = value
    return store.types[name](**made)


@pytest.mark.parametrize("kind", ["fourier", "postures"])
def test_ros_reads_it_as_its_message(kind):
    """By the message definitions of ROS 2, through their serialisation and back."""
    design = made_design("staubli_tx40", kind)
    store = get_typestore(Stores.ROS2_HUMBLE)
    name = "trajectory_msgs/msg/JointTrajectory"
    message = message_of(store, name, yaml.safe_load(program(design, ".yaml")))
    back = store.deserialize_cdr(store.serialize_cdr(message, name), name)
    assert back.joint_names == list(design.robot.joint_names)
    t = [p.time_from_start.sec + 1e-9 * p.time_from_start.nanosec - LEAD_IN for p in back.points]
    q = np.array([p.positions for p in back.points])
    np.testing.assert_allclose(q, design.motion.at(np.array(t))[0], atol=2e-8)


def test_a_quintic_between_ros_points_follows_the_motion():
    """What the controller makes of the points stays within 0.01 degrees of the motion."""
    design = made_design("staubli_tx40", "fourier")
    points = yaml.safe_load(program(design, ".yaml"))["points"]
    knots = [np.array([p[n] for p in points]) for n in ("positions", "velocities", "accelerations")]
    q, dq, ddq = (x[:-1] for x in knots)
    q1, dq1, ddq1 = (x[1:] for x in knots)
    h, s = 1.0 / 50.0, 0.5
    middle = (q + q1) / 2 + 5 * h / 32 * (dq - dq1) + h**2 / 64 * (ddq + ddq1)
    t = (np.arange(len(q)) + s) * h
    np.testing.assert_allclose(middle, design.motion.at(t)[0], atol=2e-4)


def test_a_duration_between_two_samples_still_ends_at_rest():
    design = made_design("planar_2r", "fourier", 5.0137)
    last = yaml.safe_load(program(design, ".yaml"))["points"][-1]
    assert last["time_from_start"] == {"sec": 10, "nanosec": 13_700_000}
    assert last["velocities"] == [0.0, 0.0]


def test_hostile_names_come_back_from_yaml_as_they_are():
    design = unchecked(made_design("staubli_tx40", "postures"), *HOSTILE)
    text = program(design, ".yaml")
    assert text.isascii()
    for read in (yaml.safe_load, YAML(typ="safe", pure=True).load):
        assert read(text)["joint_names"] == list(HOSTILE)


# URScript


def statements(text):
    """Calls of a URScript program, its comments left out: name and arguments."""
    lines = [line.strip() for line in text.splitlines()]
    assert (
        lines[0] in ("def pivident_motion():", "def pivident_motion_slow():") and lines[-1] == "end"
    )
    calls = []
    for line in lines[1:-1]:
        if line.startswith("#"):
            continue
        name, arguments = re.fullmatch(r"(\w+)\((.*)\)", line).groups()
        aim = re.match(r"\[([^\]]*)\]", arguments)
        q = None if aim is None else np.array([float(x) for x in aim.group(1).split(",")])
        rest = arguments[aim.end() if aim else 0 :].strip(", ")
        calls.append((name, q, rest))
    return calls


def test_a_smooth_motion_is_streamed_to_ur():
    design = made_design("staubli_tx40", "fourier")
    calls = statements(program(design, ".script"))
    assert [name for name, _, _ in calls[:2]] == ["movej", "sleep"]
    np.testing.assert_allclose(calls[0][1], design.motion.start, atol=1e-6)
    stream = [(q, rest) for name, q, rest in calls if name == "servoj"]
    assert {rest for _, rest in stream} == {"0, 0, 0.008, 0.05, 300"}
    t = np.arange(len(stream)) / UR_RATE
    assert t[-1] == pytest.approx(design.motion.duration, abs=1.0 / UR_RATE)
    np.testing.assert_allclose([q for q, _ in stream], design.motion.at(t)[0], atol=1e-6)
    assert calls[-1] == ("stopj", None, "2.0")
    assert len(calls) == len(stream) + 3


def test_postures_are_moves_of_ur_in_their_time():
    design = made_design("staubli_tx40", "postures")
    calls = statements(program(design, ".script"))
    moves = [(q, rest) for name, q, rest in calls if name == "movej"]
    np.testing.assert_allclose([q for q, _ in moves], design.motion.postures, atol=1e-6)
    assert {name for name, _, _ in calls} == {"movej", "sleep"}
    times = [float(rest.removeprefix("t=")) for _, rest in moves[1:]]
    dwell = [float(rest) for name, _, rest in calls if name == "sleep"][1:]
    assert sum(times) + sum(dwell) == pytest.approx(design.motion.duration, abs=1e-3)


# KUKA and ABB


def test_krl_goes_to_the_postures_in_degrees():
    design = made_design("staubli_tx40", "postures")
    text = program(design, ".src")
    found = re.findall(r"^PTP \{(.*)\}$", text, re.M)
    named_axes = [dict(part.split(" ") for part in aim.split(",")) for aim in found]
    assert {tuple(aim) for aim in named_axes} == {("A1", "A2", "A3", "A4", "A5", "A6")}
    axes = [[float(x) for x in aim.values()] for aim in named_axes]
    np.testing.assert_allclose(np.radians(axes), design.motion.postures, atol=1e-6)
    speeds = [int(x) for x in re.findall(r"^BAS \(#VEL_PTP,(\d+)\)$", text, re.M)]
    _, dq, _ = design.motion.sampled(2000.0)
    shares = np.abs(dq) / design.robot.rated_speeds
    per_move = np.array_split(shares, 7)  # all moves take the same time
    expected = [100.0 * share.max() for share in per_move]
    np.testing.assert_allclose(speeds[1:], np.ceil(expected), atol=1.0)
    assert speeds[0] == 10


def test_rapid_goes_to_the_postures_in_degrees_and_in_time():
    design = made_design("staubli_tx40", "postures")
    text = program(design, ".mod")
    moves = re.findall(
        r"MoveAbsJ \[\[([^]]*)\],\[(?:9E9,?){6}\]\],([\w\[,\]]+?)(?:\\T:=([\d.]+))?,fine,tool0;",
        text,
    )
    axes = np.array([[float(x) for x in own.split(",")] for own, _, _ in moves])
    np.testing.assert_allclose(np.radians(axes), design.motion.postures, atol=1e-6)
    assert moves[0][1:] == ("[50,15,50,15]", "")
    times = {float(t) for _, _, t in moves[1:]}
    assert times == {round(design.motion.family.move_duration, 4)}


def test_postures_of_two_axes_are_none_of_abb():
    """RAPID would move the four others, which nobody has checked."""
    endings = {
        p.name.rpartition(".")[2] for p in robot_programs(made_design("planar_2r", "postures"))
    }
    assert endings == {"yaml", "src"}
    assert "A2" in program(made_design("planar_2r", "postures"), ".src")


def test_krl_without_rated_speeds_is_careful():
    design = made_design("staubli_tx40", "postures")
    joints = tuple(replace(joint, rated_speed=None) for joint in design.robot.joints)
    text = program(replace(design, robot=replace(design.robot, joints=joints)), ".src")
    assert set(re.findall(r"#VEL_PTP,(\d+)", text)) == {"10"}
    assert "Rated speeds are unknown" in text


def test_a_slower_design_is_a_slower_program():
    """Controllers count in rated speeds, whatever the design was allowed."""
    design = made_design("staubli_tx40", "postures")
    joints = tuple(replace(j, rated_speed=3.0 * j.rated_speed) for j in design.robot.joints)
    faster = replace(design, robot=replace(design.robot, joints=joints))
    speeds = [
        [int(x) for x in re.findall(r"#VEL_PTP,(\d+)", program(d, ".src"))[1:]]
        for d in (design, faster)
    ]
    np.testing.assert_allclose(np.array(speeds[0]) / 3.0, speeds[1], atol=1.0)


def test_programs_say_what_was_not_checked():
    design = made_design("staubli_tx40", "postures")
    note = "Not checked: wrist and table\nhalt(), which are near in every posture."
    for text in (p.text for p in robot_programs(replace(design, notes=(note,)))):
        assert "Not checked: wrist and table" in text and "\nhalt" not in text
        assert f"Checked: {len(design.clearances)} distances" in text
    for text in (p.text for p in robot_programs(replace(design, clearances=()))):
        assert "COLLISIONS WERE NOT CHECKED" in text


COMMENT = {".script": "#", ".src": ";", ".mod": "!", ".yaml": "#"}


@pytest.mark.parametrize("ending", COMMENT)
def test_no_name_breaks_out_of_a_comment(ending):
    """But for comments, a program with hostile names is the one with harmless names."""
    design = made_design("staubli_tx40", "postures")

    def code(text):
        assert text.isascii() and "\r" not in text
        lines = [line for line in text.splitlines() if not line.strip().startswith(COMMENT[ending])]
        return [line for line in lines if not line.startswith('  - "')]  # joint names of YAML

    harmless = program(design, ending)
    hostile = program(unchecked(design, *HOSTILE), ending)
    assert code(hostile) == code(harmless)
    assert len(hostile.splitlines()) == len(harmless.splitlines())
    assert max(map(len, hostile.splitlines()[:8])) < 500  # long names are shortened there


@pytest.mark.parametrize("ending", COMMENT)
def test_every_program_warns_and_says_what_it_uses(ending):
    text = program(made_design("staubli_tx40", "postures"), ending)
    assert ("RUN THE SLOW PROGRAM FIRST" in text) == (ending in (".yaml", ".script"))
    assert ("RUN IT SLOWLY FIRST (override 10 %)" in text) == (ending in (".src", ".mod"))
    assert '1: "joint_1", speed 98 % of its limit, torque 67 % of its limit' in text
    units = {".script": "in rad:", ".yaml": "in rad:"}.get(ending, "in deg:")
    assert units in text


def test_what_cannot_be_written_is_said():
    endings = {p.name.rpartition(".")[2] for p in robot_programs(made_design("planar_2r"))}
    assert endings == {"yaml"}
    said = unwritten_programs(made_design("planar_2r"))
    assert len(said) == 4
    assert "six revolute joints, and this robot has 2 revolute joints" in said[0]
    assert "'fourier'" in said[2]
    assert unwritten_programs(made_design("staubli_tx40", "postures")) == ()
    assert {p.name.rpartition(".")[2] for p in robot_programs(made_design("emps", "postures"))} == {
        "yaml"
    }
    assert "1 prismatic joint" in unwritten_programs(made_design("emps", "postures"))[2]
