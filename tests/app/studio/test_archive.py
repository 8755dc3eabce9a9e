"""Archives: a project goes round whole; what is no project is refused before a byte is written."""

import stat
import zipfile

import pytest

from pivident.app.studio import uploads
from pivident.app.studio.projects import EXPERIMENT, ProjectError, Projects
from pivident.app.studio.uploads import open_archive, pack

FILES = {
    EXPERIMENT: b"# text\r\n",
    "arm.urdf": b"<robot/>",
    "log.csv": b"t,q\n0,1\n",
    "bag/metadata.yaml": b"a: 1",
    "bag/bag_0.db3": b"SQLite",
    "results/001-identify/piv/identification.json": b"{}",
    "results/001-identify/report.html": b"<p>",
}


def filled(projects, name="arm"):
    project = projects.create(name)
    for path, content in FILES.items():
        (project.folder / path).parent.mkdir(parents=True, exist_ok=True)
        (project.folder / path).write_bytes(content)
    return project


def content(folder):
    found = {p.relative_to(folder).as_posix(): p for p in folder.rglob("*") if p.is_file()}
    return {name: p.read_bytes() for name, p in found.items()}


@pytest.mark.parametrize("logs", [True, False])
@pytest.mark.parametrize("results", [True, False])
def test_round_trip(tmp_path, logs, results):
    projects = Projects(tmp_path)
    packed = pack(filled(projects), tmp_path / "a.zip", logs=logs, results=results)
    opened = open_archive(projects, packed, "again")
    expected = {
        name: data
        for name, data in FILES.items()
        if (results or not name.startswith("results"))
        and (logs or not name.startswith(("log", "bag")))
    }
    assert content(opened.folder) == expected


def made(path, entries, **attributes):
    with zipfile.ZipFile(path, "w") as made:
        for name, data in entries.items():
            entry = zipfile.ZipInfo(name)
            for key, value in attributes.items():
                setattr(entry, key, value)
            made.writestr(entry, data)
    return path


@pytest.mark.parametrize(
    "name", ["../evil.csv", "/evil.csv", "a/../../evil.csv", "..\\evil.csv", ".bashrc", "run.exe",
             ".pivident-studio/runs/001/run.json", "results/../evil.csv", "results/evil.exe",
             "results/.x.json", "C:/evil.csv", "a/b/c/log.csv"],
)  # fmt: skip
def test_names_that_no_project_has(tmp_path, name):
    packed = made(tmp_path / "a.zip", {EXPERIMENT: b"", name: b"x"})
    (tmp_path / "root").mkdir()
    projects = Projects(tmp_path / "root")
    with pytest.raises(ProjectError):
        open_archive(projects, packed, "arm")
    assert not list(projects.root.iterdir()) and not (tmp_path / "evil.csv").exists()


def test_links_are_refused(tmp_path):
    link = (stat.S_IFLNK | 0o777) << 16
    packed = made(tmp_path / "a.zip", {EXPERIMENT: b"", "log.csv": b"/etc/passwd"},
                  external_attr=link)  # fmt: skip
    with pytest.raises(ProjectError, match="a link"):
        open_archive(Projects(tmp_path), packed, "arm")


def test_bombs_are_refused(tmp_path, monkeypatch):
    monkeypatch.setattr(uploads, "MAX_BYTES", 10_000)
    with zipfile.ZipFile(tmp_path / "a.zip", "w", zipfile.ZIP_DEFLATED) as bomb:
        bomb.writestr(EXPERIMENT, b"")
        bomb.writestr("log.csv", b"0" * 20_000)
    with pytest.raises(ProjectError, match="unpacks to"):
        open_archive(Projects(tmp_path), tmp_path / "a.zip", "arm")
    assert not (tmp_path / "arm").exists()


def test_a_size_that_lies_is_found(tmp_path):
    packed = made(tmp_path / "a.zip", {EXPERIMENT: b"", "log.csv": b"0" * 1000})
    data = packed.read_bytes()
    size = (1000).to_bytes(4, "little")
    packed.write_bytes(data.replace(size, (10).to_bytes(4, "little")))
    with pytest.raises(ProjectError):
        open_archive(Projects(tmp_path), packed, "arm")
    assert not (tmp_path / "arm").exists()


@pytest.mark.parametrize("data", [b"", b"no archive", b"PK\x03\x04" + b"\0" * 40])
def test_what_is_no_archive(tmp_path, data):
    (tmp_path / "a.zip").write_bytes(data)
    with pytest.raises(ProjectError, match="no archive that can be read"):
        open_archive(Projects(tmp_path), tmp_path / "a.zip", "arm")


def test_an_archive_without_experiment_is_no_project(tmp_path):
    packed = made(tmp_path / "a.zip", {"log.csv": b""})
    with pytest.raises(ProjectError, match="holds no experiment"):
        open_archive(Projects(tmp_path), packed, "arm")


def test_a_name_that_is_taken(tmp_path):
    projects = Projects(tmp_path)
    packed = pack(filled(projects), tmp_path / "a.zip")
    with pytest.raises(ProjectError, match="exists already"):
        open_archive(projects, packed, "arm")
