"""docs/questions.md from the cases: ``python -m tests.questions.page`` writes it anew."""

from __future__ import annotations

import contextlib
import importlib
import io
import os
import re
import tempfile
from pathlib import Path

from pivident.app.cli import main
from tests.questions.conftest import answered, lay_out
from tests.questions.material import Case

PAGE = Path(__file__).parents[2] / "docs" / "questions.md"

CHAPTERS = {
    "The log as a file": "test_log_file",
    "What was logged": "test_signals",
    "The experiment file": "test_experiment_file",
    "The robot's description": "test_robot_description",
    "The command line": "test_command_line",
}

HEAD = """\
# What went wrong?

`pivident check my_robot.toml` examines an experiment file, its robot and its logs before anything
is estimated, and reports what is wrong, where, and what to change. Below are its answers
to {number} mistakes, sorted by where they are made; each of them is a test. Numbers are those of a
small arm with two joints, `shoulder` and `elbow`.

The exit code is 0 without errors, 1 if an identification would stop, 4 if it would run, but
something seems wrong. `--robot NAME` checks with another robot, `--json` prints everything for
programs. The check also prints what it has examined, and which parameters would be estimated from
what, with which methods, in about what time (to a factor of two, on one processor; compiling is
listed separately). A log with gaps is examined between them, and the plan covers the stretches that
are
left. In Python: `pivident.experiment.check_experiment("my_robot.toml")`.
"""


def cases(module: str) -> list[Case]:
    """The cases of one file of tests."""
    return importlib.import_module(f"tests.questions.{module}").CASES


def answer_of(case: Case) -> str:
    """The line that answers a case, without its severity."""
    before = os.getcwd()
    out, err = io.StringIO(), io.StringIO()
    with tempfile.TemporaryDirectory() as folder:
        lay_out(case, Path(folder))
        os.chdir(folder)
        try:
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                main(list(case.command))
        finally:
            os.chdir(before)
    lines = [*out.getvalue().splitlines(), *err.getvalue().splitlines()]
    line = next(line for line in lines if answered([line], case.answer)).replace(f"{folder}/", "")
    return re.sub(r"^(\s*(error|warning)\s+|error: )", "", line)


def row(case: Case, answer: str) -> str:
    """A row of the table."""
    typed = "" if case.command == ("check", "experiment.toml") else f" (`{' '.join(case.command)}`)"
    return f"| {cell(case.question)}{typed} | {cell(answer)} |"


def cell(text: str) -> str:
    """A text inside a table."""
    text = text.replace("|", "\\|").replace("<", "&lt;").replace("*", "\\*")
    return text.replace("[", "\\[").replace("]", "\\]").replace("$", "\\$")


def write() -> None:
    """Ask every question and write the page."""
    text, number = "", 0
    for title, module in CHAPTERS.items():
        text += f"\n## {title}\n\n| mistake | answer |\n|---|---|\n"
        for case in cases(module):
            text += row(case, answer_of(case)) + "\n"
            number += 1
    PAGE.write_text(HEAD.format(number=number) + text, encoding="utf-8")


if __name__ == "__main__":
    write()
