import gzip
from dataclasses import replace

import pytest

from pivident.foundation.errors import ExportError, RobotDescriptionError
from pivident.models.export.urdf import original_urdf
from pivident.robot.gallery import load_robot
from pivident.robot.urdf import parse_urdf, read_urdf
from tests.models.export.robots import UR


@pytest.fixture
def file(tmp_path):
    path = tmp_path / "arm.urdf"
    path.write_text(UR, encoding="utf-8")
    return path


def test_the_file_that_was_identified_is_found_again(file, tmp_path):
    robot = read_urdf(file)
    found = original_urdf(robot, None, tmp_path / "elsewhere")
    assert found.path == file and found.content == UR.encode() and found.notes == ()


def test_hash_is_that_of_the_unpacked_text(file, tmp_path):
    packed = tmp_path / "packed.urdf.gz"
    packed.write_bytes(gzip.compress(UR.encode()))
    assert read_urdf(packed).urdf.sha256 == read_urdf(file).urdf.sha256
    assert original_urdf(read_urdf(packed), None, tmp_path).content == UR.encode()


def test_it_may_have_moved_beside_the_result(file, tmp_path):
    robot = read_urdf(file)
    folder = tmp_path / "results"
    folder.mkdir()
    file.rename(folder / "arm.urdf")
    assert original_urdf(robot, None, folder).path == folder / "arm.urdf"


def test_missing_file_is_an_error_with_the_next_step(file, tmp_path):
    robot = read_urdf(file)
    file.unlink()
    with pytest.raises(ExportError, match=r"no longer exists, .*with --robot") as error:
        original_urdf(robot, None, tmp_path / "results")
    for place in (file, tmp_path / "results" / "arm.urdf"):
        assert str(place) in str(error.value)


def test_changed_file_is_an_error_unless_it_is_given(file, tmp_path):
    robot = read_urdf(file)
    file.write_text(UR + "<!-- later -->\n", encoding="utf-8")
    with pytest.raises(ExportError, match=r"has changed since .*SHA-256 .* instead of"):
        original_urdf(robot, None, tmp_path)
    given = original_urdf(robot, file, tmp_path)
    assert given.content.endswith(b"later -->\n")
    assert "is not the file that was identified" in given.notes[0]


def test_robots_without_a_file_have_none(tmp_path, file):
    assert original_urdf(load_robot("planar_2r"), None, tmp_path) is None
    assert original_urdf(parse_urdf(UR), None, tmp_path) is None
    assert original_urdf(parse_urdf(UR), file, tmp_path).notes == ()


def test_frozen_joints_are_known(file):
    robot = read_urdf(file, frozen={"shoulder_pan": 0.3})
    assert robot.urdf.frozen["shoulder_pan"] == 0.3
    assert replace(robot, name="other").urdf == robot.urdf


def test_unreadable_file_is_named(tmp_path):
    with pytest.raises(RobotDescriptionError, match=r"none.urdf: cannot be read"):
        original_urdf(load_robot("planar_2r"), tmp_path / "none.urdf", tmp_path)
