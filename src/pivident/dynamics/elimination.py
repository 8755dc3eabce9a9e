"""Linear equations of a few unknowns in compiled code.

``eliminate`` solves them at once (Gauss and Jordan). ``factor``, ``solve`` and ``solve_all``,

    A = L U up to the order of rows and columns,    A x = b,

are for matrices that follow each other with zeros at the same places, as the slopes of closed
loops do. With the order of the pivots it is known which products there are; they are listed once,
and the list is run through without a search from then on. Each pivot is the one that costs the
fewest products (Markowitz, The elimination form of the inverse, Management Science 3, 1957) among
those that are at least ``LEAST_PIVOT`` of the largest number in their column. An order serves as
long as no row takes more than ``LARGEST_SHARE`` of another.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.foundation.compiled import inlined, inner, summing

#: Least size of a pivot when the order is found, in the largest number left in its column.
LEAST_PIVOT = 0.1

#: Largest share of the pivot's row that is taken from another one, in an order found before.
LARGEST_SHARE = 100.0

#: Right sides that are solved at a time; their number is a multiple of it.
SIDE_BY_SIDE = 4


@summing
def eliminate(matrix, right):
    """Right ← matrix⁻¹ right, with row exchanges; the matrix is destroyed. False: singular."""
    n, columns = right.shape
    for i in range(n):
        best = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[best, i]):
                best = k
        if not abs(matrix[best, i]) > 0.0:
            return False
        if best != i:
            for c in range(n):
                matrix[i, c], matrix[best, c] = matrix[best, c], matrix[i, c]
            for c in range(columns):
                right[i, c], right[best, c] = right[best, c], right[i, c]
        inverse = 1.0 / matrix[i, i]
        for c in range(columns):
            right[i, c] *= inverse
        for c in range(i, n):
            matrix[i, c] *= inverse
        for k in range(n):
            share = matrix[k, i]
            if k != i and share != 0.0:
                for c in range(i, n):
                    matrix[k, c] -= share * matrix[i, c]
                for c in range(columns):
                    right[k, c] -= share * right[i, c]
    return True


class SparseFactors(NamedTuple):
    """A matrix, its factors, and how they are made; entries are counted row by row."""

    pattern: np.ndarray  # 1 where the matrix may be other than zero, (n, n)
    matrix: np.ndarray  # A, (n, n)
    value: np.ndarray  # shares L, U and the inverses of the pivots, where A has them, (n · n,)
    pivot: np.ndarray  # row and column of each pivot, (n, 2); -1: not found yet
    place: np.ndarray  # entry of each pivot and its row, (n, 2)
    row: np.ndarray  # row of the pivot of each unknown, (n,)
    lower: np.ndarray  # entry of each share and the row that it is taken from, (n (n - 1)/2, 2)
    #: Entry of each product's sum, of its share and of its other factor, (n (n² - 1)/3, 3).
    product: np.ndarray
    upper: np.ndarray  # entry of each number of U and its row, last unknowns first, likewise
    end: np.ndarray  # where the shares, products and numbers of U of each pivot end, (n, 3)
    left: np.ndarray  # scratch: what is left of A, (n, n)
    filled: np.ndarray  # scratch: 1 where that may be other than zero, 2 in rows of U, (n, n)


def sparse_factors(pattern: np.ndarray) -> SparseFactors:
    """Factors of no matrix yet; ``pattern``: True where it may be other than zero, (n, n)."""
    n = len(pattern)
    return SparseFactors(
        pattern=np.array(pattern, dtype=np.int64).reshape(n, n),
        matrix=np.zeros((n, n)),
        value=np.zeros(n * n),
        pivot=np.full((n, 2), -1, dtype=np.int64),
        place=np.zeros((n, 2), dtype=np.uint64),
        row=np.zeros(n, dtype=np.int64),
        lower=np.zeros((n * (n - 1) // 2, 2), dtype=np.uint64),
        product=np.zeros((n * (n * n - 1) // 3, 3), dtype=np.uint64),
        upper=np.zeros((n * (n - 1) // 2, 2), dtype=np.uint64),
        end=np.zeros((n, 3), dtype=np.int64),
        left=np.zeros((n, n)),
        filled=np.zeros((n, n), dtype=np.int64),
    )


def right_sides(n: int, columns: int) -> np.ndarray:
    """Zeros for so many right sides, with columns beyond them that nothing is written to."""
    return np.zeros((-(-columns // SIDE_BY_SIDE), n, SIDE_BY_SIDE))


@inner
def _best_pivot(f):
    """Row and column of the pivot that costs the fewest products; row -1: the matrix is singular.

    Of equal ones the largest, in its column's measure.
    """
    n = f.pivot.shape[0]
    row, column, least, best = -1, -1, n * n, 0.0
    for c in range(n):
        largest, others = 0.0, -1
        for k in range(n):
            if f.filled[k, c] == 1:
                largest = max(largest, abs(f.left[k, c]))
                others += 1
        for k in range(n):
            if f.filled[k, c] != 1 or not abs(f.left[k, c]) > 0.0:
                continue
            size = abs(f.left[k, c]) / largest
            cost = -1
            for j in range(n):
                if f.filled[k, j] == 1:
                    cost += 1
            cost *= others
            if size >= LEAST_PIVOT and (cost < least or (cost == least and size > best)):
                row, column, least, best = k, c, cost, size
    return row, column


@inner
def _find_order(f):
    """Order of the pivots for the present matrix, and lists of all products. False: singular."""
    n = f.pivot.shape[0]
    for k in range(n):
        for c in range(n):
            f.left[k, c], f.filled[k, c] = f.matrix[k, c], f.pattern[k, c]
    shares, products, numbers = 0, 0, 0
    for i in range(n):
        row, column = _best_pivot(f)
        if row < 0:
            return False
        f.pivot[i, 0], f.pivot[i, 1] = row, column
        for k in range(n):
            if k == row or f.filled[k, column] != 1:
                continue
            share = f.left[k, column] / f.left[row, column]
            f.lower[shares, 0], f.lower[shares, 1] = k * n + column, k
            shares += 1
            for c in range(n):
                if c != column and f.filled[row, c] == 1:
                    f.left[k, c] -= share * f.left[row, c]
                    f.filled[k, c] = 1
                    f.product[products, 0] = k * n + c
                    f.product[products, 1] = k * n + column
                    f.product[products, 2] = row * n + c
                    products += 1
        # what is left in the pivot's row is U
        for k in range(n):
            f.filled[k, column] = 0 if f.filled[k, column] == 1 else f.filled[k, column]
        for c in range(n):
            f.filled[row, c] = 2 if f.filled[row, c] == 1 else f.filled[row, c]
        f.place[i, 0], f.place[i, 1], f.row[column] = row * n + column, row, row
        f.end[i, 0], f.end[i, 1] = shares, products
    for i in range(n - 1, -1, -1):
        for j in range(i):
            row, column = f.pivot[j, 0], f.pivot[i, 1]
            if f.filled[row, column] == 2:
                f.upper[numbers, 0], f.upper[numbers, 1] = row * n + column, row
                numbers += 1
        f.end[i, 2] = numbers
    return True


@inlined
def _run_through(f):
    """Factors by the order that is known; False: it does not serve this matrix."""
    n, value = f.pivot.shape[0], f.value
    for k in range(n):
        for c in range(n):
            value[k * n + c] = f.matrix[k, c]
    share, product = 0, 0
    for i in range(n):
        place = f.place[i, 0]
        inverse = 1.0 / value[place]
        value[place] = inverse
        while share < f.end[i, 0]:
            entry = f.lower[share, 0]
            part = value[entry] * inverse
            if not abs(part) <= LARGEST_SHARE:
                return False
            value[entry] = part
            share += 1
        while product < f.end[i, 1]:
            a, b = f.product[product, 1], f.product[product, 2]
            value[f.product[product, 0]] -= value[a] * value[b]
            product += 1
        if not abs(inverse) < np.inf:
            return False
    return True


@inner
def factor(f):
    """Factors of ``f.matrix``. False: it is singular."""
    if f.pivot.shape[0] == 0 or (f.pivot[0, 0] >= 0 and _run_through(f)):
        return True
    if not _find_order(f):
        f.pivot[0, 0] = -1
        return False
    return _run_through(f)


@inner
def solve(f, right):
    """Right ← L⁻¹ b, then x, of one right side, (n,): unknown c in row ``f.row[c]``."""
    value, n, share, number = f.value, f.pivot.shape[0], 0, 0
    for i in range(n):
        x = right[f.place[i, 1]]
        while share < f.end[i, 0]:
            right[f.lower[share, 1]] -= value[f.lower[share, 0]] * x
            share += 1
    for i in range(n - 1, -1, -1):
        row = f.place[i, 1]
        x = right[row] * value[f.place[i, 0]]
        right[row] = x
        while number < f.end[i, 2]:
            right[f.upper[number, 1]] -= value[f.upper[number, 0]] * x
            number += 1


@inner
def solve_all(f, right):
    """As ``solve``, of several right sides, see ``right_sides``."""
    value, n = f.value, f.pivot.shape[0]
    for g in range(right.shape[0]):
        side, share, number = right[g], 0, 0
        for i in range(n):
            pivot = side[f.place[i, 1]]
            x0, x1, x2, x3 = pivot[0], pivot[1], pivot[2], pivot[3]
            while share < f.end[i, 0]:
                part, own = value[f.lower[share, 0]], side[f.lower[share, 1]]
                own[0] -= part * x0
                own[1] -= part * x1
                own[2] -= part * x2
                own[3] -= part * x3
                share += 1
        for i in range(n - 1, -1, -1):
            pivot, inverse = side[f.place[i, 1]], value[f.place[i, 0]]
            x0, x1, x2, x3 = pivot[0], pivot[1], pivot[2], pivot[3]
            x0, x1, x2, x3 = x0 * inverse, x1 * inverse, x2 * inverse, x3 * inverse
            pivot[0], pivot[1], pivot[2], pivot[3] = x0, x1, x2, x3
            while number < f.end[i, 2]:
                part, own = value[f.upper[number, 0]], side[f.upper[number, 1]]
                own[0] -= part * x0
                own[1] -= part * x1
                own[2] -= part * x2
                own[3] -= part * x3
                number += 1
