"""A folder of logs: planar arms over some days, with warmth, scatter, and wear where wanted."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values
from pivident.robot import load_robot
from pivident.simulation.closed_loop import LoopSignals, simulate
from pivident.simulation.controllers import PD
from pivident.simulation.reference import point_to_point

RATE, SAMPLES = 500.0, 1000

#: Relative change of viscous friction per kelvin, and scatter of all friction between records.
WARMTH, SCATTER = -0.01, 0.004

TEMPLATE = """
robot = "planar_2r"

[recording]
columns = {q = "q", q_ref = "r", tau = "tau"}
rate = 500
simulated = true

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
    rng = np.random.default_rng(2)
    speeds = 0.8 * load_robot("planar_2r").rated_speeds
    return point_to_point(rng.uniform(-1.5, 1.5, (30, 2)), speeds, RATE, SAMPLES)[0]


def write_log(path: Path, factor: float, rng: np.random.Generator, celsius: float) -> None:
    """One record of an arm whose friction is so many times the nominal one at 30 °C."""
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    for k, p in enumerate(base.parameters):
        if p.friction is not None and p.friction.is_dissipative:
            theta[k] *= factor * (1.0 + SCATTER * rng.standard_normal())
            theta[k] *= 1.0 + WARMTH * (celsius - 30.0) * (p.stem == "fv")
    q_ref = reference()
    noise = 2e-6 * rng.standard_normal(q_ref.shape)
    signals = LoopSignals(
        rate=RATE,
        q_ref=q_ref,
        dq_ref=None,
        inputs=None,
        noise=noise,
        drive_gain=np.ones(2),
        limit=np.full(2, np.inf),
        bound=np.full(2, 0.5),
        speed_bound=np.full(2, 50.0),
    )
    controller = PD(np.array([6000.0, 2500.0]), np.array([180.0, 60.0]))
    made = simulate(make_model(robot, base.parameters, theta), controller, signals, ("1", "2"))
    path.parent.mkdir(parents=True, exist_ok=True)
    warm = celsius + 0.1 * rng.standard_normal(SAMPLES)
    np.savez(path, q=made.q + noise, r=q_ref, tau=made.tau, celsius=warm)


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
