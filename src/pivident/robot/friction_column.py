"""A column of friction as its declaration has it: a function, its constants, what it means.

Everything that pivident does with a column follows from the declaration: values, slopes and partial
derivatives in compiled kernels (generated, see ``pivident.dynamics.generate_friction``), symbolic
models and exported programs, the signs that its parameter may have.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from enum import IntEnum
from functools import cache, cached_property
from importlib import import_module
from types import CodeType
from typing import Annotated, Any, Literal

from pivident.foundation.errors import UnusableValue
from pivident.foundation.text.plain_values import INFINITE_IN_WORDS, Name

Smoothing = Literal["sign", "atan", "tanh"]

#: Unit of a constant of shape, in terms of the joint's speed or position.
ShapeUnit = Literal["speed", "position", "1/speed", "1/position", "angle", "1"]

#: What a key of a robot file holds.
KeyValues = Literal["positive", "not negative", "number", "positive list", "flag", "name"]

#: Functions of the joint's motion that do not depend on each other, with their factors.
Functions = Mapping[tuple, float]


class SignFunction(IntEnum):
    """Code of the (smoothed) sign function in the compiled kernels."""

    SPRING = -2  # a function of the position whose torque the joint carries
    NONE = -1  # another function of the position
    SIGN = 0
    ATAN = 1
    TANH = 2
    SHARP = 3  # the sign where a term needs no smoothing


#: Sign functions of the speed, written as the expressions of columns.
SIGNS: dict[int, str] = {code: "sign(dq)" for code in SignFunction}
SIGNS |= {SignFunction.ATAN: "2/pi*atan(gamma*dq)", SignFunction.TANH: "tanh(gamma*dq)"}


@dataclass(frozen=True)
class Shape:
    """A constant that enters a friction law nonlinearly; terms that name the same one share it."""

    name: Name
    value: float
    unit: ShapeUnit
    #: Smallest value that makes sense, and largest.
    low: Annotated[float, INFINITE_IN_WORDS]
    high: Annotated[float, INFINITE_IN_WORDS]
    free: bool = True  # whether it is identified where shapes are; others stay as given

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high or not math.isfinite(self.value):
            bounds = "positive" if self.low > 0 and self.high == math.inf else "in its range"
            limits = "" if bounds == "positive" else f" ({self.low:g} to {self.high:g})"
            raise UnusableValue(f"{self.name} must be {bounds}{limits}, not {self.value}")


@dataclass(frozen=True)
class Key:
    """A key of a term's table in a robot file."""

    key: str
    meaning: str = ""  # as the error of a missing key says it
    values: KeyValues = "positive"


#: Meaning of the key that tells terms of one kind apart.
NAME_MEANING = (
    "suffix of the parameter's name where a law has several terms of the kind; lower-case letters "
    "and `_`"
)


@dataclass(frozen=True)
class Constant(Key):
    """A constant of shape: its key, its name in laws, unit, bounds and whether it is sought."""

    name: str = ""
    unit: ShapeUnit = "1"
    low: float = 0.0
    high: float = math.inf
    free: bool = True

    def at(self, value: float) -> Shape:
        """The constant with a value."""
        return Shape(self.name, value, self.unit, self.low, self.high, self.free)


@dataclass(frozen=True, kw_only=True)
class FrictionColumn:
    """One column of friction: a function of the joint's motion times one parameter.

    Its expression is written as in Python: of the speed ``dq`` and the smoothed sign ``s`` of it,
    or of the position ``q``; of the constants by their keys, two at most; with the functions ``abs
    exp sqrt sin cos max min``, and ``power`` where the exponent is a constant. With the torque
    ``load`` that the joint carries, or with a memory, it needs kernels of its own.

    Attributes:
        name: as stored robots have it.
        expression: the function; empty where it depends on the path so far.
        text: its formula with ``{stem}``, the sign ``{s}``, constants by key or as ``{shapes}``.
        constants: keys of its constants, in the order of the term's shapes.
        fewest: number of constants that are always there.
        code: in compiled kernels, of the columns of pivident.
        compiled: ``module:function`` of the generated function, of columns of other distributions.
        sharp: whether the sign needs no smoothing at values of the constants.
        speed_power: power of the speed that it grows with, or the key of the constant that is it.
        grows_with: what else it grows with, as the parameter's unit needs it.
        dissipative: whether physics demands that the parameter is not negative.
        never_negative: whether it is judged impossible if negative, though least squares may.
        carries_load: whether it is a spring, whose torque the joint carries like that of gravity.
        kinked: whether its slope jumps at standstill.
        memory: whether it depends on the path so far, by a state.
        functions: independent functions that it is a sum of, from the sign function and the
            constants; None: it is independent of all others whatever its constants.
        element: property of a simulator's joint that represents it.
        opposite: name of the column for the other direction.
        is_backwards: whether it is the one of both that acts backwards.
        words: what the parameter stands for.
        arguments: quantities that a compiled function without expression is called with.
        c_source: that function in C, for exports; empty where nobody has given it.
    """

    name: str
    expression: str
    text: str
    constants: tuple[str, ...] = ()
    fewest: int | None = None
    code: int | None = None
    compiled: str = ""
    sharp: Callable[..., bool] | None = None
    speed_power: float | str = 0.0
    grows_with: Literal["", "load", "position"] = ""
    dissipative: bool = False
    never_negative: bool = False
    carries_load: bool = False
    kinked: bool = False
    memory: bool = False
    functions: Callable[..., Functions] | None = field(default=None, repr=False)
    element: Literal["damping", "dry friction", "offset", "spring"] | None = None
    opposite: str = ""
    is_backwards: bool = False
    words: str = ""
    arguments: tuple[str, ...] = ()
    c_source: str = ""

    @cached_property
    def names(self) -> frozenset[str]:
        """Names in the expression: quantities, constants and functions."""
        return names_in(self.expression) if self.expression else frozenset()

    @property
    def of_position(self) -> bool:
        """Whether it is a function of the position."""
        return "q" in self.names

    @property
    def of_motion(self) -> bool:
        """Whether its function has several arguments, or the load; see ``own_friction``."""
        return False

    @property
    def of_load(self) -> bool:
        """Whether it grows with the torque that the joint carries."""
        return "load" in self.names

    @property
    def needs_more_than_a_sample(self) -> bool:
        """Whether it depends on the path so far or the load."""
        return self.memory or self.of_load

    @property
    def shape_counts(self) -> tuple[int, ...]:
        """How many constants a term with it may have."""
        least = len(self.constants) if self.fewest is None else self.fewest
        return tuple(sorted({least, len(self.constants)}))

    def evaluate(self, values: Sequence[float], names: Mapping[str, Any]) -> Any:
        """The expression at values of the constants, with what its other names stand for."""
        constants = dict(zip(self.constants, values, strict=False))
        return evaluated(self.expression, {**names, **constants})

    def __index__(self) -> int:
        """Number in compiled kernels: its code, or the address of its compiled function."""
        if self.code is not None:
            return self.code
        module, _, name = self.compiled.partition(":")
        return int(getattr(import_module(module), name).address)


@cache
def _compiled(expression: str) -> CodeType:
    return compile(expression, "<friction>", "eval")


def names_in(expression: str) -> frozenset[str]:
    """Names in an expression in Python's notation."""
    return frozenset(_compiled(expression).co_names)


def evaluated(expression: str, names: Mapping[str, Any]) -> Any:
    """An expression of a declaration, with what its names stand for."""
    return eval(_compiled(expression), {"__builtins__": {}}, dict(names))


def unit_on_joint(unit: str, kind: str) -> str:
    """Unit of a constant on a revolute or prismatic joint."""
    length = "rad" if kind == "revolute" else "m"
    return {
        "speed": f"{length}/s",
        "position": length,
        "1/speed": f"s/{length}",
        "1/position": f"1/{length}",
        "angle": "rad",
        "1": "1",
    }[unit]
