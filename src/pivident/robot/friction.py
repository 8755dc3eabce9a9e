"""Friction laws: one object that regressor, simulator and export share.

A law is a sequence of terms. Each term is one column of the observation matrix: a function
f(dq) of the joint speed, times one parameter that is estimated. Its shape parameters (the slope
γ of the smoothed sign, the Stribeck speed …) are given.

The smoothed sign functions are

    s(dq) = sign(dq),   (2/π) atan(γ dq)   or   tanh(γ dq)

and a law with the hard ``sign`` is simulated with the arctangent of the same γ, because the
simulation needs a finite slope at rest.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from enum import IntEnum
from typing import Literal

import numpy as np

Smoothing = Literal["sign", "atan", "tanh"]

#: γ times rated speed: 150 s/rad (Brunot et al. 2018) on the TX40's first axis of 5 rad/s.
SLOPE_AT_RATED_SPEED = 750.0


class FrictionColumn(IntEnum):
    """Code of a term's function, as the compiled kernels know it."""

    VISCOUS = 0
    COULOMB = 1
    OFFSET = 2
    COULOMB_POSITIVE = 3
    COULOMB_NEGATIVE = 4
    STRIBECK = 5


class SignFunction(IntEnum):
    """Code of the (smoothed) sign function."""

    SIGN = 0
    ATAN = 1
    TANH = 2


@dataclass(frozen=True)
class FrictionTerm:
    """One column of friction: parameter name stem, function and shape.

    Attributes:
        stem: stem of the parameter's name (``fv``, ``fc``, ``off`` …).
        column: which function of the speed.
        smoothing: how the sign function is smoothed, where the column has one.
        gamma: slope of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.
        stribeck_speed: speed at which the Stribeck excess has fallen to 1/e [rad/s or m/s].
        stribeck_exponent: exponent of the Stribeck curve.
        per_speed: whether the parameter is a torque per speed (unit only).
    """

    stem: str
    column: FrictionColumn
    smoothing: Smoothing = "atan"
    gamma: float | None = None
    stribeck_speed: float = 0.0
    stribeck_exponent: float = 2.0
    per_speed: bool = False

    def __post_init__(self) -> None:
        if self.gamma is not None and not (math.isfinite(self.gamma) and self.gamma > 0):
            raise ValueError(f"gamma of {self.stem!r} must be positive, not {self.gamma}")
        if self.column is FrictionColumn.STRIBECK and not self.stribeck_speed > 0:
            raise ValueError(f"stribeck_speed must be positive, not {self.stribeck_speed}")

    @property
    def has_sign(self) -> bool:
        """Whether the sign function is in it."""
        return self.column not in (FrictionColumn.VISCOUS, FrictionColumn.OFFSET)

    def __str__(self) -> str:
        """The term as a formula in dq."""
        sign = {"sign": "sign(dq)", "atan": "(2/π) atan(γ dq)", "tanh": "tanh(γ dq)"}
        s = sign[self.smoothing]
        fall = f"exp(-|dq/{self.stribeck_speed:g}|^{self.stribeck_exponent:g})"
        return {
            FrictionColumn.VISCOUS: f"{self.stem} dq",
            FrictionColumn.COULOMB: f"{self.stem} {s}",
            FrictionColumn.OFFSET: self.stem,
            FrictionColumn.COULOMB_POSITIVE: f"{self.stem} (1 + {s})/2",
            FrictionColumn.COULOMB_NEGATIVE: f"-{self.stem} (1 - {s})/2",
            FrictionColumn.STRIBECK: f"{self.stem} {s} {fall}",
        }[self.column]

    def encoded(self, simulated: bool = False) -> tuple[int, int, tuple[float, float, float]]:
        """Column code, sign code and shape (γ, v_s, δ) for the compiled kernels.

        Args:
            simulated: replace the hard sign by the arctangent, as the simulator needs.
        """
        sign = SignFunction[self.smoothing.upper()]
        if simulated and sign is SignFunction.SIGN:
            sign = SignFunction.ATAN
        gamma = SLOPE_AT_RATED_SPEED if self.gamma is None else self.gamma
        return int(self.column), int(sign), (gamma, self.stribeck_speed, self.stribeck_exponent)


def viscous() -> FrictionTerm:
    """Friction fv dq, fv in [N m s/rad] or [N s/m]."""
    return FrictionTerm("fv", FrictionColumn.VISCOUS, per_speed=True)


def coulomb(smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fc s(dq), fc in [N m] or [N]; γ = 150 s/rad in the paper, (P-4)."""
    return FrictionTerm("fc", FrictionColumn.COULOMB, smoothing, gamma)


def offset() -> FrictionTerm:
    """Constant torque off in [N m] or [N]."""
    return FrictionTerm("off", FrictionColumn.OFFSET)


def asymmetric_coulomb(
    smoothing: Smoothing = "atan", gamma: float | None = None
) -> tuple[FrictionTerm, FrictionTerm]:
    """Friction fcp (1 + s)/2 - fcn (1 - s)/2: one Coulomb level for each direction."""
    return (
        FrictionTerm("fcp", FrictionColumn.COULOMB_POSITIVE, smoothing, gamma),
        FrictionTerm("fcn", FrictionColumn.COULOMB_NEGATIVE, smoothing, gamma),
    )


def stribeck(
    speed: float,
    exponent: float = 2.0,
    smoothing: Smoothing = "atan",
    gamma: float | None = None,
) -> FrictionTerm:
    """Friction fs s(dq) exp(-|dq/v_s|^δ): excess of the break-away level over Coulomb friction."""
    return FrictionTerm("fs", FrictionColumn.STRIBECK, smoothing, gamma, speed, exponent)


@dataclass(frozen=True)
class FrictionLaw:
    """A sum of friction terms, one for each parameter."""

    terms: tuple[FrictionTerm, ...] = ()

    def __post_init__(self) -> None:
        stems = [term.stem for term in self.terms]
        repeated = {stem for stem in stems if stems.count(stem) > 1}
        if repeated:
            raise ValueError(f"friction terms named twice: {', '.join(sorted(repeated))}")
        if {"fc", "fcp"} <= set(stems) or {"off", "fcp"} <= set(stems):
            raise ValueError(
                "asymmetric Coulomb friction (fcp, fcn) already contains fc and off: "
                "drop the terms 'coulomb' and 'offset'"
            )

    def __str__(self) -> str:
        """The law as a formula in dq, ``fv dq + fc (2/π) atan(γ dq) + off``."""
        return " + ".join(map(str, self.terms)).replace("+ -", "- ") or "none"

    @property
    def slopes(self) -> tuple[float, ...]:
        """The γ of its smoothed signs [s/rad or s/m], each value once; none for a hard sign."""
        smoothed = (t for t in self.terms if t.has_sign and t.smoothing != "sign")
        return tuple(dict.fromkeys(t.encoded()[2][0] for t in smoothed))

    def with_default_gamma(self, gamma: float) -> FrictionLaw:
        """The same law with every γ that was left open set to ``gamma`` [s/rad or s/m]."""
        return FrictionLaw(
            tuple(t if t.gamma is not None else replace(t, gamma=gamma) for t in self.terms)
        )

    def columns(self, dq: np.ndarray, simulated: bool = False) -> np.ndarray:
        """Columns of the law, f_k(dq): shape ``dq.shape + (terms,)``.

        Args:
            dq: joint speed [rad/s or m/s], any shape.
            simulated: replace the hard sign by its smooth form, as the simulator does.
        """
        from pivident.dynamics.friction import friction_column

        dq = np.asarray(dq, dtype=float)
        out = np.empty((*dq.shape, len(self.terms)))
        for k, term in enumerate(self.terms):
            column, sign, shape = term.encoded(simulated)
            out[..., k] = friction_column(column, sign, shape, dq)
        return out


#: Friction of a joint for which nothing else is asked.
DEFAULT_FRICTION = FrictionLaw((viscous(), coulomb(), offset()))
