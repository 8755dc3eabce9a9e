"""Whether torques of motors and of sensors behind the gears are told apart, over 30 arms.

    python benchmarks/torque_side.py [SEEDS]

Seven-axis arms of random bodies in MuJoCo, 15 s at 1 kHz; what the sensors feel by Pinocchio, with
none, 5 or 15 % of the friction in the bearings; see `tests/seven_axis_arm.py`. The public records
of motors follow, where ``PIVIDENT_DATA`` names their folder.
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.seven_axis_arm import seven_axis_log

from pivident.data.logs.log import Log
from pivident.experiment.check.torque_side import TorqueSideEvidence, torque_side_evidence
from pivident.experiment.experiment import load_experiment
from pivident.experiment.recording_tables import log_of
from pivident.foundation.errors import DatasetUnavailable
from pivident.judgement.audit.inverse_model import build_inverse_model
from pivident.judgement.audit.timing import check_timing
from pivident.robot.description import Robot
from pivident.robot.urdf import parse_urdf

#: Share of friction in the bearings, by seed.
BEARINGS = (0.0, 0.05, 0.15)

EXAMPLES = Path(__file__).resolve().parents[1] / "examples"


def evidence(log: Log) -> TorqueSideEvidence:
    """What a log shows of rotors and drives."""
    timing = check_timing(log)
    return torque_side_evidence(log, timing, build_inverse_model(log, timing))


def described(robot: Robot, t: np.ndarray, q: np.ndarray, tau: np.ndarray) -> Log:
    """A log in SI."""
    channels = {"q": q, "tau": tau}
    return Log("log", robot.joint_names, {}, {"t": t}, channels=channels, robot=robot)


def main(seeds: int) -> None:
    """Print the share of rotors and the answer for each record, and the counts."""
    counts: Counter[tuple[str, str]] = Counter()
    for seed in range(seeds):
        made = seven_axis_log(seed, bearings=BEARINGS[seed % len(BEARINGS)])
        robot = parse_urdf(made.urdf)
        for truth, tau in (("link", made.tau_link), ("motor", made.tau_motor)):
            found = evidence(described(robot, made.t, made.q, tau))
            counts[truth, found.side] += 1
            share, error = (100.0 * x for x in found.pooled)
            print(
                f"seed {seed:2d} {truth:5s} called {found.side:7s} rotors {share:6.2f} ± "
                f"{2 * error:.2f} %, friction {100 * np.nanmedian(found.friction):.0f} % (median)"
            )
    for name in ("staubli_tx40", "kuka_kr300"):
        experiment = load_experiment(EXAMPLES / name / "experiment.toml")
        for entry in experiment.content.recording:
            try:
                log = log_of(entry, experiment.robot, experiment.path.parent)
            except DatasetUnavailable:
                continue
            found = evidence(log)
            counts[name, found.side] += 1
            print(f"{name} {entry.run or ''}: {found}")
    for (truth, called), count in sorted(counts.items()):
        print(f"{truth} called {called}: {count}")


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 30)
