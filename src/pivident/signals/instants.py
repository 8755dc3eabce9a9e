"""From averages over the adjoining sampling periods to values at the instant.

Differences of positions and a torque that is held over each period are averages, not values:

    (q_{k+1} - q_{k-1}) / 2h            = dq(t_k) + h²/6 d³q + …
    (q_{k+1} - 2 q_k + q_{k-1}) / h²    = ddq(t_k) + h²/12 d⁴q + …
    (τ_k + τ_{k-1}) / 2                 = τ(t_k) + h²/12 d²τ + …

each with its own error of order h². At 5 kHz and 2 Hz that is a millionth of viscous friction, more
than its standard error from a record with the applied torque. A second difference more leaves an
error of order h⁴: dq and ddq less their own second differences, and for the torque Numerov's rule,

    (x_{k-1} + 10 x_k + x_{k+1}) / 12   = τ_k,

solved for x.
"""

from __future__ import annotations

import numpy as np

from pivident.foundation.compiled import compiled


def derivatives_at_instants(dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speeds dq - Δ²dq/6 and accelerations ddq - Δ²ddq/12; the outermost samples are kept."""
    return slope_at_instants(dq), ddq - _second_difference(ddq) / 12.0


def slope_at_instants(slope: np.ndarray) -> np.ndarray:
    """Central differences x less their own second differences, x - Δ²x/6, along axis 0."""
    return slope - _second_difference(slope) / 6.0


def torque_at_instants(tau: np.ndarray) -> np.ndarray:
    """Torque at the instants, from averages over the two adjoining periods (Numerov's rule).

    Beyond the ends the averages are continued unchanged.
    """
    from scipy.linalg import solve_banded

    bands = np.full((3, len(tau)), 1.0 / 12.0)
    bands[1] = 10.0 / 12.0
    bands[1, [0, -1]] = 11.0 / 12.0
    return solve_banded((1, 1), bands, tau)


def differences_at_instants(
    q: np.ndarray, rate: float, first: int, dq: np.ndarray, ddq: np.ndarray
) -> None:
    """Speeds and accelerations at the instants on a stretch of positions (joints, samples)."""
    for j in range(len(q)):
        _differences_at_instants(q[j], float(rate), first, dq[j], ddq[j])


@compiled()
def _differences_at_instants(q, rate, first, dq, ddq):
    """The same for one joint; at the ends of the record the outermost differences repeat."""
    last, end = first + dq.size, q.size
    half, square = 0.5 * rate, rate**2
    # differences of the stretch and of a sample on either side, as far as the record goes
    begin, stop = max(first - 1, 0), min(last + 1, end)
    speed, acceleration = np.empty(stop - begin), np.empty(stop - begin)
    inner, outer = max(begin, 1), min(stop, end - 1)
    # views that begin at zero: only such loops vectorise
    before, here, after = q[inner - 1 : outer - 1], q[inner:outer], q[inner + 1 : outer + 1]
    v, a = speed[inner - begin : outer - begin], acceleration[inner - begin : outer - begin]
    for k in range(here.size):
        v[k] = half * (after[k] - before[k])
        a[k] = square * ((after[k] - here[k]) - (here[k] - before[k]))
    for x, out, share in ((speed, dq, 6.0), (acceleration, ddq, 12.0)):
        if begin == 0:
            x[0] = x[1]
        if stop == end:
            x[-1] = x[-2]
        _take_off_second_difference(x, first - begin, out, share)
        if first == 0:
            out[0] = x[0]
        if last == end:
            out[-1] = x[-1]


@compiled()
def _take_off_second_difference(x, first, out, share):
    """Out = x - Δ²x / share from sample ``first`` of x on, as far as x has both neighbours."""
    skip = 1 if first == 0 else 0
    stop = min(first + out.size, x.size - 1)
    before, here, after = (
        x[first + skip - 1 : stop - 1],
        x[first + skip : stop],
        x[first + skip + 1 :],
    )
    y = out[skip:]
    for k in range(here.size):
        y[k] = here[k] - ((after[k] - here[k]) - (here[k] - before[k])) / share


def _second_difference(x: np.ndarray) -> np.ndarray:
    """x_{k+1} - 2 x_k + x_{k-1} along axis 0, zero at both ends."""
    out = np.zeros_like(x)
    out[1:-1] = (x[2:] - x[1:-1]) - (x[1:-1] - x[:-2])
    return out
