"""The command ``pivident``: from a log to its parameters, wherever it is interrupted.

Exit codes: 0 done, 1 something is wrong with the input, 2 wrong usage, 3 done, but a method did
not converge, 4 done, but an audit found something wrong with the log, 130 interrupted. Results go
to standard output and files, progress and errors to standard error. ``PIVIDENT_DEBUG=1`` shows the
traceback of an error.

Interruptions by Ctrl-C and by SIGTERM, wherever they come.

Either raises KeyboardInterrupt in the main thread. Where C has called back into Python, as LLVM
does whenever compiled kernels are loaded, an exception cannot go on to the caller: Python reports
it and drops it, and the command would run on. Such an interruption comes again a moment later.
"""

from __future__ import annotations

import _thread
import atexit
import gc
import os
import signal
import sys
import threading
import warnings
from collections.abc import Sequence
from types import FunctionType
from typing import Any, Literal

from cyclopts import App, CycloptsError, Group, MissingArgumentError

from pivident.app.cli.console import (
    DONE,
    INTERRUPTED,
    WRONG_INPUT,
    WRONG_USAGE,
    UsageError,
    error_line,
    note,
    warning_text,
)
from pivident.foundation.errors import EstimateWarning, SimulationFailed
from pivident.foundation.registry import BrokenExtension, Registry
from pivident.foundation.version import __version__

#: The commands under the headings of the help, and where each is: its module is imported to run it.
GROUPS = {
    "Start here": {
        "init": "pivident.app.cli.init:init",
        "check": "pivident.app.cli.check:check",
        "identify": "pivident.app.cli.identify:identify",
        "apply": "pivident.app.cli.apply:apply",
        "studio": "pivident.app.cli.studio:studio",
        "demo": "pivident.app.cli.identify:demo",
    },
    "Before the log": {
        "excite": "pivident.app.cli.excite:excite",
        "audit": "pivident.app.cli.audit:audit",
        "robots": "pivident.app.cli.robots:robots",
        "datasets": "pivident.app.cli.datasets:app",
    },
    "Look closer": {
        "friction": "pivident.app.cli.friction:friction",
        "laws": "pivident.app.cli.laws:laws",
        "gains": "pivident.app.cli.gains:gains",
        "flexibility": "pivident.app.cli.flexibility:flexibility",
    },
    "Take away": {
        "predict": "pivident.app.cli.predict:predict",
        "compare": "pivident.app.cli.compare:compare",
        "consistent": "pivident.app.cli.consistent:consistent",
        "export": "pivident.app.cli.export:export",
        "symbolic": "pivident.app.cli.symbolic:symbolic",
        "payload": "pivident.app.cli.payload:payload",
        "fit-simulator": "pivident.app.cli.fit_simulator:fit_simulator",
    },
    "Studies": {
        "study": "pivident.app.cli.study:study",
        "fleet": "pivident.app.cli.fleet:fleet",
        "paper": "pivident.app.cli.paper:paper",
    },
}
#: All commands by name.
COMMANDS = Registry(
    "pivident.commands",
    FunctionType,
    {name: place for group in GROUPS.values() for name, place in group.items()},
)
#: Heading of the commands of other distributions, between those of pivident and its own options.
ADDITIONS = Group("Additions", sort_key=len(GROUPS))
app = App(
    name="pivident",
    help="Identify the dynamic parameters of a robot from a log of its closed loop.",
    version=__version__,
    group_commands=Group("The command line", sort_key=len(GROUPS) + 1),
    suppress_keyboard_interrupt=False,
)
#: After what time an interruption comes again [s].
AGAIN = 0.02
for _place, (_heading, _group) in enumerate(GROUPS.items()):
    _shown = Group(_heading, sort_key=_place)
    for _rank, (_name, _path) in enumerate(_group.items()):
        app.command(_path, name=_name, group=_shown, sort_key=_rank)


@app.command
def completion(shell: Literal["bash", "zsh", "fish"], /) -> int:
    """Print the script that completes commands and options in bash, zsh or fish.

    Parameters
    ----------
    shell
        The shell that will read it.
    """
    print(app.generate_completion(prog_name="pivident", shell=shell).rstrip())
    return DONE


def add_commands() -> None:
    """Add the commands of other distributions; one that cannot be used is named in one line."""
    for name in COMMANDS.foreign:
        if name not in app:
            try:
                app.command(COMMANDS[name], name=name, group=ADDITIONS)
            except BrokenExtension as error:
                note(f"warning: {error}")


def end_on_signals(alone: bool) -> None:
    """Let SIGTERM interrupt as Ctrl-C does; none of both is lost in a process that is ``alone``.

    ``alone``: the process is this command's, and no notebook or test.
    """
    signal.signal(signal.SIGTERM, signal.default_int_handler)
    if not alone:
        return
    report = sys.unraisablehook

    def dropped(found: Any) -> None:
        if issubclass(found.exc_type, KeyboardInterrupt):
            # SIGTERM, since in the background SIGINT may be ignored
            again = threading.Timer(AGAIN, _thread.interrupt_main, [signal.SIGTERM])
            again.daemon = True
            again.start()
        else:
            report(found)

    sys.unraisablehook = dropped


def main(tokens: Sequence[str] | None = None) -> int:
    """Run the command line (by default that of the process); returns the exit code."""
    # Matrices are small: threads of the linear algebra would wait for each other, not work.
    os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")
    # A command is short, and what it makes by importing stays: to look through it again and again
    # for what can be forgotten took a tenth of its time. Of a quarter of a million things that an
    # identification makes beside its arrays next to nothing could be.
    gc.set_threshold(500_000)
    if tokens is None:  # nor does it have to be looked through to end the process
        atexit.register(gc.freeze)
    for stream in (sys.stdout, sys.stderr):
        if hasattr(stream, "reconfigure"):  # a σ must not stop a terminal without it
            stream.reconfigure(errors="replace")
    warnings.formatwarning = warning_text
    warnings.simplefilter("ignore", EstimateWarning)  # commands show what results find
    end_on_signals(alone=tokens is None)
    add_commands()
    words = sys.argv[1:] if tokens is None else tokens
    try:
        front_page = not words or words[0] in ("--help", "-h")
        if front_page:
            app.resolved_commands()  # the first line of each is shown
        # Lines need no Markdown, whose reader takes a fifth of the time of the whole page to load.
        app.help_format = "plaintext" if front_page else "markdown"
        result = app(tokens, exit_on_error=False, print_error=False, result_action="return_value")
        sys.stdout.flush()
        return int(result or DONE)
    except CycloptsError as error:
        text = " ".join(str(error).split()).replace(", ...", " …").rstrip(".")
        missing = isinstance(error, MissingArgumentError) and error.keyword is None
        if missing and error.argument and not error.argument.tokens:  # it was not given at all
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
            from pivident.judgement.diagnostics.failed_simulation import explain

            explain(error)
        if os.environ.get("PIVIDENT_DEBUG", "") not in ("", "0"):
            raise
        note(error_line(error))
        return WRONG_INPUT
