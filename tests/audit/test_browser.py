"""The page in a browser: every figure drawn, no errors, no sideways scrolling on a phone."""

import html
import json
import re
import subprocess

import pytest

from pivident.audit import audit_log
from pivident.audit.page import render_page
from tests.audit.logs import planar
from tests.report.test_browser import BROWSER, FRAME, PHONE, PROBE


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_page_on_a_phone(tmp_path):
    text = render_page([audit_log(planar())])
    (tmp_path / "report.html").write_text(text.replace("</head>", PROBE, 1), encoding="utf-8")
    frame = tmp_path / "frame.html"
    frame.write_text(FRAME.format(width=PHONE), encoding="utf-8")
    command = [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        "--virtual-time-budget=20000",
        f"--user-data-dir={tmp_path / 'profile'}",
        "--dump-dom",
        frame.as_uri(),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=120, check=True)
    probe = re.search(r'data-probe="([^"]*)"', done.stdout)
    assert probe, done.stderr
    seen = json.loads(html.unescape(probe.group(1)))
    assert seen["errors"] == []
    assert seen["content"] <= PHONE
    assert seen["plots"] >= 8
