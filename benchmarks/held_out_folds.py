"""Real records: torque error on motion that was not fitted, LS, IV, full-rate IV and PIV.

    PIVIDENT_DATA=FOLDER python benchmarks/held_out_folds.py

TX40 (reference not logged: smoothed measurement and a virtual PD law): the motion is cut into five
contiguous folds; each is predicted from the other four, with the paper's 28 parameters and six
offsets. Error: ‖τ - Φθ‖/‖τ‖ over the fold and all joints, both sides below 20 Hz.

EMPS: fitted on one file, closed-loop simulation of the other (pulses of 5.07 V as known input).
"""

from __future__ import annotations

from itertools import pairwise

import numpy as np

from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.methods import (
    METHODS,
    Bandpass,
    InstrumentalVariables,
    LeastSquares,
    RandomWalk,
)
from pivident.estimation.problem import Loop, Problem
from pivident.recording.public_records import load_emps, load_emps_pulses, load_staubli_tx40
from pivident.robot import load_robot
from pivident.signals.bandpass import butterworth
from pivident.simulation.controllers import Cascade
from pivident.simulation.scenarios import TX40_ESSENTIAL
from pivident.simulation.virtual_pd import virtual_pd

NAMES = ("ls", "iv", "iv-full-rate", "piv")


def tx40_folds(folds: int = 5) -> dict[str, list[float]]:
    """Held-out error of each method on each fold [%]."""
    robot, record = load_robot("staubli_tx40"), load_staubli_tx40()
    loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
    chosen = (*TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
    motion = estimate_kinematics(record, RandomWalk())
    torque = butterworth(motion.tau.T, record.rate, 20.0)
    edges = np.linspace(0.1, 7.4, folds + 1)
    errors: dict[str, list[float]] = {name: [] for name in NAMES}
    for start, stop in pairwise(edges):
        parts = [record.slice(0.05, start)] if start > 0.4 else []
        parts += [record.slice(stop, 7.5)] if stop < 7.2 else []
        problem = Problem(robot, tuple(parts), loop, chosen)
        fold = slice(int(start * record.rate), int(stop * record.rate))
        for name in NAMES:
            found = identify(problem, name)
            predicted = found.predict(motion.q.T, motion.dq.T, motion.ddq.T)
            left = butterworth(motion.tau.T - predicted, record.rate, 20.0)
            errors[name].append(100 * np.linalg.norm(left[fold]) / np.linalg.norm(torque[fold]))
    return errors


def emps_unseen() -> dict[str, tuple[np.ndarray, int, float, float]]:
    """Estimates, iterations, unseen force error [%] and position error [µm] of each method."""
    robot, fitted, unseen = load_robot("emps"), load_emps(), load_emps_pulses()
    controller = Cascade(np.array([160.18]), np.array([243.45]), averaged=True)
    loop = Loop(controller, 35.15065188248547, 10.0)
    band = Bandpass(cutoff=100.0, decimation=10)
    methods = {name: METHODS[name] for name in ("iv-full-rate", "piv", "piv-as-printed")}
    methods = {
        "ls": LeastSquares(signals=band), "iv": InstrumentalVariables(signals=band), **methods
    }  # fmt: skip
    rows = {}
    for name, method in methods.items():
        found = identify(Problem(robot, (fitted,), loop), method)
        auxiliary = AuxiliaryModel(Problem(robot, (unseen,), loop), differences=False)
        (motion,) = auxiliary.simulate(found.theta)
        force = np.linalg.norm(motion.tau[0] - unseen.tau[:, 0]) / np.linalg.norm(unseen.tau)
        position = np.sqrt(np.mean((motion.q[0] - unseen.q[:, 0]) ** 2))
        rows[name] = (found.theta, found.iterations, 100 * force, 1e6 * position)
    return rows


def main() -> None:
    print("TX40, held-out torque error below 20 Hz, five contiguous folds [%]")
    errors = tx40_folds()
    for name, values in errors.items():
        print(f"  {name:14s} {'  '.join(f'{v:5.2f}' for v in values)}   mean {np.mean(values):.3f}")
    means = {name: np.mean(values) for name, values in errors.items()}
    print(f"  PIV over the best of them: {means['piv'] / min(means.values()):.3f}")
    print("EMPS, closed-loop simulation of the pulses file")
    for name, (theta, iterations, force, position) in emps_unseen().items():
        values = "  ".join(f"{v:9.4f}" for v in theta)
        print(f"  {name:14s} {values}  {iterations} it  force {force:5.2f} %  q {position:.2f} µm")


if __name__ == "__main__":
    main()
