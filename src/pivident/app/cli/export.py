"""The command ``pivident export``: an identified model in the format of another program.

``pivident export --to rrd``: the motion of a log, with measured and modelled torques.
"""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from pivident.app.cli.console import Progress
from pivident.foundation.errors import ExportError
from pivident.foundation.extras import require

if TYPE_CHECKING:
    from pivident.models.exported import ExportedText, Verification
    from pivident.models.runnable_model import RunnableModel

    To = str
else:
    try:
        from pivident.models.export.formats import FORMATS

        To = Literal[(*FORMATS, "rrd")]
    except ModuleNotFoundError:  # left out of this installation, as the command says when it runs
        To = str


def export(
    result: Path,
    /,
    *,
    to: To,
    out: Path,
    log: Path | None = None,
    robot: Path | None = None,
    free: Annotated[bool, Parameter(negative=())] = False,
    check: bool = True,
) -> int:
    """Write an identified model as URDF, MJCF, SDF, C, NumPy, JSON or LaTeX, and load it back.

    With rrd the motion of a log is written for Rerun, with measured and modelled torques.

    Parameters
    ----------
    result
        The file identification.json or consistent.json of a result, or their folder.
    to
        The format.
    out
        File to write. The header of a C file is written beside it.
    log
        Of rrd: a log with the columns of the result's own logs, or an experiment file.
    robot
        URDF to put the parameters into. Default: the one that was identified.
    free
        Export the free estimate, converted to standard parameters with the same torques, in place
        of the physically consistent parameters.
    check
        Load the file back where a program for it is installed, and compare torques.
    """
    from pivident.foundation.files import check_output
    from pivident.judgement.diagnostics.stored_verdict import result_of, said_against
    from pivident.models.export.formats import FORMATS, export_model, verify_export
    from pivident.models.export.urdf import original_urdf
    from pivident.models.stored_model import stored_model

    if robot is not None and to != "urdf":
        raise ExportError(
            "--robot is for --to urdf", advice=f"{to} holds the whole robot, leave it out"
        )
    if log is not None and to != "rrd":
        raise ExportError("--log is for --to rrd", advice=f"{to} holds no motion, leave it out")
    if to == "rrd":
        if free:
            raise ExportError(
                "--free is for models", advice="leave it out, rrd shows the result named"
            )
        export_rerun(result, log, out)
        return 0
    check_output(out.absolute().parent)
    with Progress() as progress:
        result = result_of(result)
        progress.say(f"reading {result}")
        model, files = stored_model(result, free=free, intervals=FORMATS[to].shows_intervals)
        notes = dict.fromkeys((*said_against(result.parent), *model.notes))
        model = replace(model, notes=tuple(notes))
        original, frozen = None, None
        if to == "urdf":
            original = original_urdf(model.robot, robot, result.parent)
            frozen = model.robot.urdf.frozen if model.robot.urdf else None
        inputs = (*files, *((original.path,) if original else ()))
        progress.say(f"writing {FORMATS[to].title}")
        content = None if original is None else original.content
        exported = export_model(model, to, name=out.stem, original=content, frozen=frozen)
        check_targets(exported, out, inputs, model.origin.sources.values())
        found: tuple[Verification, ...] = ()
        if check:
            progress.say("loading it back")
            found = verify_export(exported, model, to, frozen=frozen)
        if wrong := [v for v in found if not v.skipped and not v.agrees]:
            raise ExportError(
                f"{out} was not written, since it does not match the model: {wrong[0]}",
                advice="this is a bug in pivident or in that program. --no-check writes it anyway",
            )
        written = write_export(exported, out)
    print(export_text(exported, model, written, FORMATS[to].title))
    if original is not None:
        print("".join(f"  · {note}\n" for note in original.notes), end="")
    for verification in found:
        text = str(verification)
        print(text if verification.skipped else f"Loaded back: {text}")
    return 0


def check_targets(
    exported: ExportedText, out: Path, inputs: tuple[Path, ...], sources: Collection[str] = ()
) -> None:
    """Refuse to write over a file that the export, or the identification, is made from.

    ``sources`` are the SHA-256 of the files that were identified.
    """
    from pivident.data.logs.source_files import sha256

    for name in exported.further:
        if name.casefold() == out.name.casefold():
            raise ExportError(
                f"{out} is the name of the file that is written beside it",
                advice=f"give --out another ending, such as {out.with_suffix('.c').name}",
            )
    for target in (out, *(out.with_name(name) for name in exported.further)):
        if target.is_dir():
            raise ExportError(f"{target} is a folder", advice="name a file in it")
        # a copy of one is that of a project which was copied: it reads the first one's robot
        is_input = target.is_file() and sha256(target) in {*sources, *map(sha256, inputs)}
        for source in inputs:
            if target.exists() and (is_input or target.samefile(source)):
                raise ExportError(
                    f"{target} is a file that the export is made from, which must not change",
                    advice="choose another name with --out",
                )


def write_export(exported: ExportedText, out: Path) -> tuple[Path, ...]:
    """Write the file and those that belong to it, all or nothing; gzip where it ends in ``.gz``."""
    import gzip

    from pivident.foundation.files import atomic_folder

    content = exported.content
    contents = {out.name: gzip.compress(content, mtime=0) if out.suffix == ".gz" else content}
    contents |= exported.further
    with atomic_folder(out.parent) as build:
        for name, data in contents.items():
            (build / name).write_bytes(data)
    return tuple(out.with_name(name) for name in contents)


def export_text(
    exported: ExportedText, model: RunnableModel, written: tuple[Path, ...], title: str
) -> str:
    """What was written, notes on the values, what the format cannot say."""
    kind = "physically consistent" if model.consistent else "not made physically consistent"
    lines = [
        f"Written: {', '.join(map(str, written))} ({title}; {model.robot.name}, "
        f"{model.robot.size} joints; {model.origin.method}, {kind})",
        *(f"  · {note}" for note in model.notes),
    ]
    if exported.differences:
        lines += [
            f"What {title} cannot represent, or represents differently:",
            *(f"  · {sentence}" for sentence in exported.differences),
        ]
    return "\n".join(lines)


def export_rerun(result: Path, log: Path | None, out: Path) -> None:
    """Predict the torques of a log by a result, and write all of it as a file of Rerun.

    Args:
        result: of `pivident identify`.
        log: the log, or an experiment file that describes it.
        out: the file.

    Raises:
        ExportError: no log is named, or the file would replace it.
        MissingExtra: rerun-sdk is not installed.
    """
    from pivident.foundation.files import check_output
    from pivident.studies.prediction.new_logs import new_logs, stored_result
    from pivident.studies.prediction.rerun_recording import write_rerun

    if log is None:
        raise ExportError(
            "--to rrd shows a motion: name its log, or the experiment file that was identified, "
            "with --log"
        )
    if out.suffix != ".rrd":
        raise ExportError(
            f"{out.name} is no name of a file of Rerun", advice="give --out one with .rrd"
        )
    require("rerun", extra="rerun", purpose="a file of Rerun")
    check_output(out.absolute().parent)
    with Progress() as progress:
        progress.say(f"reading {result}")
        stored = stored_result(result)
        progress.say(f"reading {log}")
        logs = list(new_logs(log, stored))
        progress.say("predicting")
        made = [stored.predict(new.recording) for new in logs]
        progress.say("writing the file of Rerun")
        write_rerun(made, out)
    for one in made:
        print(f"{one.account().body}\n")
    print(f"Written: {out} (Rerun; rerun {out} shows it)")
