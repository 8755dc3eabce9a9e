"""From two files to a verdict in the studio, as a newcomer's machine does it: nothing is compiled.

    python benchmarks/studio_first_verdict.py [--seconds 30]

The UR10e-like arm of the examples, simulated by Pinocchio, in Debian's Chromium: name, Create, the
two files, Run as soon as it is offered. Kernels are compiled into an empty folder. Printed: seconds
since the first page until the draft, until Run is offered, and until the verdict.
"""

from __future__ import annotations

import argparse
import importlib.util
import os
import sys
import tempfile
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.app.studio.browsing import browsing, served

REPOSITORY = Path(__file__).resolve().parents[1]

#: Longest wait for a step [ms].
PATIENCE = 900_000

DRAFTED = "() => document.querySelector('[data-mark=files].mark').textContent.includes('✓')"
OFFERED = "() => document.querySelector('#run fieldset:enabled button.main')"


def write_files(folder: Path, seconds: float) -> list[Path]:
    """URDF and log of the arm, as its owner has them."""
    path = REPOSITORY / "examples" / "ur10e_like" / "simulate_log.py"
    spec = importlib.util.spec_from_file_location(path.stem, path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    folder.mkdir()
    module.write(folder, seconds=seconds)
    return [folder / "ur10e_like.urdf", folder / "rtde_log.csv"]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--seconds", type=float, default=30.0, help="of motion in the log")
    asked = parser.parse_args()
    with tempfile.TemporaryDirectory() as place:
        files = write_files(Path(place, "files"), asked.seconds)
        os.environ["NUMBA_CACHE_DIR"] = str(Path(place, "kernels"))
        Path(place, "robots").mkdir()
        with served(Path(place, "robots")) as server, browsing() as page:
            begin = time.perf_counter()

            def say(what: str) -> None:
                print(f"{what} after {time.perf_counter() - begin:.0f} s", flush=True)

            page.goto(server.address)
            page.get_by_label("Name of the project").first.fill("cobot")
            page.get_by_role("button", name="Create", exact=True).click()
            page.wait_for_url("**/p/cobot")
            page.locator("#bring").set_input_files(files)
            page.wait_for_function(DRAFTED, timeout=PATIENCE)
            say("drafted")
            page.wait_for_function(OFFERED, timeout=PATIENCE)
            say("Run offered")
            page.get_by_role("button", name="Run", exact=True).click()
            page.locator("article.run .headline").first.wait_for(timeout=PATIENCE)
            say("verdict")


if __name__ == "__main__":
    main()
