"""The command ``pivident symbolic``: the model of a robot as formulas and as code."""

from __future__ import annotations

from collections.abc import Collection, Sequence
from pathlib import Path
from textwrap import indent
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from pivident.app.cli.console import note
from pivident.foundation.errors import PividentError, require_known
from pivident.foundation.text.numbers import plain_table
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.models.symbolic.program import Program
    from pivident.robot.description import Robot

Names = Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)]


def symbolic(
    robot: str,
    /,
    *,
    what: Names = (),
    to: Names = (),
    out: Path | None = None,
    parameters: Literal["base", "standard"] = "base",
    values: bool = False,
) -> int:
    """Write the model of a robot as Python, C, LaTeX or SymPy, and count its operations.

    Without --to and --out the numbers of operations are printed, or with --what base the groups
    of the base parameters. With --to alone the text goes to standard output.

    Parameters
    ----------
    robot
        Name in the gallery, or a robot file (.toml, .urdf, .urdf.gz, .xml, .mjcf).
    what
        inverse, regressor, mass, gravity, coriolis, base; of a robot with closed loops also
        closure, motion; several separated by commas or repeated. Default: all of them.
    to
        python, c, latex, sympy; several separated by commas with --out. Default: all of them.
    out
        Folder for the files, named after the robot.
    parameters
        Parameters of the models: the base ones, or all standard ones.
    values
        Replace parameters by the nominal (CAD) values of the robot file.
    """
    from pivident.foundation.files import atomic_folder, check_output
    from pivident.models.symbolic.robot_models import (
        LANGUAGES,
        LOOP_MODELS,
        MODELS,
        model_files,
        models_of,
    )
    from pivident.robot.gallery import load_robot

    models = _chosen("--what", what, [*MODELS, *LOOP_MODELS])
    languages = _chosen("--to", to, LANGUAGES)
    if to and out is None and len(languages) > 1:
        raise PividentError(
            "--to names several languages", advice="give a folder for their files with --out"
        )
    if out is not None:
        check_output(out)
    machine = load_robot(robot)
    if not what:
        models = models_of(machine)
    programs = _programs(machine, models, parameters, values)
    if to and out is None:
        print(next(iter(model_files(machine, programs, languages).values())))
        return 0
    print(_costs(machine, programs))
    if "base" in what or (out is None and models == ["base"]):
        print(f"\n{_groups(machine)}")
    if out is not None:
        files = model_files(machine, programs, languages)
        with atomic_folder(out) as folder:
            for name, text in files.items():
                (folder / name).write_text(text, encoding="utf-8")
        for name in files:
            print(out / name)
        note(f"{len(files)} files written")
    return 0


def _chosen(option: str, given: Sequence[str], known: Collection[str]) -> list[str]:
    """Names of an option, all known ones where none is given."""
    names = separated(given)
    for name in names:
        require_known(name, known, f"{option}: there is no {name!r}", PividentError)
    if given and not names:
        raise PividentError(f"{option} names nothing", advice=f"choose from {', '.join(known)}")
    return list(dict.fromkeys(names)) or list(known)


def _programs(robot: Robot, models: Sequence[str], kind: str, values: bool) -> list[Program]:
    from pivident.dynamics.base_parameters import base_parameters
    from pivident.dynamics.parameters import standard_parameters
    from pivident.models.symbolic.model_symbols import Columns
    from pivident.models.symbolic.robot_models import (
        nominal_standard_values,
        symbolic_models,
    )

    numbers = None
    columns: Columns
    if kind == "base":
        columns = base = base_parameters(robot)
        numbers = base.values(nominal_standard_values(robot)) if values else None
    else:
        columns = standard_parameters(robot)
        numbers = nominal_standard_values(robot) if values else None
    return symbolic_models(robot, models, columns, numbers)


def _costs(robot: Robot, programs: Sequence[Program]) -> str:
    """Operations of each program, as a table; last those of a step of Newton's method."""
    from pivident.models.symbolic.assignments import closings_of

    every = [*programs, *(closing.step for closing in closings_of(programs))]
    counts = [program.operation_count for program in every]
    table = plain_table(
        [
            ("", "<", [program.name for program in every]),
            ("multiplications", ">", [str(n.multiplications) for n in counts]),
            ("additions", ">", [str(n.additions) for n in counts]),
            ("sines, cosines", ">", [str(n.sines) for n in counts]),
            ("other functions", ">", [str(n.functions) for n in counts]),
        ]
    )
    return f"Operations for one state of {robot.name}\n{indent(table, '  ')}"


def _groups(robot: Robot) -> str:
    """Base parameters with their groups, and what has no effect."""
    from pivident.dynamics.base_parameters import base_parameters
    from pivident.dynamics.grouping.closed_form import closed_form_base_parameters
    from pivident.models.symbolic.robot_models import has_closed_form

    if has_closed_form(robot):
        return str(closed_form_base_parameters(robot))
    base = base_parameters(robot)
    lines = [f"{n} = {e}" for n, e in zip(base.names, base.expressions, strict=True)]
    if nothing := [base.standard[k].name for k in base.without_effect]:
        lines += ["", "Without effect on any torque:", ", ".join(nothing)]
    return "\n".join(lines)
