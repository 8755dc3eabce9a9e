"""A page on a phone, as headless Chromium shows it."""

import base64
import contextlib
import json
import os
import re
import shutil
import signal
import subprocess
import threading
import zlib

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

PHONE = 390

needs_browser = pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")

#: Draws everything, as for a printer, and counts what came of it.
DRAWN = """
  dispatchEvent(new Event("beforeprint"));
  const plots = [...document.querySelectorAll(".plot")];
  const done = (plot) => plot.querySelector("svg.main-svg .trace path, svg.main-svg .hm image");
  for (let k = 0; k < 300 && !plots.every(done); k += 1) await wait(100);
  return { plots: plots.length, drawn: plots.filter(done).length };
"""

FRAME = """<body style="margin:0"><iframe src="report.html" width="{width}" height="800"></iframe>
<script>addEventListener("message", (event) => {{
  console.log("ANSWER" + btoa(String.fromCharCode(...new TextEncoder().encode(event.data))));
}});</script></body>"""


#: Runs the body of an asynchronous function in the page once it is loaded, and tells the answer.
QUESTION = """<script>
const errors = [];
addEventListener("error", (event) => errors.push(event.message));
addEventListener("unhandledrejection", (event) => errors.push(String(event.reason)));
addEventListener("securitypolicyviolation", (event) => errors.push(event.blockedURI));
const frame = () => new Promise(requestAnimationFrame);
async function wait(milliseconds) {
  await new Promise((done) => setTimeout(done, milliseconds));
  for (let k = 0; k < 3; k += 1) await frame();
}
addEventListener("load", async () => {
  let answer;
  try { answer = await (async () => { QUESTION })(); } catch (error) { errors.push(String(error)); }
  parent.postMessage(JSON.stringify(
    { errors, answer, width: innerWidth, content: document.documentElement.scrollWidth }), "*");
});
</script></head>"""


def seen_on_a_phone(text, folder):
    """How many plots the page has and draws; fails on errors and on sideways scrolling."""
    return asked(text, folder, DRAWN, PHONE)


def asked(text, folder, script, width=1280):
    """What a script answers that runs in the page; fails on errors and on sideways scrolling.

    Args:
        text: the page.
        folder: for files.
        script: body of an asynchronous function; ``await wait(milliseconds)`` lets time pass.
        width: of the window [px].
    """
    frame = framed(text, folder, QUESTION.replace("QUESTION", script), width)
    found, log = told(frame, folder, width)
    assert found["errors"] == []
    assert not re.search(r"CONSOLE.*(error|refused|uncaught)", log, re.IGNORECASE)
    assert found["width"] == width
    assert found["content"] <= width
    return found["answer"]


def told(page, folder, width, seconds=240.0):
    """What a page writes to its console behind ``ANSWER``, in real time, and all that went before.

    Frames are painted as for a reader, which virtual time does not promise.
    """
    command = [*browser(folder, width), page.as_uri()]
    process = subprocess.Popen(
        command, stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True
    )
    stop = threading.Timer(seconds, os.killpg, (process.pid, signal.SIGKILL))
    stop.start()
    lines = []
    try:
        for line in process.stderr:
            lines.append(line.decode("utf-8", "replace"))
            found = re.search(r"ANSWER([A-Za-z0-9+/=]+)", lines[-1])
            if found:
                return json.loads(base64.b64decode(found.group(1))), "".join(lines[:-1])
        raise AssertionError("the page did not answer:\n" + "".join(lines))
    finally:
        stop.cancel()
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()
        process.stderr.close()


def words_printed(text, folder):
    """How many pieces of text each printed page of a page has, shape (pages,)."""
    page, paper = folder / "printed.html", folder / "printed.pdf"
    page.write_text(text, encoding="utf-8")
    command = [*browser(folder, 800), f"--print-to-pdf={paper}", "--no-pdf-header-footer"]
    subprocess.run([*command, page.as_uri()], capture_output=True, timeout=120, check=True)
    counts = []
    for stream in re.findall(rb"stream\r?\n(.*?)endstream", paper.read_bytes(), re.DOTALL):
        with contextlib.suppress(zlib.error):
            shown = re.findall(rb"\bT[jJ]\b", zlib.decompressobj().decompress(stream))
            counts += [len(shown)] if len(shown) > 10 else []
    return counts


def framed(text, folder, probe, width):
    """A page with a script in its head, as a file, and one around it that gives it its width."""
    (folder / "report.html").write_text(text.replace("</head>", probe, 1), encoding="utf-8")
    frame = folder / "frame.html"
    frame.write_text(FRAME.format(width=width), encoding="utf-8")
    return frame


def browser(folder, width):
    """Command line of the browser, without what it should do."""
    return [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        f"--window-size={width + 20},900",
        f"--user-data-dir={folder / 'profile'}",
    ]
