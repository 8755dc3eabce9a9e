"""Friction laws: one object that regressor, simulator and export share.

A law is a sum of terms. Each term is one column of the observation matrix times one estimated
parameter; the constants that shape the column, such as the Stribeck speed, are given or identified
in an outer loop. Terms that belong together have one constructor.
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from pivident.robot.friction_term import (
    FrictionColumn,
    FrictionTerm,
    Shape,
    Smoothing,
)
from pivident.robot.naming import nearest


def viscous() -> FrictionTerm:
    """Friction fv dq, fv in [N m s/rad] or [N s/m]."""
    return FrictionTerm("fv", FrictionColumn.VISCOUS)


def asymmetric_viscous() -> tuple[FrictionTerm, FrictionTerm]:
    """Friction fvp max(dq, 0) + fvn min(dq, 0): one slope for each direction."""
    return (
        FrictionTerm("fvp", FrictionColumn.VISCOUS_POSITIVE),
        FrictionTerm("fvn", FrictionColumn.VISCOUS_NEGATIVE),
    )


def power_viscous(
    exponent: float,
    stem: str = "fvx",
    smoothing: Smoothing = "atan",
    gamma: float | None = None,
    free: bool = True,
) -> FrictionTerm:
    """Friction fvx sign(dq) |dq|^p [N m (s/rad)^p]: polynomials (2, 3), harmonic drives (1/3).

    Below p = 1 the slope at rest would be infinite, and the smoothed sign is taken.

    Args:
        exponent: p.
        stem: of the parameter's name, where a law has several such terms.
        smoothing: of the sign, for p < 1.
        gamma: slope of the smoothed sign [s/rad or s/m].
        free: whether p is identified where shapes are.

    Returns:
        One term with the parameter fvx.
    """
    name = "viscous_exponent" if stem == "fvx" else f"{stem}_exponent"
    shape = Shape(name, exponent, "1", 0.02, 5.0, free)
    return FrictionTerm(stem, FrictionColumn.POWER, smoothing, gamma, (shape,))


def coulomb(smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fc s(dq), fc in [N m] or [N]; γ = 150 s/rad in the paper.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fc.
    """
    return FrictionTerm("fc", FrictionColumn.COULOMB, smoothing, gamma)


def offset() -> FrictionTerm:
    """Constant torque off in [N m] or [N]."""
    return FrictionTerm("off", FrictionColumn.OFFSET)


def asymmetric_coulomb(
    smoothing: Smoothing = "atan", gamma: float | None = None
) -> tuple[FrictionTerm, FrictionTerm]:
    """Friction fcp (1 + s)/2 - fcn (1 - s)/2: one Coulomb level for each direction.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        Two terms with the parameters fcp and fcn [N m or N].
    """
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
    """Friction fs s(dq) exp(-|dq/v_s|^δ): excess of the break-away level over Coulomb friction.

    Args:
        speed: v_s, Stribeck speed [rad/s or m/s].
        exponent: δ.
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fs [N m or N].
    """
    shapes = _stribeck_shapes(speed, exponent)
    return FrictionTerm("fs", FrictionColumn.STRIBECK, smoothing, gamma, shapes)


def load_dependent(smoothing: Smoothing = "atan", gamma: float | None = None) -> FrictionTerm:
    """Friction fl |load| s(dq): grows with the torque that the joint carries, fl without unit.

    The load is the torque of inertia, gravity and rotor, M ddq + h, without friction. It depends
    on the other parameters, so estimators take it from their last estimate.

    Args:
        smoothing: of the sign s: ``"atan"``, ``"tanh"`` or ``"sign"``.
        gamma: slope γ of the smoothed sign [s/rad or s/m]; None: from the joint's rated speed.

    Returns:
        One term with the parameter fl.
    """
    return FrictionTerm("fl", FrictionColumn.LOAD, smoothing, gamma)


def ripple(order: float, name: str | None = None) -> tuple[FrictionTerm, FrictionTerm]:
    """Torque A cos(n q) + B sin(n q) that repeats with the position: gear teeth, cogging.

    Args:
        order: n, periods per 2π of joint position (per revolution); of a prismatic joint 2π
            times the periods per metre.
        name: what follows ``rc`` and ``rs`` in the parameters' names, such as ``a``; None: the
            order between underscores.

    Returns:
        Two terms with the parameters rc and rs [N m or N].
    """
    label = f"_{order:.6g}_" if name is None else name
    shape = (Shape(f"order{label}", order, "1/position", 1e-6, 1e6, False),)
    return (
        FrictionTerm(f"rc{label}", FrictionColumn.COSINE, shapes=shape),
        FrictionTerm(f"rs{label}", FrictionColumn.SINE, shapes=shape),
    )


def spring() -> FrictionTerm:
    """Torque ks q of a linear spring [N m/rad] or [N/m]; its rest position is in the offset."""
    return FrictionTerm("ks", FrictionColumn.SPRING)


def counterbalance(ratio: float, angle: float) -> tuple[FrictionTerm, FrictionTerm]:
    """Torque of a strut or cylinder between two links, force F0 + k l along its length l.

    With b the distance of its fixed end from the joint's axis, a = ρ b that of the moving end
    (0 < ρ < 1: exchange the ends where ρ is larger), and q = φ [rad] where both are in line on the
    same side,

        l = b √(1 + ρ² - 2ρ cos(q - φ)),    torque = (F0 + k l) dl/dq
          = cbf sin(q - φ)/√(1 + ρ² - 2ρ cos(q - φ)) + cbk sin(q - φ)

    cbf = F0 a and cbk = k a b [N m]. A spring of no preload, cbk alone, cannot be separated from
    the weight of an arm; the first term can.

    Args:
        ratio: ρ = a/b, between 0 and 1 (exchange the ends where it is larger).
        angle: φ [rad].

    Returns:
        Two terms with the parameters cbf and cbk [N m].
    """
    shapes = (
        Shape("strut_ratio", ratio, "1", 0.01, 0.99),
        Shape("strut_angle", angle, "angle", -4.0 * math.pi, 4.0 * math.pi),
    )
    return (
        FrictionTerm("cbf", FrictionColumn.STRUT, shapes=shapes),
        FrictionTerm("cbk", FrictionColumn.STRUT_STIFFNESS, shapes=shapes),
    )


def dahl(distance: float) -> FrictionTerm:
    """Dahl's presliding friction fc z with dz/dt = (dq - |dq| z)/d: Coulomb friction with a state.

    After a reversal it needs some times d of travel to come to its new level.

    Args:
        distance: d, presliding distance [rad or m]; stiffness at rest is fc/d.

    Returns:
        One term with the parameter fc [N m or N].
    """
    return FrictionTerm("fc", FrictionColumn.PRESLIDING, shapes=_presliding(distance))


def lugre(
    distance: float, excess: float, speed: float, exponent: float = 2.0, damped: bool = True
) -> tuple[FrictionTerm, ...]:
    """LuGre friction (Canudas de Wit et al. 1995): presliding with a Stribeck curve.

        dz/dt = (dq - |dq| z/g)/d,    g = 1 + ρ exp(-|dq/v_s|^δ),    friction fc z + fd d dz/dt

    with distance d [rad or m], excess ρ, speed v_s and exponent δ; fd is a term where it is damped.
    In the usual symbols σ0 = fc/d, σ1 = fd, and g fc is the curve from static to Coulomb level.

    Args:
        distance: d [rad or m].
        excess: ρ, static level over Coulomb level less one.
        speed: v_s [rad/s or m/s].
        exponent: δ.
        damped: whether the micro-damping fd is a term.

    Returns:
        Terms with the parameters fc and, if damped, fd.
    """
    shapes = (
        *_presliding(distance),
        Shape("stribeck_excess", excess, "1", 0.0, 10.0),
        *_stribeck_shapes(speed, exponent),
    )
    terms = (FrictionTerm("fc", FrictionColumn.PRESLIDING, shapes=shapes),)
    if not damped:
        return terms
    return (*terms, FrictionTerm("fd", FrictionColumn.PRESLIDING_RATE, shapes=shapes))


def maxwell_slip(
    distances: Sequence[float],
    excess: float = 0.0,
    speed: float = 1.0,
    exponent: float = 2.0,
) -> tuple[FrictionTerm, ...]:
    """Generalised Maxwell slip: Σ fm_i z_i of elements that stick for d_i and then slip.

        z_i ← min(max(z_i + Δq/d_i, -g), g),    g = 1 + ρ exp(-|dq/v_s|^δ)

    Its hysteresis remembers every reversal that has not been passed. An element that slips is at
    its level at once (the attraction of Al-Bender et al. 2005 in the limit of no delay).

    Args:
        distances: d_i [rad or m], a grid; not identified unless asked for.
        excess: ρ.
        speed: v_s [rad/s or m/s].
        exponent: δ.

    Returns:
        One term with a parameter fm_i [N m or N] for each distance.

    Raises:
        ValueError: two elements are alike, or a constant is outside its range.
    """
    if len(set(distances)) < len(distances):
        raise ValueError(f"slip distances must differ from each other, not {list(distances)}")
    weakening: tuple[Shape, ...] = ()
    if excess != 0.0:
        weakening = (
            Shape("stribeck_excess", excess, "1", 0.0, 10.0),
            *_stribeck_shapes(speed, exponent),
        )
    return tuple(
        FrictionTerm(
            f"fm{chr(ord('a') + i)}",
            FrictionColumn.MAXWELL,
            shapes=(Shape(f"slip_distance{i + 1}", d, "position", 1e-12, 1e3, False), *weakening),
        )
        for i, d in enumerate(distances)
    )


def _presliding(distance: float) -> tuple[Shape]:
    return (Shape("presliding_distance", distance, "position", 1e-12, 1e3),)


def _stribeck_shapes(speed: float, exponent: float) -> tuple[Shape, Shape]:
    return (
        Shape("stribeck_speed", speed, "speed", 1e-9, math.inf),
        Shape("stribeck_exponent", exponent, "1", 0.1, 10.0, False),
    )


@dataclass(frozen=True)
class FrictionLaw:
    """A sum of friction terms, one for each parameter.

    Attributes:
        terms: the friction terms; no two have the same stem.
    """

    terms: tuple[FrictionTerm, ...] = ()

    def __post_init__(self) -> None:
        stems = [term.stem for term in self.terms]
        repeated = {stem for stem in stems if stems.count(stem) > 1}
        if repeated:
            advice = ""
            if "fc" in repeated and any(t.has_memory for t in self.terms):
                advice = "; 'dahl' and 'lugre' take the place of 'coulomb': drop that term"
            raise ValueError(f"friction terms named twice: {', '.join(sorted(repeated))}{advice}")
        if {"fc", "fcp"} <= set(stems) or {"off", "fcp"} <= set(stems):
            raise ValueError(
                "asymmetric Coulomb friction (fcp, fcn) already contains fc and off: "
                "drop the terms 'coulomb' and 'offset'"
            )
        if {"fv", "fvp"} <= set(stems):
            raise ValueError(
                "asymmetric viscous friction (fvp, fvn) already contains fv: drop the term "
                "'viscous'"
            )

        values: dict[str, float] = {}
        for shape in (s for term in self.terms for s in term.shapes):
            if values.setdefault(shape.name, shape.value) != shape.value:
                raise ValueError(
                    f"{shape.name} is {values[shape.name]:g} in one term and {shape.value:g} in "
                    "another; terms of a law share it, give them the same value"
                )

    def __str__(self) -> str:
        """The law as a formula in dq, ``fv dq + fc (2/π) atan(γ dq) + off``."""
        return " + ".join(map(str, self.terms)).replace("+ -", "- ") or "none"

    @property
    def slopes(self) -> tuple[float, ...]:
        """The γ of its smoothed signs [s/rad or s/m], each value once; none for a hard sign."""
        smoothed = (t for t in self.terms if t.has_sign and t.smoothing != "sign")
        return tuple(dict.fromkeys(t.encoded()[2][0] for t in smoothed))

    @property
    def shapes(self) -> tuple[Shape, ...]:
        """Its constants of shape, each once, in the order of its terms."""
        return tuple({s.name: s for term in self.terms for s in term.shapes}.values())

    def with_shapes(self, values: Mapping[str, float]) -> FrictionLaw:
        """The same law with other constants of shape; ``gamma`` is that of all smoothed signs.

        Args:
            values: by the names of ``shapes``, or ``gamma``.

        Raises:
            ValueError: names an unknown constant, or one outside its range.
        """
        known = [s.name for s in self.shapes] + ["gamma"] * any(t.has_sign for t in self.terms)
        for name in values:
            if name not in known:
                raise ValueError(f"the law {self} has no constant {name!r}; {nearest(name, known)}")
        return FrictionLaw(tuple(t.with_shapes(dict(values)) for t in self.terms))

    def with_default_gamma(self, gamma: float) -> FrictionLaw:
        """The same law with every γ that was left open set to ``gamma`` [s/rad or s/m]."""
        return FrictionLaw(
            tuple(t if t.gamma is not None else replace(t, gamma=gamma) for t in self.terms)
        )


#: Friction of a joint whose description names no law.
DEFAULT_FRICTION = FrictionLaw((viscous(), coulomb(), offset()))
