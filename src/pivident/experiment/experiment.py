"""The experiment file: robot, recordings, controller and methods, as TOML.

    robot = "staubli_tx40"                 # gallery name, .toml or .urdf

    [recording]                            # several: [[recording]]
    files = "log.csv"                      # or "runs/*.parquet", or dataset = "emps"
    columns = {q = ["q1", "q2"], tau = ["i1", "i2"], q_ref = ["r1", "r2"], t = "time"}
    units = {q = "deg", q_ref = "deg", tau = {unit = "A", gain = 12.5}}

    [controller]                           # for instruments from the simulated loop
    type = "pd"                            # pd, pid, cascade, virtual_pd, identify
    kp = [5000, 3000]
    kd = [120, 80]

    [identify]
    methods = ["ls", "iv", "piv"]
    bandpass = {cutoff = 50}               # of every method that has it …
    piv = {noise = {criterion = "bic"}}    # … and of one method

Paths are relative to the file. The tables and their keys are in `pivident.experiment.file_keys`.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from pathlib import Path

from pivident.data.recording.recording import Recording
from pivident.estimation.method import Method
from pivident.estimation.methods import METHODS, WITHOUT_TORQUE
from pivident.estimation.problem import Problem
from pivident.experiment.explained import errors_name, toml_content, validated
from pivident.experiment.file_keys import ExperimentFile
from pivident.experiment.identify_table import (
    IdentifyEntry,
    median_finding,
    method_of,
)
from pivident.experiment.missing_torque import check_torque, is_without_torque, with_temperature
from pivident.experiment.recording_tables import loop_of, one_by_one, run_of
from pivident.experiment.robot_table import FRICTION_KEYS, robot_of
from pivident.foundation.errors import ExperimentError, IdentificationError, require_known
from pivident.foundation.text.display import Displayed
from pivident.loop.motion.law_torque import with_law_torque
from pivident.loop.simulation.control_loop import Loop
from pivident.models.consistency.options import ConsistencyOptions, free_methods, made_consistent
from pivident.robot.description import Robot
from pivident.robot.refusals import without_base

#: What there is for a robot on a measured base.
WITHOUT_CONSISTENCY = "leave out pc- before the methods and the table [consistency]"


@dataclass(frozen=True, eq=False)
class Experiment(Displayed):
    """A checked experiment file.

    Attributes:
        path: the file.
        content: its tables.
    """

    path: Path
    content: ExperimentFile

    @property
    def title(self) -> str:
        """Title of the report."""
        return self.content.output.title or self.path.stem.replace("_", " ")

    @property
    def output(self) -> Path | None:
        """Folder that the file names for its results, or None; it lies beside or below the file."""
        folder = self.content.output.folder
        return None if folder is None else self.path.parent / folder

    @cached_property
    def robot(self) -> Robot:
        """The robot, with everything that the file adds to its description.

        Raises:
            RobotDescriptionError: the description cannot be used.
        """
        with errors_name(self.path, "[robot]"):
            return robot_of(
                self.content.robot,
                self.path.parent,
                self.content.torque_side,
                self.content.wrench,
                self.content.contact,
            )

    @property
    def has_open_friction(self) -> bool:
        """Whether the friction of the bearings is to be found out, since nobody has chosen it."""
        chosen = self.content.robot.model_fields_set.intersection(FRICTION_KEYS)
        return self.content.torque_side == "link" and not chosen

    def recordings(self) -> tuple[Recording, ...]:
        """All recordings, read and checked; of a log with gaps those between them.

        Raises:
            RecordingError: a file or its content cannot be used.
            DatasetUnavailable: a public record is not here and cannot be fetched.
        """
        return tuple(recording for run in self.runs() for recording in run)

    def runs(self) -> tuple[tuple[Recording, ...], ...]:
        """The recordings of each table ``[[recording]]``, see `recordings`."""
        several = len(self.content.recording) > 1
        read: list[tuple[Recording, ...]] = []
        for number, entry in enumerate(self.content.recording, start=1):
            table = f"[[recording]] {number}:" if several else "[recording]"
            with errors_name(self.path, table):
                read.append(run_of(entry, self.robot, self.path.parent)[0])
        return tuple(read)

    def unseen_recordings(self) -> tuple[Recording, ...]:
        """Recordings of ``[[validation.recording]]``, on which the fits are judged.

        Raises:
            RecordingError: a file or its content cannot be used.
            DatasetUnavailable: a public record is not here and cannot be fetched.
            ExperimentError: a log without torque, which does not follow from the control law.
        """
        read: list[Recording] = []
        for number, entry in enumerate(self.content.validation.recording, start=1):
            with errors_name(self.path, f"[[validation.recording]] {number}:"):
                run, _ = run_of(entry, self.robot, self.path.parent)
                read += map(self._with_torque, run)
        return tuple(read)

    def _with_torque(self, recording: Recording) -> Recording:
        """A recording with the torque of the known law, where it has none."""
        law = self.content.controller
        if recording.torque_source != "none":
            return recording
        known = law is not None and law.type != "identify" and law.source == "recorded"
        loop = loop_of(law, self.robot, [recording])[1] if law is not None and known else None
        return with_law_torque(self.robot, loop, recording)

    def problem(
        self,
        progress: Callable[[str], None] | None = None,
        recordings: Sequence[Recording] | None = None,
    ) -> Problem:
        """Robot, recordings, loop, parameters and mask: what `identify` takes.

        Args:
            progress: called with one line at each stage.
            recordings: in place of those that the file names.

        Raises:
            ExperimentError: robot, recordings and parameters do not fit together.
            RobotDescriptionError: the robot cannot be used.
            RecordingError: a recording cannot be used.
        """
        say = progress or (lambda line: None)
        with errors_name(self.path, ""):
            check_torque(self.content)
        say(f"reading the robot {self.content.robot.model}")
        robot = self.robot
        if recordings is None:
            say("reading the recordings")
            recordings = self.recordings()
            for note in dict.fromkeys(note for each in recordings for note in each.notes):
                say(note)
        controller, given = self.content.controller, self.content.identify
        loop, reason = None, ""
        if controller is not None:
            found = controller.type == "identify" or controller.source == "reconstruct"
            if found:
                say("identifying the control loop")
            try:
                with errors_name(self.path, "[controller]"):
                    recordings, loop = loop_of(controller, robot, recordings)
            except IdentificationError as error:
                if not found:
                    raise
                reason = f"There is no simulated loop: {error.sentence}"
                say(reason)
        if robot.contacts:
            from pivident.loop.motion.planted_feet import on_planted_feet

            say("closing the legs over the ground")
            with errors_name(self.path, "[[contact]]"):
                robot, recordings = on_planted_feet(robot, recordings)
        say("finding the base parameters")
        with errors_name(self.path, ""):
            problem = problem_of(given, robot, recordings, loop)
        median = median_finding(self.methods())
        findings = (*problem.findings, *([] if median is None else [median]))
        return replace(problem, without_loop=reason, findings=findings)

    def methods(self, names: Sequence[str] | None = None) -> dict[str, Method]:
        """Methods with the file's options, by name.

        Args:
            names: which; default: those of the file, of ``pc-piv`` and the like the method before
                the stage, or else ``ls``, ``iv-full-rate`` and ``piv``, and with a controller also
                ``iv``; of logs without torque those of `WITHOUT_TORQUE`.

        Raises:
            ExperimentError: an unknown method, contradictory options, or a method that needs the
                control loop where the file does not say enough about it.
        """
        chosen: dict[str, Method] = {}
        with errors_name(self.path, ""):
            for name in names or free_methods(self._method_names()):
                require_known(name, METHODS, f"there is no method {name!r}", ExperimentError)
                chosen[name] = method_of(name, self.content.identify)
                self._check_loop(name, chosen[name])
        return chosen

    def made_consistent(self, names: Sequence[str] | None = None) -> tuple[str, ...]:
        """Methods whose estimates the stage of physical consistency follows, by name.

        Those requested as ``pc-piv`` and the like. Where none is, a table
        ``[consistency]`` requests all.

        Args:
            names: methods with or without ``pc-``; default: those of the file.

        Raises:
            RobotDescriptionError: a robot on a measured base.
        """
        chosen = names or self._method_names()
        found = made_consistent(chosen)
        found = found if found or self.content.consistency is None else tuple(chosen)
        if found:
            without_base(self.robot, "physical consistency", WITHOUT_CONSISTENCY)
        return found

    def consistency(self) -> ConsistencyOptions:
        """What the table ``[consistency]`` says; the defaults where there is none.

        Raises:
            ExperimentError: bounds of a link that does not exist, or that exclude each other.
            RobotDescriptionError: the reference cannot be used.
        """
        if self.content.consistency is None:
            return ConsistencyOptions()
        from pivident.experiment.consistency_table import consistency_of

        with errors_name(self.path, "[consistency]"):
            return consistency_of(self.content.consistency, self.robot, self.path.parent)

    def _method_names(self) -> list[str]:
        """The file's methods, or the default ones."""
        if is_without_torque(self.content):
            return self.content.identify.methods or list(WITHOUT_TORQUE)
        loop = self.content.controller is not None
        default = ["ls", "iv", "iv-full-rate", "piv"] if loop else ["ls", "iv-full-rate", "piv"]
        return self.content.identify.methods or default

    def _check_loop(self, name: str, method: Method) -> None:
        """Refuse a method that simulates the loop where controller or reference are missing."""
        controller = self.content.controller
        if is_without_torque(self.content):  # whose law `problem` asks for, whatever the method
            if not method.handles.computed_torque:
                raise ExperimentError(
                    f"the method {name!r} needs measured torques, but the log has none, and one "
                    "computed from the control law holds nothing that the positions do not",
                    advice=f"use {WITHOUT_TORQUE[0]}",
                ).within("identify", "methods")
            return
        if not method.simulates_loop:
            return
        if controller is None:
            if not method.needs_controller:
                return
            raise ExperimentError(
                f"the method {name!r} simulates the control loop, but there is no table "
                "[controller]",
                advice="add it, or use piv or iv-full-rate, which then make their instruments "
                "from the record",
            ).within("identify", "methods")
        without = [r for r in self.content.recording if r.columns and r.columns.q_ref is None]
        if controller.source == "recorded" and without:
            raise ExperimentError(
                'the reference is "recorded", but no column is named for q_ref',
                advice='name it under columns, or set reference = "reconstruct" or "smoothed"',
            ).within("controller", "reference")


def problem_of(
    entry: IdentifyEntry, robot: Robot, recordings: Sequence[Recording], loop: Loop | None
) -> Problem:
    """What the table ``[identify]`` wants to be estimated from recordings."""
    names = None if entry.parameters is None else tuple(entry.parameters)
    return Problem(
        robot, tuple(recordings), loop, parameters=names, mask=entry.mask, initial=entry.initial,
        fixed=entry.fixed, bounds=entry.bounds, priors=entry.priors,
        constraints=[(c.coefficients, c.value) for c in entry.constraints],
        weights=entry.weights or None, without_equation=tuple(entry.without_equation),
        reference_temperature=entry.reference_temperature,
    )  # fmt: skip


def load_experiment(path: str | Path) -> Experiment:
    """Read and check an experiment file; its records are not read yet.

    Args:
        path: the file.

    Returns:
        The experiment, checked; its records are read on demand.

    Raises:
        ExperimentError: it cannot be read, has an unknown key, a bad value or contradictory
            options; names the file, the key, the value and the next step.

    Example:
        >>> from pathlib import Path
        >>> file = Path("arm.toml").write_text('''robot = "planar_2r"
        ... [recording]
        ... files = "log.csv"
        ... columns = {t = "time", q = ["q1", "q2"], tau = ["tau1", "tau2"]}
        ... ''')
        >>> experiment = pv.load_experiment("arm.toml")
        >>> experiment.robot, tuple(experiment.methods())
        (<Robot 'planar 2R': 2 joints (shoulder, elbow)>, ('ls', 'iv-full-rate', 'piv'))
    """
    path = Path(path)
    with errors_name(path, ""):
        experiment = Experiment(path, with_every_run(validated(toml_content(path)), path.parent))
        for name in experiment.content.identify.with_tables:
            method_of(name, experiment.content.identify)
    experiment.methods()
    return experiment


def with_every_run(content: ExperimentFile, folder: Path) -> ExperimentFile:
    """The tables with one recording for each file of a pattern."""
    warm, validation = content.identify.temperature, content.validation
    unseen = [with_temperature(entry, warm) for entry in one_by_one(validation.recording, folder)]
    validation = validation.model_copy(update={"recording": unseen})
    runs = [with_temperature(entry, warm) for entry in one_by_one(content.recording, folder)]
    return content.model_copy(update={"recording": runs, "validation": validation})
