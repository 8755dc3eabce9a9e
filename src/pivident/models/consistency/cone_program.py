"""Quadratic objective over linear images of cones, solved by the interior-point solver Clarabel.

    minimise ½ uᵀ H u + cᵀ u    subject to    F_k u + g_k ∈ K_k

with K_k the non-negative numbers, a second-order cone, a semidefinite cone (upper triangle by
columns, off-diagonals times √2) or the exponential cone.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np

Cone = Literal["zero", "nonnegative", "second_order", "semidefinite", "exponential"]

#: Largest step of the solver as a share of the way to the boundary of the cones. The second one is
#: used if the first stalls near the boundary, as on a KR300 record.
STEPS = (0.99, 0.9)

#: Outcomes that another step length may fix, and the maximum number of iterations; 25 are usual.
STUCK, MAX_ITERATIONS = ("MaxIterations", "InsufficientProgress", "NumericalError"), 80

#: Outcomes of the solver that count as solved; ``AlmostSolved`` has reduced accuracy.
SOLVED = ("Solved", "AlmostSolved")


@dataclass(frozen=True, eq=False)
class Solved:
    """Outcome of a cone program."""

    u: np.ndarray  # unknowns, shape (unknowns,)
    # dual variable of each constraint, in the order they were given
    multipliers: tuple[np.ndarray, ...]
    status: str  # of the solver
    value: float  # the objective

    @property
    def found(self) -> bool:
        """Whether there is a solution."""
        return self.status in SOLVED

    @property
    def infeasible(self) -> bool:
        """Whether the solver proved that no point satisfies the constraints."""
        return self.status in ("PrimalInfeasible", "AlmostPrimalInfeasible")

    @property
    def unbounded(self) -> bool:
        """Whether the solver proved that the objective has no lower bound."""
        return self.status in ("DualInfeasible", "AlmostDualInfeasible")


@dataclass(frozen=True, eq=False)
class Requirement:
    """One condition F u + g ∈ K."""

    cone: Cone  # kind of K
    order: int  # order of the matrices of a semidefinite cone; otherwise the number of rows
    matrix: np.ndarray  # F on the unknowns ``columns``, shape (rows, columns)
    offset: np.ndarray  # g, shape (rows,)
    # the unknowns that F acts on; None: the first ones
    columns: np.ndarray | None = field(default=None)


def solve_cone_program(
    quadratic: np.ndarray,
    linear: np.ndarray,
    requirements: Sequence[Requirement],
    gap: float = 1e-8,
) -> Solved:
    """Solve a program; ``quadratic`` is H or its diagonal, ``gap`` absolute and relative."""
    import clarabel

    size = linear.size
    rows = np.concatenate([_rows(r, size) for r in requirements])
    offset = np.concatenate([r.offset for r in requirements])
    program = (
        _sparse(np.diag(quadratic) if quadratic.ndim == 1 else np.triu(quadratic)),
        np.asarray(linear, float),
        _sparse(-rows),
        offset,
        [_cone(clarabel, r) for r in requirements],
    )
    for fraction in STEPS:
        found = clarabel.DefaultSolver(*program, _settings(clarabel, gap, fraction)).solve()
        if str(found.status) not in STUCK:
            break
    multipliers, start = [], 0
    dual = np.asarray(found.z)
    for r in requirements:
        multipliers.append(dual[start : start + r.offset.size])
        start += r.offset.size
    return Solved(np.asarray(found.x), tuple(multipliers), str(found.status), float(found.obj_val))


def violation(requirements: Sequence[Requirement], u: np.ndarray) -> float:
    """How far a point lies outside the farthest cone, on the cone's own scale; zero inside.

    Exponential cones and equations are left out. A solution of reduced accuracy may lie outside by
    as much as all of a small bound.
    """
    from pivident.models.consistency.pseudo_inertia import from_triangle

    worst = 0.0
    for r in requirements:
        value = _rows(r, u.size) @ u + r.offset
        if r.cone == "nonnegative":
            worst = max(worst, float(-value.min(initial=0.0)))
        elif r.cone == "second_order":
            worst = max(worst, float(np.linalg.norm(value[1:]) - value[0]))
        elif r.cone == "semidefinite":
            worst = max(worst, float(-np.linalg.eigvalsh(from_triangle(value, r.order))[0]))
    return worst


def _rows(requirement: Requirement, size: int) -> np.ndarray:
    """F with a column for every unknown."""
    matrix = requirement.matrix
    if requirement.columns is None and matrix.shape[1] == size:
        return matrix
    wide = np.zeros((matrix.shape[0], size))
    columns = requirement.columns
    wide[:, np.arange(matrix.shape[1]) if columns is None else columns] = matrix
    return wide


def _sparse(matrix: np.ndarray):
    from scipy.sparse import csc_array

    return csc_array(matrix)


def _cone(clarabel, requirement: Requirement):
    made = {
        "zero": clarabel.ZeroConeT,
        "nonnegative": clarabel.NonnegativeConeT,
        "second_order": clarabel.SecondOrderConeT,
        "semidefinite": clarabel.PSDTriangleConeT,
    }
    if requirement.cone == "exponential":
        return clarabel.ExponentialConeT()
    return made[requirement.cone](requirement.order)


def _settings(clarabel, gap: float, fraction: float):
    settings = clarabel.DefaultSettings()
    settings.tol_gap_abs = settings.tol_gap_rel = gap
    settings.max_step_fraction, settings.max_iter = fraction, MAX_ITERATIONS
    settings.verbose = False
    settings.max_threads = 1
    settings.presolve_enable = False
    settings.chordal_decomposition_enable = False
    return settings
