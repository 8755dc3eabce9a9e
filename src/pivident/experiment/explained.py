"""The text of an experiment file, and what is wrong with it, as one line to act upon.

The text of an experiment file, or of another small TOML file, and errors that name it.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple, TypeVar

from pydantic import BaseModel, ValidationError

from pivident.experiment.file_keys import ExperimentFile
from pivident.experiment.identify_table import METHOD_ENTRIES
from pivident.foundation.errors import ExperimentError, PividentError, UnusableValue
from pivident.foundation.files import small_text
from pivident.foundation.text.sentences import NearestNames
from pivident.foundation.text.toml import parse_toml
from pivident.robot.mdh_keys import addition, keys_at, reason, short
from pivident.robot.naming import nearest

#: What is called otherwise here, where such a key exists.
MEANT = {
    "urdf": ("model",),
    "robot": ("model",),
    "file": ("files", "model"),
    "path": ("files", "model", "folder"),
    "csv": ("files",),
    "log": ("files",),
    "torque": ("tau",),
    "time": ("t",),
    "position": ("q",),
    "freeze": ("frozen",),
    "method": ("methods",),
    "sample_rate": ("rate",),
}
#: Keys that there were, by table, and what to do about them.
GONE = {"recording": {"simulated": "the data decide what it chose"}}
Root = TypeVar("Root", bound=BaseModel)


class Problem(NamedTuple):
    """One thing that the schema finds wrong with a file's content."""

    location: tuple[int | str, ...]  # tables and keys of the value at fault
    said: UnusableValue  # what is wrong, and what to do
    unknown: bool  # whether its last key is not known


def validated(content: dict[str, Any]) -> ExperimentFile:
    """The content of a file as a checked object."""
    refuse_robot_file(content)
    return checked(plain_form(content), ExperimentFile)


def refuse_robot_file(content: dict[str, Any]) -> None:
    """Distinguish a robot's description, which is TOML too, from an experiment."""
    if "joints" in content and "recording" not in content:
        raise ExperimentError(
            "this is a robot description, not an experiment file",
            advice="name it as robot = in one",
        )


def checked(plain: dict[str, Any], root: type[Root]) -> Root:
    """A file's content, its short forms written out, as a checked object."""
    try:
        return root.model_validate(plain)
    except ValidationError as error:
        problems = _causes(error.errors())
        heading, said = explained(problems[0], plain, root)
        if len(problems) > 1:
            said = said.followed_by(f" (and {len(problems) - 1} more)")
        raise ExperimentError.of_part(heading, said) from None


def every_problem(plain: dict[str, Any], root: type[BaseModel] = ExperimentFile) -> list[Problem]:
    """Everything that the schema finds wrong with a file's content, not only the first of it."""
    try:
        root.model_validate(plain)
    except ValidationError as error:
        return [
            Problem(
                (*details["loc"], *getattr(details.get("ctx", {}).get("error"), "place", ())),
                explained(details, plain, root)[1],
                details["type"] == "extra_forbidden",
            )
            for details in _causes(error.errors())
        ]
    return []


def _causes(problems: Sequence[Any]) -> list[Any]:
    """Unknown keys first, and without the keys that are missing because they were misspelt."""
    unknown = [p for p in problems if p["type"] == "extra_forbidden"]
    tables = {p["loc"][:-1] for p in unknown}
    return unknown + [
        p
        for p in problems
        if p["type"] != "extra_forbidden"
        and not (p["type"] == "missing" and p["loc"][:-1] in tables)
    ]


def explained(
    details: Any, content: dict[str, Any], root: type[BaseModel] = ExperimentFile
) -> tuple[str, UnusableValue]:
    """One problem that pydantic has found, in words, after the heading of its table."""
    table, key = _place(details["loc"], content)
    unknown_table = details["type"] == "extra_forbidden" and len(details["loc"]) == 1
    return "" if unknown_table else table, _said(details, table, key, root)


def _said(details: Any, table: str, key: str, root: type[BaseModel]) -> UnusableValue:
    """What is wrong with the value of a key, and what to do."""
    if details["type"] == "extra_forbidden":
        *above, last = details["loc"]
        known = keys_at(root, above)
        synonyms = [name for name in MEANT.get(str(last).lower(), ()) if name in known]
        hint = nearest(str(last), known)
        if synonyms:
            hint = NearestNames.of(f"did you mean {synonyms[0]!r}?", str(last), synonyms)
        if last in GONE.get(str(above[0] if above else ""), {}):
            gone = f"key {key!r} is gone: {GONE[str(above[0])][last]}"
            return UnusableValue(gone, advice="delete the line")
        if not above:
            return UnusableValue(f"unknown table {last!r}", advice=hint)
        in_another = any(last in entry.model_fields for entry in METHOD_ENTRIES.values())
        if len(above) == 2 and above[0] == "identify" and in_another:
            keys = f"its keys are {', '.join(sorted(known))}"
            return UnusableValue(f"the method {above[1]!r} has no {last}", advice=keys)
        return UnusableValue(f"unknown key {key!r}", advice=hint)
    if details["type"] == "missing":
        if not table:
            return UnusableValue(f"there is no {key}", advice=f"add the table [{key}]")
        return UnusableValue(f"key {key!r} is missing", advice=addition(root, details["loc"]))
    if details["type"] == "model_type":
        text = f"{key or 'this entry'} must be a table of keys, not {short(details['input'])}"
        return UnusableValue(text)
    value = short(details["input"])
    named = "" if isinstance(details["input"], dict) or value.endswith("…") else f" = {value}"
    return UnusableValue.of_part(f"key {key!r}{named}: " if key else "", reason(details))


def plain_form(content: dict[str, Any]) -> dict[str, Any]:
    """The content with its short forms written out, as the schema has them."""
    plain = dict(content)
    if isinstance(plain.get("robot"), str):
        plain["robot"] = {"model": plain["robot"]}
    if isinstance(plain.get("recording"), dict):
        plain["recording"] = [plain["recording"]]
    if isinstance(plain.get("controller"), str):
        plain["controller"] = {"type": plain["controller"]}
    if "reference" in plain and isinstance(plain.get("controller"), dict):
        plain["controller"] = {"reference": plain.pop("reference")} | plain["controller"]
    return plain


def _place(loc: Sequence[int | str], content: dict[str, Any]) -> tuple[str, str]:
    """The table that a location belongs to, as a heading, and the key within it."""
    if not loc:
        return "", ""
    head, *rest = loc
    if not isinstance(content.get(str(head)), (dict, list)):
        return "", str(head)
    heading = f"[{head}] "
    if rest and isinstance(rest[0], int):
        number, *rest = rest
        several = len(content[str(head)]) > 1
        heading = f"[[{head}]] {int(number) + 1}: " if several else heading
    return heading, ".".join(map(str, rest))


@contextmanager
def errors_name(path: Path, table: str) -> Iterator[None]:
    """Name file and table in front of an `ExperimentError`, in a note of errors with evidence."""
    try:
        yield
    except ExperimentError as error:
        raise error.headed(f"{path}:", *filter(None, [table])) from error
    except PividentError as error:
        error.add_note(f"{path}: {table.rstrip(':')}".rstrip(": "))
        raise


def toml_content(path: Path) -> dict[str, Any]:
    """The tables of an experiment file or another small TOML file, unchecked."""
    try:
        return parse_toml(small_text(path, ExperimentError, "an experiment file"))
    except ExperimentError:
        raise
    except ValueError as error:
        raise ExperimentError(
            f"is not TOML: {error}", advice=f"{_advice(path, str(error))}"
        ) from error


def _advice(path: Path, error: str) -> str:
    """What to do about a text that is not TOML, as far as the text shows."""
    text = small_text(path, ExperimentError, "an experiment file")
    beginning = text.lstrip("\ufeff \t\r\n")
    first = beginning.partition("\n")[0]
    if path.suffix.lower() in (".urdf", ".xacro") or beginning.startswith("<"):
        return "this is a robot description: name it as robot = in an experiment file (.toml)"
    if beginning.startswith("{"):
        return "this looks like JSON; an experiment file is written in TOML"
    if path.suffix.lower() != ".toml" and max(map(first.count, ",;\t")) > 1:
        return (
            "this looks like a log: name it as files = under [recording] of an experiment file, "
            "or ask pivident audit about it"
        )
    line = re.search(r"at line (\d+)", error)
    said = text.splitlines()[int(line[1]) - 1] if line else ""
    if "\\" in said:
        return "a backslash needs single quotes around it, or write / in paths"
    return "correct this line"
