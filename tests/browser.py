"""A page on a phone, as headless Chromium shows it: one browser, a fresh profile for each page."""

import atexit
import base64
import contextlib
import fcntl
import json
import os
import re
import shutil
import signal
import subprocess
import tempfile
import threading
import zlib

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

PHONE = 390

needs_browser = pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")

#: Draws everything, and counts what came of it.
DRAWN = """
  await drawAll();
  return { plots: plots().length, drawn: plots().filter(drawn).length };
"""

#: Comes to each figure of a part, which then draws itself.
SCROLLED = """
  document.querySelectorAll("details").forEach((part) => { part.open = true; });
  const own = plots().filter((plot) => plot.closest("PART"));
  for (const plot of own) {
    plot.scrollIntoView({ block: "center", behavior: "instant" });
    for (let k = 0; k < 300 && !drawn(plot); k += 1) await wait(50);
  }
  return { plots: own.length, drawn: own.filter(drawn).length };
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
const plots = () => [...document.querySelectorAll(".plot")];
const drawn = (plot) => plot.querySelector("svg.main-svg .trace path, svg.main-svg .hm image");
// As for a printer, which draws once more what is drawn already; so it is asked but once.
async function drawAll() {
  if (plots().every(drawn)) return;
  dispatchEvent(new Event("beforeprint"));
  dispatchEvent(new Event("afterprint"));
  for (let k = 0; k < 300 && !plots().every(drawn); k += 1) await wait(100);
}
addEventListener("load", async () => {
  let answer;
  try { answer = await (async () => { QUESTION })(); } catch (error) { errors.push(String(error)); }
  parent.postMessage(JSON.stringify(
    { errors, answer, width: innerWidth, content: document.documentElement.scrollWidth }), "*");
});
</script></head>"""


def seen_on_a_phone(text, folder, part=None):
    """How many plots the page has and draws; fails on errors and on sideways scrolling.

    Args:
        text: the page.
        folder: for files.
        part: selector of what is drawn of it; all by default.
    """
    script = DRAWN if part is None else SCROLLED.replace("PART", part)
    return asked(text, folder, script, PHONE)


def asked(text, folder, script, width=1280):
    """What a script answers that runs in the page; fails on errors and on sideways scrolling.

    Args:
        text: the page.
        folder: for files.
        script: body of an asynchronous function; ``await wait(milliseconds)`` lets time pass,
            ``await drawAll()`` draws the figures that are not.
        width: of the window [px].
    """
    frame = framed(text, folder, QUESTION.replace("QUESTION", script), width)
    found, log = told(frame)
    assert found["errors"] == []
    assert not re.search(r"CONSOLE.*(error|refused|uncaught)", log, re.IGNORECASE)
    assert found["width"] == width
    assert found["content"] <= width
    return found["answer"]


def told(page, seconds=240.0):
    """What a page writes to its console behind ``ANSWER``, in real time, and all that went before.

    Frames are painted as for a reader, which virtual time does not promise.
    """
    browser = running_browser()
    stop = threading.Timer(seconds, browser.kill)
    stop.start()
    lines = []
    try:
        with browser.tab(page.as_uri()):
            for line in browser.process.stderr:
                lines.append(line.decode("utf-8", "replace"))
                found = re.search(r"ANSWER([A-Za-z0-9+/=]+)", lines[-1])
                if found:
                    return json.loads(base64.b64decode(found.group(1))), "".join(lines[:-1])
            raise AssertionError("the page did not answer:\n" + "".join(lines))
    finally:
        stop.cancel()


def renumbered(end):
    """An end of a pipe that is neither 3 nor 4, where a browser listens and answers."""
    higher = fcntl.fcntl(end, fcntl.F_DUPFD_CLOEXEC, 10)
    os.close(end)
    return higher


class Browser:
    """A browser that is told over a pipe what to open, and ends with whoever holds the pipe."""

    def __init__(self):
        self._profile = tempfile.TemporaryDirectory(ignore_cleanup_errors=True)
        (listens, tells), (answers, replies) = (map(renumbered, os.pipe()) for _ in range(2))

        def takes_its_ends():
            os.dup2(listens, 3)
            os.dup2(replies, 4)

        self.process = subprocess.Popen(
            [*command_line(self._profile.name, 1300), "--remote-debugging-pipe", "about:blank"],
            stderr=subprocess.PIPE, stdout=subprocess.DEVNULL, start_new_session=True,
            preexec_fn=takes_its_ends, pass_fds=(3, 4),
        )  # fmt: skip
        os.close(listens)
        os.close(replies)
        self._tells, self._answers = os.fdopen(tells, "wb"), os.fdopen(answers, "rb")
        self._asked = 0
        atexit.register(self.kill)  # before its profile is removed

    def tell(self, method, **parameters):
        """The answer to a command of the protocol of Chromium's developer tools."""
        self._asked += 1
        message = {"id": self._asked, "method": method, "params": parameters}
        self._tells.write(json.dumps(message).encode() + b"\0")
        self._tells.flush()
        text = bytearray()
        while byte := self._answers.read(1):
            if byte != b"\0":
                text += byte
                continue
            answer = json.loads(text)
            if answer.get("id") == self._asked:
                return answer["result"]
            text.clear()
        raise AssertionError(f"the browser has ended at {method}")

    @contextlib.contextmanager
    def tab(self, address):
        """A page is open, and has met no other."""
        own = self.tell("Target.createBrowserContext")
        self.tell("Target.createTarget", url=address, **own)
        yield
        self.tell("Target.disposeBrowserContext", **own)

    def kill(self):
        """End it at once."""
        if self.process.poll() is None:
            os.killpg(self.process.pid, signal.SIGKILL)
            self.process.wait()


_BROWSERS = []


def running_browser():
    """The browser of all pages of this process; another one if it has been killed."""
    if not _BROWSERS or _BROWSERS[-1].process.poll() is not None:
        _BROWSERS[:] = [Browser()]
    return _BROWSERS[0]


def words_printed(text, folder):
    """How many pieces of text each printed page of a page has, shape (pages,)."""
    page, paper = folder / "printed.html", folder / "printed.pdf"
    page.write_text(text, encoding="utf-8")
    command = command_line(folder / "profile", 800)
    command += [f"--print-to-pdf={paper}", "--no-pdf-header-footer"]
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


def command_line(profile, width):
    """Command line of the browser, without what it should do."""
    return [
        BROWSER,
        "--headless",
        "--no-sandbox",
        "--disable-gpu",
        "--disable-background-networking",
        "--disable-features=SpareRendererForSitePerProcess",
        "--hide-scrollbars",
        "--enable-logging=stderr",
        f"--window-size={width + 20},900",
        f"--user-data-dir={profile}",
    ]
