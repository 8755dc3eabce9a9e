"""Table ``[identify]`` of an experiment file: its schema from the methods, and methods from it.

Each method has a table of its own, with the options that it declares; shared ones stand in
``[identify]`` itself. This module needs pydantic and is imported only when a file is read.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import replace
from functools import partial
from typing import TYPE_CHECKING, Annotated, Any, Literal

from pydantic import create_model, model_validator
from pydantic.functional_validators import PlainValidator

from pivident.estimation.method import Arma, AutoRegressive, InstrumentalMethod, Method, Repetition
from pivident.estimation.methods import METHODS
from pivident.estimation.signal_recipes import (
    RECIPES,
    Algebraic,
    Bandpass,
    RandomWalk,
    SignalRecipe,
    recipe_name,
)
from pivident.experiment.table_values import (
    Expected,
    Fixed,
    Limits,
    Mask,
    Names,
    entry_of,
    table_of,
)
from pivident.foundation.errors import ExperimentError, UnusableValue
from pivident.foundation.options import declarations
from pivident.foundation.text.finding import Finding, FindingKind, Topic
from pivident.foundation.text.plain_values import lists_as_tuples
from pivident.models.consistency.options import CONSISTENT_METHODS  # consistency
from pivident.robot.mdh_keys import Entry, LaterTable, key
from pivident.robot.naming import nearest

#: A median filter that not all methods have.
MEDIAN = FindingKind(Topic("methods"), "median", ("identify", "bandpass", "median"))

#: Names of methods, those of consistent estimates included.
METHOD_NAMES = (*METHODS, *CONSISTENT_METHODS)

#: Options that make the noise model an ARMA one.
_ARMA = {"ar_order", "ma_order", "largest_root"}


def _methods(value: Any) -> Any:
    names = [value] if isinstance(value, str) else value
    if not isinstance(names, list) or not names or not all(isinstance(n, str) for n in names):
        raise ValueError(
            f"must be a list with some of {', '.join(METHODS)}, each also with the prefix pc-"
        )
    for name in names:
        if name not in METHOD_NAMES:
            bare = name.lower().replace("_", "-").removeprefix("idim-")
            raise UnusableValue(f"there is no method {name!r}", advice=nearest(bare, METHOD_NAMES))
    if len(set(names)) < len(names):
        raise UnusableValue("names a method twice", advice="name each one once")
    return names


def _switch(value: Any) -> Any:
    if isinstance(value, bool):
        return value
    raise UnusableValue(
        "must be true or false, a boolean", advice="names of parameters go under parameters"
    )


class DecimatedEntry(Entry):
    """What tables of recipes share whose equations are decimated."""

    @model_validator(mode="after")
    def _one_decimation(self) -> DecimatedEntry:
        values = self.model_dump(exclude_none=True)
        if "decimation" in values and "bandwidth" in values:
            raise ExperimentError(
                "decimation and bandwidth are both given", advice="the factor follows from one"
            ).about("decimation")
        return self


class BandpassKeys(DecimatedEntry):
    """What the table of a band-pass refuses beside."""

    @model_validator(mode="after")
    def _odd_median(self) -> BandpassKeys:
        Bandpass(**self.model_dump(include={"median"}, exclude_none=True))
        return self


class NoiseKeys(Entry):
    """What the table of a noise model has beside the options of one."""

    repetition: bool | None = key(
        None,
        "fit it to what does not repeat of a periodic or repeated motion: noise alone, "
        "without model error",
        shown="`false`",
    )

    @model_validator(mode="after")
    def _one_kind(self) -> NoiseKeys:
        arma = _ARMA & self.model_fields_set
        others = {"p_max", "criterion", "motion_band", "repetition", "period"}
        others &= self.model_fields_set
        if arma and others:
            raise ExperimentError(
                f"{', '.join(sorted(arma))} make an ARMA model, {', '.join(sorted(others))} "
                "belong to an AR model",
                advice="keep one of the two",
            ).about(min(arma))
        if "period" in self.model_fields_set and not self.repetition:
            raise ExperimentError(
                "period belongs to noise from repetition", advice="set repetition = true"
            ).about("period")
        return self


BandpassEntry = entry_of(Bandpass, base=BandpassKeys, module=__name__)
AlgebraicEntry = entry_of(Algebraic, base=DecimatedEntry, module=__name__)
RandomWalkEntry = entry_of(RandomWalk, module=__name__)
NoiseEntry = entry_of(
    AutoRegressive, Repetition, Arma, base=NoiseKeys, name="NoiseEntry", module=__name__
)

#: Tables below that of a method.
PARTS: dict[str, type[Entry]] = {
    "bandpass": BandpassEntry,
    "algebraic": AlgebraicEntry,
    "random_walk": RandomWalkEntry,
    "noise": NoiseEntry,
}


class ConstraintEntry(Entry):
    """A linear equation between parameters."""

    coefficients: dict[str, float] = key(
        meaning="factors by parameter name", unit="1/parameter", kind="table"
    )
    value: float = key(0.0, "what they sum up to")


class IdentifyKeys(Entry):
    """What is estimated, and options for all methods that have them."""

    methods: Annotated[list[str], PlainValidator(_methods)] | None = key(
        None,
        f"{', '.join(f'`{name}`' for name in METHODS)}; with `pc-` in front, as in `pc-piv`, also "
        "made physically consistent; default `ls`, `iv-full-rate`, `piv`, with a controller also "
        "`iv`",
        shown="see meaning",
    )
    parameters: Names | None = key(
        None, "base parameters to estimate; the others are assumed to be zero", shown="all"
    )
    essential: Annotated[bool, PlainValidator(_switch)] = key(
        False,
        "before the methods start, leave out the parameters that the data do not support, "
        "one at a time; with the last method",
    )
    shapes: Literal["given", "identify"] = key(
        "given",
        "identify the free constants of the friction laws (Stribeck speeds, presliding "
        "distances, exponents) with the last method before the methods start; see "
        "[`friction_laws.md`](friction_laws.md)",
        kind='`"given"` or `"identify"`',
    )
    free: Names | None = key(
        None,
        "causes of model error that are corrected with the estimate: `delay`, `geometry`, "
        "`gear-ratio`, `torque-gain`, `zero-position`, `position-scale`, `encoder`, "
        "`encoder-coupling`; see [causes of model error](theory/model_errors.md)",
        kind="list of kinds",
        shown="–",
    )
    temperature: str | list[str] | dict[str, Any] | None = key(
        None,
        "temperatures of motors or gears in the logs, one column or one for each joint: viscous "
        "and Coulomb friction that change with them are brought to one temperature, where unseen "
        "motion confirms the change; see [friction that warms up](how_to/drift.md#within-a-record)",
        unit="°C or K",
        kind="columns",
    )
    reference_temperature: float | None = key(
        None,
        "temperature that friction belongs to",
        unit="as `temperature`",
        shown="the mean of the record",
    )
    mask: Mask = key(
        "auto",
        "samples of slower joints are excluded; `auto`: 0.01, but `piv` uses standstill "
        "where it is worth it",
        unit="of rated speed",
        kind='`"auto"` or number',
    )
    initial: dict[str, float] = key(
        meaning="starting values by parameter name", factory=dict, unit="of the parameter"
    )
    fixed: Fixed = key(
        meaning='values by parameter name that are known and not estimated; `"description"`: those '
        "that the description knows of parameters that are not among `parameters`",
        factory=dict,
        unit="of the parameter",
        kind='`"description"` or table',
    )
    bounds: Limits = key(
        meaning="least and largest value by parameter name, as in "
        '`{fv1 = [0.0, "none"]}`; of `ls`, `iv`, `piv` and fitted simulations',
        factory=dict,
        unit="of the parameter",
        kind="table of lists",
    )
    priors: Expected = key(
        meaning="expected value and its standard deviation by parameter name, as in "
        "`{zz1r = [0.89, 0.05]}`; of `ls`, `iv` and `piv`",
        factory=dict,
        unit="of the parameter",
        kind="table of lists",
    )
    constraints: list[ConstraintEntry] = key(
        meaning="linear equations between parameters; of `ls`, `iv` and `piv`", factory=list
    )
    weights: dict[str, float] = key(
        meaning="what the torque of a joint counts beside the others: 4 as if its standard "
        "deviation were half as large",
        factory=dict,
    )
    without_equation: list[str] = key(
        meaning="joints whose motion counts and whose torque does not", factory=list,
        kind="list of names",
    )  # fmt: skip
    if TYPE_CHECKING:
        bandpass: Any

    def of(self, method: str) -> Entry:
        """The table of one method; one without keys where the file has none."""
        table: Entry | None = getattr(self, method.replace("-", "_"))
        return METHOD_ENTRIES[method]() if table is None else table

    @property
    def with_tables(self) -> tuple[str, ...]:
        """Methods that have a table of their own in the file."""
        given = self.model_fields_set
        return tuple(name for name in METHOD_ENTRIES if name.replace("-", "_") in given)


#: Meaning of a table that also stands in ``[identify]``.
SHARED = "as in `[identify]`"


def _signals_key(method: Method) -> Any:
    """Words of the key that chooses among recipes."""
    names = [f'`"{recipe}"`' for recipe in method.recipes]
    meaning = f"{', '.join(names[:-1])} or {names[-1]}"
    return key(None, meaning, shown=f'`"{recipe_name(method.signals)}"`')


def method_entry(name: str, method: Method) -> type[Entry]:
    """Schema of a method's own table: its options, and tables of its recipes."""
    fields: dict[str, Any] = {}
    for name_of_key in method.keys:
        if name_of_key == "signals":
            if len(method.recipes) > 1:
                fields["signals"] = (Literal[tuple(RECIPES)] | None, _signals_key(method))
            fields |= {recipe: table_of(PARTS[recipe], SHARED) for recipe in method.recipes}
        elif name_of_key in PARTS:
            fields[name_of_key] = table_of(PARTS[name_of_key], SHARED)
    return entry_of(
        type(method), keys=[k for k in method.keys if k not in ("signals", *PARTS)],
        name=_title(name), further=fields, module=__name__,
    )  # fmt: skip


def _title(method: str) -> str:
    """Name of the schema of a method's table."""
    return f"{''.join(word.capitalize() for word in method.split('-'))}Entry"


class MethodEntries(Mapping[str, type[Entry]]):
    """Schemas of the tables of all methods, by name: a file needs those of its own methods."""

    def __init__(self) -> None:
        self._made: dict[str, type[Entry]] = {}

    def __getitem__(self, name: str) -> type[Entry]:
        if name not in self._made:
            self._made[name] = method_entry(name, METHODS[name])
        return self._made[name]

    def __iter__(self) -> Iterator[str]:
        return iter(METHODS.usable_names)

    def __len__(self) -> int:
        return len(METHODS.usable_names)


#: Tables of all methods, by name.
METHOD_ENTRIES = MethodEntries()


def __getattr__(name: str) -> type[Entry]:
    """The schema of a method's table: other processes find a class by its name."""
    for method in METHOD_ENTRIES:
        if name == _title(method):
            return METHOD_ENTRIES[method]
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def _later_table(name: str) -> Any:
    """A field for a method's own table, as `create_model` takes it."""
    entry = LaterTable(partial(METHOD_ENTRIES.__getitem__, name))
    meaning = f"of this method alone, see *{name}*"
    return (entry, key(None, meaning, alias=name, kind="table", shown="`{}`"))


#: With the options that methods share.
SharedKeys = entry_of(
    InstrumentalMethod, keys=[k for k, o in declarations(InstrumentalMethod).items() if o.shared],
    base=IdentifyKeys, name="SharedKeys", module=__name__,
)  # fmt: skip

if TYPE_CHECKING:
    IdentifyEntry = IdentifyKeys
else:
    IdentifyEntry = create_model(
        "IdentifyEntry",
        __base__=SharedKeys,
        __module__=__name__,
        **{part: table_of(entry, f"see *{part}*") for part, entry in PARTS.items()},
        **{name.replace("-", "_"): _later_table(name) for name in METHOD_ENTRIES},
    )
    IdentifyEntry.__doc__ = IdentifyKeys.__doc__


def method_of(name: str, entry: IdentifyEntry) -> Method:
    """One method with the file's options: the shared ones, and then those of its own table.

    Raises:
        ExperimentError: options that contradict one another.
    """
    ready, table = METHODS[name], entry.of(name)
    declared = declarations(type(ready))
    keys = table.model_dump(exclude_unset=True)
    with concerning_method(name):
        ready.check_keys(keys)
        _check_signals(ready, keys)
        shared = [k for k in ready.keys if declared[k].shared and k in entry.model_fields_set]
        options = {k: getattr(entry, k) for k in shared}
        options |= {k: keys[k] for k in keys if k in declared}
        options["signals"] = _signals(entry, ready, keys)
        if "noise" in ready.keys:
            options["noise"] = _noise(_given(entry, "noise"), keys.get("noise", {}))
        return replace(ready, **{k: lists_as_tuples(value) for k, value in options.items()})


def median_finding(methods: Mapping[str, Method]) -> Finding | None:
    """That a median filter of the positions is not in all methods; None where it is, or is none."""
    passes = {n: m.signals for n, m in methods.items() if isinstance(m.signals, Bandpass)}
    acts = {name: s.median for name, s in passes.items() if s.median > 1}
    others = [name for name in methods if name not in acts]
    if not acts or not others:
        return None
    text = (
        f"The median filter of the positions (bandpass.median = {max(acts.values())}) acts on "
        f"{', '.join(acts)} only: {', '.join(others)} smooth them in another way."
    )
    step = (
        "Positions that leave the motion and come back are left out of all methods without it; "
        "repair smaller outliers in the log."
    )
    return MEDIAN.finding("warning", text, "", step)


@contextmanager
def concerning_method(name: str) -> Iterator[None]:
    """Errors inside name the table of a method."""
    try:
        yield
    except ExperimentError as error:
        raise error.within(f"identify.{name}") from error


def _check_signals(ready: Method, keys: Mapping[str, Any]) -> None:
    """Refuse signals that the method does not take, and the table of those that are not used."""
    used = keys.get("signals") or recipe_name(ready.signals)
    if used not in ready.recipes:
        alike = [
            repr(name)
            for name, method in METHODS.usable().items()
            if type(method) is type(ready) and used in method.recipes
        ]
        raise ExperimentError(
            f"signals are {used!r}",
            advice=f"it takes {' or '.join(map(repr, ready.recipes))}, and {', '.join(alike)} is "
            f"the same with {used!r}",
        ).about("signals")
    for unused in sorted(set(keys) & (set(RECIPES) - {used})):
        raise ExperimentError(
            f"{unused} is given, but the signals are {used!r}",
            advice=f'set signals = "{unused}" or remove the table',
        ).about(unused)


def _signals(entry: IdentifyEntry, ready: Method, keys: Mapping[str, Any]) -> SignalRecipe:
    """The recipe that a file names, or that the method has."""
    name = keys.get("signals") or recipe_name(ready.signals)
    shared, special = _given(entry, name), keys.get(name, {})
    # A factor excludes a bandwidth; the method's own choice replaces the shared one.
    for one, other in (("decimation", "bandwidth"), ("bandwidth", "decimation")):
        if one in special:
            shared.pop(other, None)
    options = shared | special
    is_full_rate = isinstance(ready.signals, RandomWalk)
    if name == "algebraic" and is_full_rate and not options.keys() & {"decimation", "bandwidth"}:
        options["decimation"] = 1
    return RECIPES[name](**{k: lists_as_tuples(value) for k, value in options.items()})


def _noise(shared: dict[str, Any], special: dict[str, Any]) -> AutoRegressive | Arma:
    """The noise model; one of another kind replaces the shared one."""
    options = special if special.keys() & _ARMA else shared | special
    if options.keys() & _ARMA:
        return Arma(**options)
    repeated = options.pop("repetition", False)
    return (Repetition if repeated else AutoRegressive)(**options)


def _given(entry: IdentifyEntry, table: str) -> dict[str, Any]:
    """What the file says in a shared table, without what it leaves to the defaults."""
    return dict(getattr(entry, table).model_dump(exclude_unset=True))
