"""The experiment file itself: every wrong key and value, and what remains readable without them."""

from __future__ import annotations

import copy
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

from pivident.experiment.check.remark import Remark, advised, of_error, of_finding
from pivident.experiment.experiment import Experiment, with_every_run
from pivident.experiment.explained import every_problem, plain_form, refuse_robot_file, toml_content
from pivident.experiment.file_keys import ExperimentFile
from pivident.experiment.identify_table import method_of
from pivident.foundation.errors import ExperimentError, PividentError
from pivident.foundation.text.finding import FindingKind, Topic
from pivident.foundation.text.repair import Change, Edit, Place, Renamed, Repair, Respelt
from pivident.robot.naming import ROBOT_FILES

#: What this check looks at.
FILE = Topic("file")

UNKNOWN_KEY = FindingKind(FILE, "unknown key", stops=True)
VALUE = FindingKind(FILE, "value", stops=True)


def file_problems(
    path: Path, robot: str | None = None
) -> tuple[str, Experiment | None, list[Remark]]:
    """Text, experiment without unknown keys (None after other problems), and what is wrong."""
    try:
        content = toml_content(path)
        refuse_robot_file(content)
    except PividentError as error:
        raise ExperimentError.of_part(f"{path}: ", error) from error
    text = path.read_text(encoding="utf-8-sig")
    if robot is not None:
        model = str(Path(robot).absolute()) if robot.endswith(ROBOT_FILES) else robot
        content = content | {"robot": {"model": model}}
    plain = plain_form(content)
    remarks = []
    problems = every_problem(plain)
    for problem in problems:
        kind = UNKNOWN_KEY if problem.unknown else VALUE
        place = _place(problem.location, content)
        changes: list[Change] = [Edit(place)] if place else []
        if (meant := problem.said.meant) is not None:
            changes.insert(
                0, Renamed(place, meant[1]) if problem.unknown else Respelt(place, *meant)
            )
        repairs = [Repair((change,)) for change in changes]
        seen, step = advised(problem.said)
        remarks.append(
            of_finding(kind.finding("error", seen, "", step, place=place, repairs=repairs))
        )
    usable = _without(plain, [p.location for p in problems if p.unknown])
    if problems and every_problem(usable):
        usable = _without(usable, [p.location[:1] for p in every_problem(usable) if p.location])
        if every_problem(usable):
            return text, None, remarks
    try:
        checked = with_every_run(ExperimentFile.model_validate(usable), path.parent)
    except PividentError as error:
        return text, None, [*remarks, of_error(error, "file", ("recording", 0))]
    experiment = Experiment(path, checked)
    return text, experiment, [*remarks, *_options(experiment)]


def _place(loc: Sequence[int | str], content: dict[str, Any]) -> Place:
    """A location of the schema as tables and keys of the file."""
    place = list(loc)
    if place[:1] == ["controller"] and "controller" not in content and "reference" in content:
        place = place[1:]
    return tuple(place)


def _without(plain: dict[str, Any], locations: Sequence[Sequence[int | str]]) -> dict[str, Any]:
    """The content without some keys."""
    rest = copy.deepcopy(plain)
    for loc in locations:
        table: Any = rest
        for part in loc[:-1]:
            table = table[part]
        if isinstance(table, dict):
            table.pop(loc[-1], None)
    return rest


def _options(experiment: Experiment) -> Iterator[Remark]:
    """Options of single methods that they do not have, or that contradict each other."""
    for name in experiment.content.identify.with_tables:
        try:
            method_of(name, experiment.content.identify)
        except PividentError as error:
            yield of_error(error, "file", ("identify", name))
