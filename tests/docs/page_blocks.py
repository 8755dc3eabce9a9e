"""Blocks of the documentation's pages, and the marks that say how to run them.

A mark is an HTML comment on a line of its own above a block; it is not shown. Several may stand
above each other:

``<!-- skip: REASON -->``          not run; the reason is printed with the tests
``<!-- run by: tests/FILE.py -->`` run by another test, which names the page
``<!-- needs: record NAME -->``    skipped where the public record is missing
``<!-- needs: module NAME -->``    skipped where the Python package is missing
``<!-- before: NAME -->``          a function of ``preparations.py`` is called first
``<!-- file: NAME -->``            the block is written to this file in the page's folder
``<!-- exit: CODE -->``            the commands end with this exit code (``0 or 4``), not 0
``<!-- smaller: A => B -->``       the test replaces A by B, so that it is over soon
``<!-- output -->``                the block is what the block before it prints; ``…`` or ``...``
                                   stands for anything, numbers may differ by 5 %

A ``needs`` mark with no block below it holds for all blocks that follow on the page. Blocks of a
page are run in order in one folder, its Python blocks in one namespace.
"""

from __future__ import annotations

import re
import shlex
from dataclasses import dataclass, field
from pathlib import Path

DOCS = Path(__file__).resolve().parents[2] / "docs"
MARK = re.compile(r"<!--\s*([a-z ]+?)\s*(?::\s*(.*?))?\s*-->$")
MARKS = ("skip", "run by", "needs", "before", "file", "exit", "smaller", "output")
CONSOLE = ("console", "shell", "bash", "sh")
NUMBER = re.compile(r"[-+−]?\d+(?:\.\d+)?(?:e[-+]?\d+)?")


@dataclass(frozen=True)
class Block:
    """A fenced block of a page: its language, text, line, and marks."""

    page: str
    line: int
    language: str
    text: str
    marks: tuple[tuple[str, str], ...] = field(default=())

    def mark(self, name: str) -> str | None:
        """The text of a mark, or None without it."""
        return next((text for known, text in self.marks if known == name), None)

    def all_marks(self, name: str) -> list[str]:
        """The texts of all marks of a name."""
        return [text for known, text in self.marks if known == name]

    @property
    def kind(self) -> str:
        """What is done with it: python, console, file, toml, output or shown."""
        if self.mark("file") is not None:
            return "file"
        if self.mark("output") is not None:
            return "output"
        if self.language in ("python", "toml"):
            return self.language
        if self.language in CONSOLE or (self.language == "" and begins_with_command(self.text)):
            return "console"
        return "shown"

    @property
    def smaller(self) -> str:
        """The text with the replacements that make it quick."""
        text = self.text
        for mark in self.all_marks("smaller"):
            before, arrow, after = mark.partition(" => ")
            assert arrow and before in text, f"{self}: nothing to replace by {mark!r}"
            text = text.replace(before, after)
        return text

    def __str__(self) -> str:
        return f"{self.page}:{self.line}"


def begins_with_command(text: str) -> bool:
    """Whether a block without a language is a command line of this program."""
    first = next((line for line in text.splitlines() if line.strip()), "")
    return first.removeprefix("$ ").startswith("pivident ")


def blocks_of(text: str, page: str) -> list[Block]:
    """The fenced blocks of a page in order, with their marks."""
    found: list[Block] = []
    marks: list[tuple[str, str]] = []
    standing: list[tuple[str, str]] = []
    fence, start, language, body = "", 0, "", []
    for number, line in enumerate(text.splitlines(), start=1):
        if fence:
            if line.strip().startswith(fence) and not line.strip().strip(fence[0]):
                own = tuple(standing) + tuple(marks)
                found.append(Block(page, start, language, "\n".join(body) + "\n", own))
                fence, marks = "", []
            else:
                body.append(line)
        elif match := re.match(r"\s*(`{3,}|:{3,}|~{3,})\s*(\S*)", line):
            fence, language, start, body = match[1], match[2], number, []
        elif match := MARK.match(line.strip()):
            assert match[1] in MARKS, f"{page}:{number}: no mark {match[1]!r}; known: {MARKS}"
            marks.append((match[1], match[2] or ""))
        else:
            standing += [mark for mark in marks if mark[0] == "needs"]
            assert all(name == "needs" for name, _ in marks), f"{page}:{number}: mark of no block"
            marks = []
    return found


def commands_of(text: str) -> list[tuple[list[str], str | None]]:
    """Words of each command line, and the file that its output goes to.

    Where lines begin with a prompt, only those are commands and the others what they print.
    """
    lines = text.replace("\\\n", " ").splitlines()
    if any(line.startswith("$ ") for line in lines):
        lines = [line.removeprefix("$ ") for line in lines if line.startswith("$ ")]
    found = []
    for line in lines:
        words = shlex.split(line, comments=True)
        target = None
        if len(words) > 2 and words[-2] == ">":
            words, target = words[:-2], words[-1]
        if words:
            found.append((words, target))
    return found


def same_output(shown: str, printed: str) -> str | None:
    """The first shown line that was not printed, or None: lines in order, numbers to 5 %."""
    rest = [line.split() for line in printed.splitlines() if line.strip()]
    for line in shown.splitlines():
        words = line.split()
        if not words or words in (["…"], ["..."]):
            continue
        position = next((k for k, other in enumerate(rest) if same_words(words, other)), None)
        if position is None:
            return line
        rest = rest[position + 1 :]
    return None


def same_words(shown: list[str], printed: list[str]) -> bool:
    """Whether two lines agree word by word; dots stand for any words, numbers agree to 5 %."""
    if not shown:
        return not printed
    if shown[0] in ("…", "..."):
        return any(same_words(shown[1:], printed[k:]) for k in range(len(printed) + 1))
    if not printed:
        return False
    return same_word(shown[0], printed[0]) and same_words(shown[1:], printed[1:])


def same_word(shown: str, printed: str) -> bool:
    """Whether two words are the same but for 5 % of their numbers."""
    if shown == printed:
        return True
    if NUMBER.sub("#", shown) != NUMBER.sub("#", printed):
        return False
    pairs = zip(NUMBER.findall(shown), NUMBER.findall(printed), strict=True)
    values = [(float(a.replace("−", "-")), float(b.replace("−", "-"))) for a, b in pairs]
    return all(abs(a - b) <= 0.05 * max(abs(a), abs(b)) + 1e-12 for a, b in values)
