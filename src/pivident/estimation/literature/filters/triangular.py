"""Triangular factors in place, for matrices of the size of a filter's state.

    Cholesky   P = L Lᵀ
    LQ         W = [L 0] Q, row by row by Householder's reflections: L Lᵀ = W Wᵀ without forming it
    rank one   L' L'ᵀ = L Lᵀ ± v vᵀ  (Gill, Golub, Murray and Saunders 1974)

Diagonals are positive, so that each factor is the only one of its product.
"""

from __future__ import annotations

import math

from pivident.foundation.compiled import summing


@summing
def cholesky(matrix, factor):
    """L of a symmetric matrix (lower half read); -1, or the pivot that is not positive."""
    n = matrix.shape[0]
    for i in range(n):
        for j in range(i + 1):
            total = matrix[i, j]
            for k in range(j):
                total -= factor[i, k] * factor[j, k]
            if i == j:
                if not total > 0.0:
                    return i
                factor[i, i] = math.sqrt(total)
            else:
                factor[i, j] = total / factor[j, j]
                factor[j, i] = 0.0
    return -1


@summing
def solve_cholesky(factor, x):
    """X ← (L Lᵀ)⁻¹ x."""
    n = x.size
    for i in range(n):
        for k in range(i):
            x[i] -= factor[i, k] * x[k]
        x[i] /= factor[i, i]
    for i in range(n - 1, -1, -1):
        for k in range(i + 1, n):
            x[i] -= factor[k, i] * x[k]
        x[i] /= factor[i, i]


@summing
def lower_factor(wide, columns):
    """LQ of the first ``columns`` columns in place: the lower triangle of ``wide`` becomes L."""
    rows = wide.shape[0]
    for i in range(rows):
        own = wide[i, i:columns]
        square = 0.0
        for c in range(1, own.size):
            square += own[c] * own[c]
        head = own[0]
        length = math.sqrt(head * head + square)
        if square > 0.0:
            # reflection onto -sign(head) length, free of cancellation
            turned = -math.copysign(length, head)
            own[0] = head - turned
            norm = square + own[0] * own[0]
            for k in range(i + 1, rows):
                other = wide[k, i:columns]
                total = 0.0
                for c in range(own.size):
                    total += own[c] * other[c]
                total *= 2.0 / norm
                for c in range(own.size):
                    other[c] -= total * own[c]
            head = turned
            for c in range(1, own.size):
                own[c] = 0.0
            own[0] = head
        if head < 0.0:
            for k in range(i, rows):
                wide[k, i] = -wide[k, i]


@summing
def update_factor(factor, v, sign):
    """L of L Lᵀ + sign v vᵀ in place, v destroyed; -1, or the pivot that is not positive."""
    n = v.size
    for i in range(n):
        square = factor[i, i] ** 2 + sign * v[i] ** 2
        if not square > 0.0:
            return i
        pivot = math.sqrt(square)
        cosine, sine = pivot / factor[i, i], v[i] / factor[i, i]
        factor[i, i] = pivot
        for k in range(i + 1, n):
            factor[k, i] = (factor[k, i] + sign * sine * v[k]) / cosine
            v[k] = cosine * v[k] - sine * factor[k, i]
    return -1
