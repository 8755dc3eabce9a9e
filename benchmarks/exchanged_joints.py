"""What the verdict says of logs whose joints are mixed up, and of clean ones.

    python benchmarks/exchanged_joints.py 0 40            seeds of the arms
    python benchmarks/exchanged_joints.py 0 40 weighed    one fault alone

Arms, motions and torques are Pinocchio's (`tests.other_arms`): six random joints, 200 Hz, 30 s, 14-
bit encoders. *exchanged*: positions and torques of two neighbouring joints stand in each other's
columns; *torques*: their torques alone; *sign*: one joint's position and torque are negative;
*weighed*: as *exchanged*, in amperes with gains that follow from the masses of the description. A
verdict that takes such an estimate without a reservation about it is wrong, and so is one about a
clean log. Counted are statements of the topics *prediction* and *physics*, and errors.
"""

from __future__ import annotations

import sys
from collections import Counter, defaultdict
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

from tests.judgement.diagnostics.gains_of_masses import by_masses
from tests.other_arms import ArmLog, Setting, make_log

from pivident.data.recording.recording import Recording
from pivident.estimation.identify import identify
from pivident.estimation.problem import Problem
from pivident.foundation.errors import PividentError
from pivident.judgement.diagnostics.diagnostics import diagnose
from pivident.judgement.diagnostics.verdict import Verdict, verdict
from pivident.robot.urdf import parse_urdf

SETTING = Setting("regular", 200.0, 30.0, 0.0, 0.002, "none", 0.8)

FAULTS = ("clean", "exchanged", "torques", "sign", "weighed")

#: Gains of the drives [N m/A].
GAIN = np.array([20.0, 15.0, 12.0, 4.0, 3.0, 2.0])


def faulty(log: ArmLog, fault: str, joint: int) -> tuple[np.ndarray, np.ndarray]:
    """Positions and torques as a wrong file has them."""
    q, tau = log.q.copy(), log.tau.copy()
    pair = [joint, joint + 1]
    if fault == "weighed":
        tau /= GAIN
    if fault in ("exchanged", "weighed"):
        q[:, pair] = q[:, pair[::-1]]
    if fault in ("exchanged", "torques", "weighed"):
        tau[:, pair] = tau[:, pair[::-1]]
    if fault == "sign":
        q[:, joint], tau[:, joint] = -q[:, joint], -tau[:, joint]
    return q, tau


def judged(log: ArmLog, fault: str, joint: int) -> Verdict:
    """The verdict on least squares."""
    q, tau = faulty(log, fault, joint)
    record = Recording("run", log.arm.joint_names, q, tau, SETTING.rate, torque_timing="sampled")
    problem = Problem(parse_urdf(log.arm.urdf), (record,))
    if fault == "weighed":
        problem = by_masses(problem)
    return verdict(diagnose(problem, {"ls": identify(problem, "ls")}))


def main(first: int, last: int, faults: tuple[str, ...] = FAULTS) -> None:
    """Print every reservation about prediction or physics, and how often each was made."""
    counts: dict[str, Counter[str]] = defaultdict(Counter)
    for seed in range(first, last):
        log = make_log(seed, SETTING)
        for fault in faults:
            joint = seed % (log.q.shape[1] - 1)
            try:
                found = judged(log, fault, joint)
                said = [
                    f"{s.severity} {s.kind}" for s in found.statements
                    if s.severity == "error"
                    or (s.severity == "warning" and s.topic in ("prediction", "physics"))
                ]  # fmt: skip
            except PividentError as error:
                said = [f"refused: {type(error).__name__}"]
            counts[fault].update(dict.fromkeys(said or ["nothing"], 1))
            print(f"{seed:3d} joint {joint} {fault:10s} {'; '.join(said)}", flush=True)
    for fault, own in counts.items():
        print(fault, dict(own.most_common()))


if __name__ == "__main__":
    main(int(sys.argv[1]), int(sys.argv[2]), tuple(sys.argv[3:]) or FAULTS)
