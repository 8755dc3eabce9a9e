"""A smooth motion with reversals and standstill, and one law of every kind, for the tests."""

import numpy as np

from pivident.robot.friction import (
    FrictionLaw,
    asymmetric_coulomb,
    asymmetric_viscous,
    coulomb,
    counterbalance,
    dahl,
    load_dependent,
    lugre,
    maxwell_slip,
    offset,
    power_viscous,
    ripple,
    spring,
    stribeck,
    viscous,
)

GAMMA = 60.0

LAWS = {
    "directions": (*asymmetric_viscous(), *asymmetric_coulomb(gamma=GAMMA)),
    "polynomial": (
        viscous(), power_viscous(2.0, "fva"), power_viscous(3.0, "fvb"), coulomb(gamma=GAMMA),
    ),
    "harmonic drive": (power_viscous(1 / 3, gamma=GAMMA), coulomb("tanh", GAMMA), offset()),
    "stribeck": (viscous(), coulomb(gamma=GAMMA), stribeck(0.2, 1.5, gamma=GAMMA), offset()),
    "ripple": (viscous(), coulomb(gamma=GAMMA), offset(), *ripple(7.0), *ripple(31.5, "_b")),
    "spring": (viscous(), coulomb(gamma=GAMMA), spring()),
    "counterbalance": (viscous(), coulomb(gamma=GAMMA), counterbalance(0.4, 0.3)[0], offset()),
    "load": (viscous(), coulomb(gamma=GAMMA), load_dependent(gamma=GAMMA), offset()),
    "dahl": (viscous(), dahl(2e-3), offset()),
    "lugre": (viscous(), *lugre(2e-3, 0.4, 0.1), offset()),
    "slip": (viscous(), *maxwell_slip([5e-4, 3e-3, 2e-2]), offset()),
    "coarse slip": (viscous(), *maxwell_slip([1e-2, 1e-1]), offset()),
    "weakening slip": (viscous(), *maxwell_slip([1e-3, 1e-2], 0.5, 0.2, 1.0)),
    "load and memory": (viscous(), dahl(2e-3), load_dependent("tanh", GAMMA)),
}  # fmt: skip


def law(name: str) -> FrictionLaw:
    return FrictionLaw(LAWS[name])


def smooth_motion(
    rate: float, duration: float, joints: int
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Sums of sines, their speeds and accelerations, each (samples, joints)."""
    rng = np.random.default_rng(1968)
    t = np.arange(round(rate * duration) + 1)[:, None, None] / rate
    w = 2.0 * np.pi * rng.uniform(0.2, 2.0, (1, joints, 5))
    a, phase = rng.uniform(0.1, 0.5, w.shape), rng.uniform(0.0, 6.0, w.shape)
    x = w * t + phase
    return (
        (a * np.sin(x)).sum(2),
        (a * w * np.cos(x)).sum(2),
        (-a * w**2 * np.sin(x)).sum(2),
    )
