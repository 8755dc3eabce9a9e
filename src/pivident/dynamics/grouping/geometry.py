"""Geometry of a robot as named constants, for the groups of base parameters.

A frame whose pose in its parent is Rx(alpha) Tx(d) Rz(theta) Tz(r), as in every row of a modified
DH table without gamma and b, has the constants ``d3 r3 alpha3 theta3``. Of any other frame the
position has names, ``x3 y3 z3``, and the orientation stays numeric. Right angles and zeros are
structure and never get a name.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any, Literal

import numpy as np

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import Expression, cosine, sine
from pivident.dynamics.grouping.polynomial import Polynomial
from pivident.robot.description import Joint

#: Elements of rotation matrices closer than this to 0 or ±1, positions closer than this to 0 [m]
#: and angles closer than this to a right angle [rad] are taken to be exactly that.
GEOMETRY_TOLERANCE = 1e-9

#: Whether lengths and angles appear by their names or by their numbers.
Geometry = Literal["names", "numbers"]


@dataclass(frozen=True, slots=True)
class Quantity:
    """A number and the polynomial in named constants that it is the value of."""

    value: float
    polynomial: Polynomial

    @classmethod
    def number(cls, value: float) -> Quantity:
        """A plain number."""
        return cls(float(value), Polynomial.of(float(value)))

    @classmethod
    def named(cls, value: float, expression: Expression) -> Quantity:
        """The value of a symbol, sine or cosine."""
        return cls(value, Polynomial.of(expression))

    @property
    def is_zero(self) -> bool:
        """Whether it vanishes identically; the difference of two equal lengths does not."""
        return not self.polynomial.terms

    def __add__(self, other: Quantity | float) -> Quantity:
        b = as_quantity(other)
        total, polynomial = self.value + b.value, self.polynomial + b.polynomial
        # Fractions have no normal form: there the numbers decide whether they cancel.
        cancels = abs(total) < 1e-13 * (abs(self.value) + abs(b.value))
        if not polynomial.terms or (cancels and polynomial.is_fraction):
            return Quantity.number(0.0)
        return Quantity(total, polynomial)

    def __mul__(self, other: Quantity | float) -> Quantity:
        if isinstance(other, np.ndarray):
            return NotImplemented  # the array multiplies element by element
        b = as_quantity(other)
        return Quantity(self.value * b.value, self.polynomial * b.polynomial)

    def __truediv__(self, other: Quantity) -> Quantity:
        return Quantity(self.value / other.value, self.polynomial / other.polynomial)

    def __neg__(self) -> Quantity:
        return Quantity(-self.value, -self.polynomial)

    def __sub__(self, other: Quantity | float) -> Quantity:
        return self + -as_quantity(other)

    def __rsub__(self, other: float) -> Quantity:
        return -self + other

    __radd__ = __add__
    __rmul__ = __mul__


def as_quantity(x: Quantity | float) -> Quantity:
    """A quantity as it is, a number as a plain one."""
    return x if isinstance(x, Quantity) else Quantity.number(x)


def quantities(numbers: Any) -> np.ndarray:
    """An array of plain numbers as quantities, same shape."""
    numbers = np.asarray(numbers, dtype=float)
    out = np.empty(numbers.shape, dtype=object)
    for place, x in np.ndenumerate(numbers):
        out[place] = Quantity.number(x)
    return out


def numbers(array: np.ndarray) -> np.ndarray:
    """Values of an array of quantities, same shape."""
    return np.array([x.value for x in array.flat]).reshape(array.shape)


@dataclass(frozen=True, eq=False)
class NamedFrame:
    """Pose of a link's frame in its parent's, in quantities, at q = 0 and at a convenient position.

    Parameters that are carried from a link to its parent may be carried at any position of the
    joint: what depends on it is not felt. At the convenient position, that of the ``carrying``
    pose, ``theta`` of a revolute joint and ``r`` of a prismatic one have disappeared.
    """

    rotation: np.ndarray
    translation: np.ndarray
    carrying_rotation: np.ndarray
    carrying_translation: np.ndarray
    constants: dict[str, float]  # values by name


def named_frame(
    joint: Joint, label: str, geometry: Geometry, tolerance: float = GEOMETRY_TOLERANCE
) -> NamedFrame:
    """Frame of a joint in named constants; ``label`` follows the names (``3``, ``[elbow]``)."""
    rotation = snapped(joint.rotation, (0.0, 1.0, -1.0), tolerance)
    translation = snapped(joint.translation, (0.0,), tolerance)
    names = Names(label, geometry, tolerance)
    table = _modified_dh(rotation, translation, tolerance)
    if table is None:
        x, y, z = (
            names.length(stem, value) for stem, value in zip("xyz", translation, strict=True)
        )
        turn, origin = quantities(rotation), np.array([x, y, z])
        return NamedFrame(turn, origin, turn, origin, names.constants)
    alpha, d, theta, r = table
    (ca, sa), (ct, st) = names.angle("alpha", alpha), names.angle("theta", theta)
    length, slide = names.length("d", d), names.length("r", r)
    zero, one = quantities([0.0, 1.0])
    tilt = np.array([[one, zero, zero], [zero, ca, -sa], [zero, sa, ca]])
    screw = np.array([[ct, -st, zero], [st, ct, zero], [zero, zero, one]])
    turn, origin = tilt @ screw, np.array([length, -(sa * slide), ca * slide])
    if joint.kind == "revolute":
        return NamedFrame(turn, origin, tilt, origin, names.constants)
    return NamedFrame(turn, origin, turn, np.array([length, zero, zero]), names.constants)


def named_gravity(
    gravity: np.ndarray, geometry: Geometry, tolerance: float = GEOMETRY_TOLERANCE
) -> tuple[np.ndarray, dict[str, float]]:
    """Gravity in the base frame [m/s²]: ``g`` along an axis of the base, else ``gx gy gz``.

    Components below ``tolerance`` times the largest are zero. Also the values of the constants.
    """
    gravity = np.where(np.abs(gravity) <= tolerance * np.abs(gravity).max(), 0.0, gravity)
    names = Names("", geometry, tolerance)
    if np.count_nonzero(gravity) == 1:
        size = names.length("g", float(np.abs(gravity).max()))
        return np.array([size * float(np.sign(x)) for x in gravity]), names.constants
    components = [names.length(f"g{axis}", x) for axis, x in zip("xyz", gravity, strict=True)]
    return np.array(components), names.constants


def snapped(array: np.ndarray, targets: tuple[float, ...], tolerance: float) -> np.ndarray:
    """The array with elements near one of the targets set to it."""
    out = np.array(array, dtype=float)
    for target in targets:
        out[np.abs(out - target) < tolerance] = target
    return out


class Names:
    """Gives names to constants of one joint, and remembers their values."""

    def __init__(
        self, label: str, geometry: Geometry, tolerance: float = GEOMETRY_TOLERANCE
    ) -> None:
        self._label, self._geometry, self._tolerance = label, geometry, tolerance
        self.constants: dict[str, float] = {}

    def length(self, stem: str, value: float) -> Quantity:
        """A length (or other number); zero has no name."""
        value = float(value)
        if self._geometry == "numbers" or value == 0.0:
            return Quantity.number(value)
        return Quantity.named(value, self._named(stem, value))

    def short(self, stem: str, quantity: Quantity) -> Quantity:
        """The quantity itself where it is one product, else a name for it."""
        if len(quantity.polynomial.terms) < 2:
            return quantity
        return self.length(stem, quantity.value)

    def angle(self, stem: str, value: float) -> tuple[Quantity, Quantity]:
        """Cosine and sine of an angle; right angles have no name."""
        quarters = round(2.0 * value / np.pi)
        if abs(value - 0.5 * np.pi * quarters) < self._tolerance:
            exact = (1.0, 0.0, -1.0, 0.0)
            return Quantity.number(exact[quarters % 4]), Quantity.number(exact[(quarters - 1) % 4])
        c, s = float(np.cos(value)), float(np.sin(value))
        if self._geometry == "numbers":
            return Quantity.number(c), Quantity.number(s)
        angle = self._named(stem, float(value))
        return Quantity.named(c, cosine(angle)), Quantity.named(s, sine(angle))

    def _named(self, stem: str, value: float) -> Expression:
        name = f"{stem}{self._label}"
        self.constants[name] = value
        return symbol(name)


def _modified_dh(
    rotation: np.ndarray, translation: np.ndarray, tolerance: float
) -> tuple[float, float, float, float] | None:
    """(alpha, d, theta, r) with the pose Rx(alpha) Tx(d) Rz(theta) Tz(r), if there are such.

    The third column of Rx(alpha) Rz(theta) is (0, -sin alpha, cos alpha), the first row
    (cos theta, -sin theta, 0), and the origin is d along x and r along the third column.
    """
    axis = rotation[:, 2]
    along = float(axis[1:] @ translation[1:])
    across = float(axis[2] * translation[1] - axis[1] * translation[2])
    if axis[0] != 0.0 or abs(across) > tolerance:
        return None
    alpha = float(np.arctan2(-axis[1], axis[2]))
    theta = float(np.arctan2(-rotation[0, 1], rotation[0, 0]))
    slide = 0.0 if abs(along) < tolerance else along
    return alpha, float(translation[0]), theta, slide
