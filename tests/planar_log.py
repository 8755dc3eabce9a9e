"""A user's log of the planar arm: simulated in closed loop, written as CSV in degrees."""

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

RATE = 1000.0
HEADER = "time,q1,q2,r1,r2,tau1,tau2"

#: The experiment file that belongs to the log.
EXPERIMENT = """
robot = "planar_2r"

[recording]
files = "log.csv"
columns = {t = "time", q = ["q1", "q2"], q_ref = ["r1", "r2"], tau = ["tau1", "tau2"]}
units = {q = "deg", q_ref = "deg", tau = "N m"}

[controller]
type = "pd"
kp = [6000, 2500]
kd = [180, 60]

[identify]
methods = ["ls"]
"""


def planar_truth() -> dict[str, float]:
    base = base_parameters(load_robot("planar_2r"))
    values = base.values(nominal_values(base.robot, base.standard))
    return dict(zip(base.names, values.tolist(), strict=True))


@cache
def planar_log(samples: int = 8000) -> np.ndarray:
    """Columns of the log: time, two positions, two references [deg], two torques [N m]."""
    robot = load_robot("planar_2r")
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    rng = np.random.default_rng(2)
    postures = rng.uniform(-1.5, 1.5, (30, 2))
    q_ref, _, _ = point_to_point(postures, 0.8 * robot.rated_speeds, RATE, samples)
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
    time = np.arange(samples) / RATE
    degrees = np.rad2deg(np.hstack([made.q + noise, q_ref]))
    return np.column_stack([time, degrees, made.tau])


def write_log(path: Path) -> Path:
    """Write the log with enough digits for its encoders."""
    np.savetxt(path, planar_log(), fmt="%.9g", delimiter=",", header=HEADER, comments="")
    return path


def write_experiment(folder: Path, text: str = EXPERIMENT) -> Path:
    """Write log and experiment file into a folder; returns the experiment file."""
    write_log(folder / "log.csv")
    path = folder / "experiment.toml"
    path.write_text(text, encoding="utf-8")
    return path
