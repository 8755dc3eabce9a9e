"""A user's log of the planar arm: simulated in closed loop, written as CSV in degrees."""

from functools import cache
from io import StringIO
from pathlib import Path

import numpy as np

from tests.planar_arm import nominal_parameters, planar_motion, planar_record

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
    base, values = nominal_parameters()
    return dict(zip(base.names, values.tolist(), strict=True))


@cache
def planar_log(samples: int = 8000, seed: int = 2) -> np.ndarray:
    """Columns of the log: time, two positions, two references [deg], two torques [N m].

    The seed makes motion and noise.
    """
    rng = np.random.default_rng(seed)
    q_ref = planar_motion(rng, RATE, samples)
    q, tau = planar_record(*nominal_parameters(), q_ref, RATE, rng)
    time = np.arange(samples) / RATE
    return np.column_stack([time, np.rad2deg(np.hstack([q, q_ref])), tau])


@cache
def log_text() -> str:
    """The log with enough digits for its encoders."""
    text = StringIO()
    np.savetxt(text, planar_log(), fmt="%.9g", delimiter=",", header=HEADER, comments="")
    return text.getvalue()


def write_log(path: Path) -> Path:
    """Write the log as CSV."""
    path.write_text(log_text(), encoding="utf-8")
    return path


def write_experiment(folder: Path, text: str = EXPERIMENT) -> Path:
    """Write log and experiment file into a folder; returns the experiment file."""
    write_log(folder / "log.csv")
    path = folder / "experiment.toml"
    path.write_text(text, encoding="utf-8")
    return path
