"""The studio in a browser: time to the first paint, windows of a long log, memory of the server.

    python benchmarks/studio.py [--samples 3000000] [--joints 7]

Two projects: the example (planar arm, 12 s), and a log of so many samples of a seven-axis arm. For
each, in Debian's Chromium at 1280 pixels: first contentful paint of the page, warm [s]; time from a
change of a unit to the new picture [s]; for the long log also the time of windows of all widths
[ms], and the resident memory of server and processes when it is idle again [GB].
"""

from __future__ import annotations

import argparse
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import psutil

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.app.studio.browsing import browsing, served
from tests.seven_axis_arm import seven_axis_log

from pivident.app.studio.drafting import ROBOT, write_log

PAINT = "() => performance.getEntriesByName('first-contentful-paint')[0]?.startTime ?? -1"
#: Repetitions of the paint and of each window.
REPEATS = 5


def long_project(folder: Path, samples: int, joints: int) -> None:
    """A log of an arm with many samples, positions, references and torques, as NPZ."""
    folder.mkdir()
    (folder / "arm.urdf").write_text(seven_axis_log(1, seconds=1.0).urdf, encoding="utf-8")
    rng = np.random.default_rng(1)
    t = np.arange(samples) / 1000.0
    phase = rng.uniform(0.0, 6.0, joints)
    speed = rng.uniform(0.3, 0.9, joints)
    q = 0.8 * np.sin(t[:, None] * speed + phase)
    tau = 8.0 * np.sin(t[:, None] * 1.3 * speed + phase) + rng.normal(0.0, 1.0, q.shape)
    dq = np.gradient(q, 1e-3, axis=0)
    measured = q + rng.normal(0.0, 1e-5, q.shape)
    np.savez(folder / "log.npz", t=t, q=measured, dq=dq, q_ref=q, tau=tau)
    (folder / "experiment.toml").write_text(
        'robot = "arm.urdf"\n\n[recording]\nfiles = "log.npz"\n'
        'columns = {t = "t", q = "q", q_ref = "q_ref", dq = "dq", tau = "tau"}\n'
        'units = {q = "rad", tau = "N m"}\n\n[identify]\nmethods = ["ls"]\n',
        encoding="utf-8",
    )


def checked(page) -> float:
    """Wait until the check has ended; seconds since the call."""
    begin = time.perf_counter()
    page.wait_for_function(
        "() => document.querySelector('#checks .headline') && "
        "!document.querySelector('#checks .busy')",
        timeout=590_000,
    )
    return time.perf_counter() - begin


def memory(pid: int) -> float:
    """Resident memory of a process and its children, shared pages counted once (PSS) [GB]."""
    process = psutil.Process(pid)
    every = (process, *process.children(recursive=True))
    return sum(one.memory_full_info().pss for one in every) / 1e9


def paints(page, address: str) -> list[float]:
    found = []
    for _ in range(REPEATS):
        page.goto(address)
        page.wait_for_timeout(300)
        found.append(page.evaluate(PAINT) / 1000.0)
    return found


def windows(page, name: str, duration: float) -> dict[str, float]:
    """Median time of a window by its width, as the page's script waits for it [ms]."""
    found = {}
    for share in (1.0, 0.3, 0.03, 0.001):
        times = []
        for k in range(REPEATS):
            start = 0.1 * k * duration * (1.0 - share)
            query = f"channel=q&joints=0,1,2,3,4,5,6&from={start}&to={start + share * duration}"
            times.append(
                page.evaluate(
                    "async (to) => { const t = performance.now();"
                    "await (await fetch(to)).json(); return performance.now() - t; }",
                    f"/p/{name}/window?{query}&points=900",
                )
            )
        found[f"{share:g}"] = float(np.median(times))
    return found


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--samples", type=int, default=3_000_000)
    parser.add_argument("--joints", type=int, default=7)
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        root = Path(place)
        (root / "example").mkdir()
        (root / "example" / "experiment.toml").write_text(f'robot = "{ROBOT}"\n', encoding="utf-8")
        write_log(root / "example")
        long_project(root / "long", asked.samples, asked.joints)
        with served(root) as server, browsing() as page:
            page.goto(server.address)
            for name in ("example", "long"):
                begin = time.perf_counter()
                page.goto(f"{server.base}/p/{name}")
                page.locator(".replay canvas").wait_for(timeout=590_000)
                print(f"{name}: arm and signals {time.perf_counter() - begin:.1f} s")
                first = paints(page, f"{server.base}/p/{name}")
                print(f"{name}: first paint {np.median(first):.2f} s (worst {max(first):.2f})")
            print("long: windows [ms]", windows(page, "long", asked.samples / 1000.0))
            page.goto(f"{server.base}/p/long")
            print(f"long: memory while it is checked {memory(server.process.pid):.2f} GB")
            print(f"long: checked {checked(page):.0f} s later")
            time.sleep(5.0)
            print(f"long: memory when idle {memory(server.process.pid):.2f} GB")


if __name__ == "__main__":
    main()
