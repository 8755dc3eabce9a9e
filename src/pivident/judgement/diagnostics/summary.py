"""The verdict on one screen: answer, evidence, what is wrong, what to take away, what next.

Terminal, report, studio and ``verdict.json`` show the same five parts. Everything else that is
known of a result stands below: ``--details``, and the sections of the report.
"""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Collection, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from pivident.estimation.identification import Identification
from pivident.estimation.parameter_rows import ParameterRow, parameter_rows
from pivident.foundation.text.finding import Finding
from pivident.foundation.text.numbers import format_significant, percent, plain_table
from pivident.foundation.text.sentences import first_sentence, listed, plural
from pivident.judgement.diagnostics.diagnostics import Diagnostics
from pivident.judgement.diagnostics.uses import Use
from pivident.judgement.model_errors.time_errors import temperature_text
from pivident.judgement.validation.held_out.prediction import PredictionError

#: Width of the screen, in characters, its lines, and those of one item.
WIDTH, LINES, ITEM_LINES = 110, 24, 2

#: Joints in the table; of more the worst.
MAX_JOINTS = 7

#: Repairs and reservations that are listed.
MAX_ITEMS = 4

#: Friction that the table shows: title and stems of parameters.
SHOWN = (("viscous", ("fv", "fvp")), ("Coulomb", ("fc", "fcp")))

#: What baselines are called.
BASELINES = {"description": "your description", "plain law": "plain least squares"}

#: Commands that answer a reservation, by its topic and kind.
ANSWERED_BY = {("model", "friction"): "laws", ("model", "uneven friction"): "friction"}

#: What to take away before a repair.
NOT_YET = "nothing yet: apply, identify again, then pivident export"

#: What commands are for.
MEANT = {
    "excite": "designs a motion that tells more",
    "laws": "compares friction laws",
    "friction": "shows it over speed and position",
    "apply": "writes it into the file",
    "export": "a physically possible model",
}


@dataclass(frozen=True)
class JointRow:
    """One joint of the table.

    Attributes:
        joint: its name.
        torque: rms of its torque, with the unit.
        error: of its torque on held-out motion; without standstill in brackets where that is less.
        friction: values with 2σ, in the order of the titles.
        remark: where a value of friction is not significantly different from zero.
    """

    joint: str
    torque: str
    error: str
    friction: tuple[str, ...]
    remark: str = ""


@dataclass(frozen=True)
class Item:
    """Something that is wrong, or a reservation.

    Attributes:
        text: what.
        command: that sets it right; empty where none does.
        effect: what it did when it was tried; empty where it was not.
    """

    text: str
    command: str = ""
    effect: str = ""


@dataclass(frozen=True)
class Summary:
    """The five parts.

    Attributes:
        subject: robot, log and method.
        answer: what the estimate is good for.
        error: torque error beside those of simpler models, a sentence.
        titles: of the columns of friction.
        joints: rows of the table.
        known: how many values are known well.
        items: what is wrong, repairs first.
        more: number of items that are not listed.
        take_away: a command for the model.
        next_step: a command for what to do next.
        details: where all else is.
    """

    subject: str
    answer: str
    error: str
    titles: tuple[str, ...]
    joints: tuple[JointRow, ...]
    known: str
    items: tuple[Item, ...]
    more: int = 0
    take_away: str = ""
    next_step: str = ""
    details: str = ""

    def in_folder(
        self,
        folder: str | Path,
        experiment: str | Path | None,
        motion: str,
        refused: Collection[int] = (),
    ) -> Summary:
        """The same with commands for a folder of results.

        Args:
            folder: of the results.
            experiment: its experiment file; None where there is none.
            motion: command that designs the next motion, or empty.
            refused: numbers of repairs that contradict the file.
        """
        place = f"./{folder}" if str(folder).startswith("-") else str(folder)
        usual = experiment is not None and Path(folder) == Path(f"{Path(experiment).stem}-results")
        elsewhere = [] if usual else ["--results", place]
        items, number = [], 0
        for item in self.items:
            number += bool(item.effect)
            is_repair = item.effect and experiment is not None and number not in refused
            words = ["apply", str(experiment), str(number), *elsewhere] if is_repair else []
            if item.command and experiment is not None:
                words = [item.command, str(experiment)]
            items.append(replace(item, command=shlex.join(["pivident", *words]) if words else ""))
        export = ["pivident", "export", place, "--to", "urdf", "--out", "identified.urdf"]
        first = next((item.command for item in items if item.command), motion)
        return replace(
            self,
            items=tuple(items),
            take_away="" if number else shlex.join(export),
            next_step=first,
        )

    def text(self) -> str:
        """The screen; items take the room that is left."""
        said = (line for text in (self.answer, self.error) for line in textwrap.wrap(text, WIDTH))
        lines = [_cut(self.subject), *said, ""]
        if self.joints:
            lines += [_cut(line) for line in self.table().splitlines()]
        lines += [*textwrap.wrap(self.known, WIDTH), ""]
        later = NOT_YET * any(item.effect and item.command for item in self.items)
        named = (
            ("Take away", self.take_away or later),
            ("Next", self.next_step),
            ("Details", self.details),
        )
        tail = [_explained(f"{title:<11}", line) for title, line in named if line]
        room = LINES - len(lines) - len(tail) - 2  # a blank line, and how many more there are
        shown = min(len(self.items), room // ITEM_LINES)
        for number, item in enumerate(self.items[:shown], start=1):
            lines += _item_lines(number, item)
        if more := self.more + len(self.items) - shown:
            lines.append(f"   {plural(more, 'more reservation')}: --details")
        return "\n".join([*lines, *[""] * bool(self.items), *tail]).rstrip()

    def table(self) -> str:
        """One line for each joint."""
        columns = [
            ("joint", "<", [row.joint for row in self.joints]),
            ("torque rms", ">", [row.torque for row in self.joints]),
            ("error", "<", [row.error for row in self.joints]),
        ]
        columns += [
            (title, "<", _aligned([row.friction[k] for row in self.joints]))
            for k, title in enumerate(self.titles)
        ]
        return plain_table([*columns, ("", "<", [row.remark for row in self.joints])])


def summary_of(
    diagnostics: Diagnostics,
    name: str,
    headline: str,
    judged_uses: Sequence[Use],
    reservations: Sequence[Finding],
) -> Summary:
    """The verdict on one screen.

    Args:
        diagnostics: what it was made from.
        name: short name of the method whose estimate to take.
        headline: what the estimate is good for.
        judged_uses: the same by use.
        reservations: statements that are reservations.
    """
    result = diagnostics.identifications[name]
    judged = diagnostics.validations.get(name)
    by_name = {use.name: use for use in judged_uses}
    values, torques = by_name["parameters"], by_name["torque"]
    rows = parameter_rows(result)
    error = None if judged is None else judged.prediction
    titles, joints = _joints(result, rows, error)
    text = values.why
    if values.answer != "yes" and torques.answer != "no":
        text += "; of the others trust the torques, not single values"
    by_law = any((s.topic, s.kind) in ANSWERED_BY for s in reservations)
    text += ". ± is the 95 % interval" + " under the assumed friction law" * by_law
    at = [f"{temperature_text(own.reference)} ({own.joint})" for own in result.friction_warming]
    text += f"; friction is that at {listed(at)}" * bool(at)
    repairs = [Item(t.cause, effect=t.effect) for t in diagnostics.trials if t.wins]
    further = [_item(s) for s in reservations]
    items = repairs or further  # what a fault of the log makes of the rest is not known yet
    return Summary(
        _subject(result),
        headline,
        _error(diagnostics, error, result),
        titles,
        joints,
        f"{text}.",
        tuple(items[:MAX_ITEMS]),
        max(len(items) - MAX_ITEMS, 0),
    )


def _subject(result: Identification) -> str:
    """Robot, recordings, method and instruments."""
    records = result.recordings
    parts = [result.robot.on_fixed_base.name]
    if records:
        seconds = sum(float(r.t[-1] - r.t[0]) for r in records)
        name = records[0].name if len(records) == 1 else plural(len(records), "recording")
        parts += [name, f"{format_significant(seconds)} s"]
    parts.append(result.method.partition(" (")[0])
    return " · ".join(parts)


def _error(diagnostics: Diagnostics, error: PredictionError | None, result: Identification) -> str:
    """Torque error beside that of simpler models."""
    if error is None:
        return f"Torque on the fitted motion: {percent(100.0 * float(result.relative_error))} off."
    beside = ", ".join(
        f"{BASELINES[n]} {percent(x)}" for n, x in diagnostics.baselines.errors.items()
    )
    said = f" ({beside})" * bool(beside)
    whole, moving = error.total_in_band, error.total_moving_in_band
    moves = f", {percent(moving)} in motion" if moving < 0.5 * whole else ""
    return f"Torque on motion that was not fitted: {percent(whole)} off{moves}{said}"


def _joints(
    result: Identification, rows: Sequence[ParameterRow], error: PredictionError | None
) -> tuple[tuple[str, ...], tuple[JointRow, ...]]:
    """Titles of the columns of friction, and a row for each joint."""
    robot = result.robot
    places = dict(zip(robot.joint_names, robot.places, strict=True))
    by_joint: dict[str, dict[str, ParameterRow]] = {name: {} for name in robot.joint_names}
    names = {place: name for name, place in places.items()}
    for row, parameter in zip(rows, result.parameters, strict=True):
        if parameter.joint in names:
            by_joint[names[parameter.joint]].setdefault(parameter.stem, row)
    shown = [
        (title, stems)
        for title, stems in SHOWN
        if any(stem in own for own in by_joint.values() for stem in stems)
    ]
    units = {j.name: j.torque_unit for j in robot.joints}
    order = list(robot.joint_names)
    if error is not None and len(order) > MAX_JOINTS:
        worst = np.argsort(-error.relative_in_band)[: MAX_JOINTS - 1]
        order = [error.joint_names[k] for k in sorted(worst)]
    made = []
    for name in order:
        known = by_joint[name]
        own = [next((known[s] for s in stems if s in known), None) for _, stems in shown]
        weak = any(row is not None and row.includes_zero for row in own)
        torque, said = _of_joint(error, name, units[name])
        cells = tuple("" if row is None else " ± ".join(row.value_and_spread) for row in own)
        made.append(JointRow(name, torque, said, cells, "may be zero" if weak else ""))
    kinds = {j.kind for j in robot.joints}
    unit = {"revolute": ("N m s/rad", "N m"), "prismatic": ("N s/m", "N")}.get(
        next(iter(kinds)) if len(kinds) == 1 else "", ("", "")
    )
    titles = tuple(f"{title} {own}".rstrip() for (title, _), own in zip(shown, unit, strict=False))
    return titles, tuple(made)


def _of_joint(error: PredictionError | None, name: str, unit: str) -> tuple[str, str]:
    """Torque and error of one joint."""
    if error is None or name not in error.joint_names:
        return "", ""
    k = error.joint_names.index(name)
    whole, moving = float(error.relative_in_band[k]), float(error.moving_in_band[k])
    said = percent(whole)
    if moving < 0.5 * whole:
        said = f"{percent(moving)} ({said} with standstill)"
    return f"{format_significant(float(error.torque_in_band[k]))} {unit}", said


def _item(statement: Finding) -> Item:
    """The first sentence of a statement, and what to do: a command, or the first sentence of it."""
    first = _cut(first_sentence(statement.message), WIDTH - 3)
    command = ANSWERED_BY.get((statement.topic, statement.kind), "")
    step = "" if command else first_sentence(statement.next_step)
    return Item(f"{first}\n{step}".rstrip(), command)


def _explained(title: str, line: str) -> str:
    """A command with what it is for, as a comment of the shell, where there is room for that."""
    meant = next((MEANT[word] for word in line.split()[1:2] if word in MEANT), "")
    whole = f"{title}{line}   # {meant}"
    return whole if meant and len(whole) <= WIDTH else f"{title}{line}"


def _aligned(cells: Sequence[str]) -> list[str]:
    """Values and spreads with the signs between them below one another."""
    widest = max(len(cell.partition("±")[0]) for cell in cells)
    return [" " * (widest - len(cell.partition("±")[0])) + cell for cell in cells]


def _item_lines(number: int, item: Item) -> list[str]:
    """An item on two lines at most."""
    tail = "   ".join(filter(None, [item.command, f"tried: {item.effect}" if item.effect else ""]))
    lines = [own for part in item.text.splitlines() for own in textwrap.wrap(part, WIDTH - 3)]
    room = ITEM_LINES - bool(tail)
    if len(lines) > room:
        lines = [*lines[: room - 1], _cut(" ".join(lines[room - 1 :]), WIDTH - 3)]
    first, *others = [*lines, *([tail] if tail else [])]
    return [f"{number}  {first}", *(f"   {line}" for line in others)]


def _cut(line: str, width: int = WIDTH) -> str:
    """A line that ends where there is no more room."""
    return line if len(line) <= width else f"{line[: width - 1].rpartition(' ')[0]} …"
