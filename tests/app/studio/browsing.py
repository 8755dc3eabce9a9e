"""A studio of its own for each test, and Debian's Chromium in front of it."""

import re
import shutil
import signal
import subprocess
import sys
from contextlib import contextmanager

import pytest

BROWSER = shutil.which("chromium") or shutil.which("chromium-browser")

needs_browser = pytest.mark.skipif(BROWSER is None, reason="chromium is not installed")

#: Nothing that a browser does by itself: every request that is seen is the page's.
ARGUMENTS = [
    "--no-sandbox", "--disable-gpu", "--disable-background-networking", "--disable-sync",
    "--disable-component-update", "--disable-default-apps", "--no-first-run",
]  # fmt: skip


#: A page asks for news every 1.5 s; here it does so at once, so that no test waits for that.
HASTE = """
const later = window.setTimeout;
window.setTimeout = (task, time, ...rest) => later(task, time > 1000 ? 150 : time, ...rest);
"""


class Server:
    """A studio in a process of its own."""

    def __init__(self, root, *options):
        command = [sys.executable, "-m", "pivident", "studio", str(root), "--no-browser", *options]
        self.process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
        line = self.process.stdout.readline()
        found = re.search(r"http://127\.0\.0\.1:(\d+)/\?token=(\S+)", line)
        assert found, line
        self.address, self.port, self.token = found.group(0), int(found.group(1)), found.group(2)
        self.base = f"http://127.0.0.1:{self.port}"

    def stop(self, how=signal.SIGINT):
        self.process.send_signal(how)
        self.process.wait(20)
        self.process.stdout.close()


@contextmanager
def served(root, *options):
    server = Server(root, *options)
    try:
        yield server
    finally:
        if server.process.poll() is None:
            server.stop()


@contextmanager
def chromium():
    """A browser without a window, which takes a second to start."""
    from playwright.sync_api import sync_playwright

    with sync_playwright() as played:
        browser = played.chromium.launch(executable_path=BROWSER, args=ARGUMENTS)
        yield browser
        browser.close()


@contextmanager
def window(browser, width=1280, colour="light", touch=False):
    """A window that remembers nothing; fails on console errors and on requests to anybody else."""
    context = browser.new_context(
        viewport={"width": width, "height": 900 if width > 500 else 844},
        color_scheme=colour,
        has_touch=touch,
        accept_downloads=True,
    )
    context.set_default_timeout(60_000)
    context.add_init_script(HASTE)
    page = context.new_page()
    page.seen_errors, page.seen_requests = [], []
    page.on("pageerror", lambda error: page.seen_errors.append(str(error)))
    page.on(
        "console",
        lambda message: message.type == "error" and page.seen_errors.append(message.text),
    )
    page.on("request", lambda request: page.seen_requests.append(request.url))
    try:
        yield page
        errors, requests = page.seen_errors, page.seen_requests
    finally:
        context.close()
    assert not errors, errors
    foreign = [u for u in requests if not re.match(r"http://127\.0\.0\.1:\d+/|data:|blob:", u)]
    assert not foreign, foreign


@contextmanager
def browsing(width=1280, colour="light", touch=False):
    """A window of a browser of its own."""
    with chromium() as browser, window(browser, width, colour, touch) as page:
        yield page


def fits(page):
    """Whether nothing has to be scrolled sideways."""
    return page.evaluate("document.documentElement.scrollWidth <= innerWidth")
