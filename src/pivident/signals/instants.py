"""From averages over the adjoining sampling periods to values at the instant.

Differences of positions and a torque that is held over each period are averages, not values:

    (q_{k+1} - q_{k-1}) / 2h            = dq(t_k) + h²/6 d³q + …
    (q_{k+1} - 2 q_k + q_{k-1}) / h²    = ddq(t_k) + h²/12 d⁴q + …
    (τ_k + τ_{k-1}) / 2                 = τ(t_k) + h²/12 d²τ + …

each by its own share of h². At 5 kHz and 2 Hz that is a millionth of viscous friction, which is
more than the deviations of a record with the applied torque. Two differences further the error is
of order h⁴: dq and ddq less their own second differences, and for the torque Numerov's rule,

    (x_{k-1} + 10 x_k + x_{k+1}) / 12   = τ_k,

solved for x.
"""

from __future__ import annotations

import numpy as np


def derivatives_at_instants(dq: np.ndarray, ddq: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Speeds dq - Δ²dq/6 and accelerations ddq - Δ²ddq/12 at the instants.

    Args:
        dq: first central differences, shape (samples, …) [rad/s or m/s].
        ddq: second ones, likewise; the outermost samples of both stay as they are.
    """
    return dq - _second_difference(dq) / 6.0, ddq - _second_difference(ddq) / 12.0


def torque_at_instants(tau: np.ndarray) -> np.ndarray:
    """Torque at the instants, from averages over the two adjoining periods (Numerov's rule).

    Args:
        tau: averages, shape (samples,) or (samples, joints) [N m or N]; beyond the ends they are
            taken to go on unchanged.
    """
    from scipy.linalg import solve_banded

    bands = np.full((3, len(tau)), 1.0 / 12.0)
    bands[1] = 10.0 / 12.0
    bands[1, [0, -1]] = 11.0 / 12.0
    return solve_banded((1, 1), bands, tau)


def _second_difference(x: np.ndarray) -> np.ndarray:
    """x_{k+1} - 2 x_k + x_{k-1} along axis 0, zero at both ends."""
    out = np.zeros_like(x)
    out[1:-1] = (x[2:] - x[1:-1]) - (x[1:-1] - x[:-2])
    return out
