"""From a CSV file to LS, IV and PIV, and to a data frame with an interval for every parameter."""

from pathlib import Path

import pandas as pd

import pivident as pv

COLUMNS = {"t": "time", "q": ["q1", "q2"], "q_ref": ["r1", "r2"], "tau": ["tau1", "tau2"]}
UNITS = {"q": "deg", "q_ref": "deg", "tau": "N m"}


def estimates(log: Path, level: float = 0.95) -> pd.DataFrame:
    """Estimates by three methods, one row for each parameter of each."""
    robot = pv.load_robot("planar_2r")
    recording = pv.load_recording(log, COLUMNS, units=UNITS, robot=robot)
    loop = pv.Loop(pv.PD(kp=[6000.0, 2500.0], kd=[180.0, 60.0]))
    problem = pv.Problem(robot, (recording,), loop)
    frames = []
    for method in ("ls", "iv", "piv"):
        result = pv.identify(problem, method)
        low, high = result.conf_int(level).T
        columns = {"parameter": result.names, "value": result.theta, "std": result.std}
        columns |= {"low": low, "high": high, "unit": result.units, "method": method}
        frames.append(pd.DataFrame(columns))
    return pd.concat(frames, ignore_index=True)


if __name__ == "__main__":
    print(estimates(Path("log.csv")).to_string())
