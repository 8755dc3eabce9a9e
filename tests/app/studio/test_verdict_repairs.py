"""A repair of the verdict is a button that says what it did when it was tried."""

import json
import re
import shutil

import pytest

pytest.importorskip("starlette")

from pivident.app.cli.app import main
from pivident.app.studio.runs import Runs
from tests.app.studio.projects import ended
from tests.app.studio.test_server import arm, bodies_of, client, version, wait_for
from tests.planar_log import EXPERIMENT, write_log

__all__ = ["arm", "client"]

COMMENT = "# as the logger says"
REVERSED = EXPERIMENT.replace("[recording]", f"{COMMENT}\n[recording]").replace(
    'tau = "N m"', 'tau = ["N m", -1.0]'
)


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A project with a verdict that has tried the sign of the elbow's torque."""
    folder = tmp_path_factory.mktemp("studio") / "arm"
    folder.mkdir()
    write_log(folder / "log.csv")
    (folder / "experiment.toml").write_text(REVERSED.lstrip(), encoding="utf-8")
    runs = Runs()
    try:
        run = runs.add(folder, "identify", {"method": ["ls"]})
        assert ended(runs, folder, run)["state"] == "done"
    finally:
        runs.close()
    return folder


@pytest.fixture
def judged(client, arm, made):
    """A copy of it in the studio."""
    shutil.copytree(made, arm, dirs_exist_ok=True)
    return arm


def results(client):
    return client.get("/p/arm/part/results").text


def test_pressed_it_is_in_the_file_and_the_run_is_offered_again(client, judged):
    page = results(client)
    (body,) = bodies_of(page, "/p/arm/repair")
    assert re.search(r"elbow.* · tried: error in motion \d+ % → 0\.3\d %</button>", page)
    assert ".experiment-001.toml" not in page and "Identify again" not in page
    stale = body | {"version": "0" * 16}
    assert client.post("/p/arm/repair", json=stale).status_code == 409
    for unknown in ({"number": 2}, {"number": 0}, {"run": "007"}):
        assert client.post("/p/arm/repair", json=body | unknown).status_code in (409, 422)
    assert client.post("/p/arm/repair", json=body).status_code == 200
    text = (judged / "experiment.toml").read_text("utf-8")
    assert 'tau = ["N m", 1.0]' in text and COMMENT in text
    page = results(client)
    assert "Identify again" in page and not bodies_of(page, "/p/arm/repair")
    wait_for(client, lambda: re.search(r"main\W*>Identify again", results(client)))
    again = {"step": "identify", "arguments": {"method": ["ls"]}}
    assert client.post("/p/arm/run", json=again).status_code == 200
    wait_for(client, lambda: results(client).count("run done") == 2)
    verdict = json.loads((judged / "results/002-identify/verdict.json").read_text("utf-8"))
    assert verdict["repairs"] == [] and verdict["uses"]["torque"]["answer"] == "yes"


def test_the_command_does_the_same(client, judged, monkeypatch, capsys):
    text = (judged / "experiment.toml").read_text("utf-8")
    (body,) = bodies_of(results(client), "/p/arm/repair")
    assert client.post("/p/arm/repair", json=body).status_code == 200
    pressed = (judged / "experiment.toml").read_text("utf-8")
    (judged / "experiment.toml").write_text(text, encoding="utf-8")
    verdict = json.loads((judged / "results/001-identify/verdict.json").read_text("utf-8"))
    command = verdict["summary"]["next_step"].split()
    assert command[:2] == ["pivident", "apply"] and "--results" in command
    monkeypatch.chdir(judged)
    assert main(command[1:]) == 0
    assert (judged / "experiment.toml").read_text("utf-8") == pressed


def test_a_file_that_says_something_else_takes_no_repair(client, judged):
    (body,) = bodies_of(results(client), "/p/arm/repair")
    text = (judged / "experiment.toml").read_text("utf-8")
    (judged / "experiment.toml").write_text(text.replace("kp", "# a gain\nkp"), encoding="utf-8")
    assert bodies_of(results(client), "/p/arm/repair")  # a comment is no change
    (judged / "experiment.toml").write_text(text + "max_order = 7\n", encoding="utf-8")
    assert not bodies_of(results(client), "/p/arm/repair")
    found = client.post("/p/arm/repair", json=body | {"version": version(client)})
    assert found.status_code == 409 and "has changed since" in found.json()["error"]
