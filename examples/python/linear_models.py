"""Linear models from arrays: SRIVC and RIVC of a motor, and derivatives of an encoder by irwsm."""

import numpy as np
from numpy.typing import NDArray
from scipy.signal import TransferFunction, dlsim, lfilter

from pivident.linear import LinearEstimate, rivc, srivc
from pivident.signals import SmoothedSignal, irwsm

RATE = 200.0  # Hz
TRUE = {"numerator": [50.0], "denominator": [1.0, 8.0, 25.0]}  # 50/(p² + 8 p + 25)


def main() -> tuple[LinearEstimate, LinearEstimate, SmoothedSignal, NDArray[np.float64]]:
    """Estimates in white and in coloured noise, a smoothed encoder, and its true acceleration."""
    rng = np.random.default_rng(0)
    u = rng.choice([-1.0, 1.0], 500).repeat(10)  # held for ten samples
    plant = TransferFunction(TRUE["numerator"], TRUE["denominator"])
    _, y = dlsim(plant.to_discrete(1.0 / RATE, method="zoh"), u)
    white = srivc(u, y[:, 0] + 0.1 * rng.normal(size=u.size), 1.0 / RATE, 0, 2)
    colour = lfilter([1.0], [1.0, -0.9], 0.05 * rng.normal(size=u.size))
    coloured = rivc(u, y[:, 0] + colour, 1.0 / RATE, 0, 2)

    t = np.arange(4000) / 1000.0
    q, acceleration = np.sin(3.0 * t) + 0.3 * np.cos(9.0 * t), np.zeros(t.size)
    acceleration[:] = -9.0 * np.sin(3.0 * t) - 24.3 * np.cos(9.0 * t)
    smoothed = irwsm(q + 1e-4 * rng.normal(size=t.size), rate=1000.0)
    return white, coloured, smoothed, acceleration


if __name__ == "__main__":
    print(main()[1])
