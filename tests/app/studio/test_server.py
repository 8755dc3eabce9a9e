"""The studio's server: bad requests, bad files, other writers, and whom it talks to."""

import html
import json
import re
import time

import psutil
import pytest

pytest.importorskip("starlette")

from starlette.testclient import TestClient

from pivident.app.studio.server import application
from pivident.app.studio.studio import Studio
from tests.app.studio.browsing import Server, served
from tests.planar_log import EXPERIMENT, write_log

TOKEN, PORT = "token-of-this-test", 5321
BASE = f"http://127.0.0.1:{PORT}"


@pytest.fixture
def client(tmp_path):
    app = application(Studio(tmp_path), TOKEN, PORT)
    cookies = {f"pivident-{PORT}": TOKEN}
    with TestClient(app, base_url=BASE, headers={"origin": BASE}, cookies=cookies) as client:
        yield client


@pytest.fixture
def arm(client, tmp_path):
    assert client.post("/projects", json={"name": "arm"}).json()["to"] == "/p/arm"
    return tmp_path / "arm"


def version(client):
    page = client.get("/p/arm/part/files").text
    return re.search(r'"version": "(\w+)"', page.replace("&#34;", '"'))[1]


def test_every_method_is_described():
    from pivident.app.studio.projects import Content
    from pivident.app.studio.view import method_context
    from pivident.estimation.methods import METHODS

    groups = method_context(Content("recording = {files = 'log.csv'}"), {}, [])["groups"]
    described = {m["name"]: m["words"] for group in groups for m in group["methods"]}
    assert sorted(set(described) - {"pc-piv"}) == sorted(METHODS)
    assert all(described.values())


def test_pages_answer(client, arm):
    assert "New project" in client.get("/").text
    page = client.get("/p/arm")
    assert page.status_code == 200 and "Robot and logs" in page.text
    for name in client.get("/p/arm/state").json()["keys"]:
        assert client.get(f"/p/arm/part/{name}").status_code == 200
    for name in ("studio.js", "studio.css", "early.js", "front.js", "plotly.js"):
        assert client.get(f"/static/{name}").status_code == 200


@pytest.mark.parametrize(
    ("method", "path"),
    [("get", "/p/none"), ("get", "/p/arm/part/none"), ("get", "/static/none"),
     ("get", "/static/..%2faccess.py"), ("get", "/p/..%2f..%2fetc/state"),
     ("get", "/p/arm/results/%2e%2e/experiment.toml"), ("get", "/p/arm/results/none.html"),
     ("get", "/p/arm/audit.html"),
     ("get", "/p/arm/window?recording=x"), ("put", "/p/arm/files/%2e%2e/x.csv"),
     ("put", "/p/arm/files/x.exe"), ("delete", "/p/arm/files/experiment.toml"),
     ("post", "/p/arm/undo"), ("post", "/p/arm/runs/001/cancel"), ("delete", "/p/arm/runs/..")],
)  # fmt: skip
def test_bad_addresses_are_refused_in_words(client, arm, method, path):
    found = getattr(client, method)(path)
    assert found.status_code in (404, 405, 422), found.text
    if found.status_code == 422:
        assert len(found.json()["error"]) > 10
    assert sorted(p.name for p in arm.iterdir()) == [".pivident-studio"]


@pytest.mark.parametrize("body", [b"", b"{", b"[]", b'{"a": 1}', b'{"text": 1, "version": ""}',
                                  b"\xff", b"x" * 5_000_000])  # fmt: skip
def test_bad_bodies_are_refused_in_words(client, arm, body):
    for path in ("text", "edit", "fix", "run", "robot"):
        found = client.post(f"/p/arm/{path}", content=body)
        assert found.status_code == 422 and found.json()["error"]


def test_two_writers(client, arm):
    first = version(client)
    assert client.post("/p/arm/text", json={"text": "a = 1\n", "version": first}).status_code == 200
    found = client.post("/p/arm/text", json={"text": "a = 2\n", "version": first})
    assert found.status_code == 409 and "changed meanwhile" in found.json()["error"]
    assert (arm / "experiment.toml").read_text(encoding="utf-8") == "a = 1\n"
    assert client.post("/p/arm/undo").status_code == 422  # it was the first text


EVIL = "<img src=x onerror=alert(1)>"


def test_everything_is_escaped(client, arm):
    text = f"# {EVIL}\n[robot]\n# {EVIL}\nmodel = '{EVIL}'\n['{EVIL}']\n'{EVIL}' = '{EVIL}'\n"
    (arm / "experiment.toml").write_text(text, encoding="utf-8")
    wait_for(client, lambda: '<p class="busy"' not in client.get("/p/arm").text)
    pages = [client.get("/p/arm").text, client.get("/").text]
    for name in client.get("/p/arm/state").json()["keys"]:
        pages.append(client.get(f"/p/arm/part/{name}").text)
    assert any("&lt;img src=x" in page for page in pages)
    assert not [page for page in pages if "<img" in page]


def wait_for(client, done, seconds=120.0):
    end = time.monotonic() + seconds
    while not done():
        assert time.monotonic() < end
        time.sleep(0.1)


def bodies_of(page, address):
    """What the buttons of a page send to an address."""
    found = re.findall(rf"data-to=\"{address}\" data-body='([^']+)'", page)
    return [json.loads(html.unescape(body)) for body in found]


def errors_of_check(folder):
    (path,) = folder.glob(".pivident-studio/**/check.json")
    remarks = json.loads(path.read_text("utf-8"))["remarks"]
    return [remark["message"] for remark in remarks if remark["severity"] == "error"]


def test_run_is_not_offered_while_something_would_mislead(client, arm):
    write_log(arm / "log.csv")
    text = EXPERIMENT.replace('tau = "N m"', "tau = -1.0").lstrip()
    (arm / "experiment.toml").write_text(text, encoding="utf-8")
    run = {"step": "identify", "arguments": {"method": ["ls"]}}
    assert client.post("/p/arm/run", json=run).status_code == 422
    wait_for(client, lambda: "wrong results" in client.get("/p/arm/part/checks").text)
    found = client.post("/p/arm/run", json=run)
    assert found.status_code == 422 and "Checks" in found.json()["error"]
    assert "I know, go on" in client.get("/p/arm/part/run").text
    # Who knows it goes on, and the result remembers it.
    assert client.post("/p/arm/run", json=run | {"go_on": True}).json()["run"] == "001"
    wait_for(client, lambda: "run done" in client.get("/p/arm/part/results").text)
    (error,) = (s for s in errors_of_check(arm) if "tau" in s or "torque" in s)
    for name in ("run.json", "verdict.json"):
        stored = json.loads((arm / "results" / "001-identify" / name).read_text("utf-8"))
        assert error in stored["in_spite_of"]
    assert "Made in spite of this:" in client.get("/p/arm/part/results").text
    # Its fix is a button.
    bodies = bodies_of(client.get("/p/arm/part/checks").text, "/p/arm/fix")
    assert bodies
    assert client.post("/p/arm/fix", json=bodies[0]).status_code == 200
    wait_for(client, lambda: "Ready to run" in client.get("/p/arm/part/checks").text)


def test_the_example_is_simulated_and_may_be_simulated_again(client, tmp_path):
    assert client.post("/projects/example", json={"name": "ex"}).json()["to"] == "/p/ex"
    wait_for(client, lambda: client.get("/p/ex/state") and "recording" in text_of(tmp_path / "ex"))
    assert client.post("/p/ex/example").status_code == 422  # it has a log
    assert client.delete("/p/ex/files/log.csv").status_code == 200
    assert "Simulate a log" in client.get("/p/ex/part/files").text
    assert client.post("/p/ex/example").status_code == 200
    wait_for(client, lambda: (tmp_path / "ex" / "log.csv").is_file())


def text_of(project):
    return (project / "experiment.toml").read_text(encoding="utf-8")


def corpus():
    """Broken logs and robots, of which readers must say what is wrong."""
    return {
        "empty.csv": b"",
        "binary.csv": bytes(range(256)) * 40,
        "long.csv": b"a" * 100_000,
        "nan.csv": b"t,q1,q2,tau1,tau2\n" + b"nan,inf,-inf,1e999,x\n" * 50,
        "wide.csv": b",".join(b"c%d" % k for k in range(5000)) + b"\n",
        "evil.csv": b"t,<script>,../../x,=cmd()\n0,1,2,3\n",
        "bomb.csv.gz": b"\x1f\x8b\x08\x00" + b"\0" * 50,
        "no.mat": b"MATLAB 5.0 MAT-file" + b"\0" * 200,
        "no.npz": b"PK\x03\x04" + b"\0" * 50,
        "no.parquet": b"PAR1" + b"\0" * 50,
        "no.mcap": b"\x89MCAP0\r\n" + b"\xff" * 60,
        "no.db3": b"SQLite format 3\0" + b"\0" * 100,
        "no.bag": b"#ROSBAG V2.0\n" + b"\0" * 60,
        "laughs.urdf": b'<!DOCTYPE l [<!ENTITY a "aaaa"><!ENTITY b "&a;&a;">]><robot>&b;</robot>',
        "outside.urdf": b'<!DOCTYPE r [<!ENTITY x SYSTEM "file:///etc/passwd">]>'
        b'<robot name="&x;"/>',
        "half.urdf": b"<robot name='x'><link name='a'/><joint",
        "no.xml": b"<mujoco><include file='/etc/passwd'/></mujoco>",
        "deep.toml": b"a = " + b"[" * 3000,
    }


@pytest.mark.parametrize("name", corpus())
def test_what_is_broken_is_said(client, arm, name):
    robot = name.endswith((".urdf", ".xml", ".toml"))
    if not robot:
        body = {"model": "planar_2r", "version": version(client)}
        assert client.post("/p/arm/robot", json=body).status_code == 200
    assert client.put(f"/p/arm/files/{name}", content=corpus()[name]).status_code == 200
    wait_for(client, lambda: not client.get("/p/arm/state").json()["busy"])
    page = client.get("/p/arm")
    assert page.status_code == 200
    assert "root:" not in page.text and "<script>," not in page.text
    if not robot:
        assert "No experiment file can be drafted yet" in page.text


def test_ten_projects_at_once(client, tmp_path):
    log = tmp_path / "log.csv"
    write_log(log)
    names = [f"arm {k}" for k in range(10)]
    for name in names:
        assert client.post("/projects", json={"name": name}).status_code == 200
        (tmp_path / name / "log.csv").write_bytes(log.read_bytes())
        (tmp_path / name / "experiment.toml").write_text(EXPERIMENT.lstrip(), encoding="utf-8")
    for name in names:
        client.get(f"/p/{name}/state")
    for name in names:
        wait_for(client, lambda n=name: "Ready to run" in client.get(f"/p/{n}/part/checks").text)


def test_it_talks_to_nobody(tmp_path):
    """Connections of the server and of all its processes, while it drafts and checks."""
    folder = tmp_path / "arm"
    folder.mkdir()
    write_log(folder / "log.csv")
    (folder / "experiment.toml").write_text('robot = "planar_2r"\n', encoding="utf-8")
    seen = set()
    with served(tmp_path) as server:
        client = browser_of(server)
        end = time.monotonic() + 180
        while "Ready to run" not in client.get("/p/arm/part/checks").text:
            assert time.monotonic() < end
            seen |= addresses(server.process.pid)
            time.sleep(0.05)  # the processor is the server's
    assert seen <= {"127.0.0.1"}


def browser_of(server: Server):
    import httpx2

    client = httpx2.Client(base_url=server.base, timeout=60.0)
    client.get(f"/?token={server.token}")
    return client


def addresses(pid):
    process = psutil.Process(pid)
    found = set()
    for one in (process, *process.children(recursive=True)):
        try:
            connections = one.net_connections(kind="inet")
        except psutil.Error:
            continue
        found |= {end.ip for c in connections for end in (c.laddr, c.raddr) if end}
    return found
