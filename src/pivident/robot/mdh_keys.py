"""Keys of a modified DH file, their types and defaults, and actionable errors.

This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin

from pydantic import (
    BaseModel,
    BeforeValidator,
    ConfigDict,
    Field,
    NonNegativeFloat,
    PositiveFloat,
    ValidationError,
    create_model,
    model_validator,
)
from pydantic.fields import FieldInfo
from pydantic_core import core_schema

from pivident.foundation.errors import RobotDescriptionError, UnusableValue
from pivident.foundation.options import DECLARED, Option
from pivident.robot.description import MAX_JOINTS, STANDARD_GRAVITY
from pivident.robot.friction_column import Key, KeyValues, Smoothing
from pivident.robot.friction_terms import TERM_KINDS
from pivident.robot.naming import nearest

GRAVITY_BY_NAME = {
    "none": [0.0, 0.0, 0.0],
    "-x": [-STANDARD_GRAVITY, 0.0, 0.0],
    "+x": [STANDARD_GRAVITY, 0.0, 0.0],
    "-y": [0.0, -STANDARD_GRAVITY, 0.0],
    "+y": [0.0, STANDARD_GRAVITY, 0.0],
    "-z": [0.0, 0.0, -STANDARD_GRAVITY],
    "+z": [0.0, 0.0, STANDARD_GRAVITY],
}

#: Maximum number of problems in one error, and of characters of a quoted value.
MAX_PROBLEMS, MAX_VALUE = 20, 60

#: Keys of each friction term: those it needs, and those it may have.
TERM_KEYS = {name: kind.arguments for name, kind in TERM_KINDS.usable().items()}

#: The keys of all friction terms by name; where several terms have one, it means the same.
_KEYS = {entry.key: entry for kind in TERM_KINDS.usable().values() for entry in kind.keys}


def _gravity(value: Any) -> Any:
    if isinstance(value, str):
        if value not in GRAVITY_BY_NAME:
            raise ValueError(
                f"gravity is one of {', '.join(GRAVITY_BY_NAME)} (where it points in the base "
                "frame) or three numbers in m/s²"
            )
        return GRAVITY_BY_NAME[value]
    if not isinstance(value, list):
        raise ValueError(
            "gravity is a vector of three numbers in m/s², such as [0, 0, -9.81] in the base frame"
        )
    return value


Vector3 = Annotated[list[float], Field(min_length=3, max_length=3)]
Vector6 = Annotated[list[float], Field(min_length=6, max_length=6)]
Gravity = Annotated[Vector3, BeforeValidator(_gravity)]
JointReference = Annotated[
    str, BeforeValidator(lambda value: str(value) if type(value) is int else value)
]


class Entry(BaseModel):
    """A table of the file: unknown keys, wrong types, NaN and infinity are refused."""

    model_config = ConfigDict(
        extra="forbid", strict=True, frozen=True, allow_inf_nan=False, defer_build=True
    )


class LaterTable:
    """Annotation of a table whose schema is made when a file has it, or the manual shows it.

    Args:
        make: gives the schema.
    """

    def __init__(self, make: Callable[[], type[Entry]]) -> None:
        self._make = make

    def __or__(self, other: Any) -> Any:
        """Beside None, as of any annotation."""
        return Union[self, other]  # noqa: UP007

    @property
    def entry(self) -> type[Entry]:
        """The schema."""
        return self._make()

    def __get_pydantic_core_schema__(self, source: Any, handler: Any) -> Any:
        """Values are those of the schema, and so are errors, below the key of the table."""
        plain = core_schema.plain_serializer_function_ser_schema(_dumped, info_arg=True)
        return core_schema.no_info_plain_validator_function(
            lambda value: self.entry.model_validate(value), serialization=plain
        )


def _dumped(table: Entry | None, info: Any) -> Any:
    """A table as plain values, as the whole that it belongs to is asked for."""
    if table is None:
        return None
    return table.model_dump(
        mode=info.mode, by_alias=info.by_alias, exclude_unset=info.exclude_unset,
        exclude_none=info.exclude_none, exclude_defaults=info.exclude_defaults,
    )  # fmt: skip


def key(
    default: Any = ...,
    meaning: str = "",
    *,
    factory: Callable[[], Any] | None = None,
    alias: str | None = None,
    **declared: Any,
) -> Any:
    """A field of a table with what the manual says of it (`pivident.foundation.options`)."""
    words: Any = {DECLARED: Option(meaning, **declared)}
    if factory is not None:
        return Field(default_factory=factory, alias=alias, json_schema_extra=words)
    return Field(default, alias=alias, json_schema_extra=words)


def empty_table(entry: type[Entry], meaning: str, **declared: Any) -> Any:
    """A field that holds a table, empty where a file has none; nothing of that is to be checked."""
    return key(meaning=meaning, factory=entry.model_construct, **declared)


def declared_of(field: FieldInfo) -> Option | None:
    """Declaration of a field; None for one without."""
    words: Any = field.json_schema_extra or {}
    option: Option | None = words.get(DECLARED)
    return option


def _known_term(value: Any) -> Any:
    """Refuse an unknown term with the nearest known one, not with a list of all."""
    if isinstance(value, str) and value not in TERM_KEYS:
        raise UnusableValue("there is no such friction term", advice=nearest(value, TERM_KEYS))
    return value


def _keys_belong_to_term(entry: Any) -> Any:
    """Refuse keys that the term does not have, and name those that it lacks."""
    needed, possible = TERM_KEYS[entry.term]
    given = entry.model_fields_set - {"term"}
    foreign = sorted(given - needed - possible)
    if foreign:
        own = sorted(needed | possible)
        advice = f"it has {', '.join(own)}" if own else "remove the key"
        raise UnusableValue(f"the term {entry.term!r} has no {', '.join(foreign)}", advice=advice)
    missing = sorted(needed - given)
    if missing:
        wanted = " and ".join(_KEYS[name].meaning for name in missing)
        raise ValueError(f"the term {entry.term!r} needs {wanted} ({', '.join(missing)})")
    return entry


#: What the keys of friction terms hold, and their defaults where that is not the term's.
_VALUES: dict[KeyValues, tuple[Any, Any]] = {
    "positive": (PositiveFloat | None, None),
    "not negative": (NonNegativeFloat | None, None),
    "number": (float | None, None),
    "positive list": (Annotated[list[PositiveFloat], Field(min_length=1)] | None, None),
    "flag": (bool, True),
    "name": (Annotated[str, Field(pattern="^[a-z_]+$")] | None, None),
}


def _field(name: str, entry: Key) -> tuple[Any, Any]:
    """Type and declaration of a key, which says for which terms it is needed."""
    values, default = _VALUES[entry.values]
    needed = [f"`{term}`" for term, (always, _) in TERM_KEYS.items() if name in always]
    shown = f"needed for {', '.join(needed)}" if needed else "" if default else "see meaning"
    kind = "list of numbers" if entry.values == "positive list" else ""
    return values, key(default, entry.meaning.removeprefix("its "), shown=shown, kind=kind)


#: One term of a friction law; shapes are SI (gamma in s/rad or s/m) whatever the units.
FrictionEntry: Any = cast(Any, create_model)(
    "FrictionEntry",
    __base__=Entry,
    __validators__={"keys": cast(Any, model_validator(mode="after")(_keys_belong_to_term))},
    term=(
        Annotated[Literal[tuple(TERM_KEYS)], BeforeValidator(_known_term)],
        key(meaning="which function, see the list below", kind="name"),
    ),
    smoothing=(
        Smoothing,
        key(
            "atan",
            'sign function: `"sign"`, `"atan"` for (2/π) atan(γ dq), `"tanh"` for tanh(γ dq)',
        ),
    ),
    gamma=(
        PositiveFloat | None,
        key(None, "slope γ of the smoothed sign", unit="s/rad or s/m", shown="750 / rated speed"),
    ),
    **{name: _field(name, entry) for name, entry in _KEYS.items()},
)


def _terms(value: Any) -> Any:
    if isinstance(value, list) and all(isinstance(term, (dict, str)) for term in value):
        return [{"term": term} if isinstance(term, str) else term for term in value]
    named = value if isinstance(value, str) and value in ("sign", "atan", "tanh") else "tanh"
    raise UnusableValue(
        'must be a list of terms, such as ["viscous", {term = "coulomb", smoothing = '
        f'"{named}"}}, "offset"]',
        advice=f"terms are {', '.join(TERM_KEYS)}",
    )


FrictionTerms = Annotated[list[FrictionEntry], BeforeValidator(_terms)]


class LinkEntry(Entry):
    """A body, either at the frame's origin or at its centre of mass."""

    name: str | None = None
    mass: NonNegativeFloat
    first_moments: Vector3 | None = None
    inertia_at_origin: Vector6 | None = None
    center_of_mass: Vector3 | None = None
    inertia_at_center_of_mass: Vector6 | None = None

    @model_validator(mode="after")
    def _one_reference_point(self) -> LinkEntry:
        at_origin = {"first_moments", "inertia_at_origin"} & self.model_fields_set
        at_center = {"center_of_mass", "inertia_at_center_of_mass"} & self.model_fields_set
        if at_origin and at_center:
            raise ValueError(
                f"{', '.join(sorted(at_origin))} and {', '.join(sorted(at_center))} contradict: "
                "describe the body at the frame's origin or at its centre of mass, not both"
            )
        return self


class JointEntry(Entry):
    """One row of the table."""

    name: Annotated[str, Field(min_length=1)]
    kind: Literal["revolute", "prismatic", "fixed"] = "revolute"
    parent: str | None = None
    gamma: float = 0.0
    b: float = 0.0
    alpha: float = 0.0
    d: float = 0.0
    theta: float = 0.0
    r: float = 0.0
    position_limits: Annotated[list[float], Field(min_length=2, max_length=2)] | None = None
    rated_speed: PositiveFloat | None = None
    torque_limit: PositiveFloat | None = None
    rotor_inertia: NonNegativeFloat = 0.0
    friction: FrictionTerms | None = None
    nominal_friction: dict[str, float] = {}
    link: LinkEntry | None = None
    passive: bool = False
    body: bool = True
    posture: float = 0.0

    @model_validator(mode="after")
    def _passive_joints_have_no_motor(self) -> JointEntry:
        given = {"rotor_inertia", "torque_limit"} & self.model_fields_set
        if self.passive and given:
            raise UnusableValue(
                f"a passive joint has no {', '.join(sorted(given))}",
                advice="remove the key, or passive",
            )
        if not self.body and self.link is not None:
            raise UnusableValue("body = false and a link contradict", advice="remove one of them")
        return self

    @model_validator(mode="after")
    def _fixed_joints_do_not_move(self) -> JointEntry:
        motion = {
            "position_limits",
            "rated_speed",
            "torque_limit",
            "rotor_inertia",
            "friction",
            "nominal_friction",
            "passive",
            "body",
            "posture",
        }
        if self.kind == "fixed" and motion & self.model_fields_set:
            listed = ", ".join(sorted(motion & self.model_fields_set))
            raise UnusableValue(f"a fixed joint has no {listed}", advice="remove the key")
        return self


class CouplingEntry(Entry):
    """A motor that also turns with a second joint."""

    motor: JointReference = key(
        meaning="name or number (from 1) of the joint whose motor is coupled", kind="joint"
    )
    joint: JointReference = key(meaning="the joint that moves this motor along", kind="joint")
    reduction: float | None = None
    ratio: float | None = key(
        None, "rotor speed per speed of `joint`, on the side of `motor`", shown="from the reduction"
    )
    parameters: list[Literal["iam", "fvm", "fcm"]] = key(
        ["iam", "fvm", "fcm"], "parameters of the coupling: inertia, viscous, Coulomb"
    )
    nominal: dict[Literal["iam", "fvm", "fcm"], float] = {}

    @model_validator(mode="after")
    def _nominal_values_belong_to_parameters(self) -> CouplingEntry:
        foreign = set(self.nominal) - set(self.parameters)
        if foreign:
            raise UnusableValue(
                f"nominal {', '.join(sorted(foreign))}: not among the coupling's parameters "
                f"({', '.join(self.parameters) or 'none'})",
                advice="add it there or remove the value",
            )
        return self


class EndEntry(Entry):
    """A frame of a moving link, or of the base."""

    link: Annotated[str, Field(min_length=1)]
    at: Vector3 = [0.0, 0.0, 0.0]
    rpy: Vector3 = [0.0, 0.0, 0.0]


class LoopEntry(Entry):
    """Two frames that meet where a loop was cut."""

    name: Annotated[str, Field(min_length=1)]
    closes: Literal["point", "axis", "full"]
    first: EndEntry
    second: EndEntry


class GearEntry(Entry):
    """Joints that move in proportion, the sum of ratio times position is the offset."""

    name: Annotated[str, Field(min_length=1)]
    ratios: Annotated[dict[str, float], Field(min_length=2)]
    offset: float = 0.0


class TransmissionEntry(Entry):
    """Motor side to joint side, one number for each moving joint in order."""

    reduction: list[float] | None = None
    reduction_matrix: list[list[float]] | None = None
    drive_gain: list[float] | None = None
    position_offset: list[float] | None = None

    @model_validator(mode="after")
    def _one_reduction(self) -> TransmissionEntry:
        if self.reduction is not None and self.reduction_matrix is not None:
            raise UnusableValue(
                "reduction and reduction_matrix are both given", advice="keep one of them"
            )
        return self


class TableFile(Entry):
    """The whole file."""

    name: Annotated[str, Field(min_length=1)]
    description: str = ""
    units: Literal["radians", "degrees"] = "radians"
    gravity: Gravity = GRAVITY_BY_NAME["-z"]
    friction: FrictionTerms | None = None
    joints: Annotated[list[JointEntry], Field(min_length=1, max_length=MAX_JOINTS)]
    couplings: list[CouplingEntry] = []
    loops: list[LoopEntry] = []
    gears: list[GearEntry] = []
    floating_base: LinkEntry | None = None
    transmission: TransmissionEntry = Field(default_factory=TransmissionEntry.model_construct)


def validated(content: dict[str, Any]) -> TableFile:
    """The content of a file as a checked object."""
    if "recording" in content and "joints" not in content:
        raise RobotDescriptionError(
            "this is an experiment file, not a robot",
            advice="name the file or the gallery name that it gives for robot ([[joints]] "
            "describes a robot)",
        )
    try:
        return TableFile.model_validate(content)
    except ValidationError as error:
        found = error.errors()
        problems = [_explained(details, content) for details in found[:MAX_PROBLEMS]]
        if len(found) > MAX_PROBLEMS:
            problems.append(UnusableValue(f"and {len(found) - MAX_PROBLEMS} more"))
        more = "".join(f"\n  {problem}" for problem in problems[1:])
        raise RobotDescriptionError.of_part("", problems[0].followed_by(more)) from None


def _explained(details: Any, content: dict[str, Any]) -> UnusableValue:
    """What is wrong with a value, with its row in front."""
    where, key = _place(details["loc"], content)
    if details["type"] == "extra_forbidden":
        *table, last = details["loc"]
        near = nearest(str(last), keys_at(TableFile, table))
        return UnusableValue(f"{where}unknown key {key!r}", advice=near)
    if details["type"] == "missing":
        added = addition(TableFile, details["loc"])
        return UnusableValue(f"{where}key {key!r} is missing", advice=added)
    if details["type"] == "model_type":
        return UnusableValue(
            f"{where}{key or 'this entry'} must be a table of keys, not {short(details['input'])}"
        )
    if key:
        named = "" if isinstance(details["input"], dict) else f" = {short(details['input'])}"
        where = f"{where}key {key!r}{named}: "
    return UnusableValue.of_part(where, reason(details))


def reason(details: Any) -> Exception:
    """Why pydantic refuses a value: the error that was raised, or its own words in ours."""
    error = details.get("ctx", {}).get("error")
    if isinstance(error, Exception):
        return error
    message = details["msg"].replace(" after validation", "")
    for theirs, ours in (
        ("Input should be", "must be"),
        ("List should", "must"),
        ("Dictionary should", "must"),
    ):
        message = message.replace(theirs, ours)
    return UnusableValue(message)


def short(value: Any) -> str:
    """A value as messages quote it."""
    try:
        text = repr(value)
    except ValueError:  # a whole number of thousands of digits
        return "a number of thousands of digits"
    return text if len(text) <= MAX_VALUE else f"{text[: MAX_VALUE - 1]}…"


def _place(loc: Sequence[int | str], content: dict[str, Any]) -> tuple[str, str]:
    """The joint (or other row) that a location belongs to, and the key within it."""
    if len(loc) < 2 or not isinstance(loc[1], int):
        return "", ".".join(map(str, loc))
    table, row = str(loc[0]), int(loc[1])
    entry = content[table][row]
    singular = {"joints": "joint", "couplings": "coupling", "loops": "loop", "gears": "gear"}.get(
        table, table
    )
    name = entry.get("name") if isinstance(entry, dict) else None
    label = repr(name) if isinstance(name, str) else f"number {row + 1}"
    return f"{singular} {label}: ", ".".join(map(str, loc[2:]))


def keys_at(root: type[BaseModel], loc: Sequence[int | str]) -> list[str]:
    """Known keys of the table at a location of a file whose content is ``root``."""
    return list(fields_of(table_at(root, loc)))


def table_at(root: type[BaseModel], loc: Sequence[int | str]) -> type[BaseModel]:
    """The table at a location of a file."""
    model = root
    for part in loc:
        fields = fields_of(model)
        if part in fields:
            model = _model_in(fields[str(part)].annotation) or model
    return model


def fields_of(model: type[BaseModel]) -> dict[str, FieldInfo]:
    """Fields of a table by the names that a file has, in order."""
    return {field.alias or name: field for name, field in model.model_fields.items()}


def addition(root: type[BaseModel], loc: Sequence[int | str]) -> str:
    """Advice for a missing key: add it, with its values where they form a fixed list."""
    *table, last = loc
    for name, field in table_at(root, table).model_fields.items():
        if last in (name, field.alias) and get_origin(field.annotation) is Literal:
            return f"add it, one of {', '.join(map(repr, get_args(field.annotation)))}"
    return "add it"


def _model_in(annotation: Any) -> type[BaseModel] | None:
    """The table inside ``list[Table]``, ``Table | None`` and the like."""
    if isinstance(annotation, LaterTable):
        return annotation.entry
    if isinstance(annotation, type) and issubclass(annotation, BaseModel):
        return annotation
    return next((m for m in map(_model_in, get_args(annotation)) if m is not None), None)
