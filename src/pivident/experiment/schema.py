"""Keys of an experiment file, their types and defaults, and what contradicts each other.

This module needs pydantic and is imported only when a file is read. `pivident.experiment` turns
the checked tables into robot, recordings, loop and methods.
"""

from __future__ import annotations

import math
from pathlib import PurePath
from typing import Annotated, Any, Literal

from pydantic import AfterValidator, Field, NonNegativeFloat, PositiveFloat, model_validator
from pydantic.functional_validators import PlainValidator

from pivident.consistency.method_names import CONSISTENT_METHODS  # consistency
from pivident.estimation.methods import METHODS
from pivident.printable import is_printable
from pivident.recording.recording import Saturation, TorqueTiming
from pivident.robot.mdh_schema import Entry, FrictionTerms, Gravity, JointReference
from pivident.robot.naming import nearest
from pivident.simulation.controllers import FeedForward

#: Keys that every real loop may have.
LOOP_KEYS = {"drive_gain", "limit", "feed_forward"}

#: Keys of each control law: those it needs, and those it may have besides.
LAW_KEYS = {
    "pd": ({"kp", "kd"}, LOOP_KEYS | {"derivative_time"}),
    "pid": ({"kp", "kd"}, LOOP_KEYS | {"ki", "derivative_time"}),
    "cascade": (
        {"kp", "kv"},
        LOOP_KEYS | {"ki", "averaged", "speed_feed_forward"},
    ),
    "virtual_pd": (set(), {"bandwidth", "damping"}),
    "identify": (set(), {"drive_gain", "limit"}),
}

#: Names of methods, those of consistent estimates included.
METHOD_NAMES = (*METHODS, *CONSISTENT_METHODS)

#: Keys of a recording that a public record brings along.
SET_BY_DATASET = (
    "columns", "units", "side", "rate", "resample", "samples_axis", "position_offset", "simulated",
)  # fmt: skip


def _is_number(value: Any) -> bool:
    if not isinstance(value, (int, float)) or isinstance(value, bool):
        return False
    try:
        return math.isfinite(value)
    except OverflowError:  # a whole number of hundreds of digits
        return False


def _numbers(value: Any) -> Any:
    if _is_number(value) or (isinstance(value, list) and value and all(map(_is_number, value))):
        return value
    raise ValueError("must be a number for all joints, or a list with one number for each joint")


def _per_joint(value: Any) -> Any:
    listed = value.values() if isinstance(value, dict) else value
    if isinstance(value, (list, dict)) and value and all(map(_is_number, listed)):
        return value
    raise ValueError("must be a list with one number for each joint, or a table of joint = number")


def _paths(value: Any) -> Any:
    listed = list(value.values()) if isinstance(value, dict) else [value]
    if listed and all(isinstance(path, str) and path for path in listed):
        return value
    raise ValueError("must be a file, or a table of channel = file")


def _mask(value: Any) -> Any:
    if value == "auto" or (_is_number(value) and 0 <= value < 1):
        return value
    raise ValueError('must be "auto" or a share of the rated speed, from 0 (none) to below 1')


def _methods(value: Any) -> Any:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise ValueError(f"must be a list with some of {', '.join(METHOD_NAMES)}")
    for name in names:
        if name not in METHOD_NAMES:
            bare = name.lower().replace("_", "-").removeprefix("idim-")
            raise ValueError(f"there is no method {name!r}; {nearest(bare, METHOD_NAMES)}")
    if len(set(names)) < len(names):
        raise ValueError("names a method twice; name each one once")
    return names


def _switch(value: Any) -> Any:
    if isinstance(value, bool):
        return value
    raise ValueError("must be true or false, a boolean; names of parameters go under parameters")


def _stages(value: Any) -> Any:
    stages = value if isinstance(value, list) else [value]
    if stages and all(type(stage) is int and stage >= 1 for stage in stages):
        return tuple(stages) if isinstance(value, list) else value
    raise ValueError("must be a whole factor, or a list with the factor of each stage")


def _edge(value: Any) -> Any:
    ends = value if isinstance(value, list) else [value, value]
    if len(ends) == 2 and all(type(end) is int and end >= 0 for end in ends):
        return tuple(value) if isinstance(value, list) else value
    raise ValueError("must be a number of samples, or a list of two: at the start and at the end")


def _motion_band(value: Any) -> Any:
    if value == "auto" or (_is_number(value) and value >= 0):
        return value
    raise ValueError('must be "auto" or a frequency in Hz, 0 for no band')


Numbers = Annotated[float | list[float], PlainValidator(_numbers)]
PerJoint = Annotated[list[float] | dict[str, float], PlainValidator(_per_joint)]
Paths = Annotated[str | dict[str, str], PlainValidator(_paths)]
Mask = Annotated[Literal["auto"] | float, PlainValidator(_mask)]
Methods = Annotated[list[str], PlainValidator(_methods)]
Stages = Annotated[int | tuple[int, ...], PlainValidator(_stages)]
Edge = Annotated[int | tuple[int, int], PlainValidator(_edge)]
MotionBand = Annotated[Literal["auto"] | float, PlainValidator(_motion_band)]
Interval = Annotated[list[float], Field(min_length=2, max_length=2)]
Names = Annotated[list[str], Field(min_length=1)]


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

    @model_validator(mode="after")
    def _consistent(self) -> RobotEntry:
        if self.reduction is not None and self.reduction_matrix is not None:
            raise ValueError("reduction and reduction_matrix are both given; keep one of them")
        if not self.model.endswith((".urdf", ".urdf.gz")):
            for key in ("joints", "frozen"):
                if key in self.model_fields_set:
                    raise ValueError(f"{key} is for URDF robots, not for {self.model!r}; remove it")
        return self


class ColumnsEntry(Entry):
    """Where the channels are in the files; see `pivident.recording.columns`."""

    q: Any
    tau: Any
    q_ref: Any = None
    dq_ref: Any = None
    ddq_ref: Any = None
    q_link: Any = None  # flexible joints
    t: Any = None
    inputs: dict[str, Any] = Field(default_factory=dict)


class UnitsEntry(Entry):
    """Units of the channels; see `pivident.recording.units`."""

    q: Any = None
    tau: Any = None
    q_ref: Any = None
    dq_ref: Any = None
    ddq_ref: Any = None
    q_link: Any = None  # flexible joints
    t: Any = None
    inputs: dict[str, Any] = Field(default_factory=dict)


class RecordingEntry(Entry):
    """One run: files with columns and units, or a public record by name."""

    files: Paths | None = None
    dataset: str | None = None
    run: str | None = None
    name: str | None = None
    columns: ColumnsEntry | None = None
    units: UnitsEntry = UnitsEntry()
    side: Annotated[Any, PlainValidator(lambda value: value)] = "joint"
    rate: PositiveFloat | None = None
    resample: bool = False
    samples_axis: Literal[0, 1] | None = None
    position_offset: list[float] | None = None
    simulated: bool = False
    control_rate: PositiveFloat | None = None
    torque_timing: TorqueTiming | None = None
    delay: float | None = None
    drive_delay: NonNegativeFloat | None = None
    saturation: Saturation | None = None
    allow_constant: bool | None = None
    part: Interval | None = None

    @model_validator(mode="after")
    def _one_source(self) -> RecordingEntry:
        if (self.files is None) == (self.dataset is None):
            given = "neither is given" if self.files is None else "both are given"
            raise ValueError(f"a recording has either files or a dataset, but {given}")
        if self.files is not None and self.columns is None:
            raise ValueError("files need columns; name at least those of q and tau")
        if self.run is not None and self.dataset is None:
            raise ValueError("run belongs to a dataset; remove it")
        foreign = sorted(self.model_fields_set.intersection(SET_BY_DATASET))
        if self.dataset is not None and foreign:
            raise ValueError(
                f"the dataset {self.dataset!r} brings its own {', '.join(foreign)}; remove that, "
                "or name files instead of the dataset"
            )
        if self.part is not None and not self.part[0] < self.part[1]:
            raise ValueError(f"part = {self.part} is empty; the first time comes first")
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
    speed_feed_forward: float = 0.0
    drive_gain: Numbers = 1.0
    limit: Numbers | None = None
    feed_forward: FeedForward = "none"
    bandwidth: PositiveFloat | None = None
    damping: PositiveFloat | None = None
    reference: Literal["recorded", "smoothed", "reconstruct"] | None = None

    @model_validator(mode="after")
    def _keys_belong_to_law(self) -> ControllerEntry:
        needed, possible = LAW_KEYS[self.type]
        missing = sorted(needed - self.model_fields_set)
        if missing:
            raise ValueError(f"a {self.type} controller needs {', '.join(missing)}; add it")
        known = needed | possible | {"type", "reference"}
        foreign = sorted(self.model_fields_set - known)
        if foreign:
            raise ValueError(
                f"a {self.type} controller has no {', '.join(foreign)}; its keys are "
                f"{', '.join(sorted(known - {'type'}))}"
            )
        if self.type == "identify" and self.reference == "smoothed":
            raise ValueError(
                'a law cannot be identified from reference = "smoothed", which knows nothing of '
                'the control error; use "recorded" or "reconstruct"'
            )
        return self

    @property
    def source(self) -> Literal["recorded", "smoothed", "reconstruct"]:
        """Where the reference comes from; a virtual law was not there to record one."""
        return self.reference or ("smoothed" if self.type == "virtual_pd" else "recorded")


class BandpassEntry(Entry):
    """Options of `pivident.estimation.methods.Bandpass`."""

    cutoff: PositiveFloat | None = None
    order: Annotated[int, Field(ge=1, le=20)] | None = None
    decimation: Stages | None = None
    bandwidth: PositiveFloat | None = None
    convention: Literal["matlab", "scipy"] | None = None
    median: Annotated[int, Field(ge=1)] | None = None
    padlen: Annotated[int, Field(ge=0)] | None = None
    edge: Edge | None = None
    align: bool | None = None

    @model_validator(mode="after")
    def _one_decimation(self) -> BandpassEntry:
        if self.decimation is not None and self.bandwidth is not None:
            raise ValueError("decimation and bandwidth are both given; the factor follows from one")
        if self.median is not None and self.median % 2 == 0:
            raise ValueError(f"median = {self.median} must be an odd number of samples")
        return self


class RandomWalkEntry(Entry):
    """Options of `pivident.estimation.methods.RandomWalk`."""

    order: Literal[1, 2, 3, 4] | None = None
    passes: Annotated[int, Field(ge=1, le=10)] | None = None
    f50_max: PositiveFloat | None = None
    align: bool | None = None
    measurement_noise: Literal["white", "auto"] | None = None


class NoiseEntry(Entry):
    """Options of `AutoRegressive` noise, or with orders of `Arma`, in `estimation.methods`."""

    p_max: Annotated[int, Field(ge=1, le=5000)] | None = None
    criterion: Literal["aic", "aicc", "bic"] | None = None
    on_unmasked: bool | None = None
    motion_band: MotionBand | None = None
    repetition: bool | None = None
    period: Annotated[int, Field(ge=10)] | None = None
    ar_order: Annotated[int, Field(ge=1, le=200)] | None = None
    ma_order: Annotated[int, Field(ge=1, le=50)] | None = None
    largest_root: Annotated[float, Field(gt=0, lt=1)] | None = None

    @model_validator(mode="after")
    def _one_kind(self) -> NoiseEntry:
        arma = {"ar_order", "ma_order", "largest_root"} & self.model_fields_set
        others = {"p_max", "criterion", "motion_band", "repetition", "period"}
        others &= self.model_fields_set
        if arma and others:
            raise ValueError(
                f"{', '.join(sorted(arma))} make an ARMA model, {', '.join(sorted(others))} belong "
                "to an AR model; keep one of the two"
            )
        if self.period is not None and not self.repetition:
            raise ValueError("period belongs to noise from repetition; set repetition = true")
        return self


class SharedOptions(Entry):
    """Options that apply to every method that has them."""

    tolerance: Annotated[float, Field(gt=0, lt=1)] | None = None
    max_iterations: Annotated[int, Field(ge=1)] | None = None
    bandpass: BandpassEntry = BandpassEntry()
    random_walk: RandomWalkEntry = RandomWalkEntry()
    noise: NoiseEntry = NoiseEntry()


class MethodEntry(SharedOptions):
    """Options of one method; they win over the shared ones."""

    signals: Literal["bandpass", "random_walk"] | None = None
    prefilter: Literal["controller", "direct"] | None = None
    covariance: Literal["auto", "formula", "sandwich", "stationary"] | None = None
    start: Literal["least-squares", "initial"] | None = None
    as_printed: bool | None = None


class IdentifyEntry(SharedOptions):
    """What is estimated, and how."""

    methods: Methods | None = None
    parameters: Names | None = None
    essential: Annotated[bool, PlainValidator(_switch)] = False
    shapes: Literal["given", "identify"] = "given"
    mask: Mask = "auto"
    initial: dict[str, float] = Field(default_factory=dict)
    ols: MethodEntry = MethodEntry()
    ls: MethodEntry = MethodEntry()
    wls: MethodEntry = MethodEntry()
    iv: MethodEntry = MethodEntry()
    iv_full_rate: MethodEntry = Field(MethodEntry(), alias="iv-full-rate")
    piv: MethodEntry = MethodEntry()
    didim: MethodEntry = MethodEntry()
    piv_as_printed: MethodEntry = Field(MethodEntry(), alias="piv-as-printed")

    def of(self, method: str) -> MethodEntry:
        """The table of one method."""
        return getattr(self, method.replace("-", "_"))


class ValidationEntry(Entry):
    """How results are judged on motion that was not fitted."""

    folds: Annotated[int, Field(ge=0, le=100)] = 5
    gap: Annotated[float, Field(ge=0)] | None = None
    recording: list[RecordingEntry] = Field(default_factory=list)

    @model_validator(mode="after")
    def _one_block_is_none(self) -> ValidationEntry:
        if self.folds == 1:
            raise ValueError("folds = 1 leaves nothing to fit; use 2 or more, or 0 for none")
        return self


def _below(folder: str) -> str:
    """A folder beside or below the file: one from elsewhere must not write where it likes."""
    path = PurePath(folder)
    if path.is_absolute() or path.drive or ".." in path.parts or not is_printable(folder):
        raise ValueError(
            "must lie beside or below this file, without '..'; --out on the command line can name "
            "any other folder"
        )
    return folder


class OutputEntry(Entry):
    """Where results go and how they are headed."""

    folder: Annotated[str, Field(min_length=1), AfterValidator(_below)] | None = None
    title: str | None = None
    report: bool = True


class PayloadEntry(Entry):
    """A body of known mass on a link; see `pivident.estimation.known_payload`."""

    mass: PositiveFloat
    mass_std: NonNegativeFloat = 0.0
    center_of_mass: Annotated[list[float], Field(min_length=3, max_length=3)] | None = None
    inertia: Annotated[list[float], Field(min_length=6, max_length=6)] | None = None
    joint: JointReference | None = None


class GainsEntry(Entry):
    """What `pivident gains` takes for known; see `pivident.estimation.drive_gains`."""

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
            raise ValueError(
                "payload and [[gains.recording]], the runs taken with it, belong together; give "
                "both or neither"
            )
        return self


def _range(value: Any) -> Any:
    if isinstance(value, list) and len(value) == 2 and all(map(_is_number, value)):
        if value[0] < value[1]:
            return [float(end) for end in value]
        raise ValueError("is empty; the lower end comes first, and must be below the upper one")
    raise ValueError("must be two numbers, [lowest, highest]")


def _masses(value: Any) -> Any:
    if _range(value)[0] >= 0:
        return _range(value)
    raise ValueError("begins below zero, and no body has such a mass; begin at 0")


def _ellipsoid(value: Any) -> Any:
    if not (
        isinstance(value, list)
        and len(value) == 2
        and all(isinstance(part, list) and len(part) == 3 for part in value)
        and all(_is_number(x) for part in value for x in part)
    ):
        raise ValueError("must be [[x, y, z], [a, b, c]], centre and half axes")
    if min(value[1]) <= 0:
        raise ValueError("has a half axis that is not positive; use center_of_mass for a flat one")
    return [[float(x) for x in part] for part in value]


Range = Annotated[list[float], PlainValidator(_range)]
Ellipsoid = Annotated[list[list[float]], PlainValidator(_ellipsoid)]
Masses = Annotated[list[float], PlainValidator(_masses)]


class LinkBoundsEntry(Entry):
    """What is known about the body of one link; see `pivident.consistency`."""

    mass: Masses | None = None
    center_of_mass: Annotated[list[Range], Field(min_length=3, max_length=3)] | None = None
    ellipsoid: Ellipsoid | None = None

    @model_validator(mode="after")
    def _bounds_something(self) -> LinkBoundsEntry:
        if not self.model_fields_set:
            raise ValueError(
                "bounds nothing; give mass, center_of_mass or ellipsoid, or remove the table"
            )
        return self


class ConsistencyEntry(Entry):
    """Which real bodies the links may be, and which of them are preferred."""

    prior: Literal["entropic", "euclidean", "none"] = "entropic"
    reference: Annotated[str, Field(min_length=1)] | None = None
    margin: Annotated[float, Field(gt=0, lt=1)] | None = None
    accept_far: bool = False
    total_mass: Masses | None = None
    bounds: dict[str, LinkBoundsEntry] = Field(default_factory=dict)


class ConsistencyFile(Entry):
    """A file with nothing but ``[consistency]``, for `pivident consistent`."""

    consistency: ConsistencyEntry


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
