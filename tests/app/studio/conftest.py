"""Queues of runs that are closed at the end of a test, with nothing left running."""

from contextlib import suppress

import psutil
import pytest

from pivident.app.studio.runs import Runs
from tests.app.studio.projects import with_quick_commands


@pytest.fixture
def quick(monkeypatch):
    with_quick_commands(monkeypatch)


@pytest.fixture
def make_runs(tmp_path):
    made = []

    def make(at_once=1):
        made.append(Runs(at_once))
        return made[-1]

    yield make
    for runs in made:
        runs.close()
    for process in psutil.process_iter(["cmdline", "cwd"]):
        line, place = " ".join(process.info["cmdline"] or []), process.info["cwd"] or ""
        if "pivident" in line and place.startswith(str(tmp_path)):
            with suppress(psutil.NoSuchProcess):
                process.kill()


@pytest.fixture
def runs(make_runs):
    return make_runs()
