"""Files that come from Windows, and systems that lack what POSIX has."""

import shutil
import sys

import pytest

from pivident.experiment.check.experiment_check import check_experiment
from pivident.foundation.files import atomic_folder, check_output, named_file
from pivident.robot.gallery import load_robot
from pivident.studies.many.batch.runner import Processes
from tests.questions.material import URDF, URDF_EXPERIMENT, csv, log

BYTE_ORDER_MARK = b"\xef\xbb\xbf"


def test_an_experiment_that_was_written_on_windows_is_read_elsewhere(tmp_path):
    """A byte order mark, CRLF, backslashes in paths, and an ending in capitals."""
    (tmp_path / "data").mkdir()
    text = URDF_EXPERIMENT.replace('"log.csv"', r"'data\log.csv'").replace("arm.urdf", "ARM.URDF")
    for name, content in (("e.toml", text), ("data/log.csv", csv(log())), ("ARM.URDF", URDF)):
        mark = BYTE_ORDER_MARK if name == "e.toml" else b""
        (tmp_path / name).write_bytes(mark + content.replace("\n", "\r\n").encode())
    found = check_experiment(tmp_path / "e.toml")
    assert [remark.message for remark in found.remarks] == [] and found.plan is not None


def test_a_name_with_a_backslash_that_exists_is_meant(tmp_path):
    (tmp_path / "a").mkdir()
    (tmp_path / "a" / "b").touch()
    assert named_file(tmp_path, r"a\b") == tmp_path / "a/b"
    if sys.platform != "win32":
        (tmp_path / r"a\b").touch()
        assert named_file(tmp_path, r"a\b") == tmp_path / r"a\b"


def test_an_ending_in_capitals_is_that_of_a_robot(tmp_path):
    (tmp_path / "ARM.URDF").write_text(URDF)
    assert load_robot(str(tmp_path / "ARM.URDF")).joint_names == ("shoulder", "elbow")


def test_folders_are_written_without_locks_of_posix(tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, "fcntl", None)
    for text in ("first", "second"):
        check_output(tmp_path / "out")
        with atomic_folder(tmp_path / "out") as build:
            (build / "result.txt").write_text(text)
        assert (tmp_path / "out" / "result.txt").read_text() == text
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "out") as build:
        (build / "result.txt").write_text("third")
        raise KeyboardInterrupt
    assert (tmp_path / "out" / "result.txt").read_text() == "second"
    assert not [p for p in tmp_path.rglob(".pivident*")]
    shutil.rmtree(tmp_path / "out")


def test_workers_are_spawned_not_forked():
    """A method that Windows has, too: nothing of this process is inherited."""
    with Processes(1)() as pool:
        assert pool._mp_context.get_start_method() == "spawn"
