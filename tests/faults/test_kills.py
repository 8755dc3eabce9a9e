"""Killed, crowded out, or without room: what is finished stays, nothing is half written.

`benchmarks/kills.py` does the same to whole studies and identifications, fifty times each.
"""

import contextlib
import os
import random
import signal
import subprocess
import sys
import time

import pytest

from pivident.foundation.errors import PividentError
from pivident.foundation.files import BUILD, COMPLETE, atomic_folder
from pivident.studies.many.study.run import UNFINISHED, Store
from tests.studies.many.study.small import small

WRITER = """
import itertools, sys
from pivident.foundation.files import atomic_folder
print("ready", flush=True)
for number in itertools.count():
    with atomic_folder(sys.argv[1]) as build:
        (build / "deep").mkdir()
        for name in ("a", "b", "c", "deep/d"):
            (build / name).write_text(f"{number}\\n" * 50)
"""

APPENDER = """
import itertools, sys
from pathlib import Path
from pivident.studies.many.study.scenario import Scenario
from pivident.studies.many.study.run import Store
from pivident.foundation.text.toml import parse_toml
from tests.studies.many.study.small import TEXT
plain = parse_toml(TEXT)
plain["robot"] = {"model": plain["robot"]}
scenario = Scenario("small", plain, "small", {})  # unchecked: nothing is compiled
store = Store(Path(sys.argv[1]))
with store.opened(scenario, 10**6):
    first = max(store.done(), default=-1) + 1
    print("ready", flush=True)
    for run in itertools.count(first):
        store.append([dict(run=run, record=run, start=0, method="ls", theta=[float(run)] * 50)])
"""


def started(code, *arguments, **options):
    """A process that has come to its work."""
    command = [sys.executable, "-c", code, *map(str, arguments)]
    process = subprocess.Popen(
        command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, **options
    )
    assert process.stdout.readline() == b"ready\n"
    return process


def killed(process, seconds=0.0, how=signal.SIGKILL):
    time.sleep(seconds)
    process.send_signal(how)
    process.communicate()


def numbers(folder):
    """What stands in the files of the writer, each of which is whole."""
    texts = [(folder / name).read_text() for name in ("a", "b", "c", "deep/d")]
    assert all(text == text[: text.index("\n") + 1] * 50 for text in texts)
    return {text.split()[0] for text in texts}


def hidden(folder):
    return [p.name for p in folder.rglob(".*") if p.name.startswith((BUILD, UNFINISHED))]


@pytest.mark.parametrize("how", [signal.SIGKILL, signal.SIGINT, signal.SIGTERM])
def test_a_writer_that_is_stopped(tmp_path, how):
    chance = random.Random(how)
    for k in range(3):
        out = tmp_path / f"out{k % 2}"
        killed(started(WRITER, out), chance.uniform(0.0, 0.05), how)
        with atomic_folder(out) as build:
            (build / "note").write_text("")
        if (out / "a").exists():
            assert len(numbers(out)) == 1
        assert not hidden(tmp_path)


def test_two_writers_and_one_folder(tmp_path):
    """Both go on, and the files are those of one of them."""
    out = tmp_path / "out"
    both = [started(WRITER, out) for _ in range(2)]
    time.sleep(0.5)
    for process in both:
        assert process.poll() is None, "a writer failed"
        killed(process)
    with atomic_folder(out) as build:
        (build / "note").write_text("")
    assert len(numbers(out)) == 1
    assert not hidden(tmp_path)


def test_what_a_killed_process_was_moving_in_is_moved_in(tmp_path):
    (tmp_path / "a").write_text("new")
    (tmp_path / "b").write_text("old")
    left = tmp_path / f"{COMPLETE}01234567"
    (left / "deep").mkdir(parents=True)
    (left / "b").write_text("new")
    (left / "deep" / "c").write_text("new")
    with atomic_folder(tmp_path) as build:
        (build / "d").write_text("newest")
        assert (tmp_path / "b").read_text() == (tmp_path / "deep" / "c").read_text() == "new"
    assert not hidden(tmp_path)


def test_what_was_moved_in_since_stays(tmp_path):
    """A process killed while it moved files in, after this one had begun to build."""
    with atomic_folder(tmp_path) as build:
        left = tmp_path / f"{COMPLETE}01234567"
        left.mkdir()
        (left / "a").write_text("older")
        (left / "b").write_text("older")
        (build / "a").write_text("newer")
    assert (tmp_path / "a").read_text() == "newer"
    assert (tmp_path / "b").read_text() == "older"
    assert not hidden(tmp_path)


def test_folders_of_others_and_of_living_processes_stay(tmp_path):
    (tmp_path / ".pivident-cache").mkdir()
    with atomic_folder(tmp_path / "a") as first:
        with atomic_folder(tmp_path / "b") as second:
            (second / "x").write_text("")
        assert first.is_dir()
        (first / "x").write_text("")
    assert sorted(p.name for p in tmp_path.iterdir()) == [".pivident-cache", "a", "b"]


def test_a_folder_inside_one_that_is_being_built(tmp_path):
    with atomic_folder(tmp_path / "out") as build:
        with atomic_folder(build) as inner:
            (inner / "x").write_text("")
        with atomic_folder(build / "deep") as inner:
            (inner / "y").write_text("")
    assert sorted(p.name for p in (tmp_path / "out").rglob("*")) == ["deep", "x", "y"]
    assert not hidden(tmp_path)


def test_a_store_that_is_killed_loses_nothing_and_repeats_nothing(tmp_path):
    chance = random.Random(3)
    before = 0
    for _ in range(3):
        killed(started(APPENDER, tmp_path), chance.uniform(0.0, 0.2))
        rows = Store(tmp_path).rows()
        runs = rows["run"].to_list()
        assert runs == list(range(len(runs))) and len(runs) >= before
        assert [theta[0] for theta in rows["theta"].to_list()] == runs
        before = len(runs)
    with Store(tmp_path).opened(small(), 10**6):
        assert not hidden(tmp_path)


def test_a_second_process_is_kept_out_of_a_store(tmp_path):
    process = started(APPENDER, tmp_path)
    with pytest.raises(PividentError, match="another study is writing"):
        with Store(tmp_path).opened(small(), 10**6):
            pass
    killed(process)
    with Store(tmp_path).opened(small(), 10**6) as store:
        assert len(store.done()) == len(store.rows())


@pytest.fixture
def small_disk(tmp_path):
    """A file system of 256 kB."""
    if os.geteuid() != 0:
        pytest.skip("only root may mount a small file system")
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=256k", "tmpfs", str(place)]
    if subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("file systems cannot be mounted here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


def test_a_full_disk(small_disk):
    out = small_disk / "out"
    with atomic_folder(out) as build:
        (build / "a").write_text("old")
    with pytest.raises(PividentError, match="No space left on device"):
        with atomic_folder(out) as build:
            (build / "a").write_text("new" * 200_000)
    assert (out / "a").read_text() == "old"
    assert not hidden(small_disk)


def test_a_store_on_a_full_disk(small_disk):
    store = Store(small_disk / "study")
    with contextlib.suppress(PividentError), store.opened(small(), 10**6):
        for run in range(10**4):
            written = run
            rows = [
                {"run": run, "record": run, "start": 0, "method": "ls", "theta": [run * 1.0] * 99}
            ]
            store.append(rows)
    assert 0 < written < 10**4
    assert store.done() == set(range(written))
    assert not hidden(small_disk)


@pytest.fixture
def read_only(tmp_path):
    """A folder that nobody may write to, root included."""
    place = tmp_path / "place"
    place.mkdir()
    (place / "a").write_text("old")
    commands = [["mount", "--bind", place, place], ["mount", "-o", "remount,bind,ro", place]]
    done = [subprocess.run(list(map(str, c)), capture_output=True).returncode for c in commands]
    if any(done):
        if not done[0]:
            subprocess.run(["umount", str(place)], check=True)
        pytest.skip("folders cannot be mounted read-only here")
    yield place
    subprocess.run(["umount", str(place)], check=True)


@pytest.mark.parametrize("below", ["", "new", "new/deep"])
def test_a_read_only_folder(read_only, below):
    with pytest.raises(PividentError, match="Read-only file system"):
        with atomic_folder(read_only / below):
            pass
    with pytest.raises(PividentError, match=r"Read-only file system|contains other files"):
        with Store(read_only / below).opened(small(), 6):
            pass
    assert [p.name for p in read_only.iterdir()] == ["a"]
