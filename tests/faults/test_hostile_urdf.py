"""URDF made to harm: declarations, entities, inclusions, endless and packed trees."""

import gzip

import numpy as np
import pytest

from pivident.foundation.errors import RobotDescriptionError
from pivident.robot.urdf import parse_urdf, read_urdf
from pivident.robot.urdf_xml import MAX_ELEMENTS, MAX_LINKS, MAXIMUM_SIZE
from tests.faults.hostile import written


@pytest.mark.parametrize(
    "declaration",
    [
        '<!DOCTYPE r SYSTEM "file:///etc/passwd">',
        '<!DOCTYPE r PUBLIC "a" "http://localhost:9/x">',
        '<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>',
        '<!DOCTYPE r [<!ENTITY % x SYSTEM "http://localhost:9/x"> %x;]>',
        '<!DOCTYPE r [<!ENTITY a "lol"><!ENTITY b "&a;&a;&a;&a;&a;&a;&a;&a;&a;&a;">]>',
        "<!DOCTYPE r ["
        + "".join(f'<!ENTITY a{k} "{f"&a{k - 1};" * 10}">' for k in range(1, 30))
        + "]>",
    ],
)
@pytest.mark.parametrize("encoding", ["utf-8", "utf-16"])
def test_no_document_type_is_followed(declaration, encoding):
    head = f'<?xml version="1.0" encoding="{encoding}"?>'
    with pytest.raises(RobotDescriptionError, match="document type declaration"):
        parse_urdf(f'{head}{declaration}<robot name="&a;"/>'.encode(encoding))


def test_an_entity_that_nobody_declared():
    with pytest.raises(RobotDescriptionError, match="is not XML"):
        parse_urdf('<robot name="&xxe;"/>')


LINKS = '<link name="a"/><link name="b"/>'
ENDS = '<parent link="a"/><child link="b"/>'


@pytest.mark.parametrize("length", ["1e308", "1e200", "3e-9"])
def test_an_axis_of_any_length_is_a_direction(length):
    """Its square would be infinite, and the direction nought."""
    axis = f'<axis xyz="{length} {length} 0"/>'
    joint = f'<joint name="j" type="revolute">{ENDS}{axis}</joint>'
    robot = parse_urdf(f'<robot name="r">{LINKS}{joint}</robot>')
    z = robot.joints[0].rotation[:, 2]
    np.testing.assert_allclose(z, [np.sqrt(0.5), np.sqrt(0.5), 0.0], atol=1e-15)


def test_a_value_of_megabytes_is_not_repeated():
    joint = f'<joint name="j" type="{"x" * 10**6}">{ENDS}</joint>'
    with pytest.raises(RobotDescriptionError, match="does not exist") as caught:
        parse_urdf(f'<robot name="r">{LINKS}{joint}</robot>')
    assert len(str(caught.value)) < 3000


def test_inclusions_are_passed_over(tmp_path):
    text = """<robot name="r" xmlns:xi="http://www.w3.org/2001/XInclude">
    <xi:include href="/etc/passwd" parse="text"/><link name="a"/><link name="b"/>
    <joint name="j" type="revolute"><parent link="a"/><child link="b"/></joint></robot>"""
    assert "root:" not in repr(parse_urdf(text))


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"<robot>" + b"<a/>" * (MAX_ELEMENTS + 1) + b"</robot>", "more than .* elements"),
        (b"<robot>" + b"<a>" * 50_000, "is not XML"),
        (b"<robot>" + b" " * MAXIMUM_SIZE + b"</robot>", "larger than"),
        (
            b"<robot>%s</robot>" % b"".join(b'<link name="%d"/>' % k for k in range(1001)),
            f"{MAX_LINKS} can be read",
        ),
    ],
)  # fmt: skip
def test_packed_urdf_bombs(tmp_path, content, message):
    path = written(tmp_path, "a.urdf.gz", gzip.compress(content, 1))
    assert path.stat().st_size < 200_000
    with pytest.raises(RobotDescriptionError, match=message):
        read_urdf(path)
