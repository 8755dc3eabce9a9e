"""Friction against speed of several results, each with its interval.

τ_f(dq) = Σ_i φ_i(dq) θ_i over the terms of a joint's law that depend on speed alone, and with the
covariance Σ of these parameters  σ²(dq) = φᵀ Σ φ.  Terms of load, position or path are left out:
they have no curve against speed.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.friction import friction_column
from pivident.robot.description import Joint
from pivident.studies.comparison.entry import Entry

#: Points of a curve, half of them on either side of standstill.
POINTS = 121

#: Speed up to which a curve is drawn where no rated speed is known [rad/s or m/s].
UNRATED = 1.0


@dataclass(frozen=True, eq=False)
class FrictionCurve:
    """Friction of one joint by one result."""

    entry: int  # index of the result
    torque: np.ndarray  # friction at each speed [N m or N], shape (points,)
    std: np.ndarray  # its standard error, likewise; NaN where no covariance is known
    #: stems of the terms that are not functions of speed, or were not estimated
    left_out: tuple[str, ...]


@dataclass(frozen=True, eq=False)
class JointFriction:
    """Friction of one joint by all results."""

    name: str  # joint
    torque_unit: str  # N m or N
    speed_unit: str  # rad/s or m/s
    rated: bool  # whether the range of speed is that of the joint's rated speed
    speed: np.ndarray  # speeds, shape (points,)
    curves: tuple[FrictionCurve, ...]  # one for each result that estimates friction of this joint


def friction_curves(entries: Sequence[Entry]) -> Iterator[JointFriction]:
    """Friction against speed of all joints whose friction some result estimates."""
    for j, joint in enumerate(entries[0].robot.joints):
        rated = joint.rated_speed or max(
            (e.robot.joints[j].rated_speed or 0.0 for e in entries), default=0.0
        )
        speed = speeds(rated or UNRATED)
        curves = [
            curve
            for k, entry in enumerate(entries)
            if (curve := _curve(k, entry, j, speed)) is not None
        ]
        if curves:
            yield JointFriction(
                joint.name,
                joint.torque_unit,
                f"{joint.position_unit}/s",
                bool(rated),
                speed,
                tuple(curves),
            )


def speeds(highest: float) -> np.ndarray:
    """Speeds from -highest to highest, denser near standstill, shape (points,)."""
    u = np.linspace(-1.0, 1.0, POINTS)
    return highest * np.sign(u) * np.abs(u) ** 2.5


def speed_columns(joint: Joint, speed: np.ndarray) -> dict[str, np.ndarray]:
    """The column of each term of a joint's law that is a function of speed, by its stem."""
    law = joint.friction.with_default_gamma(joint.default_gamma)
    return {term.stem: friction_column(term, speed) for term in law.terms if term.is_of_speed_alone}


def _curve(k: int, entry: Entry, j: int, speed: np.ndarray) -> FrictionCurve | None:
    """One result's friction of one joint; None where it estimates none."""
    columns = speed_columns(entry.robot.joints[j], speed)
    heads = dict(zip(entry.groups.names, entry.groups.heads, strict=True))
    own = [(n, heads[n][1]) for n in entry.names if heads[n][0] == j and heads[n][1] in columns]
    if not own:
        return None
    phi = np.array([columns[stem] for _, stem in own])
    places = [entry.place[name] for name, _ in own]
    std = np.full(speed.shape, np.nan)
    if entry.covariance is not None:
        block = entry.covariance[np.ix_(places, places)]
        std = np.sqrt(np.maximum(np.einsum("ap,ab,bp->p", phi, block, phi), 0.0))
    stems = {stem for _, stem in own}
    missing = tuple(t.stem for t in entry.robot.joints[j].friction.terms if t.stem not in stems)
    return FrictionCurve(k, entry.value[places] @ phi, std, missing)
