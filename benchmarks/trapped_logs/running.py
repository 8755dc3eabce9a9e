"""One run of the program on a log with a trap, and what its verdict holds."""

from __future__ import annotations

import json
import os
import subprocess
import sys
import time
import tomllib
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

METHODS = "ls,iv-full-rate,piv"

#: Longest time of one command [s].
PATIENCE = 540


@dataclass
class Outcome:
    """What `pivident identify` says.

    Attributes:
        code: exit code; -1: it took too long.
        wall: time [s].
        processor: time of the processor [s].
        headline: of the verdict, or the last line of a refusal.
        severity: of the verdict, ``refused`` without one.
        statements: reservations with topic, kind, subject, severity and message.
        held_out: torque error of the recommended method on held-out motion [%].
        least_squares: the same of least squares.
        uses: answers by use, where the verdict has them.
        repairs: those that won their trial, best first.
        tried: all trials.
        notices: lines above the verdict about samples that were left out.
    """

    code: int
    wall: float
    processor: float
    headline: str
    severity: str = "refused"
    statements: list[dict[str, str]] = field(default_factory=list)
    held_out: float | None = None
    least_squares: float | None = None
    uses: dict[str, Any] = field(default_factory=dict)
    repairs: list[dict[str, Any]] = field(default_factory=list)
    tried: list[dict[str, Any]] = field(default_factory=list)
    notices: list[str] = field(default_factory=list)

    @property
    def reservations(self) -> list[dict[str, str]]:
        """Errors, then warnings, each in the order of the verdict."""
        return [
            one
            for severity in ("error", "warning")
            for one in self.statements
            if one["severity"] == severity
        ]


def identify(folder: Path) -> Outcome:
    """Identify the experiment of a folder with all methods."""
    text = (folder / "experiment.toml").read_text(encoding="utf-8")
    results = tomllib.loads(text).get("output", {}).get("folder", "experiment-results")
    words = ["identify", "experiment.toml", "-m", METHODS, "--out", results]
    code, wall, processor, said = pivident(words, folder)
    lines = [line for line in said.splitlines() if line.strip()]
    notices = [line for line in lines if "left out of the equations" in line]
    outcome = Outcome(code, wall, processor, lines[-1] if lines else "", notices=notices)
    path = folder / results / "verdict.json"
    if not path.is_file():
        return outcome
    verdict = json.loads(path.read_text(encoding="utf-8"))
    outcome.headline, outcome.severity = verdict["headline"], verdict["severity"]
    outcome.statements = [
        {key: one[key] for key in ("severity", "topic", "kind", "subject", "message")}
        for one in verdict["statements"]
    ]
    for name, errors in verdict["held_out"].items():
        if errors["method"] == verdict["method"]:
            outcome.held_out = errors["total"]
        if name == "ls":
            outcome.least_squares = errors["total"]
    outcome.uses = verdict.get("uses", {})
    outcome.repairs = verdict.get("repairs", [])
    outcome.tried = verdict.get("tried", [])
    return outcome


def pivident(words: list[str], folder: Path) -> tuple[int, float, float, str]:
    """Exit code, wall and processor time [s] and all output of one command."""
    begin = time.perf_counter()
    with (folder / f"{words[0]}.txt").open("w+", encoding="utf-8") as said:
        command = [sys.executable, "-m", "pivident", *words]
        process = subprocess.Popen(command, cwd=folder, stdout=said, stderr=subprocess.STDOUT)
        code, used = _wait(process)
        said.seek(0)
        return code, time.perf_counter() - begin, used, said.read()


def _wait(process: subprocess.Popen[bytes]) -> tuple[int, float]:
    """Exit code and processor time [s] of a process; -1: it was stopped."""
    stop = time.monotonic() + PATIENCE
    while True:
        ended, status, used = os.wait4(process.pid, os.WNOHANG)
        if ended:
            code = os.waitstatus_to_exitcode(status)
            process.returncode = code
            return code if time.monotonic() < stop else -1, used.ru_utime + used.ru_stime
        if time.monotonic() > stop:
            process.kill()
        time.sleep(0.05)
