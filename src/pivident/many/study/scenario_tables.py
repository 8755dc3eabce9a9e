"""Tables of a scenario: robot, methods, conditions, and the hash of all that a run depends on."""

from __future__ import annotations

import hashlib
import itertools
import json
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, Self

from pivident.errors import ExperimentError
from pivident.robot.naming import ROBOT_FILES

if TYPE_CHECKING:
    from pivident.estimation.method import Method
    from pivident.many.study.study_schema import ScenarioFile
    from pivident.robot.description import Robot

#: Keys for the amount of work, not its content: they may change from one call to the next.
AMOUNTS = ("runs", "description")


@dataclass(frozen=True, eq=False)
class ScenarioTables:
    """The tables of a scenario, or of one condition of it, with the objects that they describe."""

    name: str  # name of the scenario
    plain: dict[str, Any]  # its tables as plain values, short forms written out, without ``vary``
    source: str  # file it was read from; paths in it are relative to its folder
    # tables of ``vary`` by group and alternative
    alternatives: Mapping[str, Mapping[str, Mapping[str, Any]]]
    condition: str = ""  # name of the condition, empty without ``vary``

    @property
    def title(self) -> str:
        """Name with the condition."""
        return f"{self.name}/{self.condition}" if self.condition else self.name

    @cached_property
    def content(self) -> ScenarioFile:
        """The tables as checked objects."""
        from pivident.experiment.explained import checked
        from pivident.many.study.study_schema import ScenarioFile

        with file_named(self.source):
            return checked(self.plain, ScenarioFile)

    @cached_property
    def robot(self) -> Robot:
        """The robot."""
        from pivident.experiment.robot_table import robot_of
        from pivident.experiment.toml_file import errors_name

        with errors_name(Path(self.source), "[robot]"):
            return robot_of(self.content.robot, Path(self.source).parent)

    @cached_property
    def methods(self) -> dict[str, Method]:
        """Methods with the scenario's options, by name."""
        from pivident.experiment.identify_table import method_of

        names = self.content.identify.methods or ["ls", "iv", "iv-full-rate", "piv"]
        with file_named(self.source):
            return {name: method_of(name, self.content.identify) for name in names}

    @property
    def conditions(self) -> tuple[Self, ...]:
        """All conditions of the scenario; itself without ``vary``."""
        if not self.alternatives:
            return (self,)
        made = []
        for chosen in itertools.product(*(group.items() for group in self.alternatives.values())):
            plain = self.plain
            for _, changes in chosen:
                plain = merged(plain, changes)
            name = "-".join(name for name, _ in chosen)
            made.append(type(self)(self.name, short_forms(plain), self.source, {}, name))
        return tuple(made)

    def chosen_conditions(self, patterns: Sequence[str]) -> tuple[Self, ...]:
        """The conditions whose name matches one of the patterns (``tx40-*``); all without any."""
        from pivident.robot.naming import nearest

        known = [c.condition for c in self.conditions]
        for pattern in patterns:
            if not any(fnmatchcase(name, pattern) for name in known):
                if known == [""]:
                    raise ExperimentError(f"{self.source}: the scenario has no conditions")
                raise ExperimentError(
                    f"{self.source}: no condition {pattern!r}", advice=nearest(pattern, known)
                )
        return tuple(
            c
            for c in self.conditions
            if not patterns or any(fnmatchcase(c.condition, p) for p in patterns)
        )

    @cached_property
    def identity(self) -> dict[str, Any]:
        """All that the numbers of a run depend on, as plain values."""
        content = self.content.model_dump(
            mode="json",
            exclude_unset=True,
            exclude={*AMOUNTS, "vary"},
            by_alias=True,
            warnings=False,  # a whole number for a real one is no reason to warn
        )
        robot = self.content.robot.model
        file = Path(self.source).parent / robot
        if robot.endswith(ROBOT_FILES):
            self.robot  # noqa: B018 - says what is wrong with the file
            content["robot_sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
        return content

    @property
    def hash(self) -> str:
        """SHA-256 of the identity."""
        text = json.dumps(_real(self.identity), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def merged(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes: keys are replaced, tables merged, tables of another type replaced."""
    out = dict(tables)
    for key, value in changes.items():
        before = out.get(key)
        out[key] = value
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            if value.get("type", before.get("type")) == before.get("type"):
                out[key] = merged(before, value)
    return out


def _real(value: Any) -> Any:
    """Integers as floating-point numbers: 5 and 5.0 are the same scenario."""
    if isinstance(value, Mapping):
        return {key: _real(v) for key, v in value.items()}
    if isinstance(value, list):
        return [_real(v) for v in value]
    if type(value) is not int:
        return value
    try:
        return float(value)
    except OverflowError:  # a seed of hundreds of digits
        return value


def short_forms(tables: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with their short forms written out."""
    from pivident.experiment.explained import plain_form

    return plain_form(dict(tables))


@contextmanager
def file_named(source: str) -> Iterator[None]:
    """Prefix every scenario error with the file, once."""
    try:
        yield
    except ExperimentError as error:
        if str(error).startswith(f"{source}: "):
            raise
        raise ExperimentError(f"{source}: {error}") from error
