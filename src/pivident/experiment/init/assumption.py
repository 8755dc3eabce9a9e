"""Assumptions of a draft: what stands in the file, how sure it is, why, and their text.

Assumptions as the text of an experiment file: every line below a comment that says why.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Any

from pivident.data.logs.recognition.channel_words import Sureness
from pivident.experiment.file_lines import SURE
from pivident.foundation.errors import PividentError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import capital
from pivident.foundation.text.toml import comment, key_text, value_text

#: The answer to a question that nobody can answer.
UNKNOWN = "unknown"
#: What stands in front of the first table.
HEADING = """\
First draft by pivident init: {names}.
Every line follows from the log and the robot's description; the comment above it says how sure
it is and what was seen. Correct it here, then:
    pivident check {file}       what is wrong with file, robot and log
    pivident identify {file}    the parameters
All keys: docs/experiment_file.md
"""
#: What follows the way from the log to the result, table by table.
ORDER = (
    "robot",
    "recording",
    "recording.columns",
    "recording.units",
    "gains",
    "controller",
    "identify",
    "validation",
)


class DraftError(PividentError, ValueError):
    """A log or a robot of which no experiment file can be made."""


@dataclass(frozen=True)
class Question(Displayed):
    """What only a person knows.

    Attributes:
        about: short name of what is asked, key of its answer.
        text: the question.
        choices: possible answers; empty where any positive number is one.
        numbers: how many numbers are an answer, where it has no choices; one stands for all.
        optional: whether `UNKNOWN` is an answer, too.
    """

    about: str
    text: str
    choices: tuple[str, ...] = ()
    numbers: int = 1
    optional: bool = False


@dataclass(frozen=True)
class Assumption(Displayed):
    """A line of the experiment file.

    Attributes:
        table: table of the file, such as ``recording.units``.
        key: key in it.
        value: plain value; None for a line that is only there to be completed.
        sure: how sure it is.
        seen: what was seen, and why the value follows; a sentence.
        correct: how to correct it; a sentence, or empty.
        question: what to ask where somebody is there to answer.
        example: what a line without value would be, as TOML.
    """

    table: str
    key: str
    value: Any
    sure: Sureness
    seen: str
    correct: str = ""
    question: Question | None = None
    example: str = ""


#: Answers of a person by the short names of the questions.
Answers = dict[str, str]


def experiment_text(
    runs: Sequence[Sequence[Assumption]],
    rest: Iterable[Assumption],
    heading: str,
    troubles: Sequence[str],
) -> str:
    """The whole file."""
    parts = [comment(line) for line in heading.splitlines()]
    for trouble in troubles:
        parts += ["#", comment(f"TO DO: {trouble}")]
    rest = list(rest)
    for table in ORDER:
        if not table.startswith("recording"):
            own = [line for line in rest if line.table == table]
            parts += _table(table, own, commented=True) if own else []
        elif table == "recording":
            several = len(runs) > 1
            for number, run in enumerate(runs):
                for name in ("recording", "recording.columns", "recording.units"):
                    own = [line for line in run if line.table == name]
                    head = f"[[{name}]]" if several and name == "recording" else f"[{name}]"
                    parts += _table(name, own, commented=number == 0, head=head) if own else []
    return "\n".join(parts) + "\n"


def _table(
    name: str, lines: Sequence[Assumption], *, commented: bool, head: str | None = None
) -> list[str]:
    """One table with its comments."""
    head = head or f"[{name}]"
    if all(line.value is None for line in lines):
        head = f"# {head}"
    text = ["", head]
    for line in lines:
        if commented:
            seen = capital(line.seen)
            said = f"{SURE[line.sure]}: {line.seen}" if line.value is not None else seen
            text.append(comment(f"{said.rstrip('.')}. {line.correct}".rstrip()))
        if line.value is not None:
            text.append(f"{key_text(line.key)} = {value_text(line.value)}")
        elif commented:
            text.append(f"# {line.key} = {line.example}")
    return text
