"""Constraints of closed mechanisms as arrays for compiled code, and where a mechanism is."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.elimination import SparseFactors, right_sides, sparse_factors
from pivident.dynamics.kernels import Tree, tree_of
from pivident.robot.constraints import DIRECTIONS
from pivident.robot.description import Robot

# Kinds of equations.
PLACE, DIRECTION, LINEAR = 0, 1, 2

# Columns of the place of a link or of a frame in it, seen from the base: ⁰R row by row, ⁰p, ω, v,
# α, a.
P, W, V, ALPHA, A, PLACE_COLUMNS = 9, 12, 15, 18, 21, 24


class ClosureTable(NamedTuple):
    """The constraints of a robot as arrays."""

    tree: Tree
    places: np.ndarray  # independent joints, (joints,)
    others: np.ndarray  # dependent joints, (dependent,)
    equation: np.ndarray  # number in its list, kind, axis of the first and second, (dependent, 4)
    link: np.ndarray  # links of each closure, (closures, 2)
    frame: np.ndarray  # rotation row by row and origin in each link, (closures, 2, 12)
    ratio: np.ndarray  # of linear constraints, their offset last, (linear, tree joints + 1)
    slope: np.ndarray  # equation and dependent joint where A_d may be other than zero, (slopes, 2)
    posture: np.ndarray  # where the loops are closed, (tree joints,)


class ClosureWork(NamedTuple):
    """Where a mechanism is, and scratch."""

    q: np.ndarray  # positions of all joints, (tree joints,)
    dq: np.ndarray  # speeds, likewise
    gain: np.ndarray  # N, (tree joints, joints)
    drift: np.ndarray  # γ, (tree joints,)
    #: N, γ and the speeds of independent joints at the posture before, (tree joints, joints + 2),
    #: the time since, (1,), and scratch of the way from there, (2, joints).
    before: np.ndarray
    time: np.ndarray
    lead: np.ndarray
    pose: np.ndarray  # (tree joints, 12)
    place: np.ndarray  # (tree joints, 24)
    ends: np.ndarray  # the two frames of every closure, (closures, 2, 24)
    axes: np.ndarray  # two axes with three derivatives, and their normal, (3, 12)
    jacobian: np.ndarray  # A, (dependent, tree joints)
    gap: np.ndarray  # c, and dA/dt dq, (2, dependent)
    factors: SparseFactors  # A_d, its L and U
    held: np.ndarray  # whether there are an L and U, (1,)
    right: np.ndarray  # joints + 1 right sides, see ``right_sides``
    step: np.ndarray  # one right side, (dependent,)


def closure_table(robot: Robot) -> ClosureTable:
    """Constraints of a closed robot for the kernels."""
    constraints, tree = robot.constraints, robot.tree
    assert constraints is not None
    rows: list[tuple[int, int, int, int]] = []
    for k, closure in enumerate(constraints.closures):
        rows += [(k, PLACE, axis, axis) for axis in range(3)]
        rows += [(k, DIRECTION, a, b) for a, b in DIRECTIONS[closure.kind]]
    rows += [(k, LINEAR, 0, 0) for k in range(len(constraints.linear))]
    frames = [
        [np.concatenate([f.rotation.ravel(), f.translation]) for f in closure.frames]
        for closure in constraints.closures
    ]
    ratios = [np.append(one.ratios, one.offset) for one in constraints.linear]
    others = [i for i in range(tree.size) if i not in constraints.places]
    kept = [rows[k] for k in constraints.kept]
    slopes = [
        (row, others.index(i))
        for row, equation in enumerate(kept)
        for i in sorted(_moving(robot, equation).intersection(others))
    ]
    return ClosureTable(
        tree_of(tree),
        np.array(constraints.places, dtype=np.int64),
        np.array(others, dtype=np.int64),
        np.array(kept, dtype=np.int64).reshape(-1, 4),
        np.array([c.links for c in constraints.closures], dtype=np.int64).reshape(-1, 2),
        np.array(frames, dtype=float).reshape(-1, 2, 12),
        np.array(ratios, dtype=float).reshape(-1, tree.size + 1),
        np.array(slopes, dtype=np.int64).reshape(-1, 2),
        np.array(constraints.posture, dtype=float),
    )


def _moving(robot: Robot, equation: tuple[int, int, int, int]) -> set[int]:
    """Joints of the tree that an equation depends on."""
    constraints, (number, kind, _, _) = robot.constraints, equation
    assert constraints is not None
    if kind == LINEAR:
        return set(np.flatnonzero(constraints.linear[number].ratios).tolist())
    links = constraints.closures[number].links
    return {int(i) for link in links if link >= 0 for i in robot.tree.ancestors(link)}


def closure_work(table: ClosureTable) -> ClosureWork:
    """A mechanism at the posture of its description."""
    n, m, r = table.posture.size, table.places.size, table.others.size
    pattern, gain = np.zeros((r, r), dtype=bool), np.zeros((n, m))
    pattern[tuple(table.slope.T)] = True
    gain[table.places, np.arange(m)] = 1.0
    return ClosureWork(
        q=table.posture.copy(),
        dq=np.zeros(n),
        gain=gain,
        drift=np.zeros(n),
        before=np.zeros((n, m + 2)),
        time=np.zeros(1),
        lead=np.zeros((2, m)),
        pose=np.zeros((n, 12)),
        place=np.zeros((n, PLACE_COLUMNS)),
        ends=np.zeros((len(table.link), 2, PLACE_COLUMNS)),
        axes=np.zeros((3, 12)),
        jacobian=np.zeros((r, n)),
        gap=np.zeros((2, r)),
        factors=sparse_factors(pattern),
        held=np.zeros(1, dtype=np.int64),
        right=right_sides(r, m + 1),
        step=np.zeros(r),
    )
