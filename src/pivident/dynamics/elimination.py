"""Linear equations of a few unknowns in compiled code, with row exchanges.

``eliminate`` solves them at once (Gauss and Jordan); ``factor`` and ``solve`` (P A = L U) where
several right sides follow each other.
"""

from __future__ import annotations

from pivident.compiled import summing


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


@summing
def factor(matrix, order):
    """L and U in place of a matrix; ``order`` receives the row exchanges, (n,). False: singular.

    On the diagonal are the inverses of the pivots.
    """
    n = order.size
    for i in range(n):
        best = i
        for k in range(i + 1, n):
            if abs(matrix[k, i]) > abs(matrix[best, i]):
                best = k
        order[i] = best
        if not abs(matrix[best, i]) > 0.0:
            return False
        if best != i:
            for c in range(n):
                matrix[i, c], matrix[best, c] = matrix[best, c], matrix[i, c]
        inverse = 1.0 / matrix[i, i]
        matrix[i, i] = inverse
        for k in range(i + 1, n):
            share = matrix[k, i] * inverse
            matrix[k, i] = share
            if share != 0.0:
                for c in range(i + 1, n):
                    matrix[k, c] -= share * matrix[i, c]
    return True


@summing
def solve(matrix, order, right):
    """Right ← A⁻¹ right, (n, columns), from what ``factor`` has made of A."""
    n, columns = right.shape
    for i in range(n):
        best = order[i]
        if best != i:
            for c in range(columns):
                right[i, c], right[best, c] = right[best, c], right[i, c]
    for i in range(n):
        for k in range(i + 1, n):
            share = matrix[k, i]
            if share != 0.0:
                for c in range(columns):
                    right[k, c] -= share * right[i, c]
    for i in range(n - 1, -1, -1):
        for c in range(columns):
            right[i, c] *= matrix[i, i]
        for k in range(i):
            share = matrix[k, i]
            if share != 0.0:
                for c in range(columns):
                    right[k, c] -= share * right[i, c]
