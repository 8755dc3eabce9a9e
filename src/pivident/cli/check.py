"""The command ``pivident check``: what is wrong with an experiment, before it is computed."""

from __future__ import annotations

import json
from collections.abc import Iterator
from pathlib import Path
from textwrap import wrap
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from pivident.cli.console import Progress

if TYPE_CHECKING:
    from pivident.check.experiment_check import ExperimentCheck
    from pivident.check.remark import Remark

DONE, WRONG_INPUT, FAULTY_LOG = 0, 1, 4

#: Width of a line on a terminal; lines of a file or a pipe are not broken.
WIDTH = 96


def check(
    experiment: Path,
    /,
    *,
    robot: str | None = None,
    as_json: Annotated[bool, Parameter(name="--json", negative=(), show_default=False)] = False,
) -> int:
    """Say what is wrong with an experiment file, its robot and its logs; nothing is estimated.

    Parameters
    ----------
    experiment
        The experiment file.
    robot
        Robot in place of the file's: name in the gallery, .toml or .urdf.
    as_json
        Print everything as JSON, for programs.
    """
    from pivident.check.experiment_check import check_experiment

    with Progress() as progress:
        found = check_experiment(experiment, robot, progress.say)
    if as_json:
        print(json.dumps(found.as_json(), ensure_ascii=False, allow_nan=False, indent=1))
    else:
        print_check(found)
    if found.refused:
        return WRONG_INPUT
    return FAULTY_LOG if found.severity == "wrong" else DONE


def print_check(found: ExperimentCheck) -> None:
    """Remarks, the gravest first; then what was checked and what would be estimated.

    Args:
        found: what the check has found.
    """
    import sys

    from rich.console import Console
    from rich.text import Text

    from pivident.cli.audit import STYLES
    from pivident.text.printable import escaped

    console = Console(highlight=False)
    counts = {s: sum(r.severity == s for r in found.remarks) for s in ("wrong", "look")}
    print(escaped(f"{found.path}: {_headline(found, counts)}"))
    for remark in found.remarks:
        lines = [escaped(line) for line in _lines(remark)]
        if sys.stdout.isatty():
            indent = " " * 9
            broken = [part for line in lines for part in wrap(line, WIDTH - len(indent))]
            console.print(Text(f"  {remark.severity:<6} ", STYLES[remark.severity]), end="")
            console.print(Text(f"\n{indent}".join(broken)))
        else:
            print(f"  {remark.severity:<6} {' '.join(lines)}")
    print("Checked: " + escaped("; ".join(found.looked_at)) + ".")
    if found.plan is not None:
        when = " once the gaps are seen to as said above" if found.refused else ""
        print(escaped(f"To be estimated{when}:\n{found.plan}"))


def _headline(found: ExperimentCheck, counts: dict[str, int]) -> str:
    if not found.remarks:
        return "looks fine"
    listed = f"{counts['wrong']} wrong, {counts['look']} to look at"
    if found.refused:
        return f"{listed}; an identification would stop"
    if counts["wrong"]:
        return f"{listed}; an identification would run, and mislead"
    return f"{listed}; nothing is wrong"


def _lines(remark: Remark) -> Iterator[str]:
    """Place, sentence and step."""
    if remark.heading:
        yield f"{remark.heading}:"
    yield remark.sentence
    if remark.step:
        yield remark.step
