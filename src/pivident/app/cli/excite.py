"""The command ``pivident excite``: the motion whose record determines the parameters best."""

from __future__ import annotations

import itertools
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any

from cyclopts import Parameter

from pivident.app.cli.console import DONE, FAULTY_LOG, NOT_CONVERGED, Progress, name_bodies
from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.sentences import separated

if TYPE_CHECKING:
    from pivident.estimation.identification import Identification
    from pivident.experiment.excite_keys import ExciteEntry
    from pivident.robot.description import Robot
    from pivident.studies.excitation.request import DesignRequest


def excite(
    subject: str,
    /,
    *,
    duration: Annotated[float | None, Parameter(show_default=False)] = None,
    motion: Annotated[str | None, Parameter(show_default=False)] = None,
    criterion: Annotated[str | None, Parameter(show_default=False)] = None,
    parameters: Annotated[
        tuple[str, ...], Parameter(name="--for", negative=(), show_default=False)
    ] = (),
    to: Annotated[str | None, Parameter(show_default=False)] = None,
    after: Annotated[tuple[Path, ...], Parameter(negative=(), show_default=False)] = (),
    cell: Path | None = None,
    frozen: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    start: Annotated[str | None, Parameter(show_default=False, allow_leading_hyphen=True)] = None,
    rate: Annotated[float | None, Parameter(show_default=False)] = None,
    seconds: Annotated[float | None, Parameter(show_default=False)] = None,
    seed: Annotated[int | None, Parameter(show_default=False)] = None,
    out: Path | None = None,
    check: Path | None = None,
) -> int:
    """Design a motion that determines the parameters, within all limits, and say how well it will.

    Ctrl-C ends the search with the best motion so far.

    Parameters
    ----------
    subject
        The robot: URDF, .toml or gallery name; an experiment file, whose table [excite] may say
        all of this too; or a result, after which the motion is the next one.
    duration
        Duration of the motion in s. Default: 20. With --to the longest that is tried.
    motion
        splines, fourier or postures (moves from posture to posture, for teach pendants). Default:
        splines.
    criterion
        a (mean squared relative standard error), d (determinant), worst (largest standard error) or
        cond (condition number). Default: a, and worst with --for.
    parameters
        Parameters that count, separated by commas: zz3r,fc5. Default: all.
    to
        Standard error over its value that each of them must reach, such as 2% (of a very small
        parameter: over the size from which on its torque is noticeable); the shortest motion that
        gives it is designed.
    after
        Earlier results, the last one first: their noise and what they know already count.
    cell
        File with a table [excite]: limits, obstacles, floor, box of the tool. Default: that of the
        experiment file.
    frozen
        Joints of a URDF that stand still, with their positions in rad or m, separated by commas:
        finger_1=0.02,finger_2=0.02.
    start
        Posture at both ends in rad or m, one number for each joint, separated by commas:
        --start=-0.2,0.5. Default: chosen with the motion.
    rate
        Rate of the samples in motion.csv and motion.npz in Hz. Default: 1000.
    seconds
        Time for the search in s. Default: 20.
    seed
        Seed of the random starts. Default: 0.
    out
        Folder for the design, its files and its page; one that holds a design already is refused,
        since a record may lie beside it. Default: motion, or motion-2 and so on.
    check
        A log, or the experiment file that describes it: whether the robot ran the design of the
        folder that is named first, and what the log still gives; nothing is designed.
    """
    if check is not None:
        return _checked(Path(subject), check)
    from pivident.foundation.files import check_output
    from pivident.robot.refusals import without_loops
    from pivident.studies.collision.room import clearances_of_room
    from pivident.studies.excitation.design_file import RATE, check_rate, write_design
    from pivident.studies.excitation.design_motion import DESIGNED_ELSEWHERE, design_motion
    from pivident.studies.excitation.request import limits_of, question_of, torque_noise_of

    folder = out or _new_folder()
    check_output(folder)
    if (folder / "design.json").exists():
        raise ExperimentError(
            f"{folder} holds a design, and may hold its record",
            advice="choose another --out, or remove it",
        )
    with Progress() as progress:
        progress.say(f"reading {subject}")
        robot, table, known = _subject(subject, frozen_joints(frozen))
        name_bodies(robot)
        without_loops(robot, "the design of motions", DESIGNED_ELSEWHERE)
        if cell is not None:
            from pivident.studies.excitation.request import read_cell

            table = read_cell(cell)
        earlier = [*_results(after), *known]
        given = {
            "duration": duration,
            "motion": motion,
            "criterion": criterion,
            "parameters": tuple(separated(parameters)) or None,
            "goal": None if to is None else relative_error(to),
            "start": None if start is None else _numbers(start),
            "seconds": seconds,
            "seed": seed,
        }
        request = _request(table, given)
        samples = next(r for r in (rate, table.rate, RATE) if r is not None)
        check_rate(samples)
        limits = limits_of(robot, table)
        progress.say("looking at bodies and obstacles")
        clearances = clearances_of_room(limits.of_robot(robot), table)
        design = design_motion(
            robot,
            request,
            limits=limits,
            after=earlier,
            clearances=clearances,
            question=question_of(table),
            torque_noise=torque_noise_of(robot, table),
            progress=progress.say,
        )
        progress.say("writing the design")
        asked = table.model_dump(mode="json", exclude_unset=True)
        asked |= {"robot": subject} if _names_robot(Path(subject)) else {"subject": subject}
        design = replace(design, settings=asked | dict(design.settings))
        written = write_design(design, folder, samples)
    print(design)
    print(f"\nFiles: {', '.join(path.name for path in written)} in {folder}")
    goal = request.goal
    missed = goal is not None and max(p.share for p in design.predicted if p.wanted) > goal
    return NOT_CONVERGED if missed else DONE


def _checked(design: Path, log: Path) -> int:
    """Say whether the robot ran a design, recording by recording."""
    from pivident.models.runnable_model import runnable_model
    from pivident.studies.excitation.design_file import load_design
    from pivident.studies.excitation.recorded_run import recorded_run
    from pivident.studies.prediction.new_logs import StoredResult, new_logs

    with Progress() as progress:
        progress.say(f"reading {design}")
        designed = load_design(design)
        progress.say(f"reading {log}")
        known = StoredResult(runnable_model(designed.robot), design)
        runs = [recorded_run(designed, new.recording) for new in new_logs(log, known)]
    print(*runs, sep="\n\n")
    return DONE if all(run.is_as_designed for run in runs) else FAULTY_LOG


def _new_folder() -> Path:
    """The first of motion, motion-2, … that does not exist."""
    names = itertools.chain(["motion"], (f"motion-{k}" for k in itertools.count(2)))
    return next(Path(name) for name in names if not Path(name).exists())


def _subject(
    subject: str, frozen: dict[str, float]
) -> tuple[Robot, ExciteEntry, list[Identification]]:
    """Robot, table ``[excite]`` and result of what was named."""
    from pivident.estimation.stored_identification import load_identification
    from pivident.experiment.excite_keys import ExciteEntry
    from pivident.experiment.experiment import load_experiment
    from pivident.judgement.diagnostics.stored_verdict import result_of
    from pivident.robot.gallery import load_robot
    from pivident.robot.urdf import read_urdf

    empty, path = ExciteEntry.model_validate({}), Path(subject)
    if frozen:
        if not _names_robot(path):
            raise ExperimentError(
                "--frozen is for a URDF",
                advice="an experiment file has its own, frozen = {…} under [robot]",
            )
        return read_urdf(path, frozen=frozen), empty, []
    if _names_robot(path):
        return load_robot(subject), empty, []
    if path.suffix == ".toml":
        experiment = load_experiment(path)
        return experiment.robot, experiment.content.excite or empty, []
    found = load_identification(result_of(path))
    return found.robot, empty, [found]


def _names_robot(path: Path) -> bool:
    """Whether a robot is named, not an experiment or a result."""
    from pivident.experiment.explained import toml_content

    if path.suffix == ".toml" and not path.is_dir():
        return "joints" in toml_content(path)
    return not (path.is_dir() or path.suffix == ".json")


def _results(paths: tuple[Path, ...]) -> list[Identification]:
    """Earlier results from their files or folders."""
    from pivident.estimation.stored_identification import load_identification
    from pivident.judgement.diagnostics.stored_verdict import result_of

    return [load_identification(result_of(path)) for path in paths]


def _request(table: ExciteEntry, given: dict[str, Any]) -> DesignRequest:
    """What is asked: the command line before the file."""
    from pivident.studies.excitation.request import DesignRequest

    written: dict[str, Any] = {
        "duration": table.duration,
        "motion": table.motion,
        "criterion": table.criterion,
        "parameters": tuple(table.parameters) or None,
        "goal": table.to,
        "start": None if table.start is None else tuple(table.start),
        "seconds": table.seconds,
        "seed": table.seed,
    }
    chosen = {key: given[key] if given[key] is not None else written[key] for key in written}
    return DesignRequest(**{key: value for key, value in chosen.items() if value is not None})


def relative_error(text: str) -> float:
    """A relative standard error, written as 2% or 0.02."""
    number, percent = text.strip().removesuffix("%").strip(), text.strip().endswith("%")
    try:
        value = float(number)
    except ValueError:
        raise ExperimentError(
            f"--to {text} is no number", advice="write it as 2% or 0.02"
        ) from None
    return value / 100.0 if percent else value


def frozen_joints(given: tuple[str, ...]) -> dict[str, float]:
    """Positions of joints that stand still, by their names."""
    found = {}
    for text in separated(given):
        name, _, value = text.rpartition("=")
        try:
            found[name.strip()] = float(value)
        except ValueError:
            name = ""
        if not name:
            raise ExperimentError(
                f"--frozen {text}: write the joint and its position, such as finger_1=0.02"
            )
    return found


def _numbers(text: str) -> tuple[float, ...]:
    """Numbers separated by commas."""
    try:
        return tuple(float(part) for part in text.split(","))
    except ValueError:
        raise ExperimentError(
            f"--start {text} is not a list of numbers",
            advice="write one for each joint, such as 0,-1.2,0.5",
        ) from None
