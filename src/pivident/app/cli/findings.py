"""Findings on the command line: a line each, broken and coloured on a terminal."""

from __future__ import annotations

import sys
from collections.abc import Iterable
from textwrap import wrap

from pivident.foundation.text.finding import Finding, Severity
from pivident.foundation.text.printable import escaped

#: How severities look on a terminal with colours.
STYLES: dict[Severity, str] = {
    "error": "bold red",
    "warning": "yellow",
    "note": "",
    "ok": "green",
}

#: Width of a line on a terminal; lines of a file or a pipe are not broken.
WIDTH = 96


def print_findings(findings: Iterable[Finding]) -> None:
    """Severity, place, message and next step of each."""
    from rich.console import Console
    from rich.text import Text

    console = Console(highlight=False)
    for finding in findings:
        word = f"  {finding.severity:<7} "
        heading = f"{finding.heading}:" if finding.heading else ""
        lines = [escaped(x) for x in (heading, finding.message, finding.next_step) if x]
        if not sys.stdout.isatty():
            print(word + " ".join(lines))
            continue
        broken = [part for line in lines for part in wrap(line, WIDTH - len(word))]
        console.print(Text(word, STYLES[finding.severity]), end="")
        console.print(Text(f"\n{' ' * len(word)}".join(broken)))
