"""The planar arm's log without its torques, and the experiment file that belongs to it."""

from pathlib import Path

import numpy as np

from tests.planar_log import EXPERIMENT, HEADER, planar_log

#: The law is known, so that the torque follows from it.
POSITIONS_ONLY = (
    EXPERIMENT.replace(', tau = ["tau1", "tau2"]', "")
    .replace(', tau = "N m"', "")
    .replace('methods = ["ls"]\n', "")
)

#: The same with a law that nobody knows.
WITHOUT_LAW = POSITIONS_ONLY.partition("[controller]")[0]


def write_positions(folder: Path, text: str = POSITIONS_ONLY, seed: int = 2) -> Path:
    """Write a log of time, positions and references, and the experiment file; returns the latter.

    The columns of the torques are not in the log.
    """
    names = HEADER.split(",")[:5]
    table = planar_log(seed=seed)[:, :5]
    np.savetxt(
        folder / "log.csv", table, fmt="%.9g", delimiter=",", header=",".join(names), comments=""
    )
    path = folder / "experiment.toml"
    path.write_text(text, encoding="utf-8")
    return path
