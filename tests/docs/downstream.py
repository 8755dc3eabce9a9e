"""A program of a user, checked with ``mypy --strict`` against the public types."""

from pathlib import Path

import numpy as np

import pivident as pv
from pivident.linear.estimate import LinearEstimate
from pivident.linear.srivc import srivc


def deviations(log: Path) -> dict[str, float]:
    """Identify a log and return the relative deviations."""
    robot: pv.Robot = pv.load_robot("planar_2r")
    columns = {"t": "time", "q": ["q1", "q2"], "q_ref": ["r1", "r2"], "tau": ["tau1", "tau2"]}
    recording: pv.Recording = pv.load_recording(log, columns, robot=robot)
    loop = pv.Loop(pv.PD(kp=[6000, 2500], kd=[180, 60]))
    problem = pv.Problem(robot, (recording,), loop)
    found: pv.Identification = pv.identify(
        problem, pv.PrefilteredIV(signals=pv.RandomWalk(order=3))
    )
    torque: np.ndarray = found.predict(recording.q, recording.q, recording.q)
    assert torque.shape == recording.q.shape
    verdict = pv.verdict(found)
    print(verdict.headline, [statement.severity for statement in verdict.statements])
    pv.write_report([found], "report.html")
    return {name: float(found.value(name)) for name in found.names}


def transfer_function(u: np.ndarray, y: np.ndarray) -> LinearEstimate:
    """Identify a transfer function of first order."""
    return srivc(u, y, dt=0.01, numerator_order=0, denominator_order=1)
