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

import math
import re
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from importlib import resources
from pathlib import Path
from typing import Any

import numpy as np

from pivident.estimation.methods import METHODS
from pivident.foundation.errors import ExperimentError, require_known
from pivident.foundation.files import small_text
from pivident.foundation.text.toml import parse_toml
from pivident.robot.naming import nearest
from pivident.robot.refusals import without_loops
from pivident.studies.many.study.bench import Bench
from pivident.studies.many.study.scenario_tables import (
    ScenarioTables,
    file_named,
    merged,
    reach_of,
    short_forms,
)

#: Smallest number of samples of a record for all methods.
MIN_RECORD = 200

#: Largest number of samples of a record: two days at 5 kHz.
MAX_RECORD = 1_000_000_000


def check_scenario(scenario: ScenarioTables) -> None:
    """Refuse a scenario whose tables do not fit its robot."""
    without_loops(scenario.robot, "a study of simulated records", "use pivident.simulate")
    bench = Bench(scenario)
    scenario.methods, bench.estimated, bench.noise, bench.loop  # noqa: B018 - making them checks
    bench.controller.check(scenario.robot.size)
    _check_motion(scenario)


def _check_motion(scenario: ScenarioTables) -> None:
    entry, rate = scenario.content.trajectory, scenario.content.record.rate
    if entry.type != "fourier":
        reach_of(entry, scenario.robot.size)
    speeds = scenario.robot.rated_speeds
    if not np.isfinite(speeds).all():
        missing = scenario.robot.joint_names[int(np.flatnonzero(np.isnan(speeds))[0])]
        raise ExperimentError(
            f"[trajectory] the robot has no rated speed of joint {missing!r}, which the motion "
            "needs",
            advice="add rated_speed to its description",
        )
    if entry.duration * rate > MAX_RECORD:
        raise ExperimentError(
            f"[trajectory] key 'duration' = {entry.duration:g} s gives a record of more than "
            f"{MAX_RECORD:,} samples at {rate:g} Hz",
            advice="shorten it",
        )
    samples = round(entry.duration * rate)
    if samples < MIN_RECORD:
        raise ExperimentError(
            f"[trajectory] key 'duration' = {entry.duration:g} s gives a record of {samples} "
            f"samples at {rate:g} Hz",
            advice=f"at least {MIN_RECORD} are needed",
        )


#: Stands for all methods of a league.
ALL = "all"


def league_methods(names: Sequence[str]) -> list[str]:
    """Methods by name, ``all`` written out, those named ``-NAME`` taken out; in order, each once.

    Raises:
        ExperimentError: there is no such method, or none is left.
    """
    chosen: dict[str, None] = {}
    taken_out = set()
    for name in names:
        bare = name.removeprefix("-")
        require_known(bare, (ALL, *METHODS), f"there is no method {bare!r}", ExperimentError)
        if name.startswith("-"):
            taken_out.add(bare)
        elif name == ALL:
            chosen |= dict.fromkeys(n for n, m in METHODS.usable().items() if m.in_leagues)
        else:
            chosen[name] = None
    left = [name for name in chosen if name not in taken_out]
    if not left:
        raise ExperimentError(
            "no method is left", advice="name some, such as all,-particle or ls,iv,piv"
        )
    return left


#: Maximum number of conditions of a scenario.
MAX_CONDITIONS = 1000


@dataclass(frozen=True, eq=False)
class Scenario(ScenarioTables):
    """A checked scenario, or one condition of it.

    Attributes:
        name: name of the scenario.
        plain: its tables as plain values, short forms written out, without ``vary``.
        source: file it was read from; paths in it are relative to its folder.
        alternatives: what ``vary`` holds: tables by group and alternative.
        condition: name of the condition, empty where nothing is varied.
    """

    def changed(self, **tables: Any) -> Scenario:
        """The scenario with other keys or tables: ``changed(runs=40, noise={"torque": 0})``.

        Args:
            **tables: keys and tables of a scenario's file by their names there; a table is merged
                with the one that stands, one that does not exist is refused.
        """
        plain = short_forms(merged(self.plain, tables))
        made = Scenario(self.name, plain, self.source, self.alternatives, self.condition)
        made.check()
        return made

    def with_runs(self, runs: int) -> Scenario:
        """The same scenario with another number of runs, in all conditions."""
        return self._everywhere({"runs": runs})

    def with_methods(self, names: Sequence[str]) -> Scenario:
        """The same scenario with other methods, in all conditions.

        Args:
            names: of methods. ``all`` stands for each that can judge a simulated loop, ``-NAME``
                takes one out.

        Raises:
            ExperimentError: there is no such method, or none is left.
        """
        return self._everywhere({"identify": {"methods": league_methods(names)}})

    def _everywhere(self, tables: dict[str, Any]) -> Scenario:
        """The same scenario with keys that no condition changes."""
        alternatives = {
            group: {name: _without(own, tables) for name, own in named.items()}
            for group, named in self.alternatives.items()
        }
        plain = merged(self.plain, tables)
        made = Scenario(self.name, plain, self.source, alternatives, self.condition)
        for condition in made.conditions:
            condition.content  # noqa: B018 - reading it is the check
        return made

    def check(self) -> None:
        """Refuse contradictions and values of the wrong kind, in all conditions."""
        for condition in self.conditions:
            with file_named(condition.source):
                check_scenario(condition)


def load_scenario(name: str | Path) -> Scenario:
    """A shipped scenario by its name, or one of a TOML file; all of its conditions are checked.

    Args:
        name: ``fine``, ``loop``, ``coloured``, ``coarse``, ``birdy``, or a file.

    Returns:
        The scenario.

    Raises:
        ExperimentError: there is no such scenario; or it has an unknown key, a bad value or a
            contradiction, and the message names table, key, value and the next step.
    """
    path = Path(name)
    if path.suffix == ".toml" or path.is_file():
        with file_named(str(path)):
            text = small_text(path, ExperimentError, "a scenario")
        return read_scenario(text, path.stem, str(path))
    known = shipped_scenarios()
    if str(name) not in known:
        raise ExperimentError(
            f"there is no scenario {str(name)!r}",
            advice=f"{nearest(str(name), known)}, or name a .toml file",
        )
    text = (resources.files(__package__) / "scenarios" / f"{name}.toml").read_text("utf-8")
    return read_scenario(text, str(name), f"{name}.toml")


def shipped_scenarios() -> tuple[str, ...]:
    """Names of the scenarios in the package."""
    files = (resources.files(__package__) / "scenarios").iterdir()
    return tuple(sorted(f.name.removesuffix(".toml") for f in files if f.name.endswith(".toml")))


def read_scenario(text: str, name: str, source: str | None = None) -> Scenario:
    """A scenario from the text of its file.

    Args:
        text: TOML.
        name: name of the scenario.
        source: what errors call it, and what paths are relative to.

    Returns:
        The scenario.

    Raises:
        ExperimentError: as of ``load_scenario``.
    """
    from pivident.experiment.explained import checked
    from pivident.studies.many.study.scenario_keys import ScenarioFile

    source = source or f"{name}.toml"
    with file_named(source):
        try:
            tables = parse_toml(text)
        except ValueError as error:
            raise ExperimentError(f"is not TOML: {error}", advice="correct this line") from error
        plain = short_forms(tables)
        checked(plain, ScenarioFile)
    vary = plain.pop("vary", {})
    with file_named(source):
        _check_alternatives(vary)
    scenario = Scenario(name, plain, source, vary)
    scenario.check()
    return scenario


def _without(tables: Mapping[str, Any], keys: Mapping[str, Any]) -> dict[str, Any]:
    """Tables without the keys that other tables have, at any depth."""
    kept = {}
    for key, value in tables.items():
        if key not in keys:
            kept[key] = value
        elif isinstance(value, Mapping) and isinstance(keys[key], Mapping):
            kept[key] = _without(value, keys[key])
    return kept


def _check_alternatives(vary: Mapping[str, Mapping[str, Any]]) -> None:
    """Refuse too many conditions, and names that cannot be names of folders."""
    count = math.prod(len(group) for group in vary.values())
    if count > MAX_CONDITIONS:
        raise ExperimentError(
            f"[vary] gives {count} conditions, at most {MAX_CONDITIONS} are possible",
            advice="vary less at once",
        )
    if vary and not count:
        empty = next(name for name, group in vary.items() if not group)
        raise ExperimentError(
            f"[vary.{empty}] has no alternatives", advice="add some, or remove the table"
        )
    for group, alternatives in vary.items():
        for name in alternatives:
            if not re.fullmatch(r"\w[\w.+-]{0,63}", name):
                raise ExperimentError(
                    f"[vary.{group}] the alternative {name!r} names a folder of results",
                    advice="use letters, digits, '.', '_', '+' and '-' only, at most 64",
                )
