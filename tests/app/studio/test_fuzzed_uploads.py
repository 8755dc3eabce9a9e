"""Spoilt files of the fuzzer come through the upload: each is read, or refused in words."""

import random
import sys
import time

import pytest

pytest.importorskip("starlette")

from starlette.testclient import TestClient

from pivident.app.studio.server import application
from pivident.app.studio.studio import Studio
from pivident.app.studio.uploads import is_log
from tests.conftest import REPOSITORY

sys.path.insert(0, str(REPOSITORY / "benchmarks"))

from fuzzing.readers import READERS

TOKEN, PORT = "token-of-this-test", 5323
BASE = f"http://127.0.0.1:{PORT}"

#: Spoilt files of each reader.
EXAMPLES = 3


def test_the_fuzzed_corpus(tmp_path):
    app = application(Studio(tmp_path), TOKEN, PORT)
    with TestClient(
        app, base_url=BASE, headers={"origin": BASE}, cookies={f"pivident-{PORT}": TOKEN}
    ) as client:
        names = list(bring(client))
        assert len(names) > 20
        for name in names:
            end = time.monotonic() + 240
            while client.get(f"/p/{name}/state").json()["busy"]:
                assert time.monotonic() < end, name
                time.sleep(0.2)
            found = client.get(f"/p/{name}")  # with its parts, of checks and of files among them
            assert found.status_code == 200, (name, found.text)
            assert 'id="files"' in found.text and 'id="checks"' in found.text
            assert "bug in pivident" not in found.text, name
            assert "Error:" not in found.text, (name, found.text)  # no exception but ours


def bring(client):
    """A project for each spoilt file: as the log of a robot, or as the robot of nobody."""
    rng = random.Random(24)
    for reader in READERS.values():
        for k in range(EXAMPLES):
            data = rng.choice(reader.seeds())
            for _ in range(k):
                data = reader.mutated(data, rng)
            name = f"{reader.file.replace('.', ' ')} {k}"
            made = client.post("/projects", json={"name": name})
            if made.status_code != 200:
                continue  # two readers of one kind of file
            if is_log(reader.file):
                html = client.get(f"/p/{name}/part/files").text.replace("&#34;", '"')
                version = html.partition('"version": "')[2][:16]
                chosen = {"model": "planar_2r", "version": version}
                assert client.post(f"/p/{name}/robot", json=chosen).status_code == 200
            found = client.put(f"/p/{name}/files/{reader.file}", content=data)
            assert found.status_code in (200, 422), found.text
            if found.status_code == 200:
                yield name
