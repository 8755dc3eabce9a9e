"""Files that come over the network: whole or not at all, in the project or nowhere."""

import asyncio
import shutil
from collections import namedtuple

import pytest

from pivident.app.studio import uploads
from pivident.app.studio.projects import EXPERIMENT, ProjectError, Projects


@pytest.fixture
def project(tmp_path):
    return Projects(tmp_path).create("arm")


def received(path, parts, declared=None):
    async def coming():
        for part in parts:
            if isinstance(part, Exception):
                raise part
            yield part

    return asyncio.run(uploads.receive(path, coming(), declared))


@pytest.mark.parametrize(
    "name", ["log.csv", "Log 1.CSV", "arm.urdf", "scene.xml", "run.mcap", "bag/metadata.yaml",
             "bag/bag_0.db3", "log.csv.gz", "run.parquet", "my_robot.toml", "arm.urdf.gz"],
)  # fmt: skip
def test_what_is_taken(project, name):
    path = uploads.target(project, name)
    assert received(path, [b"ab", b"", b"c"], 3) == 3
    assert path.read_bytes() == b"abc" and path in project.inputs()


@pytest.mark.parametrize(
    "name", ["run.exe", "a.html", "../log.csv", "a/b/log.csv", ".csv", "log.csv/", "/log.csv",
             "results/log.csv", "x/../log.csv", "log.csv\0.urdf", "<b>.csv", "metadata.yaml",
             ".pivident-studio/log.csv", "a.svg", "C:\\log.csv"],
)  # fmt: skip
def test_what_is_not(project, name):
    with pytest.raises(ProjectError):
        uploads.target(project, name)


def test_half_a_file_does_not_appear(project):
    path = uploads.target(project, "bag/bag_0.db3")
    with pytest.raises(ProjectError, match="broke off after 2 of 5 bytes"):
        received(path, [b"ab"], 5)
    with pytest.raises(RuntimeError):
        received(path, [b"ab", RuntimeError("the tab was closed")])
    assert not project.inputs() and not path.parent.exists()


def test_an_old_file_stays_until_the_new_one_is_whole(project):
    path = uploads.target(project, "log.csv")
    received(path, [b"old"])
    with pytest.raises(ProjectError):
        received(path, [b"new"], 7)
    assert path.read_bytes() == b"old"


def test_size_is_bounded(project, monkeypatch):
    monkeypatch.setattr(uploads, "MAX_BYTES", 10)
    path = uploads.target(project, "log.csv")
    for parts, declared in (([b"x" * 6] * 2, None), ([b""], 11)):
        with pytest.raises(ProjectError, match="has more than"):
            received(path, parts, declared)
    assert not project.inputs() and not list(project.folder.glob(".*.part"))


def test_a_full_disk_is_said(project, monkeypatch):
    usage = namedtuple("usage", "total used free")
    monkeypatch.setattr(shutil, "disk_usage", lambda path: usage(0, 0, uploads.RESERVE + 5))
    path = uploads.target(project, "log.csv")
    with pytest.raises(ProjectError, match="free some space"):
        received(path, [b"x" * 6], 6)
    assert received(path, [b"x" * 5], 5) == 5


def test_remove(project):
    for name in ("log.csv", "bag/bag_0.db3"):
        received(uploads.target(project, name), [b"x"])
        uploads.remove(project, name)
    assert not project.inputs() and not (project.folder / "bag").exists()
    project.experiment.write_text("", encoding="utf-8")
    for name in (EXPERIMENT, "log.csv", "../arm/log.csv", ".pivident-studio"):
        with pytest.raises(ProjectError):
            uploads.remove(project, name)
