"""How heavy a report is, and how soon a reader sees it: six axes, 45,000 samples, three methods.

    python -m benchmarks.report_page [--page report.html] [--runs 5]

Opens the page in headless Chromium, in real time, and reads what the browser itself measured: the
first contentful paint, the load event, and how long the first figure takes once a reader goes to
it. Figures below the fold are not drawn before. Asked: below 8 MB, and the first view below 2 s.
"""

from __future__ import annotations

import argparse
import statistics
import tempfile
import time
from pathlib import Path

from tests.browser import BROWSER, told
from tests.synthetic_identification import synthetic_identification

from pivident.judgement.report.builder import render_report

SAMPLES, RATE, METHODS = 45_000, 5000.0, ("IDIM-LS", "IDIM-IV", "IDIM-PIV")

PROBE = """<script>
addEventListener("load", () => setTimeout(async () => {
  const paint = performance.getEntriesByName("first-contentful-paint")[0];
  const navigation = performance.getEntriesByType("navigation")[0];
  const drawn = document.querySelectorAll(".plot[data-drawn]").length;
  const plot = [...document.querySelectorAll("#torque .plot")].find((own) => own.checkVisibility());
  const before = performance.now();
  let figure = null;
  if (plot) {
    plot.scrollIntoView({ behavior: "instant" });
    while (!plot.querySelector(".trace path")) await new Promise(requestAnimationFrame);
    figure = performance.now() - before;
  }
  const all = document.querySelectorAll(".plot").length;
  console.log("ANSWER" + btoa(JSON.stringify(
    { paint: paint?.startTime, load: navigation.loadEventEnd, drawn, all, figure })));
}, 300));
</script></head>"""


def main() -> None:
    """Render or read the page, open it several times, print the figures."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--page", type=Path, help="a page that exists, instead of a made-up one")
    parser.add_argument("--runs", type=int, default=5)
    options = parser.parse_args()
    if BROWSER is None:
        raise SystemExit("chromium is not installed")
    if options.page:
        text = options.page.read_text(encoding="utf-8")
    else:
        results = [
            synthetic_identification(name, "staubli_tx40", samples=SAMPLES, rate=RATE, seed=k)
            for k, name in enumerate(METHODS)
        ]
        begin = time.perf_counter()
        text = render_report(results)
        print(f"rendered in {time.perf_counter() - begin:.1f} s")
    print(f"size {len(text.encode()) / 1e6:.2f} MB (asked: below 8 MB)")
    found = [_opened(text) for _ in range(options.runs)]
    for key, words in (
        ("paint", "first contentful paint"),
        ("load", "load event"),
        ("figure", "first figure after going to it"),
    ):
        values = [one[key] / 1000.0 for one in found if one[key] is not None]
        if values:
            median = statistics.median(values)
            print(f"{words}: median {median:.2f} s, {min(values):.2f} to {max(values):.2f} s")
    print(f"figures drawn before: {found[0]['drawn']} of {found[0]['all']}")


def _opened(text: str) -> dict[str, float]:
    """What a fresh browser measures on the page."""
    with tempfile.TemporaryDirectory() as folder:
        page = Path(folder) / "report.html"
        page.write_text(text.replace("</head>", PROBE, 1), encoding="utf-8")
        return told(page, Path(folder), width=1400)[0]


if __name__ == "__main__":
    main()
