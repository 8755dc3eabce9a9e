"""Arguments of steps: each value is one of its choices or inside its range, or is refused.

Values come from a form or from a program; what is not on the list never reaches a command line, so
that no value can be taken for an option or for a path elsewhere.
"""

from __future__ import annotations

import math
import re
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal

from pivident.app.studio.projects import RESULTS, Project
from pivident.data.logs.tables.tables import is_log
from pivident.estimation.methods import METHODS
from pivident.foundation.errors import PividentError
from pivident.models.stored_model import CONSISTENT_FILE

Kind = Literal[
    "choice", "choices", "number", "integer", "flag", "result", "results", "names", "log"
]  # fmt: skip

#: What makes a folder one of results: files of one method, or the verdict on several.
RESULT_FILES = ("identification.json", CONSISTENT_FILE, "verdict.json")

#: Most entries of a list.
MAX_ENTRIES = 40

_RESULT = re.compile(r"(?:results/)?([0-9]{3,6}-[a-z]+)(?:/([a-z0-9-]+))?")
_NAME = re.compile(r"[A-Za-z0-9_][A-Za-z0-9_.+:-]{0,63}")


class StepError(PividentError, ValueError):
    """A step that does not exist, or an argument that it does not take."""


@dataclass(frozen=True)
class Argument:
    """One argument of a step.

    Attributes:
        name: in forms and files.
        kind: what its values are; ``result`` is a folder of results of the project, ``names`` are
            parameters, ``log`` is a log of the project.
        label: for a form.
        option: of the command line; empty for what is named without one.
        choices: allowed values, where the kind is a choice.
        default: what the command takes where nothing is given, for a form; None: nothing.
        low: least number.
        high: largest number.
        unit: behind the number on the command line, ``%``.
        is_needed: whether the step cannot do without.
    """

    name: str
    kind: Kind
    label: str
    option: str = ""
    choices: tuple[str, ...] = ()
    default: Any = None
    low: float = -math.inf
    high: float = math.inf
    unit: str = ""
    is_needed: bool = False

    def tokens(self, project: Path, value: Any) -> list[str]:
        """The argument on a command line; nothing where it is not given.

        Raises:
            StepError: a value that is not allowed.
        """
        if value is None or value in ("", [], ()):
            if self.is_needed:
                raise StepError(f"{self.label} is missing", advice="choose it")
            return []
        if self.kind == "flag":
            return [self.option] if _flag(self, value) else []
        if self.kind in ("number", "integer"):
            return [self.option, f"{self._number(value)}{self.unit}"]
        several = self.kind in ("choices", "results", "names")
        values = _listed(value) if several else [value]
        if len(values) > MAX_ENTRIES:
            raise StepError(
                f"{self.label}: {len(values)} values", advice=f"give at most {MAX_ENTRIES}"
            )
        words = dict.fromkeys(self._word(one) for one in values)
        checked = [self._text(project, word) for word in words]
        return [self.option, ",".join(checked)] if self.option else checked

    def _number(self, value: Any) -> str:
        """A number in its range as it is typed."""
        try:
            number = float(value)
        except (TypeError, ValueError):
            raise StepError(f"{self.label}: {_quoted(value)} is no number") from None
        if not math.isfinite(number) or not self.low <= number <= self.high:
            raise StepError(
                f"{self.label}: {_quoted(value)} is not between {self.low:g} and {self.high:g}"
            )
        if self.kind == "integer" and number != int(number):
            raise StepError(f"{self.label}: {_quoted(value)} is not a whole number")
        return str(int(number)) if number == int(number) else repr(number)

    def _word(self, value: Any) -> str:
        """A name or a whole number as text."""
        if isinstance(value, bool) or not isinstance(value, str | int):
            raise StepError(
                f"{self.label}: {_quoted(value)} is no name", advice="choose one of the list"
            )
        return str(value)

    def _text(self, project: Path, value: str) -> str:
        """One of the choices, a folder of results, or the name of a parameter."""
        if self.kind in ("result", "results"):
            return result_folder(project, value)
        if self.kind == "log":
            return log_file(project, value)
        if self.kind == "names":
            if not _NAME.fullmatch(value):
                raise StepError(f"{self.label}: {_quoted(value)} is not the name of a parameter")
            return value
        if value not in self.choices:
            raise StepError(
                f"{self.label}: there is no {_quoted(value)}",
                advice=f"choose from {', '.join(self.choices)}",
            )
        return value


def result_folder(project: Path, name: str) -> str:
    """A folder of results of the project, ``results/001-identify`` or that of one method in it.

    Of one that holds consistent parameters alone it is their file, which commands take.

    Raises:
        StepError: this is no such folder.
    """
    named = _RESULT.fullmatch(name)
    if named:
        method = named[2] or ""
        path = project / RESULTS / named[1] / method
        inside = path.resolve().is_relative_to(project.resolve())
        there = [file for file in RESULT_FILES if (path / file).is_file()]
        if inside and (not method or method in METHODS) and there:
            alone = CONSISTENT_FILE if there == [CONSISTENT_FILE] else ""
            return "/".join(filter(None, (RESULTS, named[1], method, alone)))
    raise StepError(
        f"{_quoted(name)} is no result of this project", advice="choose one of the list"
    )


def log_file(project: Path, name: str) -> str:
    """A log of the project, of those that were brought or that results are tested on.

    Raises:
        StepError: there is none of this name.
    """
    ours = Project(project, project.name)
    there = [p.relative_to(project).as_posix() for p in (*ours.inputs(), *ours.test_logs())]
    if name not in filter(is_log, there):
        raise StepError(f"{_quoted(name)} is no log of this project", advice="bring it first")
    return f"./{name}" if name.startswith("-") else name


def _flag(argument: Argument, value: Any) -> bool:
    """Yes or no, as forms and programs say it."""
    said = str(value).lower()
    if said not in ("true", "on", "1", "yes", "false", "off", "0", "no"):
        raise StepError(f"{argument.label}: {_quoted(value)} is neither yes nor no")
    return said in ("true", "on", "1", "yes")


def _listed(value: Any) -> Sequence[Any]:
    """Several values, in a list or separated by commas."""
    if isinstance(value, str):
        return [part.strip() for part in value.split(",") if part.strip()]
    if isinstance(value, list | tuple):
        return value
    raise StepError(f"{_quoted(value)} is no list")


def _quoted(value: Any) -> str:
    """A value in a message, not longer than can be read."""
    text = repr(value)
    return text if len(text) <= 60 else f"{text[:57]}…"
