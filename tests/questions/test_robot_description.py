# ruff: noqa: E501  (one case, one line)
"""Mistakes in the robot's description: URDF and modified DH files."""

import gzip

import pytest

from tests.questions.conftest import answered
from tests.questions.material import URDF, URDF_EXPERIMENT, WITHOUT_ROTORS, Case, log, urdf

UPPER = '<joint name="shoulder" type="revolute">'
LOWER = '<joint name="elbow" type="revolute">'
LIMIT = '<limit lower="-2.62" upper="2.62" velocity="4.19" effort="40"/>'
FOREARM = '<inertia ixx="0.001" ixy="0" ixz="0" iyy="0.02" iyz="0" izz="0.02"/>'


def arm(question: str, old: str, new: str, *answer: str, **more) -> Case:
    return Case(question, answer, text=URDF_EXPERIMENT, files=urdf((old, new)), **more)


def file(question: str, content, *answer: str, name: str = "arm.urdf", **more) -> Case:
    text = URDF_EXPERIMENT.replace("arm.urdf", name)
    return Case(question, answer, text=text, files={name: content}, **more)


def named(question: str, keys: str, *answer: str, **more) -> Case:
    text = URDF_EXPERIMENT.replace('model = "arm.urdf"', f'model = "arm.urdf", {keys}')
    return Case(question, answer, text=text, files=urdf(), **more)


DH = """\
name = "arm"
gravity = "-y"

[[joints]]
name = "shoulder"
link = {mass = 4, center_of_mass = [0.2, 0, 0], inertia_at_center_of_mass = [0, 0, 0, 0, 0, 0.05]}

[[joints]]
name = "elbow"
d = 0.4
"""


def table(question: str, old: str, new: str, *answer: str, **more) -> Case:
    assert old in DH, old
    text = URDF_EXPERIMENT.replace("arm.urdf", "arm.toml")
    return Case(question, answer, text=text, files={"arm.toml": DH.replace(old, new)}, **more)


CASES = [
    # the file
    file("the URDF is empty", "", "line 1", "arm.urdf", "not XML"),
    file("the URDF is not closed", URDF.replace("</robot>", ""), "line 1", "arm.urdf", "not XML", "line"),
    file("the URDF is an SDF", "<sdf version='1.7'><model name='a'/></sdf>", "line 1", "<sdf>", "not a URDF"),
    file("the URDF is a MuJoCo model", "<mujoco/>", "line 1", "<mujoco>", "not a URDF"),
    file("the URDF is a web page", "<!DOCTYPE html><html></html>", "line 1", "arm.urdf", "html"),
    file("the URDF still has xacro commands", URDF.replace('<mass value="4"/>', '<mass value="${m}"/>'), "line 1", "upper_arm", "${m}", "xacro"),
    file("the URDF still has xacro macros", URDF.replace('<robot name="arm">', '<robot name="arm" xmlns:xacro="http://ros.org/wiki/xacro"><xacro:arm/>'), "line 1", "xacro", "arm.urdf"),
    file("the archive of the URDF is damaged", gzip.compress(URDF.encode())[:-30], "line 1", "gzip", name="arm.urdf.gz"),
    # links and joints
    file("all joints are fixed", URDF.replace('type="revolute"', 'type="fixed"'), "line 1", "no moving joint", "arm.urdf"),
    arm("a joint mimics one that is not there", "<axis xyz=\"0 0 1\"/>\n    " + LIMIT, '<mimic joint="sholder"/>' + LIMIT, "line 1", "elbow", "mimics 'sholder'", "freeze"),
    arm("a joint floats", LOWER, LOWER.replace("revolute", "floating"), "line 1", "elbow", "'floating' is not supported", "freeze"),
    arm("a joint's type is misspelt", LOWER, LOWER.replace("revolute", "revolut"), "line 1", "elbow", "'revolut' does not exist", "'revolute'"),
    arm("two joints have the same name", LOWER, LOWER.replace("elbow", "shoulder"), "line 1", "shoulder", "used twice"),
    arm("two links have the same name", '<link name="forearm">', '<link name="upper_arm">', "line 1", "upper_arm", "used twice"),
    arm("a joint's parent does not exist", '<parent link="upper_arm"/>', '<parent link="uper_arm"/>', "line 1", "elbow", "'uper_arm'", "'upper_arm'"),
    arm("a joint has no child", '<child link="forearm"/>', "", "line 1", "elbow", "<child> is missing"),
    arm("there are two roots", '<link name="base"/>', '<link name="base"/>\n  <link name="table"/>', "line 1", "'base', 'table'", "one root"),
    arm("the joints form a ring", '<parent link="base"/>', '<parent link="forearm"/>', "line 1", "ring", "arm.urdf"),
    arm("a link has two parents", '<child link="forearm"/>', '<child link="upper_arm"/>', "line 1", "'upper_arm'", "shoulder", "elbow"),
    arm("an axis has no direction", "<axis xyz=\"0 0 1\"/>\n    " + LIMIT, '<axis xyz="0 0 0"/>' + LIMIT, "line 1", "elbow", "no direction"),
    arm("an axis is written with commas", "<axis xyz=\"0 0 1\"/>\n    " + LIMIT, '<axis xyz="0,0,1"/>' + LIMIT, "line 1", "elbow", "axis xyz", "0,0,1"),
    arm("an axis points the other way", "<axis xyz=\"0 0 1\"/>\n    " + LIMIT, '<axis xyz="0 0 -1"/>' + LIMIT, "elbow seems to turn in the opposite direction", log=log(), code=4),
    # limits
    arm("limits are in degrees", 'lower="-2.62" upper="2.62"', 'lower="-150" upper="150"', "line 1", "elbow", "-150 to 150 rad", "degrees", code=4),
    arm("limits are reversed", 'lower="-2.62" upper="2.62"', 'lower="2.62" upper="-2.62"', "line 1", "elbow", "no room to move"),
    arm("a rated speed is in degrees per second", 'velocity="4.19"', 'velocity="240"', "line 1", "elbow", "240 rad/s", "degrees", code=4),
    arm("a joint turns without limits", f"{LOWER}", LOWER.replace("revolute", "continuous"), "no errors, no warnings", log=log(), code=0),
    arm("a rated speed is missing", ' velocity="4.19"', "", "line 1", "elbow", "rated speed", "velocity", log=log(), code=0),
    arm("an effort limit is negative", 'effort="40"', 'effort="-40"', "line 1", "elbow", "effort", "negative"),
    arm("limits are not numbers", 'upper="2.62"', 'upper="150 deg"', "line 1", "elbow", "150 deg", "not a number"),
    arm("limits are infinite", 'upper="2.62"', 'upper="inf"', "line 1", "elbow", "inf", "not finite"),
    # bodies
    file("links have no masses", "".join(URDF.partition("<inertial>")[:1]) + "</link><link name='forearm'/>" + URDF[URDF.index("<joint"):], "line 1", "no link", "mass", "IV and PIV start from them", log=log(), code=0),
    arm("a mass is negative", '<mass value="2.5"/>', '<mass value="-2.5"/>', "line 1", "forearm", "-2.5", "negative"),
    arm("a mass is zero and its inertia is not", '<mass value="2.5"/>', '<mass value="0"/>', "line 1", "forearm", "mass", "0 kg", log=log(), code=0),
    arm("a mass is missing", '<mass value="2.5"/>', "", "line 1", "forearm", "<mass> is missing"),
    arm("a mass contains its unit", '<mass value="2.5"/>', '<mass value="2.5 kg"/>', "line 1", "forearm", "2.5 kg", "not a number"),
    arm("a mass is in grams", '<mass value="2.5"/>', '<mass value="2500"/>', "line 1", "forearm", "2500 kg", "grams", code=4),
    arm("an inertia is not positive definite", FOREARM, FOREARM.replace('ixy="0"', 'ixy="0.3"'), "line 1", "forearm", "not positive definite", code=4),
    arm("an inertia breaks the triangle inequality", FOREARM, FOREARM.replace('izz="0.02"', 'izz="0.09"'), "line 1", "forearm", "larger than the two others", log=log(), code=0),
    arm("an inertia is in kg mm²", FOREARM, FOREARM.replace("0.001", "1000").replace("0.02", "20000"), "line 1", "forearm", "kg mm²", code=4),
    arm("an element of the inertia is missing", FOREARM, FOREARM.replace(' izz="0.02"', ""), "line 1", "forearm", "'izz' is missing"),
    arm("a centre of mass is in millimetres", '<origin xyz="0.15 0 0"/>', '<origin xyz="150 0 0"/>', "line 1", "forearm", "150 m", "millimetres", code=4),
    arm("a link's length is in millimetres", '<origin xyz="0.4 0 0"/>', '<origin xyz="400 0 0"/>', "line 1", "elbow", "400 m", "millimetres", code=4),
    arm("an origin has two numbers", '<origin xyz="0.4 0 0"/>', '<origin xyz="0.4 0"/>', "line 1", "elbow", "3 numbers are needed"),
    # additions
    named("a frozen joint does not exist", "frozen = {wrist = 0}", "line 1", "frozen", "no moving joint 'wrist'"),
    named("a joint to keep does not exist", 'joints = ["shoulder", "elbwo"]', "line 1", "joints", "'elbwo'", "'elbow'"),
    named("a joint is kept and frozen", 'joints = ["shoulder", "elbow"], frozen = {elbow = 0}', "line 1", "elbow", "kept and frozen"),
    named("a joint is kept twice", 'joints = ["elbow", "elbow"]', "line 1", "elbow", "twice"),
    Case("a joint with columns is frozen", ("q lists 2 column(s) for 1 joint(s)", "shoulder"), text=URDF_EXPERIMENT.replace("rotor_inertia = [0.25, 0.1]", "frozen = {elbow = 0}"), files=urdf()),
    Case("gravity was left to the URDF, and the arm hangs on a wall", ("line 1", "gravity seems to point along -y", "wall"), text=URDF_EXPERIMENT.replace("gravity = [0, -9.81, 0], ", ""), files=urdf(), log=log(), code=4),
    Case("gravity points up", ("line 1", "gravity", "shoulder"), text=URDF_EXPERIMENT.replace("-9.81", "9.81"), files=urdf(), log=log(), code=4),
    Case("the robot is another one", ("line 5", "q lists 2 column(s) for 6 joint(s)", "joint_1"), text=URDF_EXPERIMENT.replace('{model = "arm.urdf", gravity = [0, -9.81, 0], rotor_inertia = [0.25, 0.1]}', '"staubli_tx40"')),
    Case("the rotor inertias were left out, and methods start from the description", ("line 1", "elbow", "rotor_inertia"), text=WITHOUT_ROTORS.replace('["ls"]', '["iv"]\niv.start = "initial"'), files=urdf(), log=log(), code=0),
    # modified DH
    table("a row is misspelt", "[[joints]]\nname = \"elbow\"", "[[joint]]\nname = \"elbow\"", "line 1", "arm.toml", "joint", "'joints'"),
    table("a row has an unknown key", "d = 0.4", "a = 0.4", "line 1", "arm.toml", "elbow", "'a'"),
    table("two rows have the same name", 'name = "elbow"', 'name = "shoulder"', "line 1", "arm.toml", "shoulder"),
    table("angles in degrees are read as radians", "d = 0.4", "d = 0.4\nposition_limits = [-150, 150]", "line 1", "elbow", "degrees", code=4),
    table("a parent does not exist", "d = 0.4", 'd = 0.4\nparent = "sholder"', "line 1", "arm.toml", "'sholder'", "shoulder"),
    table("an inertia has three numbers", "[0, 0, 0, 0, 0, 0.05]", "[0, 0, 0.05]", "line 1", "arm.toml", "shoulder", "6 items"),
    table("an experiment is named as the robot", DH, '[recording]\nfiles = "log.csv"\n', "line 1", "arm.toml", "joints"),
]  # fmt: skip


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.question)
def test_the_answer_names_cause_and_place(ask, case):
    code, lines = ask(case)
    assert answered(lines, case.answer), "\n".join(lines)
    assert code == case.code, "\n".join(lines)
