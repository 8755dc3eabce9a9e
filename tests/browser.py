"""A page on a phone, as headless Chromium shows it."""

import html
import json
import re
import shutil
import subprocess

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

PHONE = 390

needs_browser = pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")

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
      (plot) => plot.querySelector("svg.main-svg .trace path, svg.main-svg .hm image")
    ).length,
  }), "*"), 2000);
});
</script></head>"""

FRAME = """<body style="margin:0"><iframe src="report.html" width="{width}" height="800"></iframe>
<script>addEventListener("message", (event) => {{ document.body.dataset.probe = event.data; }});
</script></body>"""


def seen_on_a_phone(text, folder):
    """What the page reports of itself; fails on errors and on sideways scrolling."""
    (folder / "report.html").write_text(text.replace("</head>", PROBE, 1), encoding="utf-8")
    frame = folder / "frame.html"
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
        f"--user-data-dir={folder / 'profile'}",
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
    return seen
