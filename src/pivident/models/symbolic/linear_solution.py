"""Linear equations of expressions, solved block by block.

What a loop does not depend on is zero in A, so that few joints have to be solved together: the
equations are put into block triangular form (a matching, then strongly connected joints; Duff and
Reid 1978). A block of one to three joints is solved by its determinant, a larger one by orthogonal
elimination (modified Gram–Schmidt), which needs no exchange of rows and divides by zero only where
the mechanism is singular.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from typing import NamedTuple

import numpy as np

from pivident.dynamics.grouping.expressions import ONE, ZERO, Expression, call, divide

Columns = list[list[Expression]]


class Block(NamedTuple):
    """Equations and the joints that they determine, given those of the blocks before."""

    rows: tuple[int, ...]
    columns: tuple[int, ...]


def block_order(pattern: np.ndarray) -> list[Block]:
    """Blocks of a square matrix from where it is not zero, each after those it depends on.

    Raises:
        ValueError: no permutation has a diagonal without zeros; the matrix is singular.
    """
    from scipy.sparse import csr_matrix
    from scipy.sparse.csgraph import connected_components, maximum_bipartite_matching

    size = len(pattern)
    match = maximum_bipartite_matching(csr_matrix(pattern), perm_type="row")  # row of each column
    if size and match.min() < 0:
        raise ValueError("the matrix is singular whatever its elements are")
    square = pattern[match]  # row k determines column k
    count, label = connected_components(csr_matrix(square), connection="strong")
    depends: dict[int, set[int]] = {k: set() for k in range(count)}
    for i, j in zip(*np.nonzero(square), strict=True):
        if label[i] != label[j]:
            depends[label[i]].add(label[j])
    blocks: list[Block] = []
    done: set[int] = set()
    while len(done) < count:
        ready = [k for k in range(count) if k not in done and depends[k] <= done]
        for k in ready:
            columns = tuple(np.flatnonzero(label == k).tolist())
            blocks.append(Block(tuple(int(match[c]) for c in columns), columns))
        done.update(ready)
    return blocks


def solved_by_blocks(
    matrix: np.ndarray,
    rights: Sequence[Sequence[Expression]],
    blocks: Sequence[Block],
    known: dict[int, list[Expression]] | None = None,
) -> np.ndarray:
    """X with ``matrix`` X = ``rights``, shape (columns, rights), as expressions.

    ``rights`` are given by column; ``known`` are rows of X that need no solution.
    """
    solution = np.full((matrix.shape[1], len(rights)), ZERO, dtype=object)
    for column, row in (known or {}).items():
        solution[column] = row
    done: list[int] = []
    for block in blocks:
        if known is None or not set(block.columns) <= known.keys():
            own = [
                [_rest(matrix[r], right[r], solution[:, k], done) for r in block.rows]
                for k, right in enumerate(rights)
            ]
            for k, values in enumerate(solved(matrix[np.ix_(block.rows, block.columns)], own)):
                solution[list(block.columns), k] = values
        done.extend(block.columns)
    return solution


def _rest(
    row: np.ndarray, right: Expression, solution: np.ndarray, done: Sequence[int]
) -> Expression:
    for column in done:
        right = right - row[column] * solution[column]
    return right


def solved(matrix: np.ndarray, rights: Columns) -> Columns:
    """Solutions of a square system, one for each right side."""
    size = len(matrix)
    if size > 3:
        return _orthogonal(matrix, rights)
    cofactors = np.full((size, size), ZERO, dtype=object)
    for i in range(size):
        for j in range(size):
            minor = np.delete(np.delete(matrix, i, axis=0), j, axis=1)
            cofactors[i, j] = _determinant(minor) * (-1.0) ** (i + j)
    total = _sum(matrix[0, j] * cofactors[0, j] for j in range(size))
    if size == 1:
        return [[divide(right[0], total)] for right in rights]
    inverse = divide(ONE, total)
    return [
        [_sum(cofactors[i, j] * right[i] for i in range(size)) * inverse for j in range(size)]
        for right in rights
    ]


def _determinant(matrix: np.ndarray) -> Expression:
    """Determinant of at most two rows."""
    if len(matrix) == 0:
        return ONE
    if len(matrix) == 1:
        return matrix[0, 0]
    return matrix[0, 0] * matrix[1, 1] - matrix[0, 1] * matrix[1, 0]


def _orthogonal(matrix: np.ndarray, rights: Columns) -> Columns:
    """A = Q R column by column, R x = Qᵀ b; b is made orthogonal along with the columns of A."""
    size = len(matrix)
    columns = [list(matrix[:, j]) for j in range(size)] + [list(right) for right in rights]
    triangle = np.full((size, len(columns)), ZERO, dtype=object)
    for k in range(size):
        length = call("sqrt", _sum(x * x for x in columns[k]))
        inverse = divide(ONE, length)
        unit = [x * inverse for x in columns[k]]
        triangle[k, k] = length
        for j in range(k + 1, len(columns)):
            triangle[k, j] = share = _sum(a * b for a, b in zip(unit, columns[j], strict=True))
            columns[j] = [b - share * a for a, b in zip(unit, columns[j], strict=True)]
    solutions: Columns = []
    for j in range(size, len(columns)):
        x: list[Expression] = [ZERO] * size
        for k in reversed(range(size)):
            rest = triangle[k, j] - _sum(triangle[k, i] * x[i] for i in range(k + 1, size))
            x[k] = divide(rest, triangle[k, k])
        solutions.append(x)
    return solutions


def _sum(terms: Iterable[Expression]) -> Expression:
    total: Expression = ZERO
    for term in terms:
        total = total + term
    return total
