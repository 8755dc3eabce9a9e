"""The steps of the path that run a command: what they are called, what they take, how they run."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from pivident.app.studio.fixes import LAWS
from pivident.app.studio.projects import EXPERIMENT
from pivident.app.studio.step_arguments import Argument, StepError
from pivident.estimation.methods import METHODS
from pivident.models.consistency.options import CONSISTENT_METHODS
from pivident.models.export.formats import FORMATS

#: Causes of model error that `identify` corrects.
CAUSES = (
    "delay", "geometry", "gear-ratio", "torque-gain", "zero-position", "position-scale", "encoder",
    "encoder-coupling",
)  # fmt: skip

#: Blocks of the motion that are held out in turn; one would leave nothing to fit.
FOLDS = tuple(str(number) for number in range(21) if number != 1)

#: Names of exported files, in C also of their functions: by what is in them.
ESTIMATE, CONSISTENT_SET, MOTION = EXPORTED = ("robot_estimate", "robot_consistent", "robot_motion")


@dataclass(frozen=True)
class Step:
    """One step.

    Attributes:
        title: for a button.
        words: what it does, a sentence.
        name: of the command.
        arguments: what it takes, in the order of a form.
        subject: what is named first on the command line, given which arguments have a value.
        output: where the command is told to write, given the folder and the values; nothing where
            it only prints.
    """

    title: str
    words: str
    name: str
    arguments: tuple[Argument, ...]
    subject: Callable[[Mapping[str, Any]], list[str]]
    output: Callable[[str, Mapping[str, Any]], list[str]]

    def command(self, project: Path, arguments: Mapping[str, Any], out: str) -> list[str]:
        """The command line behind ``pivident``.

        Args:
            project: folder of the project.
            arguments: values by name.
            out: folder for the results, relative to the project.

        Raises:
            StepError: an argument that there is not, or a value that is not allowed.
        """
        known = {argument.name: argument for argument in self.arguments}
        for name in arguments:
            if name not in known:
                raise StepError(
                    f"{self.title} takes no {name!r}",
                    advice=f"it takes {', '.join(known) or 'nothing'}",
                )
        tokens = {
            name: argument.tokens(project, arguments.get(name)) for name, argument in known.items()
        }
        given = {name: found for name, found in tokens.items() if found}
        unnamed = [t for name, found in given.items() if not known[name].option for t in found]
        options = [t for name, found in given.items() if known[name].option for t in found]
        subject = [*unnamed, *self.subject(given)]
        argv = [self.name, *subject, *options, *self.output(out, given)]
        if EXPERIMENT in argv and not (project / EXPERIMENT).is_file():
            raise StepError(
                f"{project.name} has no {EXPERIMENT} yet", advice="describe the log first"
            )
        return argv


def _experiment(given: Mapping[str, Any]) -> list[str]:
    return [EXPERIMENT]


def _nothing(given: Mapping[str, Any]) -> list[str]:
    return []


def _unless(name: str) -> Callable[[Mapping[str, Any]], list[str]]:
    """The experiment file, unless an argument names what is taken in its place."""
    return lambda given: [] if name in given else [EXPERIMENT]


def _folder(out: str, given: Mapping[str, Any]) -> list[str]:
    return ["--out", out]


def _file(out: str, given: Mapping[str, Any]) -> list[str]:
    """The exported file; Rerun also needs the log."""
    to = given["to"][1]
    if to == "rrd":
        return ["--log", EXPERIMENT, "--out", f"{out}/{MOTION}.rrd"]
    name = ESTIMATE if "free" in given else CONSISTENT_SET
    return ["--out", f"{out}/{name}{FORMATS[to].ending}"]


_RESULT = Argument("result", "result", "Result", is_needed=True)

#: All steps by name.
STEPS: dict[str, Step] = {
    "identify": Step(
        "Identify",
        "Estimate the dynamic parameters, judge them on held-out motion and write the report.",
        "identify",
        (
            Argument(
                "method", "choices", "Methods", "--method", (*METHODS, *CONSISTENT_METHODS)
            ),
            Argument("folds", "choice", "Held-out blocks", "--folds", FOLDS, "5"),
            Argument("free", "choices", "Correct with the estimate", "--free", CAUSES),
        ),
        _experiment,
        _folder,
    ),
    "compare": Step(
        "Compare",
        "Put results side by side and list the parameters that differ significantly.",
        "compare",
        (
            Argument("results", "results", "Results", is_needed=True),
            Argument(
                "level", "number", "Probability of a false mark", "--level",
                default=0.05, low=1e-6, high=0.5,
            ),
        ),
        _nothing,
        _folder,
    ),
    "consistent": Step(
        "Make physically consistent",
        "Find the nearest parameters that a real machine can have.",
        "consistent",
        (
            _RESULT,
            Argument(
                "prior", "choice", "Nearest to the nominal bodies by", "--prior",
                ("entropic", "euclidean", "none"), "entropic",
            ),
            Argument("accept_far", "flag", "Accept parameters that are far away", "--accept-far"),
        ),
        _nothing,
        _folder,
    ),
    "export": Step(
        "Export",
        "Write the identified model as a file for another program and load it back.",
        "export",
        (
            _RESULT,
            Argument("to", "choice", "Format", "--to", (*FORMATS, "rrd"), is_needed=True),
            Argument("free", "flag", "The estimate, not the consistent set", "--free"),
        ),
        _nothing,
        _file,
    ),
    "friction": Step(
        "Show friction",
        "Show friction against speed, position, load and time.",
        "friction",
        (
            Argument("method", "choice", "Estimate to subtract", "--method", tuple(METHODS)),
            Argument(
                "standstill", "number", "Standstill, share of the rated speed", "--standstill",
                default=0.01, low=1e-6, high=0.5,
            ),
            Argument("ripple", "flag", "Search for ripple over position", "--ripple"),
        ),
        _experiment,
        _folder,
    ),
    "laws": Step(
        "Choose friction laws",
        "Try friction laws on each joint and report which one predicts best.",
        "laws",
        (
            Argument(
                "method", "choice", "Estimator", "--method", ("ls", "iv", "iv-full-rate", "piv")
            ),
            Argument("blocks", "integer", "Blocks", "--blocks", default=10, low=2, high=100),
            Argument("band", "number", "Highest frequency of the motion [Hz]", "--band",
                     low=1e-3, high=1e6),
            Argument("depth", "integer", "Terms that may change", "--depth", default=3, low=1,
                     high=10),
        ),
        _experiment,
        lambda out, given: ["--out", f"{out}/{LAWS}"],
    ),
    "predict": Step(
        "Test on another log",
        "Predict the torques of a log with the same columns and say how large the errors are.",
        "predict",
        (_RESULT, Argument("log", "log", "Log", is_needed=True)),
        _nothing,
        lambda out, given: ["--html", f"{out}/prediction.html"],
    ),
    "payload": Step(
        "Identify the payload",
        "Find mass, centre of mass and inertia of a load from a record without and one with it.",
        "payload",
        (
            Argument("arm", "result", "The arm without load, identified earlier"),
            Argument("method", "choice", "Method", "--method", ("ls", "iv-full-rate", "piv")),
        ),
        _experiment,
        _folder,
    ),
    "gains": Step(
        "Find drive gains",
        "Find the gains of the drives from a known payload or a trusted number, or their ratios.",
        "gains",
        (
            Argument("in_log_units", "flag", "Each motor in the unit of its log", "--in-log-units"),
            Argument("least_squares", "flag", "Also by least squares", "--least-squares"),
        ),
        _experiment,
        lambda out, given: [],
    ),
    "excite": Step(
        "Design a motion",
        "Design the motion whose record determines the parameters best, within all limits.",
        "excite",
        (
            Argument("result", "result", "Next after the result"),
            Argument("duration", "number", "Duration [s]", "--duration", default=20, low=1,
                     high=3600),
            Argument("motion", "choice", "Motion", "--motion",
                     ("splines", "fourier", "postures"), "splines"),
            Argument("criterion", "choice", "Criterion", "--criterion",
                     ("a", "d", "worst", "cond")),
            Argument("parameters", "names", "Parameters that count", "--for"),
            Argument("to", "number", "Largest standard error [%]", "--to", low=0.01, high=100,
                     unit="%"),
            Argument("rate", "number", "Rate of the samples [Hz]", "--rate", default=1000, low=1,
                     high=100_000),
            Argument("seconds", "number", "Time for the search [s]", "--seconds", default=20,
                     low=1, high=3600),
            Argument("seed", "integer", "Seed", "--seed", default=0, low=0, high=2**31 - 1),
        ),
        _unless("result"),
        _folder,
    ),
}  # fmt: skip


def step_named(name: str) -> Step:
    """A step by its name.

    Raises:
        StepError: there is none of this name.
    """
    if name not in STEPS:
        raise StepError(
            f"there is no step {str(name)[:60]!r}", advice=f"choose from {', '.join(STEPS)}"
        )
    return STEPS[name]
