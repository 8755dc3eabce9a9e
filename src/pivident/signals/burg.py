"""Burg's reflection coefficients, by the lattice or from sums of products.

Burg (1975) minimises forward and backward prediction errors order by order; with sums over all
stretches of the record,

    k_p = -2 Σ f b / Σ (f² + b²),   f ← f + k_p b,   b ← b + k_p f.

The *lattice* computes exactly this: every order reads and writes the whole record. But f and b are
combinations of p + 2 neighbouring samples x, f = αᵀx and b = βᵀx with α = (1, a_1 … a_p, 0) and β
its reverse, so the sums are quadratic forms of

    Q_ij = Σ v_{n-i} v_{n-j} = c_{|i-j|} - (products at the beginning and at the end)

with the products c_k = Σ v_n v_{n-k} of the whole record (after K. Vos, *A fast implementation of
Burg's method*, 2013). One pass over the record computes them; the orders then cost no more with
more samples. Rounding grows with (Σ|a|)² c_0 / Σ f², which is monitored: where it could matter, as
on a spectrum with a deep notch, the lattice is used.
"""

from __future__ import annotations

import numpy as np

from pivident.foundation.compiled import compiled, section

#: Largest relative rounding of a sum of squares that does not matter: coefficients are estimates
#: with errors of 1/√N, a thousand times as large.
_ROUNDING = 1e-6

#: Samples of a stretch that stays in the fastest cache.
_STRETCH = 1024

#: Sums may be reordered, so that they vectorise; no other fast arithmetic is allowed.
_REORDERED = {"contract", "reassoc"}


def reflection_coefficients(v: np.ndarray, stops: np.ndarray, order: int) -> np.ndarray:
    """Reflection coefficients k_1 … k_order of centred samples ``v``, stretches end to end.

    ``stops`` are the ends of the stretches. Zeros from the order on that leaves nothing to predict.
    """
    shortest = int(np.diff(stops, prepend=0).min())
    # multiply-adds: four of the lattice for every sample and order, against one and order³/6 and
    # those at the ends
    if v.size > order * (0.3 * order + 4 * len(stops)) and shortest > order + 1:
        whole, head, tail = products(v, stops, order)
        found, exact = by_products(whole, head, tail, order)
        if exact:
            return found
    return by_lattice(v, stops, order)


@compiled()
def by_lattice(v, stops, order):
    """Reflection coefficients by the lattice.

    At order p the errors of a stretch pair f[p+1+i] with b[i]: forward errors lose their first
    sample, backward errors their last, without moving any.
    """
    forward, backward = v.copy(), v.copy()
    reflections = np.zeros(order)
    for p in range(order):
        cross, energy = 0.0, 0.0
        start = 0
        for stop in stops:
            if stop - start > p + 1:
                part = _products(forward[start + p + 1 : stop], backward[start : stop - p - 1])
                cross += part[0]
                energy += part[1]
            start = stop
        if energy == 0:
            break
        k = -2 * cross / energy
        reflections[p] = k
        start = 0
        for stop in stops:
            if stop - start > p + 1:
                _reflect(forward[start + p + 1 : stop], backward[start : stop - p - 1], k)
            start = stop
    return reflections


@section
def _products(f, b):
    """Σ f b and Σ (f² + b²), in eight interleaved sums, which vectorise."""
    cross, energy = np.zeros(8), np.zeros(8)
    whole = f.size - f.size % 8
    for i in range(0, whole, 8):
        for lane in range(8):
            x, y = f[i + lane], b[i + lane]
            cross[lane] += x * y
            energy[lane] += x * x + y * y
    for i in range(whole, f.size):
        cross[0] += f[i] * b[i]
        energy[0] += f[i] * f[i] + b[i] * b[i]
    return cross.sum(), energy.sum()


@section
def _reflect(f, b, k):
    """One order of the lattice in place: f ← f + k b, b ← b + k f."""
    for i in range(f.size):
        x, y = f[i], b[i]
        f[i] = x + k * y
        b[i] = y + k * x


@compiled()
def products(v, stops, order):
    """c_k of all stretches (each longer than order + 1), and the products at their ends.

    With L the length of a stretch, ``head[k, t]`` = Σ_{k ≤ m ≤ t} v_m v_{m-k} and
    ``tail[k, i]`` = Σ_{L-i ≤ m < L} v_m v_{m-k}.
    """
    whole = np.zeros(order + 1)
    head, tail = np.zeros((order + 1, order + 1)), np.zeros((order + 1, order + 2))
    start = 0
    for stop in stops:
        for first in range(start, stop, _STRETCH):
            last = min(first + _STRETCH, stop)
            fours = 4 * (min(order - 3, first - start - 3) // 4 + 1)
            for k in range(0, fours, 4):
                sums = _four_sums(v, k, first, last)
                for i in range(4):  # of slices would be compiled five times as long
                    whole[k + i] += sums[i]
            for k in range(fours, order + 1):
                begin = max(first, start + k)
                if begin < last:
                    whole[k] += dot(v[begin:last], v[begin - k : last - k])
        for k in range(order + 1):
            total = 0.0
            for t in range(k, order + 1):
                total += v[start + t] * v[start + t - k]
                head[k, t] += total
            total = 0.0
            for i in range(1, order + 2):
                if stop - i - k >= start:
                    total += v[stop - i] * v[stop - i - k]
                tail[k, i] += total
        start = stop
    return whole, head, tail


@compiled(fastmath=_REORDERED)
def dot(x, y):
    """Σ x y; a library would start threads, which cost more than the product."""
    total = 0.0
    for i in range(x.size):
        total += x[i] * y[i]
    return total


@compiled(fastmath=_REORDERED)
def _four_sums(v, k, first, last):
    """Σ v_m v_{m-k} for k and the next three, first ≤ m < last; a sample serves all four."""
    x = v[first:last]
    y0, y1 = v[first - k : last - k], v[first - k - 1 : last - k - 1]
    y2, y3 = v[first - k - 2 : last - k - 2], v[first - k - 3 : last - k - 3]
    s0 = s1 = s2 = s3 = 0.0
    for i in range(x.size):
        s0 += x[i] * y0[i]
        s1 += x[i] * y1[i]
        s2 += x[i] * y2[i]
        s3 += x[i] * y3[i]
    return s0, s1, s2, s3


@compiled()
def by_products(whole, head, tail, order):
    """Reflection coefficients from :func:`products`, and whether rounding is negligible in them."""
    reflections = np.zeros(order)
    alpha = np.zeros(order + 2)
    alpha[0] = 1.0
    for p in range(order):
        last = p + 1  # α = (1, a_1 … a_p, 0); β is its reverse
        cross, energy, size = 0.0, 0.0, 0.0
        for i in range(last + 1):
            size += abs(alpha[i])
        for k in range(last + 1):  # a diagonal of Q, and its mirror image
            twice = 1.0 if k == 0 else 2.0
            for i in range(last + 1 - k):
                early = head[k, p - i] if i <= p else 0.0
                q = twice * (whole[k] - early - tail[k, i])
                x, y = alpha[i], alpha[i + k]
                mirrored_x, mirrored_y = alpha[last - i], alpha[last - i - k]
                energy += q * (x * y + mirrored_x * mirrored_y)
                cross += 0.5 * q * (x * mirrored_y + y * mirrored_x)
        if not energy * _ROUNDING > 2.0 * np.finfo(np.float64).eps * size**2 * whole[0]:
            return reflections, False
        reflection = -2.0 * cross / energy
        if not abs(reflection) < 1.0:
            return reflections, False
        reflections[p] = reflection
        for i in range((last + 1) // 2):  # α ← α + k β
            x, y = alpha[i], alpha[last - i]
            alpha[i] = x + reflection * y
            alpha[last - i] = y + reflection * x
        if last % 2 == 0:
            alpha[last // 2] *= 1.0 + reflection
    return reflections, True
