"""The command ``pivident init``: questions, the file, and what was assumed."""

from __future__ import annotations

import os
import shlex
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.app.cli.console import DONE, FAULTY_LOG, Progress, UsageError, note
from pivident.app.cli.excite import excite
from pivident.foundation.errors import PividentError
from pivident.foundation.text.identifiers import escaped
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.experiment.init.assumption import Answers, Question
    from pivident.experiment.init.draft import Draft

#: How sure an assumption is, as the summary shows it, and its colour on a terminal.
SURE = {
    "certain": ("seen", "green"),
    "likely": ("likely", "cyan"),
    "assumed": ("ASSUMED", "yellow"),
}

#: Longest value in the summary, in characters.
MAX_VALUE = 60


def init(
    *logs: Path,
    robot: str | None = None,
    out: Path = Path("experiment.toml"),
    joints: Annotated[str | None, Parameter(show_default=False)] = None,
    columns: Annotated[str | None, Parameter(show_default=False)] = None,
    rate: Annotated[float | None, Parameter(show_default=False)] = None,
    gravity: Annotated[str | None, Parameter(show_default=False)] = None,
    body: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    yes: Annotated[bool, Parameter(name=["--yes", "-y"], negative=())] = False,
    force: Annotated[bool, Parameter(negative=())] = False,
) -> int:
    """Write a first experiment file for a log, with a reason for every assumption in it.

    Parameters
    ----------
    logs
        Files of one run side by side, or several runs of the same columns.
    robot
        Name in the gallery, .toml, .urdf or .urdf.gz. Default: the only URDF beside the log.
    out
        The experiment file.
    joints
        Joints to identify, separated by commas; the others stand still. Default: all that move and
        have a torque.
    columns
        Names of the columns of a log without header, in their order: t,q1..q6,-,tau1..tau6, with -
        for those that are not needed.
    rate
        Rate of the log in Hz, or of the samples that are made of irregular ones. Default: that of
        its clock.
    gravity
        Where gravity points in the base frame: --gravity=-y, none, or three numbers in m/s²,
        --gravity=0,0,-9.81. Default: that of the robot.
    body
        A body that was mounted and that the robot's description lacks, once for each:
        --body "flange 2.75 kg", with its centre of mass in m "flange 2.75 kg at 0,0,0.05".
    yes
        Ask nothing; write the best assumption and mark it.
    force
        Replace a file that exists.
    """
    if not logs:
        if robot is None or yes or not sys.stdin.isatty() or not design_first(robot):
            raise without_log(robot)
        return excite(robot)
    done = run_init(
        logs,
        robot,
        out,
        joints=separated([joints or ""]),
        column_names=separated([columns or ""]),
        rate=rate,
        gravity=gravity,
        bodies=body,
        ask=sys.stdin.isatty() and not yes,
        force=force,
    )
    return DONE if done else FAULTY_LOG


def run_init(
    logs: Sequence[Path],
    robot: str | None,
    out: Path,
    *,
    joints: Sequence[str] = (),
    column_names: Sequence[str] = (),
    rate: float | None = None,
    gravity: str | None = None,
    bodies: Sequence[str] = (),
    ask: bool = False,
    force: bool = False,
) -> bool:
    """Draft an experiment file, write it, and print what was assumed.

    True where nothing stands in the way of an identification.
    """
    from pivident.app.cli.compile_ahead import compile_in_first_run
    from pivident.experiment.init.draft import draft_experiment
    from pivident.foundation.common_work import numbers_beside
    from pivident.foundation.files import write_file

    check_target(out, logs, robot, force)
    compile_in_first_run()
    answers: Answers = {}
    while True:
        with Progress() as progress, numbers_beside(out):
            draft = draft_experiment(
                logs,
                robot,
                out=out,
                joints=joints,
                column_names=column_names,
                rate=rate,
                gravity=gravity,
                bodies=bodies,
                answers=answers,
                progress=progress.say,
            )
        open_questions = [q for q in draft.questions if q.about not in answers] if ask else []
        if not open_questions:
            break
        for question in open_questions:
            answers[question.about] = _asked(question)
    write_file(out, draft.text)
    print_draft(draft, out)
    return not draft.troubles


def without_log(robot: str | None) -> UsageError:
    """What to do where there is no log yet, as far as the robot is known."""
    arm = shlex.quote(robot or "my_arm.urdf")
    return UsageError(
        f"init needs a log: pivident init LOG --robot {arm}. Where there is none yet, design a "
        f"motion first: pivident excite {arm} --out motion",
        advice="run it on the robot, and log it",
    )


def design_first(robot: str) -> bool:
    """Ask the person at the terminal whether a motion is to be designed now."""
    from pivident.experiment.init.assumption import Question

    text = f"There is no log yet. Design a motion for {robot} now, into the folder motion?"
    return _asked(Question("motion", text, ("yes", "no"))) == "yes"


def check_target(out: Path, logs: Sequence[Path], robot: str | None, force: bool) -> None:
    """Refuse to overwrite an experiment file that exists, or one of the inputs."""
    if out.suffix != ".toml":
        raise PividentError(f"--out {out} must end with .toml", advice="choose another name")
    inputs: list[str | Path] = [*logs, *([robot] if robot else [])]
    if out.is_dir() or any(
        os.path.exists(path) and out.exists() and out.samefile(path) for path in inputs
    ):
        raise PividentError(
            f"{out} is a folder or one of the inputs", advice="choose another --out"
        )
    if out.exists() and not force:
        raise PividentError(
            f"{out} exists already", advice="choose another --out, or replace it with --force"
        )


def print_draft(draft: Draft, out: Path) -> None:
    """Every assumption with how sure it is, and the next step."""
    from rich.console import Console
    from rich.table import Table
    from rich.text import Text

    from pivident.foundation.text.toml import value_text

    console = Console(highlight=False)
    rows = []
    for line in draft.assumptions:
        if line.value is None:
            continue
        value = " ".join(value_text(line.value, 10**9).split())
        if len(value) > MAX_VALUE:
            value = f"{value[: MAX_VALUE - 1]}…"
        rows.append((line.sure, f"{line.table}.{line.key}", escaped(value), escaped(line.seen)))
    if console.is_terminal:
        table = Table.grid(padding=(0, 2))
        for sure, key, value, seen in rows:
            word, style = SURE[sure]
            table.add_row(Text(word, style), Text(key), Text(value), Text(seen, "dim"))
        console.print(table)
    else:
        for sure, key, value, seen in rows:
            print(f"{SURE[sure][0]:<7}  {key} = {value}  ({seen})")
    if draft.explained:
        errors = ", ".join(f"{joint} {100 * e:.2g} %" for joint, e in draft.explained.items())
        print(f"\nA first least squares leaves this share of the torque: {escaped(errors)}")
    for trouble in draft.troubles:
        note(f"to do: {trouble}")
    assumed = sum(row[0] == "assumed" for row in rows)
    checks = {0: "nothing in it is assumed", 1: "1 line of it is an assumption; check it"}
    number = checks.get(assumed, f"{assumed} lines of it are assumptions; check them")
    print(f"\nWritten: {escaped(str(out))}; {number}.")
    print(f"Next:    pivident check {escaped(str(out))}")
    print(f"         pivident identify {escaped(str(out))}")
    if any(line.key == "speed_feed_forward" for line in draft.assumptions):
        print(f"or:      pivident fit-simulator {escaped(str(out))}")


def _asked(question: Question) -> str:
    """The answer of the person at the terminal; questions go to standard error."""
    from pivident.experiment.init.assumption import UNKNOWN

    choices = f" [{' / '.join(question.choices)}]" if question.choices else ""
    if question.optional:
        several = f"{question.numbers} numbers or one for all" if question.numbers > 1 else "number"
        choices = f" [{several}, or {UNKNOWN}]"
    while True:
        print(f"{question.text}{choices} ", end="", file=sys.stderr, flush=True)
        line = sys.stdin.readline()
        if not line:
            raise KeyboardInterrupt
        answer = line.strip()
        if question.choices:
            fits = [c for c in question.choices if c.lower().startswith(answer.lower())]
            if answer and len(fits) == 1:
                return fits[0]
        elif question.optional and answer.lower() == UNKNOWN:
            return UNKNOWN
        elif _are_positive(answer, question.numbers):
            return answer
        print("Please answer with one of these.", file=sys.stderr)


def _are_positive(text: str, numbers: int) -> bool:
    """Whether a text is one positive, finite number, or so many of them."""
    parts = text.replace(",", " ").split()
    return len(parts) in (1, numbers) and all(map(_is_positive, parts))


def _is_positive(text: str) -> bool:
    """Whether a text is a positive, finite number."""
    try:
        return 0.0 < float(text) < float("inf")
    except ValueError:
        return False
