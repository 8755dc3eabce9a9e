"""The command ``pivident``: from a log to its parameters without writing code.

Exit codes: 0 done, 1 something is wrong with the input, 2 wrong usage, 3 done, but a method did
not converge, 4 done, but an audit found something wrong with the log, 130 interrupted. Results go
to standard output and files, progress and errors to standard error. ``PIVIDENT_DEBUG=1`` shows the
traceback of an error.
"""

from __future__ import annotations

import os
import sys
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import App, CycloptsError, MissingArgumentError, Parameter

from pivident.cli.check import check
from pivident.cli.compare import compare
from pivident.cli.completion import Shell, completion_script
from pivident.cli.consistent import consistent
from pivident.cli.console import error_line, note
from pivident.cli.excite import excite
from pivident.cli.export import export
from pivident.cli.fit_simulator import fit_simulator
from pivident.cli.fleet import fleet
from pivident.cli.flexibility import flexibility
from pivident.cli.friction import friction
from pivident.cli.gains import gains
from pivident.cli.interruption import end_on_signals
from pivident.cli.laws import laws
from pivident.cli.paper import paper
from pivident.cli.payload import payload
from pivident.cli.predict import predict
from pivident.cli.studio import studio
from pivident.cli.study import study
from pivident.cli.symbolic import symbolic
from pivident.errors import DatasetUnavailable, PividentError, SimulationFailed
from pivident.text.lists import separated
from pivident.version import __version__

if TYPE_CHECKING:
    from pivident.cli.workflow import Outcome

DONE, WRONG_INPUT, WRONG_USAGE, NOT_CONVERGED, INTERRUPTED = 0, 1, 2, 3, 130
FAULTY_LOG = 4

#: Names of the columns of a log without header.
Columns = Annotated[str | None, Parameter(show_default=False)]

app = App(
    name="pivident",
    help="Identify the dynamic parameters of a robot from a log of its closed loop.",
    version=__version__,
    suppress_keyboard_interrupt=False,
)
datasets_app = App(
    name="datasets",
    help="Public records: list them, or fetch one.",
    suppress_keyboard_interrupt=False,
)
app.command(datasets_app)
app.command(check)
app.command(excite)
app.command(study)
app.command(studio)
app.command(paper)
app.command(fleet)
app.command(friction)
app.command(flexibility)
app.command(gains)
app.command(laws)
app.command(compare)
app.command(consistent)
app.command(payload)
app.command(fit_simulator)
app.command(predict)
app.command(export)
app.command(symbolic)


@app.command
def demo(*, out: Path = Path("pivident-demo"), seed: int = 0) -> int:
    """Simulate a TX40 record, identify it with LS, IV and PIV, and compare with the truth.

    Parameters
    ----------
    out
        Folder for the results.
    seed
        Seed of the simulated noise.
    """
    from pivident.cli.workflow import run_demo

    return code_of(run_demo(out, seed))


@app.command
def identify(
    experiment: Path,
    /,
    *,
    method: Annotated[
        tuple[str, ...], Parameter(name=["--method", "-m"], negative=(), show_default=False)
    ] = (),
    folds: Annotated[int | None, Parameter(show_default=False)] = None,
    free: Annotated[tuple[str, ...], Parameter(negative=(), show_default=False)] = (),
    out: Path | None = None,
) -> int:
    """Identify the record that an experiment file (TOML) describes.

    Parameters
    ----------
    experiment
        The experiment file.
    method
        A method of least squares (ols, ls, tls, irls, ridge, map, ml-ls, set-membership, adaline,
        hopfield, frequency), a filter (ekf, ukf, cdkf, particle), with instruments (iv,
        iv-full-rate, piv, didim, piv-as-printed), or one that fits a simulation (cloe, clie, ml,
        oloe); with the prefix pc- also made physically consistent (pc-piv); several separated by
        commas or repeated. Default: those of the file.
    folds
        Blocks of the motion that are held out in turn to judge the methods; 0: none. Default: that
        of the file, or else 5.
    free
        Causes of model error that are corrected with the estimate, each with an interval: delay,
        geometry, gear-ratio, torque-gain, zero-position, position-scale, encoder; several separated
        by commas. Default: those of the file, or else none.
    out
        Folder for the results. Default: that of the file, or else NAME-results for NAME.toml.
    """
    from pivident.cli.workflow import run_experiment

    names = separated(method)
    if method:
        _check_methods(names)
    if folds is not None and (folds < 0 or folds == 1):
        raise UsageError(f"--folds {folds} leaves nothing to fit; use 2 or more, or 0 for none")
    return code_of(run_experiment(experiment, names, out, folds, separated(free)))


def code_of(outcome: Outcome) -> int:
    """Exit code of a run over several methods: what failed counts before the others."""
    if outcome.failed or outcome.unjudged:
        return WRONG_INPUT
    return DONE if outcome.converged else NOT_CONVERGED


@app.command  # audit
def audit(
    log: Path,
    /,
    *,
    robot: str | None = None,
    experiment: Path | None = None,
    columns: Columns = None,
    out: Path | None = None,
) -> int:
    """Report what is wrong with a log before anything is identified from it.

    Parameters
    ----------
    log
        A log (.csv, .txt, .tsv, .npz, .mat, .parquet), or an experiment file that names logs.
    robot
        Robot of a log without experiment file: name in the gallery, .toml or .urdf.
    experiment
        Experiment file that describes the log's columns.
    columns
        Names of the columns of a log without header, in their order: t,q1..q6,-,tau1..tau6, with -
        for those that are not needed.
    out
        Folder for audit.json and audit.html. Default: NAME-audit for NAME.csv.
    """
    from pivident.cli.audit import run_audit

    done = run_audit(log, robot, experiment, out, separated([columns or ""]))
    return DONE if done else FAULTY_LOG


@app.command
def init(
    *logs: Path,
    robot: str | None = None,
    out: Path = Path("experiment.toml"),
    joints: Annotated[str | None, Parameter(show_default=False)] = None,
    columns: Columns = None,
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
        Joints of a URDF to identify, separated by commas. Default: all that move and have a torque.
    columns
        Names of the columns of a log without header, in their order: t,q1..q6,-,tau1..tau6, with -
        for those that are not needed.
    yes
        Ask nothing; write the best assumption and mark it.
    force
        Replace a file that exists.
    """
    from pivident.cli.init import run_init

    if not logs:
        from pivident.cli.init import design_first, without_log

        if robot is None or yes or not sys.stdin.isatty() or not design_first(robot):
            raise UsageError(without_log(robot))
        return excite(robot)
    names = separated([joints or ""])
    ask = sys.stdin.isatty() and not yes
    named = separated([columns or ""])
    done = run_init(logs, robot, out, joints=names, column_names=named, ask=ask, force=force)
    return DONE if done else FAULTY_LOG


@app.command
def robots(name: str | None = None, /) -> int:
    """List the robots of the gallery, or show one: geometry and base parameters.

    Parameters
    ----------
    name
        Name in the gallery, or a robot file (.toml, .urdf, .urdf.gz, .xml, .mjcf).
    """
    from pivident.cli.robot_sheet import gallery_text, robot_text

    print(gallery_text() if name is None else robot_text(name))
    return DONE


@datasets_app.default
def datasets() -> int:
    """List the public records, and whether they are here."""
    from pivident.recording.datasets import (
        DATASETS,
        ENVIRONMENT,
        dataset_files,
        dataset_names,
        describe,
    )

    for name in dataset_names():
        published = all(file.url for file in DATASETS[name].files.values())
        try:
            place = f"here: {next(iter(dataset_files(name).values())).parent}"
        except DatasetUnavailable as error:
            way = f"pivident datasets fetch {name}" if published else "not published in this form"
            place = f"not here ({error.file}): {way}"
        except PividentError as error:
            place = f"not usable: {error}"
        print("\n  ".join([name, *describe(name).splitlines(), place]), end="\n\n")
    print(f"{ENVIRONMENT} = {os.environ.get(ENVIRONMENT, 'not set')}")
    return DONE


@datasets_app.command
def fetch(name: str, /) -> int:
    """Fetch a public record, check it, and print where its files are.

    Parameters
    ----------
    name
        Name of the record.
    """
    from pivident.cli.console import Progress
    from pivident.recording.datasets import fetch as fetch_files

    with Progress() as progress:
        progress.say(f"fetching {name}")
        files = fetch_files(name)
    for path in files.values():
        print(path)
    return DONE


@app.command
def completion(shell: Shell, /) -> int:
    """Print the script that completes commands and options in bash, zsh or fish.

    Parameters
    ----------
    shell
        The shell that will read it.
    """
    print(completion_script(app, shell))
    return DONE


class UsageError(PividentError):
    """A command line that cannot be understood."""


def _check_methods(names: Sequence[str]) -> None:
    """Refuse methods that do not exist, before anything is read."""
    from pivident.consistency.method_names import CONSISTENT_METHODS
    from pivident.estimation.methods import METHODS
    from pivident.robot.naming import nearest

    known = (*METHODS, *CONSISTENT_METHODS)
    if not names:
        raise UsageError(
            f"--method names no method; choose from {', '.join(METHODS)}, each also with the "
            "prefix pc-"
        )
    for name in names:
        if name not in known:
            bare = name.lower().removeprefix("idim-")
            raise UsageError(f"there is no method {name!r}; {nearest(bare, known)}")


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line (by default that of the process); returns the exit code."""
    # Matrices are small: threads of the linear algebra would wait for each other, not work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a σ must not stop a terminal without it
            stream.reconfigure(errors="replace")
    end_on_signals(alone=tokens is None)
    try:
        result = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return int(result or DONE)
    except CycloptsError as error:
        text = " ".join(str(error).split()).replace(", ...", " …").rstrip(".")
        if isinstance(error, MissingArgumentError) and error.keyword is None and error.argument:
            if not error.argument.tokens:  # it was not given at all
                text = f"{error.argument.name} is missing"
        note(f"error: {text}; see {' '.join(('pivident', *(error.command_chain or ())))} --help")
        return WRONG_USAGE
    except UsageError as error:
        note(error_line(error))
        return WRONG_USAGE
    except KeyboardInterrupt:
        note("interrupted; no file is left half written")
        if tokens is None:
            # Python ends itself by the signal if code that it generates was interrupted; scripts
            # are promised an exit code. Nothing is left to be cleaned up.
            sys.stdout.flush()
            os._exit(INTERRUPTED)
        return INTERRUPTED
    except BrokenPipeError:  # the reader, such as head, has seen enough
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return DONE
    except Exception as error:
        if isinstance(error, SimulationFailed):
            from pivident.diagnostics.failed_simulation import explain

            explain(error)
        if os.environ.get("PIVIDENT_DEBUG", "") not in ("", "0"):
            raise
        note(error_line(error))
        return WRONG_INPUT
