"""Every way in which a URDF can be wrong, and what its error says."""

import gzip

import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot import urdf_xml
from pivident.robot.urdf import parse_urdf, read_urdf

INERTIA = '<inertia ixx="1" ixy="0" ixz="0" iyy="1" iyz="0" izz="1"/>'


def urdf(joint='<parent link="a"/><child link="b"/>', link="", extra="", kind="revolute"):
    return f"""<robot name="r"><link name="a"/><link name="b">{link}</link>
    <joint name="j" type="{kind}">{joint}</joint>{extra}</robot>"""


def ends(more):
    return f'<parent link="a"/><child link="b"/>{more}'


def inertial(content):
    return urdf(link=f"<inertial>{content}</inertial>")


def joint(name, parent, child, kind="revolute", more=""):
    return (
        f'<joint name="{name}" type="{kind}"><parent link="{parent}"/>'
        f'<child link="{child}"/>{more}</joint>'
    )


WRONG = [
    ("this is not XML", r"is not XML: .*line 1"),
    ("", r"is not XML"),
    ("<robot>", r"is not XML"),
    (b'<?xml version="1.0" encoding="klingon"?><robot/>', r"is not XML: unknown encoding"),
    ("<sdf/>", r"root element is <sdf>, expected <robot>"),
    ("<robot/>", r"no moving joint"),
    ('<robot><link name="a"/></robot>', r"no moving joint"),
    ("<robot><link/></robot>", r"link: attribute 'name' is missing or empty; add it"),
    ('<robot><joint type="fixed"/></robot>', r"joint: attribute 'name' is missing"),
    (urdf(extra='<link name="a"/>'), r"link names used twice: a"),
    (urdf(extra=joint("j", "a", "b")), r"joint names used twice: j"),
    (urdf(kind=""), r"joint 'j': attribute 'type' is missing"),
    (urdf(kind="revolut"), r"type 'revolut' does not exist; did you mean 'revolute'"),
    (urdf('<child link="b"/>'), r"joint 'j': element <parent> is missing; add it"),
    (urdf('<parent link="a"/>'), r"joint 'j': element <child> is missing"),
    (urdf('<parent/><child link="b"/>'), r"joint 'j': parent: attribute 'link' is missing"),
    (urdf('<parent link="a"/><child link="c"/>'), r"child link 'c' is not in the file; known are"),
    (urdf(ends('<axis xyz="0 0 0"/>')), r"axis xyz = '0 0 0' has no direction"),
    (urdf(ends("<axis/>")), r"joint 'j': axis: attribute 'xyz' is missing"),
    (urdf(ends('<axis xyz="0 1"/>')), r"axis xyz = '0 1': 3 numbers are needed"),
    (urdf(ends('<axis xyz="0 0 nan"/>')), r"axis xyz = 'nan' is not finite"),
    (urdf(ends('<origin xyz="0 0 one"/>')), r"origin xyz = 'one' is not a number; write a decimal"),
    (urdf(ends('<origin rpy="0 ${pi} 0"/>')), r"'\$\{pi\}' is not a number; .*xacro"),
    (urdf(ends('<limit lower="inf" upper="1"/>')), r"limit lower = 'inf' is not finite"),
    (urdf(ends('<limit lower="1" upper="-1"/>')), r"lower = 1, upper = -1 leaves no room"),
    (urdf(ends('<limit velocity="-2"/>')), r"joint 'j': limit velocity = -2 is negative"),
    (urdf(ends('<limit effort="-2"/>')), r"joint 'j': limit effort = -2 is negative"),
    (urdf(ends('<dynamics damping="-1"/>')), r"joint 'j': dynamics damping = -1 is negative"),
    (urdf(ends('<dynamics friction="x"/>')), r"dynamics friction = 'x' is not a number"),
    (urdf(ends("<mimic/>")), r"joint 'j': mimic: attribute 'joint' is missing"),
    (
        urdf(ends('<mimic joint="k"/>')),
        r"it mimics 'k', .*freeze it, frozen = \{j = 0.0\} under \[robot\]",
    ),
    (urdf(kind="floating"), r"type 'floating' is not supported; freeze it"),
    (urdf(kind="planar"), r"type 'planar' is not supported; freeze it"),
    (inertial(INERTIA), r"link 'b': inertial: element <mass> is missing"),
    (inertial('<mass value="1"/>'), r"link 'b': inertial: element <inertia> is missing"),
    (inertial(f"<mass/>{INERTIA}"), r"link 'b': inertial mass: attribute 'value' is missing"),
    (inertial(f'<mass value="-1"/>{INERTIA}'), r"mass value = -1 is negative; give the mass in kg"),
    (inertial(f'<mass value="nan"/>{INERTIA}'), r"mass value = 'nan' is not finite"),
    (inertial('<mass value="1"/><inertia ixx="1"/>'), r"inertia: attribute 'ixy' is missing"),
    (
        inertial('<mass value="1"/>' + INERTIA.replace('ixy="0"', 'ixy="o"')),
        r"inertia ixy = 'o' is not a number",
    ),
    (
        inertial(f'<mass value="1"/><origin xyz="0"/>{INERTIA}'),
        r"link 'b': inertial: origin xyz = '0': 3 numbers",
    ),
    (
        urdf(extra=joint("k", "a", "b")),
        r"link 'b' is the child of joints 'j' and 'k': a closed loop",
    ),
    (urdf(extra='<link name="c"/>'), r"links 'a', 'c' have no parent joint, one root is needed"),
    (urdf(extra=joint("k", "b", "a")), r"joints 'j', 'k' form a ring"),
    (
        urdf(
            extra='<link name="c"/><link name="d"/>' + joint("k", "c", "d") + joint("l", "d", "c")
        ),
        r"joints 'k', 'l' form a ring without a root link",
    ),
]


@pytest.mark.parametrize(("text", "message"), WRONG, ids=[message for _, message in WRONG])
def test_a_wrong_urdf_is_refused_with_element_and_value(text, message):
    with pytest.raises(RobotDescriptionError, match=message) as caught:
        parse_urdf(text, source="arm.urdf")
    assert str(caught.value).startswith("arm.urdf: ")


CHAIN = urdf(extra='<link name="c"/>' + joint("k", "b", "c"))

WRONG_CHOICES = [
    ({"joints": ["jj"]}, r"joints: there is no moving joint 'jj'; did you mean 'j'"),
    ({"frozen": {"x": 0.0}}, r"frozen: there is no moving joint 'x'; known are 'j', 'k'"),
    ({"joints": ["j"], "frozen": {"j": 0.0}}, r"joints: j cannot be kept and frozen"),
    ({"joints": ["j", "j"]}, r"joints: j cannot be kept twice"),
    ({"joints": ["k", "j"]}, r"'k' is listed before 'j', which carries it"),
    ({"joints": []}, r"no moving joint"),
    ({"frozen": {"j": float("nan")}}, r"frozen: position of 'j' is nan; not finite"),
    ({"gravity": [0, 0]}, r"three finite numbers"),
]


@pytest.mark.parametrize(("choice", "message"), WRONG_CHOICES, ids=[m for _, m in WRONG_CHOICES])
def test_a_choice_of_joints_that_does_not_fit_is_refused(choice, message):
    with pytest.raises(RobotDescriptionError, match=message):
        parse_urdf(CHAIN, **choice)


def test_a_floating_joint_can_only_be_frozen_at_zero():
    text = urdf(kind="floating", extra='<link name="c"/>' + joint("k", "b", "c"))
    with pytest.raises(RobotDescriptionError, match=r"only be frozen at 0, not at 0\.5"):
        parse_urdf(text, frozen={"j": 0.5})


BILLION_LAUGHS = """<!DOCTYPE lolz [
 <!ENTITY lol "lol">
 <!ENTITY lol1 "&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;&lol;">
 <!ENTITY lol2 "&lol1;&lol1;&lol1;&lol1;&lol1;&lol1;&lol1;&lol1;&lol1;&lol1;">
]>
<robot name="&lol2;"/>"""
EXTERNAL = '<!DOCTYPE r [<!ENTITY secret SYSTEM "file:///etc/hostname">]><robot name="&secret;"/>'
EXTERNAL_DTD = '<!DOCTYPE robot SYSTEM "http://example.org/robot.dtd"><robot/>'


@pytest.mark.parametrize("text", [BILLION_LAUGHS, EXTERNAL, EXTERNAL_DTD])
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_document_type_declarations_are_refused_before_anything_is_expanded(text, encoding):
    with pytest.raises(RobotDescriptionError, match=r"document type declaration .*remove it"):
        parse_urdf(text.encode(encoding))


def test_an_entity_without_declaration_is_not_xml():
    with pytest.raises(RobotDescriptionError, match="is not XML: undefined entity"):
        parse_urdf('<robot name="&lol;"/>')


def test_a_missing_file_is_named(tmp_path):
    with pytest.raises(RobotDescriptionError, match=r"no\.urdf: cannot be read"):
        read_urdf(tmp_path / "no.urdf")


def test_a_folder_is_not_a_file(tmp_path):
    with pytest.raises(RobotDescriptionError, match="cannot be read"):
        read_urdf(tmp_path)


@pytest.mark.parametrize(
    "damage", [lambda b: b[:-12], lambda b: b[:10] + b"\0" * 30, lambda b: b[:2]]
)
def test_a_damaged_gzip_file_is_refused(tmp_path, damage):
    path = tmp_path / "arm.urdf.gz"
    path.write_bytes(damage(gzip.compress(CHAIN.encode() * 20)))
    with pytest.raises(RobotDescriptionError, match="damaged gzip file"):
        read_urdf(path)


def test_a_file_that_expands_beyond_reason_is_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(urdf_xml, "MAXIMUM_SIZE", 2**20)
    path = tmp_path / "bomb.urdf.gz"
    path.write_bytes(gzip.compress(b" " * (2**20 + 1)))
    with pytest.raises(RobotDescriptionError, match="larger than 1 MiB"):
        read_urdf(path)
