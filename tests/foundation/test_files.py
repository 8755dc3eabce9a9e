"""An output folder is as it was or complete, whatever happens in between."""

import errno
import os
from pathlib import Path

import pytest

from pivident.foundation import files
from pivident.foundation.errors import PividentError
from pivident.foundation.files import MAX_TEXT, atomic_folder, check_output, small_text


def content(folder: Path) -> dict[str, str]:
    return {p.name: p.read_text() for p in folder.rglob("*") if p.is_file()}


def test_new_folder_appears_with_its_parents(tmp_path):
    with atomic_folder(tmp_path / "a" / "b") as build:
        (build / "one.txt").write_text("1")
        (build / "deep").mkdir()
        (build / "deep" / "two.txt").write_text("2")
        assert not (tmp_path / "a").exists()
    assert (tmp_path / "a" / "b" / "deep" / "two.txt").read_text() == "2"
    assert content(tmp_path) == {"one.txt": "1", "two.txt": "2"}


def test_foreign_files_stay_and_own_ones_are_replaced(tmp_path):
    (tmp_path / "notes.txt").write_text("mine")
    (tmp_path / "one.txt").write_text("old")
    with atomic_folder(tmp_path) as build:
        (build / "one.txt").write_text("new")
        assert (tmp_path / "one.txt").read_text() == "old"
    assert content(tmp_path) == {"notes.txt": "mine", "one.txt": "new"}


@pytest.mark.parametrize("stop", [KeyboardInterrupt, ValueError, SystemExit])
def test_any_exception_leaves_the_folder_as_it_was(tmp_path, stop):
    (tmp_path / "one.txt").write_text("old")
    with pytest.raises(stop), atomic_folder(tmp_path) as build:
        (build / "one.txt").write_text("half")
        raise stop
    assert content(tmp_path) == {"one.txt": "old"}
    assert [p.name for p in tmp_path.iterdir()] == ["one.txt"]


def test_interrupted_first_run_leaves_nothing(tmp_path):
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path / "out") as build:
        (build / "one.txt").write_text("half")
        raise KeyboardInterrupt
    assert list(tmp_path.iterdir()) == []


def test_interrupt_between_the_renames_finishes_them(tmp_path, monkeypatch):
    calls = []

    def replace(source, target):
        calls.append(target)
        os.rename(source, target)
        if len(calls) == 1:
            raise KeyboardInterrupt

    monkeypatch.setattr(files.os, "replace", replace)
    with pytest.raises(KeyboardInterrupt), atomic_folder(tmp_path) as build:
        for name in "abc":
            (build / name).write_text("new")
    assert content(tmp_path) == dict.fromkeys("abc", "new")
    assert len(list(tmp_path.iterdir())) == 3


def test_full_disk_is_one_readable_line(tmp_path):
    (tmp_path / "one.txt").write_text("old")
    with pytest.raises(PividentError, match="No space left on device") as caught:
        with atomic_folder(tmp_path):
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))
    assert "\n" not in str(caught.value)
    assert content(tmp_path) == {"one.txt": "old"}


def test_read_only_folder_is_one_readable_line(tmp_path, monkeypatch):
    def refuse(self, *args, **options):
        raise PermissionError(errno.EACCES, os.strerror(errno.EACCES), str(self))

    monkeypatch.setattr(Path, "mkdir", refuse)
    with pytest.raises(PividentError, match=f"cannot write to {tmp_path}: Permission denied"):
        with atomic_folder(tmp_path):
            pass


@pytest.mark.skipif(os.geteuid() == 0, reason="root may write anywhere")
def test_read_only_folder_on_disk(tmp_path):
    folder = tmp_path / "out"
    folder.mkdir(mode=0o555)
    with pytest.raises(PividentError, match="Permission denied"), atomic_folder(folder):
        pass


def test_a_name_that_no_file_system_has(tmp_path):
    with pytest.raises(PividentError, match=r"cannot write to .*too long; choose another --out"):
        check_output(tmp_path / ("a" * 5000))


def test_folder_below_a_file(tmp_path):
    (tmp_path / "file").write_text("")
    with pytest.raises(PividentError, match="Not a directory"), atomic_folder(tmp_path / "file/x"):
        pass


def test_errors_about_other_files_pass(tmp_path):
    with pytest.raises(FileNotFoundError), atomic_folder(tmp_path / "out"):
        Path(tmp_path / "log.csv").read_text()


@pytest.mark.parametrize(
    ("content", "sentence"),
    [
        (b"x" * (MAX_TEXT + 1), "has 1048577 bytes, too many for a table"),
        (b"a = \xff", "is not UTF-8 text \\(byte 4\\)"),
        (None, "cannot be read"),
    ],
)
def test_text_that_people_write(tmp_path, content, sentence):
    path = tmp_path / "table.toml"
    if content is not None:
        path.write_bytes(content)
    with pytest.raises(PividentError, match=sentence):
        small_text(path, PividentError, "a table")
    path.write_text("σ = 1", encoding="utf-8")
    assert small_text(path, PividentError, "a table") == "σ = 1"
