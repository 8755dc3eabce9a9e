"""Who is answered: only who has the token, asks this host, and comes from its own page."""

import pytest

pytest.importorskip("starlette")

from starlette.applications import Starlette
from starlette.middleware import Middleware
from starlette.responses import PlainTextResponse
from starlette.routing import Route
from starlette.testclient import TestClient

from pivident.app.studio.access import POLICY, Access, new_token

TOKEN, PORT = "a-secret-of-this-test", 5123
BASE = f"http://127.0.0.1:{PORT}"


def client(base=BASE, token=TOKEN, **headers):
    async def answer(request):
        return PlainTextResponse("inside")

    app = Starlette(
        routes=[Route("/{rest:path}", answer, methods=["GET", "POST", "PUT", "DELETE"])],
        middleware=[Middleware(Access, token=TOKEN, port=PORT)],
    )
    cookies = {f"pivident-{PORT}": token} if token else {}
    return TestClient(app, base_url=base, headers=headers, cookies=cookies, follow_redirects=False)


def test_with_token_and_own_origin():
    assert client().get("/").text == "inside"
    for method in ("post", "put", "delete"):
        assert getattr(client(origin=BASE), method)("/p/x").text == "inside"


@pytest.mark.parametrize("token", ["", "a-secret-of-this-tess", "A-SECRET-OF-THIS-TEST", "%C3%A4"])
def test_nothing_without_the_token(token):
    for path in ("/", "/static/studio.js", "/p/x/state", "/nowhere"):
        found = client(token=token).get(path)
        assert found.status_code == 401 and "inside" not in found.text
    assert client(token=token and "x", origin=BASE).post("/p/x").status_code == 401


def test_token_of_the_address_becomes_a_cookie_and_leaves_the_address():
    asked = client(token="")
    found = asked.get(f"/p/x?token={TOKEN}&more=1")
    assert found.status_code == 303 and found.headers["location"] == "/p/x?more=1"
    cookie = found.headers["set-cookie"].lower()
    assert "httponly" in cookie and "samesite=strict" in cookie and "path=/" in cookie
    assert asked.get("/p/x").text == "inside"  # the cookie is kept
    assert client(token="").get("/?token=wrong").status_code == 401


def test_the_address_leads_nowhere_else():
    found = client(token="").get(f"{BASE}//evil.example/?token={TOKEN}")
    assert found.headers["location"] == "/evil.example/"


def test_a_form_cannot_carry_the_token():
    assert client(token="", origin=BASE).post(f"/p/x?token={TOKEN}").status_code == 401


@pytest.mark.parametrize(
    "host", ["evil.example", f"evil.example:{PORT}", "127.0.0.1", f"127.0.0.1:{PORT + 1}", "",
             f"127.0.0.1.evil.example:{PORT}", f"[::1]:{PORT}"],
)  # fmt: skip
def test_other_hosts_are_refused(host):
    found = client(host=host).get("/")
    assert found.status_code == 421 and "inside" not in found.text


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "null", f"https://127.0.0.1:{PORT}", "http://127.0.0.1:1", ""]
)
def test_other_origins_are_refused(origin):
    assert client(origin=origin).post("/p/x").status_code == 403
    assert client(origin=origin).get("/p/x").status_code == 403


def test_a_change_without_origin_is_refused():
    assert client().post("/p/x").status_code == 403
    assert client(**{"sec-fetch-site": "cross-site"}).get("/").status_code == 403
    assert client(**{"sec-fetch-site": "same-site"}).get("/").status_code == 403  # another port


def test_every_answer_forbids_framing_and_reading_elsewhere():
    for found in (client().get("/"), client(token="").get("/")):
        assert found.headers["x-frame-options"] == "DENY"
        assert found.headers["content-security-policy"] == POLICY
        assert found.headers["x-content-type-options"] == "nosniff"
        assert found.headers["referrer-policy"] == "no-referrer"
        assert found.headers["cache-control"] == "no-store"
        assert found.headers["cross-origin-resource-policy"] == "same-origin"


def test_broken_cookies_are_no_token():
    headers = {"cookie": 'pivident-5123="\\777; ;;==='}
    assert client(token="", **headers).get("/").status_code == 401


def test_tokens_differ_and_are_long():
    tokens = {new_token() for _ in range(50)}
    assert len(tokens) == 50 and min(map(len, tokens)) >= 43
