"""Keys of an experiment file, their types and defaults, and what contradicts each other.

This module needs pydantic and is imported only when a file is read. `pivident.experiment` turns
the checked tables into robot, recordings, loop and methods. The tables ``[identify]``,
``[consistency]`` and ``[excite]`` are in `method_keys`, `consistency_keys` and `excite_keys`.
"""

from __future__ import annotations

from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator
from pydantic.functional_validators import PlainValidator

from pivident.data.recording.recording import Saturation, TorqueTiming
from pivident.experiment.identify_table import IdentifyEntry
from pivident.experiment.table_values import (
    DriveGain,
    Folder,
    Interval,
    Names,
    Numbers,
    Paths,
    PerJoint,
)
from pivident.foundation.errors import ExperimentError
from pivident.foundation.registry import named
from pivident.loop.simulation.controllers import FeedForward
from pivident.robot.description import TorqueSide
from pivident.robot.mdh_keys import (
    Entry,
    FrictionTerms,
    Gravity,
    JointReference,
    LaterTable,
    Vector3,
    Vector6,
    empty_table,
    key,
)
from pivident.robot.naming import MJCF_FILES
from pivident.robot.wrench_sensor import Acts

if TYPE_CHECKING:
    from pivident.experiment.consistency_keys import ConsistencyEntry
    from pivident.experiment.excite_keys import ExciteEntry
else:  # few files have these
    ConsistencyEntry = LaterTable(
        partial(named, "pivident.experiment.consistency_keys:ConsistencyEntry")
    )
    ExciteEntry = LaterTable(partial(named, "pivident.experiment.excite_keys:ExciteEntry"))

#: Keys that every real loop may have.
LOOP_KEYS = {"drive_gain", "limit", "feed_forward", "counts"}

#: Keys of each control law: those it needs, and those it may have besides.
LAW_KEYS = {
    "pd": ({"kp", "kd"}, LOOP_KEYS | {"derivative_time", "speed_feed_forward"}),
    "pid": ({"kp", "kd"}, LOOP_KEYS | {"ki", "derivative_time", "speed_feed_forward"}),
    "cascade": ({"kp", "kv"}, LOOP_KEYS | {"ki", "averaged", "speed_feed_forward"}),
    "virtual_pd": (set(), {"bandwidth", "damping"}),
    "identify": (set(), {"drive_gain", "limit", "counts"}),
}

#: Keys of a recording that a public record brings along.
SET_BY_DATASET = (
    "column_names", "columns", "units", "side", "rate", "resample", "samples_axis",
    "position_offset",
)  # fmt: skip


class CouplingEntry(Entry):
    """A motor that also turns with a second joint."""

    motor: JointReference = key(
        meaning="name or number (from 1) of the joint whose motor is coupled", kind="joint"
    )
    joint: JointReference = key(meaning="the joint that moves this motor along", kind="joint")
    ratio: float | None = key(
        None, "rotor speed per speed of `joint`, on the side of `motor`", shown="from the reduction"
    )
    parameters: list[Literal["iam", "fvm", "fcm"]] = key(
        ["iam", "fvm", "fcm"], "parameters of the coupling: inertia, viscous, Coulomb"
    )


class BodyEntry(Entry):
    """A body on a link, such as a tool."""

    link: JointReference = key(
        meaning="link that carries it, by its name or that or the number of its joint; a fixed "
        "link of a URDF; `flange`: the last link",
        kind="link",
    )
    mass: float = key(
        meaning="mass; negative for a body of the description that was not mounted", unit="kg"
    )
    center_of_mass: Vector3 = key(
        [0.0, 0.0, 0.0], "centre of mass in the frame of the link", unit="m", kind="3 numbers"
    )
    inertia: Vector6 = key(
        [0.0] * 6,
        "about the centre of mass: xx xy xz yy yz zz",
        unit="kg m²",
        kind="6 numbers",
        shown="zeros",
    )


class RobotEntry(Entry):
    """The robot, and what its description does not say about the machine that was logged."""

    model: Annotated[str, Field(min_length=1)] = key(
        meaning="gallery name (`pivident robots` lists them), a [robot file](robot_file.md) "
        "`.toml`, "
        "a URDF (`.urdf`, `.urdf.gz`), or an MJCF (`.xml`, `.mjcf`, with the extra `mujoco`)",
    )
    joints: Names | None = key(
        None,
        "joints to keep, in the order of the log's columns; the others are "
        "frozen, but those that loops of an MJCF or `mimic` move along with a kept one",
        shown="all",
    )
    frozen: dict[str, float] = key(
        meaning="joints that do not move, with their position: `frozen = {elbow = 0.0}`",
        factory=dict,
        unit="rad or m",
    )
    passive: Names | None = key(
        None,
        "joints of an MJCF with closed loops that have no motor",
        shown="those without an actuator",
    )
    bodies: list[BodyEntry] = key(
        meaning="bodies that were mounted and that the description lacks, see *bodies*: `[{link = "
        '"flange", mass = 2.75}]`',
        factory=list,
    )
    gravity: Gravity | None = key(
        None,
        'direction in the base frame: `"-z"`, `"+y"` …, `"none"`, or a vector',
        unit="m/s²",
        kind="name or 3 numbers",
        shown="the model's",
    )
    friction: FrictionTerms | None = key(
        None,
        'friction law of all joints, see *friction terms*; with `torque_side = "link"` that '
        "of the bearings, tested where it is not given",
        kind="list of terms",
        shown="the model's",
    )
    joint_friction: dict[str, FrictionTerms] = key(
        meaning='laws of single joints in place of the common one: `{elbow = ["viscous", {term = '
        '"dahl", distance = 1e-3}]}`',
        factory=dict,
        kind="table of lists",
    )
    extra_friction: dict[str, FrictionTerms] = key(
        meaning='more terms for single joints: `{elbow = [{term = "stribeck", speed = 0.05}]}`',
        factory=dict,
        kind="table of lists",
    )
    rotor_inertia: PerJoint | None = key(
        None,
        "nominal motor inertias on the joint side",
        unit="kg m² or kg",
        kind="per joint",
        shown="the model's",
    )
    reduction: PerJoint | None = key(
        None,
        "motor position per joint position; the sign counts",
        kind="per joint",
        shown="the model's",
    )
    reduction_matrix: list[list[float]] | None = key(
        None,
        "the whole reduction, with couplings off the diagonal, in place of `reduction`",
        kind="list of lists",
        shown="the model's",
    )
    drive_gain: PerJoint | None = key(
        None,
        'motor torque per unit of the logged command, for `tau` in A, V or `"command"`',
        unit="N m per A, V …",
        kind="per joint",
        shown="the model's",
    )
    position_offset: PerJoint | None = key(
        None,
        "joint position of the model where a motor-side log reads zero",
        unit="rad or m",
        kind="per joint",
        shown="the model's",
    )
    couplings: list[CouplingEntry] | None = key(
        None, "motors that also turn with a second joint, see *couplings*", shown="the model's"
    )
    floating_base: bool = key(
        False,
        "the base moves, and its pose is among the columns, see [force "
        "sensors](how_to/force_sensors.md)",
    )

    @model_validator(mode="after")
    def _consistent(self) -> RobotEntry:
        if self.reduction is not None and self.reduction_matrix is not None:
            raise ExperimentError(
                "reduction and reduction_matrix are both given", advice="keep one of them"
            ).about("reduction")
        if self.passive is not None and not self.model.endswith(MJCF_FILES):
            raise ExperimentError(
                f"passive is for MJCF robots, not for {self.model!r}",
                advice="a robot file says passive = true at the joint, and in a URDF joints that "
                "mimic others are passive; remove it",
            ).about("passive")
        return self


class UnitsEntry(Entry):
    """Units of the channels; see `pivident.data.logs.units`."""

    q: Any = key(
        None,
        '`"rad"`, `"deg"`, `"rev"`, `"m"`, `"mm"`, `"um"`, or `{unit = "counts", '
        "per_revolution = 4096}`",
        kind="unit",
        shown="rad or m",
    )
    tau: Any = key(
        None,
        '`"N m"`, `"mN m"`, `"N"` …, `{unit = "A", gain = 12.5}`, or `"A"`, `"V"` with '
        '`drive_gain` of the robot; `scale = "masses"` or `"assumed"` beside the gain where '
        "it is an assumption",
        kind="unit",
        shown="N m or N",
    )
    q_ref: Any = key(
        None, "as `q`, but independent of the unit of `q`", kind="unit", shown="rad or m"
    )
    dq_ref: Any = key(None, '`"deg/s"`, `"rpm"` …', kind="unit", shown="rad/s or m/s")
    ddq_ref: Any = key(None, '`"deg/s^2"` …', kind="unit", shown="rad/s² or m/s²")
    q_link: Any = key(None, "as for `q`", kind="unit", shown="rad or m")
    dq: Any = key(None, "as for `dq_ref`", kind="unit", shown="rad/s or m/s")
    t: Any = key(None, '`"s"`, `"ms"`, `"us"`, `"ns"`', kind="unit", shown="s")
    inputs: dict[str, Any] = key(
        meaning="unit of each known input, in the unit of the controller's output",
        factory=dict,
        kind="table of units",
    )
    wrench: dict[str, Any] = key(
        meaning='of each sensor: `"N"`, `"kN"` with moments in the same times m, or a list of six',
        factory=dict,
        kind="table of units",
    )
    base: dict[str, Any] = key(
        meaning='`{position = "mm", rpy = "deg"}`', factory=dict, kind="table of units"
    )


class ColumnsEntry(Entry):
    """Where the channels are in the files; see `pivident.data.logs.channel_places`."""

    q: Any = key(meaning="measured positions", kind="columns")
    tau: Any = key(
        None,
        "torques, forces or drive commands; without it the known law under `[controller]` gives "
        "the torque, see [without torque](how_to/without_torque.md)",
        kind="columns",
    )
    q_ref: Any = key(None, "reference positions; IV and PIV use them", kind="columns")
    dq_ref: Any = key(None, "reference speeds", kind="columns")
    ddq_ref: Any = key(None, "reference accelerations", kind="columns")
    q_link: Any = key(
        None,
        "positions of second encoders behind the gear; `q` is then the motor encoder over the gear "
        "ratio, see [`flexibility.md`](flexibility.md)",
        kind="columns",
    )
    dq: Any = key(
        None,
        "measured speeds, for instruments where their noise is not that of the positions, see "
        "[controllers that nobody knows](how_to/unknown_controller.md); the motion itself is that "
        "of `q`",
        kind="columns",
    )
    t: Any = key(
        None,
        'time stamps; this or `rate`; `{q = "time", tau = "stamp"}` where channels have clocks of '
        'their own; for a bag none, `"stamp"` or `"receive_time"`',
        kind="column or table",
    )
    temperature: Any = key(
        None,
        "temperatures of motors or gears of this run, °C or K, where they are called otherwise "
        "than `temperature` under `[identify]` says; without that key of no effect",
        kind="columns",
    )
    inputs: dict[str, Any] = key(
        factory=dict,
        meaning="known signals added to the controller's output, by name",
        kind="table of columns",
    )
    wrench: dict[str, Any] = key(
        factory=dict,
        meaning='force and moment of each sensor, `{floor = ["fx", "fy", "fz", "mx", "my", "mz"]}`',
        kind="table of columns",
    )
    base: dict[str, Any] = key(
        factory=dict,
        meaning="pose of a floating base: `position`, and `quaternion` (x, y, z, w) or `rpy`; with "
        "measured speeds `dq` of the joints also `twist`, its speed and angular velocity in the "
        "world",
        kind="table of columns",
    )


class WrenchEntry(Entry):
    """A sensor of force and moment; its six columns are under ``wrench`` of each recording."""

    name: Annotated[str, Field(min_length=1)] = key(
        meaning="what its columns are called under `wrench`"
    )
    link: Annotated[str, Field(min_length=1)] = key(
        meaning="the link that the wrench acts on, by its name, or the name or number of its "
        "joint; "
        '`"base"` for a sensor under the base, or on one that floats',
    )
    at: Annotated[list[float], Field(min_length=3, max_length=3)] = key(
        [0.0, 0.0, 0.0],
        "origin of the sensor in the frame of the link; moments are about it",
        unit="m",
        kind="3 numbers",
    )
    rpy: Annotated[list[float], Field(min_length=3, max_length=3)] = key(
        [0.0, 0.0, 0.0],
        "axes of the sensor there, Rz(yaw) Ry(pitch) Rx(roll)",
        unit="rad",
        kind="3 numbers",
    )
    acts: Acts = key(
        "on_robot",
        '`"on_robot"`: what the surroundings do to the link; `"by_robot"`: what the link '
        "does to them",
    )


class ContactEntry(Entry):
    """A point of a link that stands still, of a robot on a floating base."""

    link: Annotated[str, Field(min_length=1)] = key(
        meaning="the last link of the leg, by its name or that of its joint"
    )
    at: Annotated[list[float], Field(min_length=3, max_length=3)] = key(
        [0.0, 0.0, 0.0], "the foot in the frame of the link", unit="m", kind="3 numbers"
    )


class RecordingEntry(Entry):
    """One run: files with columns and units, or a public record by name."""

    files: Paths | None = key(
        None,
        "the log (CSV, NPZ, NPY, MAT, Parquet, ROS bag, see [`logs.md`](logs.md)), "
        '`"runs/*.parquet"` for many runs of the same columns, or `{q = "a.csv", tau = '
        '"b.csv"}`; this or `dataset`',
        kind="path or table",
    )
    dataset: str | None = key(
        None,
        "a public record in place of files and columns; `pivident datasets` lists them",
        kind="name",
    )
    run: str | None = key(None, "which run of the data set", kind="name", shown="its first")
    name: str | None = key(None, "name of the run in results", shown="the file's")
    column_names: Names | None = key(
        None,
        'names of the columns of a text table without a header, in their order, `"-"` for '
        'one that is not needed: `["t", "q1..q7", "-", "tau1..tau7"]`; without it they are '
        "`column_1` …",
        shown="by the header",
    )
    columns: ColumnsEntry | None = key(
        None, "where the channels are, see *columns*", shown="needed with `files`"
    )
    units: UnitsEntry = empty_table(UnitsEntry, "what they are measured in, see *units*")
    side: Annotated[Any, PlainValidator(lambda value: value)] = key(
        "joint",
        '`"joint"` or `"motor"`, or by channel: `{q = "joint", tau = "motor"}`',
        kind="name or table",
    )
    torque_side: TorqueSide | None = key(
        None,
        'what `tau` measures: `"motor"`: the torque of the motors, whatever its unit and '
        'side; `"link"`: sensors behind the gears, which feel neither rotors nor drives, see '
        "[torque sensors](how_to/torque_sensors.md)",
        shown='`"motor"`',
    )
    rate: PositiveFloat | None = key(
        None,
        "sampling rate, where `t` was not logged or its stamps are coarse",
        unit="Hz",
        shown="of the time stamps",
    )
    resample: bool = key(
        False,
        "interpolate irregular stamps, or channels with clocks of their own, onto a uniform "
        "grid; gaps of more than 3 samples and 10 ms remain, with a recording on either side",
    )
    samples_axis: Literal[0, 1] | None = key(
        None, "which axis of a two-dimensional array is time", kind="0 or 1", shown="detected"
    )
    position_offset: list[float] | None = key(
        None,
        "added to the positions; zero on the joint side, the robot's on the motor side",
        unit="rad or m",
        kind="list of numbers",
        shown="see meaning",
    )
    control_rate: PositiveFloat | None = key(
        None,
        "rate of the control loop, where the log is slower or faster",
        unit="Hz",
        shown="`rate`",
    )
    torque_timing: TorqueTiming | None = key(
        None,
        'a torque sample is `"held"` until the next one, `"averaged"` before it, or `"sampled"`',
        shown='`"held"`, of sensors behind the gears `"sampled"`',
    )
    delay: float | None = key(None, "how much later `tau` is than `q`", unit="s", shown="`0.0`")
    drive_delay: NonNegativeFloat | None = key(
        None,
        "how much later than its sample a logged torque acts: the log holds the command to "
        "the drive; the simulated loop has the same delay",
        unit="s",
        shown="`0.0`",
    )
    saturation: Saturation | None = key(
        None, '`"allow"` accepts torques cut off at a limit', shown='`"refuse"`'
    )
    allow_constant: bool | None = key(None, "accept joints that do not move", shown="`false`")
    part: Interval | None = key(
        None,
        "use only these times, `[start, stop]` on the log's clock",
        unit="s",
        kind="2 numbers",
        shown="all",
    )
    design: Annotated[str, Field(min_length=1)] | None = key(
        None,
        "the design of the motion, written by `pivident excite`: the predicted standard "
        "errors are printed beside those reached",
        kind="path",
        shown="`design.json` beside the log, if there is one",
    )

    @property
    def is_without_torque(self) -> bool:
        """Whether no column is named for the torque; a public record has one."""
        return self.columns is not None and self.columns.tau is None

    @model_validator(mode="after")
    def _one_source(self) -> RecordingEntry:
        if (self.files is None) == (self.dataset is None):
            given = "neither is given" if self.files is None else "both are given"
            raise ExperimentError(f"a recording has either files or a dataset, but {given}").about(
                *self.model_fields_set & {"files"}
            )
        if self.files is not None and self.columns is None:
            raise ExperimentError(
                "files need columns", advice="name at least those of q and tau"
            ).about("files")
        if self.column_names is not None and isinstance(self.files, dict):
            raise ExperimentError(
                "column_names are those of one file",
                advice="with several, use column_1, column_2 … of each",
            ).about("column_names")
        if self.run is not None and self.dataset is None:
            raise ExperimentError("run belongs to a dataset", advice="remove it").about("run")
        foreign = sorted(self.model_fields_set.intersection(SET_BY_DATASET))
        if self.dataset is not None and foreign:
            raise ExperimentError(
                f"the dataset {self.dataset!r} brings its own {', '.join(foreign)}",
                advice="remove that, or name files instead of the dataset",
            ).about("dataset")
        if self.part is not None and not self.part[0] < self.part[1]:
            raise ExperimentError(
                f"part = {self.part} is empty", advice="the first time comes first"
            ).about("part")
        return self


class ControllerEntry(Entry):
    """The control law of the loop that the record was taken in."""

    type: Literal["pd", "pid", "cascade", "virtual_pd", "identify"] = key(
        meaning='`"pd"`, `"pid"`, `"cascade"`; `"virtual_pd"` where the law is unknown; '
        '`"identify"` '
        "identifies it from q_ref, q and tau, including gravity compensation",
    )
    kp: Numbers | None = key(
        None,
        "proportional gain (u: the controller's output)",
        unit="u per rad or m; cascade: 1/s",
        kind="number(s)",
        shown="needed by its law",
    )
    kd: Numbers | None = key(
        None,
        "derivative gain",
        unit="u per rad/s or m/s",
        kind="number(s)",
        shown="needed by `pd`, `pid`",
    )
    ki: Numbers | None = key(
        None,
        "integral gain of `pid`, or of the speed loop of `cascade`",
        unit="u per rad s; cascade: 1/s",
        kind="number(s)",
    )
    kv: Numbers | None = key(
        None,
        "gain of the speed loop",
        unit="u per rad/s or m/s",
        kind="number(s)",
        shown="needed by `cascade`",
    )
    derivative_time: NonNegativeFloat = key(0.0, "filter time of the derivative", unit="s")
    averaged: bool = key(False, "`cascade`: speed from the two-sample mean")
    speed_feed_forward: float | None = key(
        None,
        "share s of the reference speed in kd (s dq_ref - dq), or in kv of a cascade; 0 for "
        "position actuators of MuJoCo, which damp the speed itself",
        shown="1; `cascade`: 0",
    )
    drive_gain: DriveGain = key(
        1.0,
        'joint torque per controller output; `"unknown"` for a log [without '
        "torque](how_to/without_torque.md): parameters are then ratios to it",
        unit="N m or N per u",
        kind='number(s) or `"unknown"`',
    )
    limit: Numbers | None = key(None, "largest controller output", unit="u", kind="number(s)")
    feed_forward: FeedForward = key(
        "none",
        'what the controller adds, computed from the nominal robot: `"gravity"` or '
        '`"computed_torque"` of the reference, `"gravity_measured"` of the measured position',
    )
    counts: Numbers | None = key(
        None,
        "encoder that the law reads, where it is coarse: `didim` simulates the loop with it; "
        "0 for a joint without",
        unit="per revolution or metre of the joint",
        kind="number or list",
        shown="–",
    )
    bandwidth: PositiveFloat | None = key(
        None, "`virtual_pd`: bandwidth of the declared law", unit="Hz", shown="chosen"
    )
    damping: PositiveFloat | None = key(None, "`virtual_pd`: its damping ratio", shown="chosen")
    reference: Literal["recorded", "smoothed", "reconstruct"] | None = key(
        None,
        '`"recorded"` q_ref; `"smoothed"` measurement (default of `virtual_pd`); '
        '`"reconstruct"` reconstructs one that was not logged',
        shown="see meaning",
    )

    @model_validator(mode="after")
    def _keys_belong_to_law(self) -> ControllerEntry:
        needed, possible = LAW_KEYS[self.type]
        missing = sorted(needed - self.model_fields_set)
        if missing:
            raise ExperimentError(
                f"a {self.type} controller needs {', '.join(missing)}", advice="add it"
            ).about(missing[0])
        known = needed | possible | {"type", "reference"}
        foreign = sorted(self.model_fields_set - known)
        if foreign:
            raise ExperimentError(
                f"a {self.type} controller has no {', '.join(foreign)}",
                advice=f"its keys are {', '.join(sorted(known - {'type'}))}",
            ).about(foreign[0])
        if self.type == "identify" and self.reference == "smoothed":
            raise ExperimentError(
                'a law cannot be identified from reference = "smoothed", which knows nothing of '
                "the control error",
                advice='use "recorded" or "reconstruct"',
            ).about("reference")
        return self

    @property
    def gain(self) -> float | list[float]:
        """Joint torque per unit of the output; 1 where it is not known."""
        return 1.0 if isinstance(self.drive_gain, str) else self.drive_gain

    @property
    def feed_forward_share(self) -> float:
        """Share of the reference speed that the law's gain on speed counts."""
        if self.speed_feed_forward is None:
            return 0.0 if self.type == "cascade" else 1.0
        return self.speed_feed_forward

    @property
    def source(self) -> Literal["recorded", "smoothed", "reconstruct"]:
        """Where the reference comes from; a virtual law was not there to record one."""
        return self.reference or ("smoothed" if self.type == "virtual_pd" else "recorded")


class ValidationEntry(Entry):
    """How results are judged on motion that was not fitted."""

    folds: Annotated[int, Field(ge=0, le=100)] = key(
        5,
        "contiguous blocks of the motion, left out in turn; the nearest number that the "
        "motion has room for is taken, which the verdict reports; `0`: none, which it "
        "reports too",
    )
    gap: Annotated[float, Field(ge=0)] | None = key(
        None,
        "left out on either side of a block",
        unit="s",
        shown="two periods of the highest frequency of the motion",
    )
    recording: list[RecordingEntry] = key(
        meaning="`[[validation.recording]]`, as `[recording]`: validation on these in place of "
        "blocks",
        factory=list,
        kind="tables",
    )

    @model_validator(mode="after")
    def _one_block_is_none(self) -> ValidationEntry:
        if self.folds == 1:
            raise ExperimentError(
                "folds = 1 leaves nothing to fit", advice="use 2 or more, or 0 for none"
            ).about("folds")
        return self


class OutputEntry(Entry):
    """Where results go and how they are headed."""

    folder: Folder | None = key(
        None,
        "folder of the results, beside or below the file; `--out` overrides it, and may name "
        "any other",
        kind="path",
        shown="`NAME-results`",
    )
    title: str | None = key(None, "title of the report", shown="the file's name")
    report: bool = key(True, "write `report.html`")


class PayloadEntry(Entry):
    """A body of known mass on a link; see `pivident.estimation.drives.known_payload`."""

    mass: PositiveFloat = key(meaning="its mass", unit="kg")
    mass_std: NonNegativeFloat = key(0.0, "standard deviation of the mass", unit="kg")
    center_of_mass: Annotated[list[float], Field(min_length=3, max_length=3)] | None = key(
        None, "in the frame of its link; left out: estimated", unit="m", kind="3 numbers"
    )
    inertia: Annotated[list[float], Field(min_length=6, max_length=6)] | None = key(
        None,
        "xx, xy, xz, yy, yz, zz about the centre of mass; left out: estimated",
        unit="kg m²",
        kind="6 numbers",
    )
    joint: JointReference | None = key(
        None, "the joint whose link carries it; left out: the last one", kind="name or number"
    )


class GainsEntry(Entry):
    """What `pivident gains` takes for known; see `pivident.estimation.drives.drive_gains`."""

    payload: PayloadEntry | None = key(
        None, "a body of known mass, see *payload*; with `[[gains.recording]]`"
    )
    recording: list[RecordingEntry] = key(
        meaning="runs taken with the payload, as `[recording]`", factory=list
    )
    trusted: dict[str, PositiveFloat] = key(
        meaning="known gains: `trusted = {joint_2 = 32.0}`", factory=dict, unit="N m per A, V …"
    )
    trusted_parameters: dict[str, float] = key(
        meaning="known base parameters, by name", factory=dict, unit="of the parameter"
    )
    trusted_within: Annotated[float, Field(ge=0, lt=1)] = key(
        0.0, "relative standard deviation of the trusted values"
    )
    friction_under_load: bool = key(True, "friction may change with the payload")
    known_within: Annotated[float, Field(gt=0, lt=1)] = key(
        0.25, "a gain or ratio is called known if ±2σ is at most this share of it"
    )
    temperature: str | list[str] | None = key(
        None,
        'motor temperatures in the log, one column or one for each joint; or `"time"`: a '
        "drift linear in time",
        unit="°C or K",
        kind="columns",
    )
    reference_temperature: float | None = key(
        None, "temperature that the gains belong to", unit="as `temperature`", shown="the mean"
    )
    friction_drift: bool = key(True, "friction may change with temperature too")
    sensors: list[str] | None = key(
        None,
        "torques of sensors behind the gears in the same log, one column for each joint: gain, "
        "efficiency, friction and rotor of each gear follow from both",
        unit="N m or N",
        kind="columns",
    )

    @model_validator(mode="after")
    def _payload_has_recordings(self) -> GainsEntry:
        if (self.payload is None) == bool(self.recording):
            raise ExperimentError(
                "payload and [[gains.recording]], the runs taken with it, belong together",
                advice="give both or neither",
            ).about("payload")
        return self


class ToolFrameEntry(Entry):
    """Frame of a tool in that of the link that carries it, as in a URDF origin."""

    xyz: Annotated[list[float], Field(min_length=3, max_length=3)] = key(
        [0.0, 0.0, 0.0],
        "origin of the tool's frame in the frame of the link",
        unit="m",
        kind="3 numbers",
    )
    rpy: Annotated[list[float], Field(min_length=3, max_length=3)] = key(
        [0.0, 0.0, 0.0],
        "its roll, pitch and yaw, as in a URDF's `<origin>`",
        unit="rad",
        kind="3 numbers",
    )


class LoadEntry(Entry):
    """A load that `pivident payload` looks for; see `pivident.studies.payload`."""

    recording: list[RecordingEntry] = key(
        meaning="runs with the load, as `[recording]`, which holds those without; left out where "
        "the "
        "arm is known from a file",
        factory=list,
    )
    link: JointReference | None = key(
        None,
        "link that carries the load, or the joint that moves it, or a fixed link of the URDF, such "
        "as a flange; left out: the last one that moves",
        kind="name or number",
    )
    method: Literal["ls", "iv-full-rate", "piv"] | None = key(
        None,
        '`"ls"`, `"iv-full-rate"` or `"piv"`; left out: `"piv"` with a controller, `"ls"` without',
    )
    mass: PositiveFloat | None = key(None, "its mass, from a scale; left out: estimated", unit="kg")
    mass_std: NonNegativeFloat = key(0.0, "standard deviation of the mass", unit="kg")
    center_of_mass: Annotated[list[float], Field(min_length=3, max_length=3)] | None = key(
        None, "known centre of mass, in `frame`", unit="m", kind="3 numbers"
    )
    center_of_mass_std: NonNegativeFloat = key(
        0.0, "standard deviation of each coordinate", unit="m"
    )
    inertia: Annotated[list[float], Field(min_length=6, max_length=6)] | None = key(
        None,
        "known xx, xy, xz, yy, yz, zz about the centre of mass, in axes of `frame`; needs "
        "`center_of_mass`",
        unit="kg m²",
        kind="6 numbers",
    )
    inertia_std: NonNegativeFloat = key(0.0, "standard deviation of each element", unit="kg m²")
    frame: ToolFrameEntry | None = key(
        None, "frame of results and known parts, see *frame*; left out: that of the link"
    )
    friction_under_load: bool = key(True, "friction may change with the load")


class ExperimentFile(Entry):
    """The whole file, its short forms written out."""

    robot: RobotEntry = key(meaning="the machine, see `[robot]`", kind="name or table")
    recording: Annotated[list[RecordingEntry], Field(min_length=1)] = key(
        meaning="the runs, see `[recording]`", kind="table or list of tables"
    )
    controller: ControllerEntry | None = key(
        None,
        "the control loop, see `[controller]`; without it IV and PIV take their instruments "
        "from the record",
        kind="name or table",
    )
    identify: IdentifyEntry = empty_table(
        IdentifyEntry, "what is estimated and how, see `[identify]`"
    )
    validation: ValidationEntry = empty_table(
        ValidationEntry, "how results are validated, see `[validation]`"
    )
    output: OutputEntry = empty_table(OutputEntry, "where the results go, see `[output]`")
    gains: GainsEntry = empty_table(
        GainsEntry, "what `pivident gains` takes as known, see `[gains]`"
    )
    consistency: ConsistencyEntry | None = key(
        None,
        "physical consistency of the links, see `[consistency]`; even an empty table requests it",
        kind="table",
    )
    payload: LoadEntry | None = key(
        None, "the load that `pivident payload` identifies, see `[payload]`"
    )
    excite: ExciteEntry | None = key(
        None, "limits, obstacles and wishes of a designed motion, see `[excite]`", kind="table"
    )
    wrench: list[WrenchEntry] = key(meaning="force sensors, see `[[wrench]]`", factory=list)
    contact: list[ContactEntry] = key(meaning="feet that stand, see `[[contact]]`", factory=list)

    @property
    def torque_side(self) -> TorqueSide:
        """What the logged torques are: of the motors, or of sensors behind the gears."""
        return self.recording[0].torque_side or "motor"

    @model_validator(mode="after")
    def _one_stance(self) -> ExperimentFile:
        if self.contact and self.validation.recording:
            raise ExperimentError(
                "a robot on feet that stand is judged on held-out blocks of its own stance, not "
                "on [[validation.recording]]",
                advice="remove one of both",
            ).about("contact")
        return self

    @model_validator(mode="after")
    def _one_kind_of_torque(self) -> ExperimentFile:
        """All runs measure the same torque, and only a declared law acts behind the gears."""
        tables = {
            "[[recording]]": self.recording,
            "[[validation.recording]]": self.validation.recording,
            "[[gains.recording]]": self.gains.recording,
            "[[payload.recording]]": [] if self.payload is None else self.payload.recording,
        }
        for table, entries in tables.items():
            for entry in entries:
                if (entry.torque_side or "motor") != self.torque_side:
                    raise ExperimentError(
                        f"torque_side of the first recording is {self.torque_side!r}, that of a "
                        f"table {table} {entry.torque_side or 'motor'!r}: motors and sensors "
                        "behind the gears measure different torques",
                        advice="set the same in all",
                    ).about(*table.strip("[]").split("."))
        law = self.controller
        if self.torque_side == "link" and law is not None and law.type != "virtual_pd":
            raise ExperimentError(
                f'a {law.type} law drives the motors, but torque_side = "link" says that the '
                "torques are those behind the gears: their model has no rotors and no drives that "
                "such a law could drive",
                advice="remove [controller], and instruments come from the record itself",
            ).about("controller", "type")
        return self
