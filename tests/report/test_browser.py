"""The page in a browser: figures drawn, no errors, no sideways scrolling on a phone."""

import html
import json
import re
import shutil
import subprocess

import pytest

from pivident.report.builder import render_report
from tests.synthetic_identification import (
    synthetic_identification,
    synthetic_loop,
    true_parameters,
)

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

PHONE = 390

#: Draws everything, then tells the page around it what came of it.
PROBE = """<script>
const errors = [];
addEventListener("error", (event) => errors.push(event.message));
addEventListener("securitypolicyviolation", (event) => errors.push(event.blockedURI));
addEventListener("load", () => {
  dispatchEvent(new Event("beforeprint"));
  setTimeout(() => parent.postMessage(JSON.stringify({
    errors,
    width: innerWidth,
    content: document.documentElement.scrollWidth,
    plots: document.querySelectorAll(".plot").length,
    drawn: [...document.querySelectorAll(".plot")].filter(
      (plot) => plot.querySelector("svg.main-svg .trace path")
    ).length,
  }), "*"), 2000);
});
</script></head>"""

FRAME = """<body style="margin:0"><iframe src="report.html" width="{width}" height="800"></iframe>
<script>addEventListener("message", (event) => {{ document.body.dataset.probe = event.data; }});
</script></body>"""


@pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")
def test_page_on_a_phone(tmp_path):
    results = [
        synthetic_identification("IDIM-LS", seed=3),
        synthetic_identification("IDIM-IV", seed=4, loop=synthetic_loop("law")),
        synthetic_identification("IDIM-PIV", seed=5, loop=synthetic_loop("moves")),
    ]
    text = render_report(results, true_parameters())
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
    assert not re.search(r"CONSOLE.*(error|refused|uncaught)", done.stderr, re.IGNORECASE)
    assert seen["width"] == PHONE
    assert seen["content"] <= PHONE
    assert seen["drawn"] == seen["plots"] > 10
