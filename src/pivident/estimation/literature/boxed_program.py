"""Linear programs over rows that have a bound on either side, by the dual simplex method.

    minimise cᵀθ   where   |τ_r - a_r θ| ≤ ε_r   on all rows r

A *basis* is as many independent rows as there are parameters, each held at one of its bounds:
a_k θ = τ_k + s_k ε_k. With the prices y, Σ y_k a_k = c, and sides s_k = -sign y_k,

    cᵀθ = Σ y_k τ_k - |y_k| ε_k

is a lower bound of the minimum (weak duality), and the minimum itself where θ keeps to all rows.
Sides can be chosen for every basis, so that none has to be searched for at the start, and the last
one of another c serves (Wagner 1958). The row that θ violates most enters, its price grows from
zero; others pass zero and change sides until the bound would fall: that one leaves (Fourer 1994;
Maros 2003).

Where several prices are zero, exchanges may go in a circle. They are made for a cost that differs
by a ten-billionth, for which none is; the bound is that of the cost itself.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pivident.dynamics.elimination import eliminate
from pivident.foundation.compiled import kernel, summing

#: Most exchanges of a program, for each of its parameters.
MAX_EXCHANGES = 1000

#: Exchanges after which the inverse is made anew.
RENEWED = 100

#: Violation, over the bound, that is none, and relative change of the cost.
FEASIBLE, CHANGED = 1e-10, 1e-10

#: Price, over the largest, that is none: either side will do.
NO_PRICE = 1e-14

#: Least share of a leaving row in the one that enters, over the largest. Prices of smaller ones may
#: pass zero unnoticed, until they are made anew.
LEAST_PIVOT = 1e-7


class Basis(NamedTuple):
    """Rows that determine θ, and what follows from them."""

    rows: np.ndarray  # numbers of the rows, (parameters,)
    inverse: np.ndarray  # in row k the change of θ that changes a_k θ by one, and no other
    price: np.ndarray  # y, (parameters,)
    side: np.ndarray  # s, likewise
    share: np.ndarray  # w of the row that enters, a_r = Σ w_k a_k, likewise
    step: np.ndarray  # growth of its price at which y_k is zero, likewise
    theta: np.ndarray  # θ, likewise
    cost: np.ndarray  # c, changed a little, likewise
    matrix: np.ndarray  # scratch, (parameters, parameters)


def lower_bound(tau: np.ndarray, bound: np.ndarray, basis: Basis) -> float:
    """Σ y_k τ_k - |y_k| ε_k, below which cᵀθ is for no θ that keeps to the rows."""
    return float(basis.price @ tau[basis.rows] - np.abs(basis.price) @ bound[basis.rows])


def basis_of(rows: np.ndarray) -> Basis:
    """A basis of independent rows, by their numbers, (parameters,)."""
    n = len(rows)
    price, share, step, theta, cost = np.zeros((5, n))
    inverse, matrix = np.zeros((2, n, n))
    own = np.asarray(rows, np.int64)
    return Basis(own, inverse, price, np.ones(n), share, step, theta, cost, matrix)


@kernel
def minimise(phi, tau, bound, cost, basis):
    """Exchange rows of the basis until θ keeps to all rows.

    ``phi``: (rows, parameters); ``tau`` and ``bound``: (rows,); ``cost``: c. Returns whether it
    does; if not, the rows contradict each other, or are too nearly dependent.
    """
    renewed, largest = -1, 0.0
    for a in range(cost.size):
        largest = max(largest, abs(cost[a]))
    for a in range(cost.size):  # shares of the golden ratio: as good as random
        part = 0.6180339887498949 * (a + 1)
        basis.cost[a] = cost[a] + CHANGED * largest * (0.5 + part - math.floor(part))
    for exchange in range(MAX_EXCHANGES * cost.size):
        if renewed < 0 or exchange - renewed >= RENEWED:
            if not _renew(phi, basis):
                return False
            renewed = exchange
        _place(tau, bound, basis)
        row, error = _most_violated(phi, tau, bound, basis.theta)
        if row < 0:
            if exchange == renewed:
                _multiply(basis.inverse, cost, basis.price)
                return True
            renewed = -1
            continue
        _multiply(basis.inverse, phi[row], basis.share)
        way = 1.0 if error > 0.0 else -1.0
        leaving = _leaving(bound, basis, way, bound[row] * (abs(error) - 1.0))
        if leaving < 0:  # rounding alone may say so
            if exchange == renewed:
                return False
            renewed = -1
            continue
        _exchange(basis, leaving, row, way)
    return False


@kernel
def _renew(phi, basis):
    """The inverse, and the prices, from the rows; False: they are dependent."""
    size = basis.cost.size
    for k in range(size):
        for a in range(size):
            basis.matrix[a, k] = phi[basis.rows[k], a]
            basis.inverse[k, a] = 1.0 if a == k else 0.0
    if not eliminate(basis.matrix, basis.inverse):
        return False
    _multiply(basis.inverse, basis.cost, basis.price)
    largest = 0.0
    for k in range(size):
        largest = max(largest, abs(basis.price[k]))
    for k in range(size):  # prices that are zero but for rounding have no say
        if abs(basis.price[k]) > NO_PRICE * largest:
            basis.side[k] = -1.0 if basis.price[k] > 0.0 else 1.0
    return True


@summing
def _multiply(inverse, vector, out):
    """Products of the inverse's rows with a vector."""
    for k in range(out.size):
        total = 0.0
        for a in range(vector.size):
            total += inverse[k, a] * vector[a]
        out[k] = total


@summing
def _place(tau, bound, basis):
    """θ where each row of the basis is at its side."""
    theta, size = basis.theta, basis.theta.size
    for a in range(size):
        theta[a] = 0.0
    for k in range(size):
        row = basis.rows[k]
        held = tau[row] + basis.side[k] * bound[row]
        for a in range(size):
            theta[a] += held * basis.inverse[k, a]


@summing
def _most_violated(phi, tau, bound, theta):
    """Number of the row with the largest (a_r θ - τ_r)/ε_r, and this; -1: none is violated."""
    worst, largest, signed = -1, 1.0 + FEASIBLE, 0.0
    for r in range(tau.size):
        total = -tau[r]
        for a in range(theta.size):
            total += phi[r, a] * theta[a]
        if abs(total) > largest * bound[r]:
            signed = total / bound[r]
            worst, largest = r, abs(signed)
    return worst, signed


@kernel
def _leaving(bound, basis, way, slope):
    """Which row of the basis leaves; ``slope``: growth of cᵀθ by the entering price; -1: none."""
    price, share, side, step = basis.price, basis.share, basis.side, basis.step
    size, largest = price.size, 0.0
    for k in range(size):
        largest = max(largest, abs(share[k]))
    for k in range(size):
        step[k] = np.inf
        if way * share[k] * side[k] > LEAST_PIVOT * largest:
            step[k] = abs(price[k] / share[k])
    while True:
        first = -1
        for k in range(size):
            if step[k] < np.inf and (first < 0 or step[k] < step[first]):
                first = k
        if first < 0:
            return -1
        slope -= 2.0 * bound[basis.rows[first]] * abs(share[first])
        if slope <= 0.0:
            return first
        step[first], side[first] = np.inf, -side[first]


@summing
def _exchange(basis, leaving, row, way):
    """A row in place of another."""
    inverse, price, share, size = basis.inverse, basis.price, basis.share, basis.price.size
    growth = way * basis.step[leaving]
    pivot = 1.0 / share[leaving]
    for a in range(size):
        inverse[leaving, a] *= pivot
    for k in range(size):
        if k == leaving:
            continue
        price[k] += growth * share[k]
        for a in range(size):
            inverse[k, a] -= share[k] * inverse[leaving, a]
    basis.rows[leaving], basis.side[leaving], price[leaving] = row, way, -growth
