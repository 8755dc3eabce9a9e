"""A scenario: robot, truth, control law, motion, noise and methods of a study, as TOML.

    robot = "planar_2r"
    runs = 200

    [controller]
    type = "pd"
    kp = [6000, 2500]                      # N m per rad
    kd = [180, 60]

    [record]
    rate = 1000

    [trajectory]
    duration = 8.0

    [noise]
    encoder = 2e-6                         # rad, in the loop
    torque = 0.05                          # N m, on the record

    [identify]
    methods = ["ls", "iv-full-rate", "piv"]

All tables and keys are in `docs/studies.md`. A scenario with a table ``[vary]`` stands for several
conditions: one alternative of each of its groups, named ``alternative-alternative``.
"""

from __future__ import annotations

import hashlib
import itertools
import json
import math
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass
from fnmatch import fnmatchcase
from functools import cached_property
from importlib import resources
from pathlib import Path
from typing import TYPE_CHECKING, Any

from pivident.errors import ExperimentError
from pivident.files import regular_file
from pivident.text.toml import MAX_FILE, parse_toml

if TYPE_CHECKING:
    from pivident.estimation.methods import Method
    from pivident.many.study.study_schema import ScenarioFile
    from pivident.robot.description import Robot

#: Most conditions of a scenario.
MAX_CONDITIONS = 1000

#: Keys that say how much is done, not what: they may change from one call to the next.
AMOUNTS = ("runs", "description")


@dataclass(frozen=True, eq=False)
class Scenario:
    """A checked scenario, or one condition of it."""

    name: str  # name of the scenario
    plain: dict[str, Any]  # its tables as plain values, short forms written out, without ``vary``
    source: str  # file it was read from; paths in it are relative to its folder
    # what ``vary`` holds: tables by group and alternative
    alternatives: Mapping[str, Mapping[str, Mapping[str, Any]]]
    condition: str = ""  # name of the condition, empty where nothing is varied

    @property
    def title(self) -> str:
        """Name with the condition."""
        return f"{self.name}/{self.condition}" if self.condition else self.name

    @cached_property
    def content(self) -> ScenarioFile:
        """The tables as checked objects."""
        from pivident.experiment.explained import checked
        from pivident.many.study.study_schema import ScenarioFile

        with _named(self.source):
            return checked(self.plain, ScenarioFile)

    @cached_property
    def robot(self) -> Robot:
        """The robot."""
        from pivident.experiment.experiment import errors_name
        from pivident.experiment.robot_table import robot_of

        with errors_name(Path(self.source), "[robot]"):
            return robot_of(self.content.robot, Path(self.source).parent)

    @cached_property
    def methods(self) -> dict[str, Method]:
        """Methods with the scenario's options, by name."""
        from pivident.experiment.method_table import method_of

        names = self.content.identify.methods or ["ls", "iv", "iv-full-rate", "piv"]
        with _named(self.source):
            return {name: method_of(name, self.content.identify) for name in names}

    @property
    def conditions(self) -> tuple[Scenario, ...]:
        """The conditions that the scenario stands for; itself where nothing is varied."""
        if not self.alternatives:
            return (self,)
        made = []
        for chosen in itertools.product(*(group.items() for group in self.alternatives.values())):
            plain = self.plain
            for _, changes in chosen:
                plain = merged(plain, changes)
            name = "-".join(name for name, _ in chosen)
            made.append(Scenario(self.name, _short_forms(plain), self.source, {}, name))
        return tuple(made)

    def chosen_conditions(self, patterns: Sequence[str]) -> tuple[Scenario, ...]:
        """The conditions whose name matches one of the patterns (``tx40-*``); all without any."""
        from pivident.robot.naming import nearest

        known = [c.condition for c in self.conditions]
        for pattern in patterns:
            if not any(fnmatchcase(name, pattern) for name in known):
                if known == [""]:
                    raise ExperimentError(f"{self.source}: the scenario has no conditions")
                raise ExperimentError(
                    f"{self.source}: no condition {pattern!r}; {nearest(pattern, known)}"
                )
        return tuple(
            c
            for c in self.conditions
            if not patterns or any(fnmatchcase(c.condition, p) for p in patterns)
        )

    def changed(self, **tables: Any) -> Scenario:
        """The scenario with other keys or tables: ``changed(runs=40, noise={"torque": 0})``."""
        plain = _short_forms(merged(self.plain, tables))
        made = Scenario(self.name, plain, self.source, self.alternatives, self.condition)
        made.check()
        return made

    def with_runs(self, runs: int) -> Scenario:
        """The same scenario with another number of runs."""
        plain = self.plain | {"runs": runs}
        made = Scenario(self.name, plain, self.source, self.alternatives, self.condition)
        for condition in made.conditions:
            condition.content  # noqa: B018 - reading it is the check
        return made

    def check(self) -> None:
        """Refuse contradictions and values of the wrong kind, in all conditions."""
        from pivident.many.study.checks import check_scenario

        for condition in self.conditions:
            with _named(condition.source):
                check_scenario(condition)

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
        if robot.endswith((".toml", ".urdf", ".urdf.gz")):
            self.robot  # noqa: B018 - says what is wrong with the file
            content["robot_sha256"] = hashlib.sha256(file.read_bytes()).hexdigest()
        return content

    @property
    def hash(self) -> str:
        """SHA-256 of the identity."""
        text = json.dumps(_real(self.identity), sort_keys=True, separators=(",", ":"))
        return hashlib.sha256(text.encode()).hexdigest()


def load_scenario(name: str | Path) -> Scenario:
    """A shipped scenario by its name, or one of a TOML file; all of its conditions are checked.

    Args:
        name: ``fine``, ``loop``, ``coloured``, ``coarse``, ``birdy``, or a file.

    Raises:
        ExperimentError: there is no such scenario; or it has an unknown key, a bad value or a
            contradiction, and the message names table, key, value and the next step.
    """
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        try:
            size = regular_file(path).stat().st_size
            if size > MAX_FILE:
                raise ExperimentError(f"{path}: has {size} bytes, too many for a scenario")
            text = path.read_text(encoding="utf-8")
        except (OSError, UnicodeDecodeError) as error:
            reason = getattr(error, "strerror", None) or "it is not UTF-8 text"
            raise ExperimentError(f"{path}: cannot be read ({reason}); check the path") from error
        return read_scenario(text, path.stem, str(path))
    known = shipped_scenarios()
    if str(name) not in known:
        from pivident.robot.naming import nearest

        raise ExperimentError(
            f"there is no scenario {str(name)!r}; {nearest(str(name), known)}, or name a .toml file"
        )
    text = (resources.files(__package__) / "scenarios" / f"{name}.toml").read_text("utf-8")
    return read_scenario(text, str(name), f"{name}.toml")


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios that come along."""
    files = (resources.files(__package__) / "scenarios").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def read_scenario(text: str, name: str, source: str | None = None) -> Scenario:
    """A scenario from the text of its file."""
    from pivident.experiment.explained import checked
    from pivident.many.study.study_schema import ScenarioFile

    source = source or f"{name}.toml"
    with _named(source):
        try:
            tables = parse_toml(text)
        except ValueError as error:
            raise ExperimentError(f"is not TOML: {error}; correct this line") from error
        plain = _short_forms(tables)
        checked(plain, ScenarioFile)
    vary = plain.pop("vary", {})
    with _named(source):
        _check_alternatives(vary)
    scenario = Scenario(name, plain, source, vary)
    scenario.check()
    return scenario


def _check_alternatives(vary: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse more conditions than anyone simulates, and names that are no names of folders."""
    count = math.prod(len(group) for group in vary.values())
    if count > MAX_CONDITIONS:
        raise ExperimentError(
            f"[vary] makes {count} conditions, at most {MAX_CONDITIONS} are possible; vary less "
            "at once"
        )
    if vary and not count:
        empty = next(name for name, group in vary.items() if not group)
        raise ExperimentError(f"[vary.{empty}] has no alternatives; add some, or remove the table")
    for group, alternatives in vary.items():
        for name in alternatives:
            if not re.fullmatch(r"\w[\w.+-]{0,63}", name):
                raise ExperimentError(
                    f"[vary.{group}] the alternative {name!r} names a folder of results; use "
                    "letters, digits, '.', '_', '+' and '-' only, at most 64"
                )


def merged(tables: Mapping[str, Any], changes: Mapping[str, Any]) -> dict[str, Any]:
    """Tables with changes: keys are replaced, tables merged, and a changed type starts anew."""
    out = dict(tables)
    for key, value in changes.items():
        before = out.get(key)
        out[key] = value
        if isinstance(before, Mapping) and isinstance(value, Mapping):
            if value.get("type", before.get("type")) == before.get("type"):
                out[key] = merged(before, value)
    return out


def _real(value: Any) -> Any:
    """Whole numbers as real ones: 5 and 5.0 are the same scenario."""
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


def _short_forms(tables: Mapping[str, Any]) -> dict[str, Any]:
    from pivident.experiment.explained import plain_form

    return plain_form(dict(tables))


@contextmanager
def _named(source: str) -> Iterator[None]:
    """Put the file in front of every scenario error, once."""
    try:
        yield
    except ExperimentError as error:
        if str(error).startswith(f"{source}: "):
            raise
        raise ExperimentError(f"{source}: {error}") from error
