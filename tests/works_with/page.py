"""docs/reference/works_with.md from what methods declare: ``python -m tests.works_with.page``."""

from __future__ import annotations

from pathlib import Path

from pivident.estimation.methods import METHODS
from tests.works_with.scenes import FEATURES

PAGE = Path(__file__).parents[2] / "docs" / "reference" / "works_with.md"

HEAD = """\
# What works with what

Each method declares what it copes with, and a test runs every cell that says yes on a small robot.
What is not handled is refused before any work, with the methods to use instead. All
[methods](methods.md) take several recordings, trees and coupled motors.

"""


def page() -> str:
    """The text of the page."""
    titles = [feature.title for feature in FEATURES.values()]
    lines = ["| | " + " | ".join(titles) + " |", "|" + "---|" * (len(titles) + 1)]
    for name, method in METHODS.usable().items():
        cells = ["yes" if f.handled(method) else "–" for f in FEATURES.values()]
        lines.append(f"| `{name}` | " + " | ".join(cells) + " |")
    return HEAD + "\n".join(lines) + "\n"


if __name__ == "__main__":
    PAGE.write_text(page(), encoding="utf-8")
