"""One term of a friction law: a function of motion times one parameter, and its table in a file.

The functions have five kinds of argument: the speed; the position (ripple, springs); the torque
that the joint carries (load-dependent friction); the path so far (presliding, where friction has
a state z that remembers the last reversals); constants of shape such as the Stribeck speed, which
enter nonlinearly. They are declared in ``pivident.robot.friction_terms``.

The smoothed sign functions are

    s(dq) = sign(dq),   (2/π) atan(γ dq)   or   tanh(γ dq)

and a term with the hard ``sign`` is simulated with the arctangent of the same γ, because the
simulation needs a finite slope at rest.

A friction term as robot files name it: one table of the file, one column or more.

Keys of robot files and how a law is written into one follow from the declaration, the candidates of
``pivident laws``, and the causes of model error.
"""

from __future__ import annotations

import inspect
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Annotated, Any

from pivident.foundation.errors import UnknownName, UnusableValue, require_kind
from pivident.foundation.text.display import Displayed
from pivident.foundation.text.plain_values import Called, Limits, Name
from pivident.robot.friction_column import (
    Constant,
    FrictionColumn,
    Key,
    Shape,
    SignFunction,
    Smoothing,
)
from pivident.robot.naming import nearest

#: γ times rated speed: 150 s/rad (Brunot et al. 2018) on the TX40's first axis of 5 rad/s.
SLOPE_AT_RATED_SPEED = 750.0
#: Constants of shape that the compiled kernels take with each term, besides γ.
MAX_SHAPES = 4
#: The smoothed signs in formulas.
_SIGNS = {"sign": "sign(dq)", "atan": "(2/π) atan(γ dq)", "tanh": "tanh(γ dq)"}


@dataclass(frozen=True)
class FrictionTerm(Displayed):
    """One column of friction: parameter name stem, function and shape.

    Attributes:
        stem: stem of the parameter's name (``fv``, ``fc``, ``off`` …).
        column: which function.
        smoothing: how the sign function is smoothed, where the column has one.
        gamma: slope of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.
        shapes: constants of the function, in the order that its kernel expects.
    """

    stem: Annotated[Name, Limits(min_length=1)]
    column: Annotated[FrictionColumn, Called("function")]
    smoothing: Smoothing = "atan"
    gamma: float | None = None
    shapes: tuple[Shape, ...] = ()

    def __post_init__(self) -> None:
        require_kind("column", self.column, FrictionColumn, "friction.terms has one for each name")
        if self.gamma is not None and not (math.isfinite(self.gamma) and self.gamma > 0):
            raise UnusableValue(f"gamma of {self.stem!r} must be positive, not {self.gamma}")
        allowed = self.column.shape_counts
        if len(self.shapes) not in allowed:
            raise UnusableValue(
                f"the term {self.stem!r} ({self.column.name}) has {len(self.shapes)} constants of "
                "shape",
                advice=f"it needs {' or '.join(map(str, allowed))}",
            )

    @property
    def values(self) -> tuple[float, ...]:
        """Values of the constants of the function."""
        return tuple(shape.value for shape in self.shapes)

    @property
    def has_sign(self) -> bool:
        """Whether the (smoothed) sign function is in it."""
        sharp = self.column.sharp
        return "s" in self.column.names and not (sharp is not None and sharp(*self.values))

    @property
    def has_memory(self) -> bool:
        """Whether it depends on the path so far, by a state."""
        return self.column.memory

    @property
    def depends_on_position(self) -> bool:
        """Whether it is a function of the joint's position."""
        return self.column.of_position

    @property
    def depends_on_load(self) -> bool:
        """Whether it grows with the torque that the joint carries."""
        return self.column.of_load

    @property
    def carries_load(self) -> bool:
        """Whether it is a spring, whose torque the joint carries like that of gravity."""
        return self.column.carries_load

    @property
    def has_inner_signal(self) -> bool:
        """Whether its column needs more than one sample: the path so far or the load."""
        return self.column.needs_more_than_a_sample

    @property
    def is_of_speed_alone(self) -> bool:
        """Whether it is a function of the joint's speed only."""
        several = self.has_inner_signal or self.column.of_motion
        return not (self.depends_on_position or several)

    @property
    def is_independent(self) -> bool:
        """Whether its column is independent of all others of a robot, whatever its constants."""
        return self.column.functions is None

    @property
    def is_dissipative(self) -> bool:
        """Whether physics demands that its parameter is not negative."""
        return self.column.dissipative

    @property
    def exponent(self) -> float:
        """Power of the speed that the term grows with, as its parameter's unit needs it."""
        power = self.column.speed_power
        return self.values[self.column.constants.index(power)] if isinstance(power, str) else power

    def shape(self, name: str) -> Shape:
        """The constant of that name.

        Raises:
            UnknownName: the term has none.
        """
        for shape in self.shapes:
            if shape.name == name:
                return shape
        raise UnknownName(
            f"the friction term {self.stem!r} has no constant {name!r}",
            advice=nearest(name, [shape.name for shape in self.shapes]),
        )

    def with_shapes(self, values: dict[str, float]) -> FrictionTerm:
        """The same term with other constants.

        Args:
            values: constants by name; names that the term does not have are ignored.
        """
        changed = tuple(replace(s, value=values.get(s.name, s.value)) for s in self.shapes)
        gamma = values.get("gamma", self.gamma) if self.has_sign else self.gamma
        return replace(self, shapes=changed, gamma=gamma)

    def __str__(self) -> str:
        """The term as a formula in dq, q and the states z."""
        texts = [f"{value:g}" for value in self.values]
        return self.column.text.format(
            stem=self.stem,
            s=_SIGNS[self.smoothing] if self.has_sign else "sign(dq)",
            shapes=", ".join(texts),
            **dict(zip(self.column.constants, texts, strict=False)),
        )

    def sign_code(self, simulated: bool = False) -> SignFunction:
        """Which sign function its compiled function has; ``simulated``: no hard one."""
        if self.depends_on_position:
            return SignFunction.SPRING if self.carries_load else SignFunction.NONE
        if not self.has_sign:
            return SignFunction.SHARP
        sign = SignFunction[self.smoothing.upper()]
        return SignFunction.ATAN if simulated and sign is SignFunction.SIGN else sign

    def encoded(self, simulated: bool = False) -> tuple[int, int, tuple[float, ...]]:
        """Column code, sign code and shape (γ, then ``MAX_SHAPES`` constants) for the kernels.

        Args:
            simulated: replace the hard sign by the arctangent, as the simulator needs.
        """
        gamma = SLOPE_AT_RATED_SPEED if self.gamma is None else self.gamma
        padded = (*self.values, *[0.0] * (MAX_SHAPES - len(self.values)))
        return int(self.column), int(self.sign_code(simulated)), (gamma, *padded)


@dataclass(frozen=True)
class Candidate:
    """A change of a law that ``pivident laws`` tries: terms that are added or take a place.

    Attributes:
        name: of the change.
        terms: the terms, from travel and largest speed of the joint, and the smoothing and γ of
            the sign that the law has.
        instead_of: columns that are replaced; the first one has to be there.
        unless: columns and constants with which it makes no sense.
        sign_of: columns whose sign is taken over.
    """

    name: str
    terms: Callable[[float, float, Smoothing, float | None], tuple[FrictionTerm, ...]]
    instead_of: tuple[str, ...] = ()
    unless: tuple[str, ...] = ()
    sign_of: tuple[str, ...] = ("coulomb",)


@dataclass(frozen=True)
class TermKind:
    """A friction term as the table of a robot file names it.

    Attributes:
        name: ``term = "stribeck"``.
        make: constructor of the terms; its arguments are the keys, needed where they have no
            default. They are called as the constants are in expressions.
        columns: the columns of its terms; a law's term with the first one stands for the table.
        keys: what the keys mean; the constants of the first column among them, in their order.
        written: keys and values for the robot file that no constant holds, from the term with the
            first column and all terms of the law, None for keys that are left out; None: the table
            of another term holds it.
        candidates: changes of laws that ``pivident laws`` tries.
        causes: shapes of model error, expressions by name: of ``dq``, the sign ``s``, ``load``, and
            of the joint's ``fastest`` and ``heaviest``.
    """

    name: str
    make: Callable[..., FrictionTerm | tuple[FrictionTerm, ...]]
    columns: tuple[FrictionColumn, ...]
    keys: tuple[Key, ...] = ()
    written: Callable[[FrictionTerm, Sequence[FrictionTerm]], Mapping[str, Any] | None] | None = (
        None
    )
    candidates: tuple[Candidate, ...] = ()
    causes: Mapping[str, str] = field(default_factory=dict)

    @cached_property
    def arguments(self) -> tuple[frozenset[str], frozenset[str]]:
        """Keys that a table needs, and those that it may have."""
        found = inspect.signature(self.make).parameters.values()
        needed = frozenset(p.name for p in found if p.default is p.empty)
        return needed, frozenset(p.name for p in found) - needed

    @property
    def constants(self) -> tuple[Constant, ...]:
        """The constants among its keys."""
        return tuple(key for key in self.keys if isinstance(key, Constant))

    def begins_with(self, term: FrictionTerm) -> bool:
        """Whether a term of a law is the first one of a table of this kind."""
        count = len(self.constants)
        return term.column == self.columns[0] and count in (0, len(term.shapes))
