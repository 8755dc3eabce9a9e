"""One term of a friction law: a function of the joint's motion times one parameter.

The functions have five kinds of argument: the speed; the position (ripple, springs); the torque
that the joint carries (load-dependent friction); the path so far (presliding, where friction has
a state z that remembers the last reversals); constants of shape such as the Stribeck speed, which
enter nonlinearly.

The smoothed sign functions are

    s(dq) = sign(dq),   (2/π) atan(γ dq)   or   tanh(γ dq)

and a term with the hard ``sign`` is simulated with the arctangent of the same γ, because the
simulation needs a finite slope at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

Smoothing = Literal["sign", "atan", "tanh"]

#: Unit of a constant of shape, in terms of the joint's speed or position.
ShapeUnit = Literal["speed", "position", "1/speed", "1/position", "angle", "1"]

#: γ times rated speed: 150 s/rad (Brunot et al. 2018) on the TX40's first axis of 5 rad/s.
SLOPE_AT_RATED_SPEED = 750.0

#: Constants of shape that the compiled kernels take with each term, besides γ.
MAX_SHAPES = 4


class FrictionColumn(IntEnum):
    """Code of a term's function in the compiled kernels."""

    VISCOUS = 0
    COULOMB = 1
    OFFSET = 2
    COULOMB_POSITIVE = 3
    COULOMB_NEGATIVE = 4
    STRIBECK = 5
    POWER = 6
    VISCOUS_POSITIVE = 7
    VISCOUS_NEGATIVE = 8
    COSINE = 9
    SINE = 10
    SPRING = 11
    STRUT = 12
    STRUT_STIFFNESS = 13
    LOAD = 14
    PRESLIDING = 15
    PRESLIDING_RATE = 16
    MAXWELL = 17


class SignFunction(IntEnum):
    """Code of the (smoothed) sign function."""

    SIGN = 0
    ATAN = 1
    TANH = 2


#: Functions of the position, and those with a state.
OF_POSITION = (
    FrictionColumn.COSINE,
    FrictionColumn.SINE,
    FrictionColumn.SPRING,
    FrictionColumn.STRUT,
    FrictionColumn.STRUT_STIFFNESS,
)
_SPRINGS = (
    FrictionColumn.SPRING,
    FrictionColumn.STRUT,
    FrictionColumn.STRUT_STIFFNESS,
)
WITH_MEMORY = (FrictionColumn.PRESLIDING, FrictionColumn.PRESLIDING_RATE, FrictionColumn.MAXWELL)
_SIGN = (
    FrictionColumn.COULOMB,
    FrictionColumn.COULOMB_POSITIVE,
    FrictionColumn.COULOMB_NEGATIVE,
    FrictionColumn.STRIBECK,
    FrictionColumn.LOAD,
)


@dataclass(frozen=True)
class Shape:
    """A constant that enters a friction law nonlinearly; terms that name the same one share it."""

    name: str
    value: float
    unit: ShapeUnit
    low: float  # smallest value that makes sense
    high: float
    free: bool = True  # whether it is identified where shapes are; others stay as given

    def __post_init__(self) -> None:
        if not self.low <= self.value <= self.high or not math.isfinite(self.value):
            bounds = "positive" if self.low > 0 and self.high == math.inf else "in its range"
            limits = "" if bounds == "positive" else f" ({self.low:g} to {self.high:g})"
            raise ValueError(f"{self.name} must be {bounds}{limits}, not {self.value}")


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


@dataclass(frozen=True)
class FrictionTerm:
    """One column of friction: parameter name stem, function and shape.

    Attributes:
        stem: stem of the parameter's name (``fv``, ``fc``, ``off`` …).
        column: which function.
        smoothing: how the sign function is smoothed, where the column has one.
        gamma: slope of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.
        shapes: constants of the function, in the order that its kernel expects.
    """

    stem: str
    column: FrictionColumn
    smoothing: Smoothing = "atan"
    gamma: float | None = None
    shapes: tuple[Shape, ...] = ()

    def __post_init__(self) -> None:
        if self.gamma is not None and not (math.isfinite(self.gamma) and self.gamma > 0):
            raise ValueError(f"gamma of {self.stem!r} must be positive, not {self.gamma}")

    @property
    def has_sign(self) -> bool:
        """Whether the sign function is in it."""
        return self.column in _SIGN or (self.column is FrictionColumn.POWER and self.exponent < 1)

    @property
    def has_memory(self) -> bool:
        """Whether it depends on the path so far, by a state."""
        return self.column in WITH_MEMORY

    @property
    def depends_on_position(self) -> bool:
        """Whether it is a function of the joint's position."""
        return self.column in OF_POSITION

    @property
    def depends_on_load(self) -> bool:
        """Whether it grows with the torque that the joint carries."""
        return self.column is FrictionColumn.LOAD

    @property
    def carries_load(self) -> bool:
        """Whether it is a spring, whose torque the joint carries like that of gravity."""
        return self.column in _SPRINGS

    @property
    def has_inner_signal(self) -> bool:
        """Whether its column needs more than one sample: the path so far or the load."""
        return self.has_memory or self.depends_on_load

    @property
    def is_independent(self) -> bool:
        """Whether its column is independent of all others of a robot, whatever its constants."""
        shaped = (FrictionColumn.STRIBECK, FrictionColumn.POWER)
        return self.has_inner_signal or self.column in shaped

    @property
    def is_dissipative(self) -> bool:
        """Whether physics demands that its parameter is not negative."""
        return self.column in (
            FrictionColumn.VISCOUS,
            FrictionColumn.VISCOUS_POSITIVE,
            FrictionColumn.VISCOUS_NEGATIVE,
            FrictionColumn.COULOMB,
            FrictionColumn.COULOMB_POSITIVE,
            FrictionColumn.COULOMB_NEGATIVE,
            FrictionColumn.LOAD,
            FrictionColumn.PRESLIDING,
            FrictionColumn.PRESLIDING_RATE,
            FrictionColumn.MAXWELL,
        )

    @property
    def exponent(self) -> float:
        """Power of the speed that the term grows with, as its parameter's unit needs it."""
        if self.column is FrictionColumn.POWER:
            return self.shapes[0].value
        linear = (
            FrictionColumn.VISCOUS,
            FrictionColumn.VISCOUS_POSITIVE,
            FrictionColumn.VISCOUS_NEGATIVE,
            FrictionColumn.PRESLIDING_RATE,
        )
        return 1.0 if self.column in linear else 0.0

    def shape(self, name: str) -> Shape:
        """The constant of that name.

        Raises:
            KeyError: the term has none.
        """
        for shape in self.shapes:
            if shape.name == name:
                return shape
        raise KeyError(name)

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
        sign = {"sign": "sign(dq)", "atan": "(2/π) atan(γ dq)", "tanh": "tanh(γ dq)"}
        s = sign[self.smoothing]
        a = [f"{shape.value:g}" for shape in self.shapes] + [""] * MAX_SHAPES
        c = FrictionColumn
        if self.column is c.POWER:
            function = f"{s} |dq|^{a[0]}" if self.has_sign else f"sign(dq) |dq|^{a[0]}"
            return f"{self.stem} {function}"
        return {
            c.VISCOUS: f"{self.stem} dq",
            c.COULOMB: f"{self.stem} {s}",
            c.OFFSET: self.stem,
            c.COULOMB_POSITIVE: f"{self.stem} (1 + {s})/2",
            c.COULOMB_NEGATIVE: f"-{self.stem} (1 - {s})/2",
            c.STRIBECK: f"{self.stem} {s} exp(-|dq/{a[0]}|^{a[1]})",
            c.VISCOUS_POSITIVE: f"{self.stem} max(dq, 0)",
            c.VISCOUS_NEGATIVE: f"{self.stem} min(dq, 0)",
            c.COSINE: f"{self.stem} cos({a[0]} q)",
            c.SINE: f"{self.stem} sin({a[0]} q)",
            c.SPRING: f"{self.stem} q",
            c.STRUT: f"{self.stem} sin(q - {a[1]})/√(1 + {a[0]}² - 2·{a[0]} cos(q - {a[1]}))",
            c.STRUT_STIFFNESS: f"{self.stem} sin(q - {a[1]})",
            c.LOAD: f"{self.stem} |load| {s}",
            c.PRESLIDING: f"{self.stem} z({', '.join(x for x in a if x)})",
            c.PRESLIDING_RATE: f"{self.stem} {a[0]} dz/dt",
            c.MAXWELL: f"{self.stem} slip({', '.join(x for x in a if x)})",
        }[self.column]

    def encoded(self, simulated: bool = False) -> tuple[int, int, tuple[float, ...]]:
        """Column code, sign code and shape (γ, then ``MAX_SHAPES`` constants) for the kernels.

        Args:
            simulated: replace the hard sign by the arctangent, as the simulator needs.
        """
        sign = SignFunction[self.smoothing.upper()]
        if simulated and sign is SignFunction.SIGN:
            sign = SignFunction.ATAN
        gamma = SLOPE_AT_RATED_SPEED if self.gamma is None else self.gamma
        values = [shape.value for shape in self.shapes]
        padded = values + [0.0] * (MAX_SHAPES - len(values))
        return int(self.column), int(sign), (gamma, *padded)
