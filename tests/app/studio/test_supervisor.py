"""The supervisor: killed, on a full disk, and with a command that says too much."""

import errno
import os
import shutil
import subprocess
import sys
from pathlib import Path

import psutil
import pytest

from pivident.app.studio import run_folder
from pivident.app.studio.output import KeptStream, cleaned, last_line, shown
from pivident.app.studio.run_folder import RunError, RunFolder, is_held, new_run, take
from pivident.app.studio.run_listing import RunProgress
from pivident.app.studio.supervisor import supervise, with_title
from tests.app.studio.projects import WAITS, WRITES, ended, entry, make_project, wait_for

pytestmark = pytest.mark.skipif(os.name == "nt", reason="signals and locks of POSIX")

#: Fills what is left of a small disk, and then does what a command does on one.
FILLS = """
import sys
try:
    with open("filler", "wb", buffering=0) as file:
        while True:
            file.write(bytes(4096))
except OSError:
    pass
"""


@pytest.fixture
def project(tmp_path, quick):
    return make_project(tmp_path / "elbow_1")


@pytest.fixture
def small_disk(tmp_path, quick):
    place = tmp_path / "disk"
    place.mkdir()
    mount = ["mount", "-t", "tmpfs", "-o", "size=512k", "tmpfs", str(place)]
    if shutil.which("mount") is None or subprocess.run(mount, capture_output=True).returncode:
        pytest.skip("a small file system can be mounted by root only")
    yield place
    wait_for(lambda: not subprocess.run(["umount", str(place)], capture_output=True).returncode)


def supervisor_of(project: Path, run: str) -> psutil.Process:
    state = str(RunFolder(project, run).state)
    return wait_for(
        lambda: next(
            (p for p in psutil.process_iter(["cmdline"]) if state in (p.info["cmdline"] or [])),
            None,
        )
    )


def test_a_run_whose_supervisor_is_killed_is_run_once_more(project, runs):
    (project / "script.py").write_text(WRITES + WAITS)
    run = runs.add(project, "identify", {})
    wait_for((project / "begun").exists)
    (command,) = (supervisor := supervisor_of(project, run)).children()
    # What the first attempt has left must not be taken for a result.
    (project / "results" / "001-identify" / "stale").touch()
    (project / "begun").unlink()
    supervisor.kill()
    wait_for((project / "begun").exists)
    assert not command.is_running() or command.status() == psutil.STATUS_ZOMBIE
    assert entry(runs, project, run)["state"] == "running"
    (project / "go").touch()
    found = ended(runs, project, run)
    assert found["state"] == "done" and "stale" not in {f["path"] for f in found["files"]}
    assert len((project / "ran").read_text().splitlines()) == 2


def test_a_run_that_is_killed_twice_has_failed(project, runs):
    (project / "script.py").write_text("import os\n" + WAITS)
    run = runs.add(project, "identify", {})
    for _ in range(2):
        wait_for((project / "begun").exists)
        (project / "begun").unlink()
        supervisor_of(project, run).kill()
    found = ended(runs, project, run)
    assert found["state"] == "failed" and "killed from outside, twice" in found["message"]
    assert not (project / "begun").exists() and not list(project.glob(".experiment-*"))


def test_a_killed_run_that_was_to_stop_is_cancelled(project, make_runs):
    (project / "script.py").write_text(
        "import os, signal\nsignal.signal(2, signal.SIG_IGN)" + WAITS
    )
    runs = make_runs()
    run = runs.add(project, "identify", {})
    wait_for((project / "begun").exists)
    runs.cancel(project, run)
    supervisor_of(project, run).kill()
    assert ended(runs, project, run)["state"] == "cancelled"


def test_a_supervisor_does_nothing_where_another_one_is_at_work(project):
    run = new_run(project, {"argv": [], "results": "results/{id}-x"}, None)
    lock = take(run.state / "lock")
    assert is_held(run.state / "lock") and run.stage() == "running"
    supervise(run)
    assert not run.started() and not run.outcome()
    lock.release()
    assert not is_held(run.state / "lock") and run.stage() == "waiting"


def test_an_unforeseen_error_of_the_supervisor_is_an_outcome(project):
    run = new_run(project, {"argv": ["x"]}, None)
    supervise(run)
    assert run.outcome()["state"] == "failed" and "KeyError" in run.outcome()["message"]


def test_a_full_disk_refuses_a_run_in_words(small_disk, runs):
    project = make_project(small_disk / "p")
    (project / "filler").write_bytes(bytes(440_000))
    before = sorted(p.name for p in project.iterdir())
    with pytest.raises(RunError, match=r"No space left.*free some space"):
        for _ in range(4):
            new_run(project, {"argv": [], "results": "results/{id}-x"}, b"x" * 4096)
    kept = [p for p in (project / ".pivident-studio" / "runs").iterdir() if p.is_dir()]
    assert len(kept) < 4 and all((p / "run.json").stat().st_size for p in kept)
    assert sorted(p.name for p in project.iterdir()) == [".pivident-studio", *before]


def test_a_disk_that_fills_up_leaves_an_outcome_in_words(small_disk, runs):
    error = "error: cannot write to results: No space left on device; free some space"
    script = f"{FILLS}print('x' * 9000)\nprint({error!r}, file=sys.stderr)\nsys.exit(1)\n"
    project = make_project(small_disk / "p", script)
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert found["state"] == "failed" and found["message"].startswith(error)
    assert found["results"] == "" and not list(project.rglob("*.new"))


def test_results_that_cannot_be_completed_say_so(small_disk, runs):
    project = make_project(small_disk / "p", f"import os\n{WRITES}{FILLS}")
    found = ended(runs, project, runs.add(project, "identify", {}))
    assert found["state"] == "done" and "No space left" in found["message"]
    assert {f["path"] for f in found["files"]} == {"identification.json"}
    assert not list((project / "results").glob(".pivident-*"))


@pytest.mark.parametrize("name", ["run.json", "last"])
def test_a_write_error_refuses_a_run_and_leaves_nothing(project, monkeypatch, name):
    written = run_folder.write_whole

    def full(path, text):
        if path.name == name:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC), str(path))
        written(path, text)

    monkeypatch.setattr(run_folder, "write_whole", full)
    with pytest.raises(RunError, match="No space left"):
        new_run(project, {}, None)
    assert not [p for p in (project / ".pivident-studio" / "runs").iterdir() if p.is_dir()]


def test_a_state_that_is_a_link_is_refused(project, tmp_path):
    (tmp_path / "elsewhere").mkdir()
    (project / "results").symlink_to(tmp_path / "elsewhere")
    with pytest.raises(RunError, match="is a link"):
        new_run(project, {}, None)


def test_output_without_end_is_bounded_and_cleaned(project, runs):
    """More than is kept, with commands for a terminal."""
    (project / "script.py").write_text(
        "import sys\nprint('\\x1b[31mred\\x1b[0m \\x1b]0;title\\x07\\x08begin')\n"
        "for _ in range(300):\n    sys.stdout.write('y' * 9999 + '\\n')\n"
        "print('10 %\\r 50 %\\r100 %')\nprint('the end')\n"
    )
    found = ended(runs, project, runs.add(project, "gains", {}))
    text = found["output"]
    assert len(text) < 201_000 and text.startswith("red \\x08begin\nyyy")
    assert text.endswith("\n100 %\nthe end\n") and "bytes left out" in text
    assert "\x1b" not in text and "title" not in text
    assert RunFolder(project, "001").state.joinpath("stdout").stat().st_size < 1_200_000


def test_kept_streams_have_their_beginning_and_their_end(tmp_path):
    stream = KeptStream(tmp_path / "out", most=10, last=4)
    for chunk in (b"01234567", b"89abc", b"defghijk"):
        stream.feed(chunk)
    stream.close()
    text = (tmp_path / "out").read_text()
    assert text == "0123456789\n… 7 bytes left out …\nhijk" and stream.end == "hijk"
    exact = KeptStream(tmp_path / "short", most=10, last=4)
    exact.feed(b"0123456789ab")
    exact.close()
    assert (tmp_path / "short").read_text() == "0123456789ab"


def test_a_stream_that_cannot_be_written_keeps_its_end(tmp_path):
    stream = KeptStream(tmp_path / "no" / "folder")
    stream.feed(b"error: disk full\n")
    stream.close()
    assert (
        stream.trouble == "No such file or directory"
        and last_line(stream.end) == "error: disk full"
    )


@pytest.mark.parametrize(
    ("said", "seen"),
    [
        ("\x1b[1;31mred\x1b[0m\x1b[2K", "red"),
        ("\x1b]8;;http://x\x1b\\link\x1b]8;;\x1b\\", "link"),
        ("\x1b]0;no end\nnext", "\nnext"),
        ("a\rb\r\nc\rd", "b\nd"),
        ("tab\tnul\x00 bell\x07 back\u202eward", "tab\tnul\\x00 bell\\x07 back\\u202eward"),
        ("\x9b31m", "\\x9b31m"),
    ],
)  # fmt: skip
def test_what_controls_a_terminal_is_taken_out(said, seen):
    assert cleaned(said) == seen


def test_shown_text_has_both_ends(tmp_path):
    (tmp_path / "out").write_text("a" * 600 + "z" * 600)
    assert shown(tmp_path / "out", 1000) == f"{'a' * 500}\n… 200 bytes left out …\n{'z' * 500}"
    assert shown(tmp_path / "absent") == ""


def test_progress_is_read_as_it_grows(tmp_path):
    progress = RunProgress(tmp_path / "progress")
    assert progress.now() == {
        "stage": "", "number": 0, "of": 0, "left_s": None, "line": "", "kept": [],
    }  # fmt: skip
    with (tmp_path / "progress").open("w") as file:
        file.write('{"stages": {"ls": 2, "piv": 10}}\n{"stage": "piv", "number": 2, "of": 2, "le')
        file.flush()
        assert progress.now()["of"] == 2 and progress.now()["stage"] == ""
        assert 10.0 < progress.now()["left_s"] <= 12.0
        file.write('ft_s": 1000.5}\nno json\n[1]\n{"keep": "ls: \\u001b[1mdone"}\n{"say": "now"}\n')
        file.flush()
        found = progress.now()
    assert (found["stage"], found["number"], found["line"]) == ("piv", 2, "now")
    assert found["kept"] == ["ls: done"] and 900.0 < found["left_s"] <= 1000.5
    (tmp_path / "progress").write_text('{"say": "again"}\n')
    assert progress.now()["line"] == "again" and progress.now()["kept"] == []


@pytest.mark.parametrize(
    ("text", "titled"),
    [
        ("# none\n", '# none\n\n[output]\ntitle = "my arm"\n'),
        (
            "[output]  # it\nfiles = 1\n\n[a]\n",
            '[output]  # it\nfiles = 1\ntitle = "my arm"\n\n[a]\n',
        ),
        ("output.files = 1\n", 'output.files = 1\noutput.title = "my arm"\n'),
        ("output = {files = 1}\n", 'output = {files = 1, title = "my arm"}\n'),
        ('[output]\ntitle = "mine"\n', '[output]\ntitle = "mine"\n'),
        ("output = 1\n", "output = 1\n"),
        ("[output\n", "[output\n"),
    ],
)
def test_a_file_without_a_title_gets_one(text, titled):
    assert with_title(text, "my_arm").replace("{files = 1,title", "{files = 1, title") == titled


def test_a_supervisor_starts_without_the_numerics():
    code = "import sys, pivident.app.studio.supervisor; print('numpy' in sys.modules)"
    found = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert found.stdout == "False\n"
