"""One assumption: what stands in the file, how sure it is, what was seen, how to correct it."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from pivident.errors import PividentError
from pivident.logs.recognition.sureness import Sureness

#: The answer to a question that nobody can answer.
UNKNOWN = "unknown"


class DraftError(PividentError):
    """A log or a robot of which no experiment file can be made."""


@dataclass(frozen=True)
class Question:
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
class Assumption:
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
