"""Tasks run beside this process, are heard, fail in words, and end when they are stopped."""

import os
import signal
import time
from pathlib import Path

import pytest

from pivident.app.studio.tasks import Tasks
from pivident.foundation.errors import RecordingError


def write(path, words, say):
    say("writing")
    Path(path).write_text(f"{words} {os.getpid()}", encoding="utf-8")
    say("written")


def refuse(say):
    raise RecordingError("the log is empty; export it again")


def divide(say):
    say(f"{1 / 0}")


def die(say):
    os.kill(os.getpid(), signal.SIGKILL)


def write_forever(path, say):
    say("begun")
    while True:
        Path(path).write_text("x", encoding="utf-8")
        time.sleep(0.001)


@pytest.fixture(scope="module")
def tasks():
    made = Tasks()
    yield made
    made.close()


def until(tasks, key, condition, seconds=60.0):
    """The state of a task as soon as it fulfils a condition."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        state = tasks.state(key)
        if condition(state):
            return state
        time.sleep(0.005)
    raise AssertionError(f"{key} is still {tasks.state(key)}")


def ended(state):
    return state["state"] in ("done", "failed")


def test_a_task_runs_in_another_process(tasks, tmp_path):
    assert tasks.state("a") == {"state": "none", "line": "", "error": ""}
    tasks.start("a", write, tmp_path / "a", "by")
    assert until(tasks, "a", ended) == {"state": "done", "line": "written", "error": ""}
    words, process = (tmp_path / "a").read_text().split()
    assert words == "by" and int(process) != os.getpid()


@pytest.mark.parametrize(
    ("function", "words"),
    [(refuse, "the log is empty; export it again"), (divide, "ZeroDivisionError: division by zero"),
     (die, "stopped by signal 9")],
)  # fmt: skip
def test_why_a_task_failed(tasks, function, words):
    tasks.start("bad", function)
    state = until(tasks, "bad", ended)
    assert state["state"] == "failed" and words in state["error"]


def test_a_stopped_task_writes_no_more(tasks, tmp_path):
    path = tmp_path / "x"
    tasks.start("long", write_forever, path)
    until(tasks, "long", lambda state: state["line"] == "begun")
    while not path.exists():
        time.sleep(0.005)
    tasks.stop("long")
    path.unlink(missing_ok=True)
    time.sleep(0.1)
    assert not path.exists()
    assert tasks.state("long")["state"] == "none"


def test_a_new_task_takes_the_place_of_an_older_one(tasks, tmp_path):
    tasks.start("key", write_forever, tmp_path / "old")
    until(tasks, "key", lambda state: state["line"] == "begun")
    tasks.start("key", write, tmp_path / "new", "by")
    assert until(tasks, "key", ended)["state"] == "done"
    (tmp_path / "old").unlink(missing_ok=True)
    time.sleep(0.1)
    assert not (tmp_path / "old").exists()
