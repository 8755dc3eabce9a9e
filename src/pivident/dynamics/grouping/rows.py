"""Rows: combinations of parameters that a joint can feel by the motions that reach its link.

Motions and directions of gravity that the joints before a link can subject it to.

Closed under the motion of every joint by rule: turning about z keeps what lies along z and turns
what lies across to every direction across; sliding along z adds ω × z to the speed of the origin.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.grouping.geometry import Quantity

#: Coefficient by index of the parameter; none is 0.
Row = dict[int, Quantity]
ONE = Quantity.number(1.0)
#: Relative size below which a number is rounding. The geometry was cleaned before (see
#: ``GEOMETRY_TOLERANCE``), so that no number is near this threshold.
ROUNDING = 1e-10


def times(row: Row, factor: Quantity) -> Row:
    """A multiple of a row; nothing where the factor is zero."""
    return {k: factor * x for k, x in row.items() if factor.value}


def summed(a: Row, b: Row) -> Row:
    """The sum of two rows."""
    return a | {k: a[k] + x if k in a else x for k, x in b.items()}


@dataclass(frozen=True, eq=False)
class Reach:
    """What a link can be subjected to by the joints before it and by gravity.

    Rows of ``twists`` are a basis of all (ω, v, speeds of the coupled joints) of the frame's
    origin, rows of ``gravities`` one of all (g, 1), both in the link's frame.
    """

    twists: np.ndarray  # (twists, 6 + coupled joints)
    gravities: np.ndarray  # (directions, 4)

    @classmethod
    def of_base(cls, gravity: np.ndarray, coupled: int) -> Reach:
        """The base does not move; gravity has one direction."""
        return cls(np.zeros((0, 6 + coupled)), np.array([[*gravity, 1.0]]))

    def seen_from(self, rotation: np.ndarray, translation: np.ndarray) -> Reach:
        """The same in the frame of the next joint at q = 0: Rᵀω, Rᵀ(v + ω × p), Rᵀg."""
        omega, v, speeds = self.twists[:, :3], self.twists[:, 3:6], self.twists[:, 6:]
        v = v + np.cross(omega, translation)
        return Reach(
            np.hstack([omega @ rotation, v @ rotation, speeds]),
            np.hstack([self.gravities[:, :3] @ rotation, self.gravities[:, 3:]]),
        )

    def moved_by(self, kind: str, coupled: int | None) -> Reach:
        """What is reachable behind the joint: all its positions, and its own screw."""
        twists, gravities = self.twists, self.gravities
        screw = np.zeros((1, twists.shape[1]))
        screw[0, 2 if kind == "revolute" else 5] = 1.0
        if coupled is not None:
            screw[0, 6 + coupled] = 1.0
        if kind == "revolute":
            # what lies along z stays, what lies across turns to any direction
            along, across = twists.copy(), twists.copy()
            along[:, [0, 1, 3, 4]] = 0.0
            across[:, [2, 5]] = across[:, 6:] = 0.0
            twists = np.vstack([along, across, _quarter_turned(across), screw])
            still, turning = gravities.copy(), gravities.copy()
            still[:, :2] = turning[:, 2:] = 0.0
            turned = np.zeros_like(turning)
            turned[:, :3] = np.cross([0.0, 0.0, 1.0], turning[:, :3])
            gravities = np.vstack([still, turning, turned])
        else:
            # sliding along z adds ω × z to the speed of the origin
            added = np.zeros_like(twists)
            added[:, 3:6] = np.cross(twists[:, :3], [0.0, 0.0, 1.0])
            twists = np.vstack([twists, added, screw])
        return Reach(row_space(twists), row_space(gravities))


def row_space(rows: np.ndarray) -> np.ndarray:
    """Rows that span the same space, in reduced echelon form with complete pivoting."""
    left = rows[np.abs(rows).max(axis=1, initial=0.0) > ROUNDING]
    left = left / np.abs(left).max(axis=1, initial=0.0, keepdims=True)
    found = np.zeros((0, rows.shape[1]))
    while left.size and np.abs(left).max() > ROUNDING:
        n, column = np.unravel_index(np.abs(left).argmax(), left.shape)
        pivot = left[n] / left[n, column]
        left = np.delete(left, n, axis=0)
        left = left - np.outer(left[:, column], pivot)
        found = np.vstack([found - np.outer(found[:, column], pivot), pivot])
    return np.where(np.abs(found) < ROUNDING, 0.0, found)


def _quarter_turned(twists: np.ndarray) -> np.ndarray:
    """Twists turned by 90° about z."""
    z, out = [0.0, 0.0, 1.0], np.zeros_like(twists)
    out[:, :3], out[:, 3:6] = np.cross(z, twists[:, :3]), np.cross(z, twists[:, 3:6])
    return out


def reduced(rows: list[Row], order: list[int]) -> dict[int, Row]:
    """Gauss–Jordan elimination: rows by their leading column (a 1), sought in the given order."""
    left = [(row, max(abs(x.value) for x in row.values())) for row in rows if row]
    done: dict[int, Row] = {}
    for column in order:
        best, pick = ROUNDING, None
        for n, (row, scale) in enumerate(left):
            if column in row and abs(row[column].value) > best * scale:
                best, pick = abs(row[column].value) / scale, n
        if pick is None:
            continue
        row, _ = left.pop(pick)
        row = {k: ONE if k == column else x / row[column] for k, x in row.items()}
        left = [(_without(other, column, row), scale) for other, scale in left]
        done = {head: _without(other, column, row) for head, other in done.items()}
        done[column] = row
    return done


def _without(row: Row, column: int, pivot: Row) -> Row:
    """The row less the multiple of the pivot row that clears the column."""
    if column not in row:
        return row
    factor, out = row[column], dict(row)
    del out[column]
    for k, x in pivot.items():
        if k == column:
            continue
        old = out.pop(k, None)
        new = -(factor * x) if old is None else old - factor * x
        if abs(new.value) > ROUNDING * max(abs(old.value) if old else 0.0, abs(factor.value)):
            out[k] = new
    return out
