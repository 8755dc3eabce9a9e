"""Keys of an experiment file, their types and defaults, and what contradicts each other.

This module needs pydantic and is imported only when a file is read. `pivident.experiment` turns
the checked tables into robot, recordings, loop and methods. The tables ``[identify]``,
``[consistency]`` and ``[excite]`` are in `method_keys`, `consistency_keys` and `excite_keys`.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

from pydantic import Field, NonNegativeFloat, PositiveFloat, model_validator
from pydantic.functional_validators import PlainValidator

from pivident.errors import ExperimentError
from pivident.experiment.consistency_keys import ConsistencyEntry  # consistency
from pivident.experiment.excite_keys import ExciteEntry  # excite
from pivident.experiment.method_keys import IdentifyEntry
from pivident.experiment.table_values import (
    DriveGain,
    Folder,
    Interval,
    Names,
    Numbers,
    Paths,
    PerJoint,
)
from pivident.recording.recording import Saturation, TorqueTiming
from pivident.robot.description import TorqueSide
from pivident.robot.mdh_schema import Entry, FrictionTerms, Gravity, JointReference
from pivident.robot.naming import MJCF_FILES, URDF_FILES
from pivident.robot.wrench_sensor import Acts
from pivident.simulation.controllers import FeedForward

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

    motor: JointReference
    joint: JointReference
    ratio: float | None = None
    parameters: list[Literal["iam", "fvm", "fcm"]] = Field(["iam", "fvm", "fcm"])


class RobotEntry(Entry):
    """The robot, and what its description does not say about the machine that was logged."""

    model: Annotated[str, Field(min_length=1)]
    joints: Names | None = None
    frozen: dict[str, float] = Field(default_factory=dict)
    passive: Names | None = None
    gravity: Gravity | None = None
    friction: FrictionTerms | None = None
    joint_friction: dict[str, FrictionTerms] = Field(default_factory=dict)
    extra_friction: dict[str, FrictionTerms] = Field(default_factory=dict)
    rotor_inertia: PerJoint | None = None
    reduction: PerJoint | None = None
    reduction_matrix: list[list[float]] | None = None
    drive_gain: PerJoint | None = None
    position_offset: PerJoint | None = None
    couplings: list[CouplingEntry] | None = None
    floating_base: bool = False

    @model_validator(mode="after")
    def _consistent(self) -> RobotEntry:
        if self.reduction is not None and self.reduction_matrix is not None:
            raise ExperimentError(
                "reduction and reduction_matrix are both given; keep one of them"
            ).about("reduction")
        if not self.model.endswith((*URDF_FILES, *MJCF_FILES)):
            for key in ("joints", "frozen"):
                if key in self.model_fields_set:
                    raise ExperimentError(
                        f"{key} is for URDF and MJCF robots, not for {self.model!r}; remove it"
                    ).about(key)
        if self.passive is not None and not self.model.endswith(MJCF_FILES):
            raise ExperimentError(
                f"passive is for MJCF robots, not for {self.model!r}; a robot file says "
                "passive = true at the joint, and in a URDF joints that mimic others are passive; "
                "remove it"
            ).about("passive")
        return self


class UnitsEntry(Entry):
    """Units of the channels; see `pivident.logs.units`."""

    q: Any = None
    tau: Any = None
    q_ref: Any = None
    dq_ref: Any = None
    ddq_ref: Any = None
    q_link: Any = None  # flexible joints
    dq: Any = None
    t: Any = None
    inputs: dict[str, Any] = Field(default_factory=dict)
    wrench: dict[str, Any] = Field(default_factory=dict)
    base: dict[str, Any] = Field(default_factory=dict)


class ColumnsEntry(UnitsEntry):
    """Where the channels are in the files; see `pivident.logs.channel_places`."""

    q: Any


class WrenchEntry(Entry):
    """A sensor of force and moment; its six columns are under ``wrench`` of each recording."""

    name: Annotated[str, Field(min_length=1)]
    link: Annotated[str, Field(min_length=1)]
    at: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])
    rpy: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])
    acts: Acts = "on_robot"


class ContactEntry(Entry):
    """A point of a link that stands still, of a robot on a floating base."""

    link: Annotated[str, Field(min_length=1)]
    at: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])


class RecordingEntry(Entry):
    """One run: files with columns and units, or a public record by name."""

    files: Paths | None = None
    dataset: str | None = None
    run: str | None = None
    name: str | None = None
    column_names: Names | None = None
    columns: ColumnsEntry | None = None
    units: UnitsEntry = UnitsEntry()
    side: Annotated[Any, PlainValidator(lambda value: value)] = "joint"
    torque_side: TorqueSide | None = None
    rate: PositiveFloat | None = None
    resample: bool = False
    samples_axis: Literal[0, 1] | None = None
    position_offset: list[float] | None = None
    control_rate: PositiveFloat | None = None
    torque_timing: TorqueTiming | None = None
    delay: float | None = None
    drive_delay: NonNegativeFloat | None = None
    saturation: Saturation | None = None
    allow_constant: bool | None = None
    part: Interval | None = None
    design: Annotated[str, Field(min_length=1)] | None = None

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
            raise ExperimentError("files need columns; name at least those of q and tau").about(
                "files"
            )
        if self.column_names is not None and isinstance(self.files, dict):
            raise ExperimentError(
                "column_names are those of one file; with several, use column_1, column_2 … of each"
            ).about("column_names")
        if self.run is not None and self.dataset is None:
            raise ExperimentError("run belongs to a dataset; remove it").about("run")
        foreign = sorted(self.model_fields_set.intersection(SET_BY_DATASET))
        if self.dataset is not None and foreign:
            raise ExperimentError(
                f"the dataset {self.dataset!r} brings its own {', '.join(foreign)}; remove that, "
                "or name files instead of the dataset"
            ).about("dataset")
        if self.part is not None and not self.part[0] < self.part[1]:
            raise ExperimentError(f"part = {self.part} is empty; the first time comes first").about(
                "part"
            )
        return self


class ControllerEntry(Entry):
    """The control law of the loop that the record was taken in."""

    type: Literal["pd", "pid", "cascade", "virtual_pd", "identify"]
    kp: Numbers | None = None
    kd: Numbers | None = None
    ki: Numbers | None = None
    kv: Numbers | None = None
    derivative_time: NonNegativeFloat = 0.0
    averaged: bool = False
    speed_feed_forward: float | None = None
    drive_gain: DriveGain = 1.0
    limit: Numbers | None = None
    feed_forward: FeedForward = "none"
    counts: Numbers | None = None
    bandwidth: PositiveFloat | None = None
    damping: PositiveFloat | None = None
    reference: Literal["recorded", "smoothed", "reconstruct"] | None = None

    @model_validator(mode="after")
    def _keys_belong_to_law(self) -> ControllerEntry:
        needed, possible = LAW_KEYS[self.type]
        missing = sorted(needed - self.model_fields_set)
        if missing:
            raise ExperimentError(
                f"a {self.type} controller needs {', '.join(missing)}; add it"
            ).about(missing[0])
        known = needed | possible | {"type", "reference"}
        foreign = sorted(self.model_fields_set - known)
        if foreign:
            raise ExperimentError(
                f"a {self.type} controller has no {', '.join(foreign)}; its keys are "
                f"{', '.join(sorted(known - {'type'}))}"
            ).about(foreign[0])
        if self.type == "identify" and self.reference == "smoothed":
            raise ExperimentError(
                'a law cannot be identified from reference = "smoothed", which knows nothing of '
                'the control error; use "recorded" or "reconstruct"'
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

    folds: Annotated[int, Field(ge=0, le=100)] = 5
    gap: Annotated[float, Field(ge=0)] | None = None
    recording: list[RecordingEntry] = Field(default_factory=list)

    @model_validator(mode="after")
    def _one_block_is_none(self) -> ValidationEntry:
        if self.folds == 1:
            raise ExperimentError(
                "folds = 1 leaves nothing to fit; use 2 or more, or 0 for none"
            ).about("folds")
        return self


class OutputEntry(Entry):
    """Where results go and how they are headed."""

    folder: Folder | None = None
    title: str | None = None
    report: bool = True


class PayloadEntry(Entry):
    """A body of known mass on a link; see `pivident.drives.known_payload`."""

    mass: PositiveFloat
    mass_std: NonNegativeFloat = 0.0
    center_of_mass: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    inertia: Annotated[list[float], Field(min_length=6, max_length=6)] | None = None
    joint: JointReference | None = None


class GainsEntry(Entry):
    """What `pivident gains` takes for known; see `pivident.drives.drive_gains`."""

    payload: PayloadEntry | None = None
    recording: list[RecordingEntry] = Field(default_factory=list)
    trusted: dict[str, PositiveFloat] = Field(default_factory=dict)
    trusted_parameters: dict[str, float] = Field(default_factory=dict)
    trusted_within: Annotated[float, Field(ge=0, lt=1)] = 0.0
    friction_under_load: bool = True
    known_within: Annotated[float, Field(gt=0, lt=1)] = 0.25
    temperature: str | list[str] | None = None
    reference_temperature: float | None = None
    friction_drift: bool = True

    @model_validator(mode="after")
    def _payload_has_recordings(self) -> GainsEntry:
        if (self.payload is None) == bool(self.recording):
            raise ExperimentError(
                "payload and [[gains.recording]], the runs taken with it, belong together; give "
                "both or neither"
            ).about("payload")
        return self


class ToolFrameEntry(Entry):
    """Frame of a tool in that of the link that carries it, as in a URDF origin."""

    xyz: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])
    rpy: Annotated[list[float], Field(min_length=3, max_length=3)] = Field([0.0, 0.0, 0.0])


class LoadEntry(Entry):
    """A load that `pivident payload` looks for; see `pivident.payload`."""

    recording: list[RecordingEntry] = Field(default_factory=list)
    link: JointReference | None = None
    method: Literal["ls", "iv-full-rate", "piv"] | None = None
    mass: PositiveFloat | None = None
    mass_std: NonNegativeFloat = 0.0
    center_of_mass: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    center_of_mass_std: NonNegativeFloat = 0.0
    inertia: Annotated[list[float], Field(min_length=6, max_length=6)] | None = None
    inertia_std: NonNegativeFloat = 0.0
    frame: ToolFrameEntry | None = None
    friction_under_load: bool = True


class ExperimentFile(Entry):
    """The whole file, its short forms written out."""

    robot: RobotEntry
    recording: Annotated[list[RecordingEntry], Field(min_length=1)]
    controller: ControllerEntry | None = None
    identify: IdentifyEntry = Field(default_factory=lambda: IdentifyEntry.model_validate({}))
    validation: ValidationEntry = ValidationEntry()
    output: OutputEntry = OutputEntry()
    gains: GainsEntry = GainsEntry()  # drive gains
    consistency: ConsistencyEntry | None = None  # consistency
    payload: LoadEntry | None = None  # payload
    excite: ExciteEntry | None = None  # excite
    wrench: list[WrenchEntry] = Field(default_factory=list)  # force sensors
    contact: list[ContactEntry] = Field(default_factory=list)  # feet that stand

    @property
    def torque_side(self) -> TorqueSide:
        """What the logged torques are: of the motors, or of sensors behind the gears."""
        return self.recording[0].torque_side or "motor"

    @model_validator(mode="after")
    def _one_stance(self) -> ExperimentFile:
        if self.contact and self.validation.recording:
            raise ExperimentError(
                "a robot on feet that stand is judged on held-out blocks of its own stance, not on "
                "[[validation.recording]]; remove one of both"
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
                        "behind the gears measure different torques; set the same in all"
                    ).about(*table.strip("[]").split("."))
        law = self.controller
        if self.torque_side == "link" and law is not None and law.type != "virtual_pd":
            raise ExperimentError(
                f'a {law.type} law drives the motors, but torque_side = "link" says that the '
                "torques are those behind the gears: their model has no rotors and no drives that "
                "such a law could drive; remove [controller], and instruments come from the "
                "record itself"
            ).about("controller", "type")
        return self
