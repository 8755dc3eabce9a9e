"""Options that are declared once: default, limits, unit and meaning stand with the field.

    @dataclass(frozen=True)
    class Particles(Options):
        particles: int = option(500, "how many", at_least=10)

From the declaration follow the check of a value, the key of the experiment file with its row in the
manual and its field in the studio, the help of the command line, and JSON.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import MISSING, dataclass, field, fields
from functools import cache
from types import UnionType
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np
from numpy.typing import ArrayLike

from pivident.foundation.errors import ExperimentError
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.sentences import plural

#: Key of a declaration in the metadata of a field.
DECLARED = "option"


@dataclass(frozen=True)
class Option:
    """What is said of an option beside its name, its type and its default.

    Attributes:
        meaning: what it is, half a sentence.
        unit: unit of its value, empty without one.
        kind: type in words, such as ``list of names``; empty: from the annotation.
        shown: default in words where it is found out; empty: the value itself.
        at_least: smallest value that it may have, or None.
        at_most: largest value, or None.
        above: value that it has to exceed, or None.
        below: value that it has to stay below, or None.
        shared: whether a value for all methods, one level above, holds for this one.
    """

    meaning: str
    unit: str = ""
    kind: str = ""
    shown: str = ""
    at_least: float | None = None
    at_most: float | None = None
    above: float | None = None
    below: float | None = None
    shared: bool = False

    @property
    def limits(self) -> str:
        """What a number has to be, in words; empty without limits."""
        low = self.above if self.at_least is None else self.at_least
        high = self.below if self.at_most is None else self.at_most
        if low is not None and high is not None:
            return f"it lies between {low:g} and {high:g}"
        if self.above is not None:
            return "it has to be positive" if self.above == 0 else f"more than {self.above:g}"
        if self.at_least is not None:
            return "zero or more" if self.at_least == 0 else f"at least {self.at_least:g}"
        if self.below is not None:
            return f"less than {self.below:g}"
        return "" if self.at_most is None else f"at most {self.at_most:g}"

    def allows(self, value: float) -> bool:
        """Whether a number is finite and within the limits."""
        return (
            math.isfinite(value)
            and (self.at_least is None or value >= self.at_least)
            and (self.at_most is None or value <= self.at_most)
            and (self.above is None or value > self.above)
            and (self.below is None or value < self.below)
        )


def per_joint(key: str, value: ArrayLike, joints: int) -> np.ndarray:
    """One number for each joint, from one for all or one for each, shape (joints,).

    Args:
        key: what it is called.
        value: the number or numbers.
        joints: how many joints there are.

    Raises:
        ExperimentError: numbers for another number of joints.
    """
    given = np.asarray(value, dtype=float)
    if given.shape not in ((), (joints,)):
        raise ExperimentError(
            f"{key} has {plural(given.size, 'number')} for {plural(joints, 'joint')}",
            advice="give one for all or one for each",
        ).about(key)
    return np.broadcast_to(given, joints).copy()


def option(
    default: Any = MISSING,
    meaning: str = "",
    *,
    factory: Callable[[], Any] | None = None,
    **declared: Any,
) -> Any:
    """A field of a dataclass of `Options`, with its declaration.

    Args:
        default: its default.
        meaning: what it is, half a sentence.
        factory: makes the default, in its place.
        **declared: the other attributes of `Option`.
    """
    metadata = {DECLARED: Option(meaning, **declared)}
    if factory is not None:
        return field(default_factory=factory, metadata=metadata)
    return field(default=default, metadata=metadata)


@dataclass(frozen=True)
class Options(Displayed):
    """A set of options, checked when it is made.

    Raises:
        ExperimentError: names the option, the value and what it may be.
    """

    def __post_init__(self) -> None:
        for name, declared in declarations(type(self)).items():
            check_option(name, getattr(self, name), declared, choices_of(type(self), name))

    def __repr__(self) -> str:
        """The call that makes it: the options that differ from their defaults."""
        shown = [f.name for f in fields(self) if f.init and f.repr]
        texts = {name: repr(getattr(self, name)) for name in shown}
        own = [f"{n}={x}" for n, x in texts.items() if x != repr(default_of(type(self), n))]
        return f"{type(self).__name__}({', '.join(own)})"


def declarations(kind: type[Options]) -> dict[str, Option]:
    """Declared options of a class by name, in their order."""
    return {f.name: f.metadata[DECLARED] for f in fields(kind) if DECLARED in f.metadata}


def default_of(kind: type[Options], name: str) -> Any:
    """Default of an option."""
    (declared,) = (f for f in fields(kind) if f.name == name)
    if declared.default_factory is not MISSING:
        return declared.default_factory()
    return declared.default


def check_option(name: str, value: Any, declared: Option, choices: tuple[Any, ...] = ()) -> None:
    """Refuse a value that an option cannot have.

    Args:
        name: name of the option.
        value: its value; of several numbers each is checked, None is not.
        declared: its declaration.
        choices: values of a fixed list; empty: any.

    Raises:
        ExperimentError: names the option, the value and what it may be.
    """
    if value is None:
        return
    if choices and not isinstance(value, (int, float)) and value not in choices:
        raise ExperimentError(
            f"{name} is {value!r}", advice=f"choose one of {', '.join(map(repr, choices))}"
        ).about(name)
    if choices == (True, False) and not isinstance(value, bool):
        raise ExperimentError(f"{name} is {value!r}", advice="true or false").about(name)
    listed = value.values() if isinstance(value, Mapping) else value
    numbers = listed if isinstance(listed, (tuple, list)) else (listed,)
    for number in numbers if declared.limits else ():
        if isinstance(number, (int, float)) and not declared.allows(number):
            raise ExperimentError(f"{name} is {number}", advice=declared.limits).about(name)


def annotations_of(kind: type[Options]) -> dict[str, Any]:
    """Types of a class's fields by name."""
    return _hints(kind)  # type: ignore[arg-type]


@cache
def _hints(kind: object) -> dict[str, Any]:
    return get_type_hints(kind)


def choices_of(kind: type[Options], name: str) -> tuple[Any, ...]:
    """Values of a fixed list that an option has, by its annotation; empty where any will do."""
    return literals(annotations_of(kind)[name])


def literals(annotation: Any) -> tuple[Any, ...]:
    """Values of a ``Literal`` or a truth value, alone or beside other types."""
    if annotation is bool:
        return (True, False)
    if get_origin(annotation) is Literal:
        return get_args(annotation)
    if get_origin(annotation) in (Union, UnionType):
        return tuple(x for part in get_args(annotation) for x in literals(part))
    return ()
