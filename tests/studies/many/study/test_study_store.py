"""Results on disk: whole or not at all, never those of another scenario, nothing twice."""

import errno
import json
import os
import subprocess
import sys

import pytest

from pivident.studies.many.batch.batch_errors import OtherScenario, StudyFolderError
from pivident.studies.many.study.run import MANIFEST, UNFINISHED, Store
from tests.studies.many.study.small import small


def row(run, method="ls", **values):
    return {"run": run, "record": run, "start": 0, "method": method} | values


def filled(folder, runs=(0, 1, 2)):
    store = Store(folder)
    with store.opened(small(), 6):
        store.append([row(r, theta=[1.0 / 3.0, r]) for r in runs])
    return store


def contents(folder):
    return {p.relative_to(folder): p.read_bytes() for p in folder.rglob("*") if p.is_file()}


def test_rows_come_back_bit_for_bit_and_sorted(tmp_path):
    store = filled(tmp_path / "a" / "b", runs=(2, 0))
    store.append([row(1, error="SomeError", message="why")])
    rows = store.rows()
    assert rows["run"].to_list() == [0, 1, 2]
    assert rows["theta"].to_list() == [[1.0 / 3.0, 0.0], None, [1.0 / 3.0, 2.0]]
    assert rows["message"].to_list() == [None, "why", None]
    assert store.done() == {0, 1, 2}


def test_a_copied_shard_is_not_counted_twice(tmp_path):
    store = filled(tmp_path)
    shard = next(store.shards.glob("*.parquet"))
    (store.shards / "copy.parquet").write_bytes(shard.read_bytes())
    assert store.rows()["run"].to_list() == [0, 1, 2]


def test_the_manifest_says_what_the_runs_are_of(tmp_path):
    filled(tmp_path)
    manifest = json.loads((tmp_path / MANIFEST).read_text())
    assert manifest["hash"] == small().hash
    assert manifest["scenario"]["noise"] == {"encoder": 2e-6, "torque": 0.05}
    assert manifest["methods"]["iv-full-rate"]["signals"]["order"] == 3
    assert manifest["runs"] == 6 and manifest["version"]


def test_the_folder_of_another_scenario_is_left_alone(tmp_path):
    filled(tmp_path)
    before = contents(tmp_path)
    other = small(noise={"torque": 0.1})
    with pytest.raises(OtherScenario, match=r"noise\.torque: 0\.1 here, 0\.05 there") as caught:
        with Store(tmp_path).opened(other, 6):
            pass
    assert caught.value.differences == ("noise.torque: 0.1 here, 0.05 there",)
    assert contents(tmp_path) == before


def test_more_runs_of_the_same_scenario_are_welcome(tmp_path):
    filled(tmp_path)
    with Store(tmp_path).opened(small().with_runs(50), 50):
        assert Store(tmp_path).manifest()["runs"] == 50
    with Store(tmp_path).opened(small(), 6):
        assert Store(tmp_path).manifest()["runs"] == 50


def test_a_folder_with_other_files_is_refused(tmp_path):
    (tmp_path / "thesis.tex").write_text("x")
    with pytest.raises(StudyFolderError, match=r"contains other files and no manifest\.json"):
        with Store(tmp_path).opened(small(), 6):
            pass
    assert [p.name for p in tmp_path.iterdir()] == ["thesis.tex"]


def test_runs_of_another_version_are_refused(tmp_path):
    filled(tmp_path)
    manifest = json.loads((tmp_path / MANIFEST).read_text())
    (tmp_path / MANIFEST).write_text(json.dumps(manifest | {"version": "0.0.1"}))
    with pytest.raises(StudyFolderError, match=r"made by pivident 0\.0\.1"):
        with Store(tmp_path).opened(small(), 6):
            pass


def test_two_studies_do_not_write_to_one_folder(tmp_path):
    with Store(tmp_path).opened(small(), 6):
        with pytest.raises(StudyFolderError, match="another study is writing"):
            with Store(tmp_path).opened(small(), 6):
                pass


def test_what_a_kill_left_unfinished_is_removed(tmp_path):
    store = filled(tmp_path)
    (store.shards / f"{UNFINISHED}1234").write_bytes(b"half")
    (tmp_path / f"{UNFINISHED}99").write_bytes(b"half")
    with store.opened(small(), 6):
        assert store.done() == {0, 1, 2}
    assert not list(tmp_path.rglob(f"{UNFINISHED}*"))


def test_a_broken_shard_is_named(tmp_path):
    store = filled(tmp_path)
    (store.shards / "broken.parquet").write_bytes(b"PAR1 and nothing")
    for reading in (store.rows, store.done):
        with pytest.raises(StudyFolderError, match=r"broken\.parquet.*delete it"):
            reading()


@pytest.mark.parametrize("call", ["fsync", "replace"])
def test_a_full_disk_leaves_what_is_there(tmp_path, monkeypatch, call):
    store = filled(tmp_path)
    before = contents(tmp_path)

    def full(*_):
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    monkeypatch.setattr(os, call, full)
    with pytest.raises(StudyFolderError, match=r"No space left on device.*free some space"):
        store.append([row(3)])
    assert contents(tmp_path) == before


def test_a_file_system_without_room_is_a_clear_error(tmp_path):
    """The kernel refuses to let the file grow, as a full disk does."""
    filled(tmp_path)
    before = contents(tmp_path)
    code = f"""
import resource, signal
from pathlib import Path
from pivident.studies.many.study.run import Store
signal.signal(signal.SIGXFSZ, signal.SIG_IGN)
resource.setrlimit(resource.RLIMIT_FSIZE, (512, 512))
rows = [dict(run=r, record=r, start=0, method="ls", theta=[r / 7.0] * 99) for r in range(3, 9)]
try:
    Store(Path({str(tmp_path)!r})).append(rows)
except Exception as error:
    print(type(error).__name__, error)
"""
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True)
    assert "StudyFolderError" in done.stdout and "File too large" in done.stdout, done.stderr
    assert contents(tmp_path) == before


@pytest.mark.parametrize("place", ["/proc/study", "/dev/null", "/dev/null/study"])
def test_a_folder_that_cannot_be_made_is_a_clear_error(place):
    from pathlib import Path

    with pytest.raises(StudyFolderError, match="choose another"):
        with Store(Path(place)).opened(small(), 6):
            pass


def test_a_program_that_has_changed_is_remembered(tmp_path, monkeypatch):
    from pivident.studies.many.batch import results_folder as module

    filled(tmp_path)
    (first,) = Store(tmp_path).programs()
    monkeypatch.setattr(module, "fingerprint", lambda: "0.1.0 (changed)")
    with Store(tmp_path).opened(small(), 6):
        assert Store(tmp_path).programs() == (first, "0.1.0 (changed)")
