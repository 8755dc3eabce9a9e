"""A folder of logs: planar arms over some days, with warmth, scatter, and wear where wanted."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from tests.planar_arm import nominal_parameters, planar_motion, planar_record

RATE, SAMPLES = 500.0, 1000

#: Relative change of viscous friction per kelvin, and scatter of all friction between records.
WARMTH, SCATTER = -0.01, 0.004

TEMPLATE = """
robot = "planar_2r"

[recording]
columns = {q = "q", q_ref = "r", tau = "tau"}
rate = 500

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[fleet]
pattern = "{robot}/{day}.npz"
method = "ls"
temperature = "celsius"
"""


@cache
def reference() -> np.ndarray:
    return planar_motion(np.random.default_rng(2), RATE, SAMPLES)


def write_log(path: Path, factor: float, rng: np.random.Generator, celsius: float) -> None:
    """One record of an arm whose friction is so many times the nominal one at 30 °C."""
    base, theta = nominal_parameters()
    for k, p in enumerate(base.parameters):
        if p.friction is not None and p.friction.is_dissipative:
            theta[k] *= factor * (1.0 + SCATTER * rng.standard_normal())
            theta[k] *= 1.0 + WARMTH * (celsius - 30.0) * (p.stem == "fv")
    q, tau = planar_record(base, theta, reference(), RATE, rng)
    path.parent.mkdir(parents=True, exist_ok=True)
    warm = celsius + 0.1 * rng.standard_normal(SAMPLES)
    np.savez(path, q=q, r=reference(), tau=tau, celsius=warm)


def write_fleet(
    folder: Path,
    robots: int = 4,
    days: int = 5,
    worn: Mapping[str, float] = {},
    since: int = 4,
    text: str = TEMPLATE,
) -> Path:
    """Logs ``arm_1/2026-03-01.npz`` … and ``fleet.toml``.

    Args:
        folder: for logs and template.
        robots: number of arms.
        days: records of each.
        worn: factor on the friction of single arms.
        since: first worn day, counted from one.
        text: the template.
    """
    for r in range(1, robots + 1):
        rng = np.random.default_rng(r)
        own = 1.0 + 0.1 * rng.standard_normal()
        for day in range(1, days + 1):
            rise = worn.get(f"arm_{r}", 1.0) if day >= since else 1.0
            celsius = 30.0 + 5.0 * rng.standard_normal()
            write_log(folder / f"arm_{r}" / f"2026-03-{day:02d}.npz", own * rise, rng, celsius)
    path = folder / "fleet.toml"
    path.write_text(text, encoding="utf-8")
    return path
