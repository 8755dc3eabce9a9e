"""What follows from a result: a test on another log, friction laws that were chosen."""

import json
import re

import numpy as np
import pytest

pytest.importorskip("starlette")

from tests.app.studio.test_server import arm, client, version, wait_for
from tests.planar_log import EXPERIMENT, HEADER, planar_log, write_log

__all__ = ["arm", "client"]


def results(client):
    return client.get("/p/arm/part/results").text


def test_a_result_is_tested_on_another_log(client, arm, tmp_path):
    write_log(arm / "log.csv")
    (arm / "experiment.toml").write_text(EXPERIMENT.lstrip(), encoding="utf-8")
    wait_for(client, lambda: "Ready to run" in client.get("/p/arm/part/checks").text)
    run = {"step": "identify", "arguments": {"method": ["ls"]}}
    assert client.post("/p/arm/run", json=run).status_code == 200
    wait_for(client, lambda: "run done" in results(client))
    assert 'data-step="predict"' in results(client) and 'data-into="test_logs"' in results(client)
    path, values = tmp_path / "other.csv", planar_log(samples=4000, seed=7)
    np.savetxt(path, values, fmt="%.9g", delimiter=",", header=HEADER, comments="")
    log = "test_logs/other.csv"
    test = {"step": "predict", "arguments": {"result": "results/001-identify", "log": log}}
    found = client.post("/p/arm/run", json=test)
    assert found.status_code == 422 and "no log of this project" in found.json()["error"]
    text = (arm / "experiment.toml").read_text("utf-8")
    assert client.put(f"/p/arm/files/{log}", content=path.read_bytes()).status_code == 200
    assert client.post("/p/arm/run", json=test).status_code == 200
    wait_for(client, lambda: results(client).count("run done") == 2)
    answer = re.search(r"<strong>The torque error below 20 Hz is (0\.\d+) %", results(client))
    assert answer and float(answer[1]) < 1.0
    assert "prediction.html" in results(client)
    # It is no log to identify from: nothing is drafted of it, and the check does not begin again.
    assert (arm / "experiment.toml").read_text("utf-8") == text
    files = client.get("/p/arm/part/files").text
    assert re.search(r"test_logs/other\.csv</th><td>log for tests", files)


LAWS = """[robot.joint_friction]
"elbow" = [{term = "viscous"}, {term = "coulomb", smoothing = "tanh", gamma = 100.0}]
"""


def test_chosen_laws_are_written_into_the_file(client, arm):
    (arm / "experiment.toml").write_text(EXPERIMENT.lstrip(), encoding="utf-8")
    folder = arm / "results" / "001-laws"
    folder.mkdir(parents=True)
    (folder / "output.txt").write_text("no law predicts significantly better\n", "utf-8")
    assert "laws of elbow" not in results(client)
    (folder / "laws.toml").write_text(LAWS, "utf-8")
    (folder / "run.json").write_text(json.dumps({"step": "laws", "state": "done"}), "utf-8")
    assert "Write the laws of elbow into the experiment" in results(client)
    body = {"run": "001", "version": version(client)}
    assert client.post("/p/arm/laws", json=body | {"version": "0" * 16}).status_code == 409
    assert client.post("/p/arm/laws", json=body | {"run": "002"}).status_code == 422
    assert client.post("/p/arm/laws", json=body).status_code == 200
    text = (arm / "experiment.toml").read_text("utf-8")
    law = '[{term = "viscous"}, {term = "coulomb", smoothing = "tanh", gamma = 100.0}]'
    assert f'robot = {{model = "planar_2r", joint_friction = {{elbow = {law}}}}}' in text
    assert "laws of elbow" not in results(client)  # they are there
