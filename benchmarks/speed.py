"""Speed, with the peers run beside us in the same process: one table.

    python benchmarks/speed.py [--repeats 5] [--record FOLDER]

Medians of warm runs (compiled code cached). Pinocchio is called sample by sample from Python, as
its users do; statsmodels and simdkalman smooth one channel with given variances. The whole job
runs on the public TX40 record where PIVIDENT_DATA points to it, on a simulated one otherwise.
"""

from __future__ import annotations

import argparse
import json
import os
import platform
import time
from collections.abc import Callable
from pathlib import Path

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.dynamics.parameters import nominal_values, standard_parameters
from pivident.dynamics.regressor import Regressor
from pivident.estimation.identify import identify
from pivident.estimation.problem import Loop, Problem
from pivident.robot import FrictionLaw, load_robot
from pivident.robot.friction import lugre, offset, viscous
from pivident.signals.random_walk import smooth
from pivident.simulation import scenarios
from pivident.simulation.closed_loop import simulate
from pivident.simulation.virtual_pd import virtual_pd

SAMPLES = 34500


def median_ms(work: Callable[[], object], repeats: int) -> float:
    """Median time of a warm call [ms]."""
    work()
    times = []
    for _ in range(repeats):
        started = time.perf_counter()
        work()
        times.append(time.perf_counter() - started)
    return 1e3 * float(np.median(times))


def pinocchio_model():
    """The TX40's kinematics for Pinocchio: joints from the same modified DH table."""
    import pinocchio as pin

    robot, model = load_robot("staubli_tx40"), pin.Model()
    for i, joint in enumerate(robot.joints):
        place = pin.SE3(joint.rotation, joint.translation)
        added = model.addJoint(i, pin.JointModelRZ(), place, joint.name)
        model.appendBodyToJoint(added, pin.Inertia.Random(), pin.SE3.Identity())
    return pin, model, model.createData()


def dynamics_rows(repeats: int) -> list[tuple[str, float, float, str, float]]:
    """Observation matrix, model and simulation beside Pinocchio's loops."""
    robot = load_robot("staubli_tx40")
    base = base_parameters(robot)
    regressor = Regressor.build(robot, base.parameters)
    q, dq, ddq = scenarios.tx40_reference(SAMPLES)
    buffer = regressor.matrix(q, dq, ddq)
    pin, model, data = pinocchio_model()
    tau = np.zeros(q.shape)

    def pin_regressor() -> None:
        for k in range(SAMPLES):
            pin.computeJointTorqueRegressor(model, data, q[k], dq[k], ddq[k])

    def pin_runge_kutta() -> None:
        """Runge–Kutta 4 with one substep on ABA: four evaluations per sample."""
        for k in range(SAMPLES):
            for _ in range(4):
                pin.aba(model, data, q[k], dq[k], tau[k])

    from pivident.simulation.controllers import PD

    heads, truth = scenarios.tx40_truth(robot)
    values = make_model(robot, heads, np.array([truth[p.name] for p in heads]))
    problem, _ = scenarios.tx40_fine(samples=SAMPLES)
    from pivident.estimation.auxiliary_model import AuxiliaryModel

    assert problem.loop is not None
    ((signals, start),) = AuxiliaryModel(problem, differences=False).signals
    controller = problem.loop.controller
    assert isinstance(controller, type(PD(np.ones(1), np.ones(1))))
    # friction with a state on all joints, in place of the Coulomb friction
    lugre_robot = robot.with_friction(
        FrictionLaw((viscous(), *lugre(1e-3, 0.3, 0.1, damped=False), offset()))
    )
    lugre_heads = standard_parameters(lugre_robot)
    lugre_values = make_model(lugre_robot, lugre_heads, nominal_values(lugre_robot, lugre_heads))
    few = max(1, repeats // 2)
    loop_regressor, loop_aba = median_ms(pin_regressor, few), median_ms(pin_runge_kutta, few)
    return [
        (
            "base observation matrix (60 columns) into a reused buffer",
            median_ms(lambda: regressor.matrix(q, dq, ddq, buffer), repeats),
            12.0,
            "Pinocchio regressor loop",
            loop_regressor,
        ),
        (
            "closed-loop simulation, accurate to 1e-4",
            median_ms(
                lambda: simulate(values, controller, signals, robot.joint_names, start), repeats
            ),
            60.0,
            "Pinocchio ABA loop, RK4 x1",
            loop_aba,
        ),
        (
            "closed-loop simulation with LuGre friction on all joints",
            median_ms(
                lambda: simulate(lugre_values, controller, signals, robot.joint_names, start),
                repeats,
            ),
            120.0,
            "",
            np.nan,
        ),
        (
            "model of the TX40 from its description, base parameters included",
            median_ms(lambda: base_parameters(load_robot("staubli_tx40")), repeats),
            200.0,
            "",
            np.nan,
        ),
    ]


def smoother_row(repeats: int) -> list[tuple[str, float, float, str, float]]:
    """Random walk smoother with maximum likelihood beside peers that only smooth."""
    problem, _ = scenarios.tx40_fine(samples=SAMPLES)
    y = problem.recordings[0].q[:, 0].copy()
    ours = median_ms(lambda: smooth(y, scenarios.RATE), repeats)
    import simdkalman
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    kalman = simdkalman.KalmanFilter(
        state_transition=np.array([[1.0, 1.0], [0.0, 1.0]]),
        process_noise=np.diag([0.0, 1e-5]),
        observation_model=np.array([[1.0, 0.0]]),
        observation_noise=1.0,
    )
    simd = median_ms(lambda: kalman.smooth(y), 1)
    structural = UnobservedComponents(y, "smooth trend")
    stats = median_ms(lambda: structural.smooth([1.0, 1e-5]), max(1, repeats // 2))
    label = "random walk smoother, m = 3, ML included, one channel"
    return [
        (label, ours, 25.0, "simdkalman, m = 2, smoothing only", simd),
        (label, ours, 25.0, "statsmodels, m = 2, smoothing only", stats),
    ]


def loop_rows(repeats: int) -> list[tuple[str, float, float, str, float]]:
    """Linear models and control laws."""
    from pivident.estimation.controller_identification import identify_controller
    from pivident.linear import srivc
    from pivident.linear.benchmarks import RAO_GARNIER

    record = RAO_GARNIER.record(0)
    problem, _ = scenarios.tx40_fine(samples=45000)
    return [
        (
            "SRIVC of the Rao-Garnier system, 7161 samples",
            median_ms(lambda: srivc(record.u, record.y, 0.01, 1, 4), repeats),
            70.0,
            "",
            np.nan,
        ),
        (
            "control laws of six joints, 45,000 samples, all terms tested",
            median_ms(lambda: identify_controller(problem.recordings), repeats),
            1000.0,
            "",
            np.nan,
        ),
    ]


def whole_job_row(repeats: int) -> list[tuple[str, float, float, str, float]]:
    """Full IDIM-PIV, smoother included, without file reading and report."""
    try:
        from pivident.recording.public_records import load_staubli_tx40

        record = load_staubli_tx40()
        robot = load_robot("staubli_tx40")
        names = (*scenarios.TX40_ESSENTIAL, *(f"off{j}" for j in range(1, 7)))
        loop = Loop(virtual_pd(robot, record.q.mean(axis=0)), reference="smoothed")
        problem = Problem(robot, (record,), loop, names)
        label = "full IDIM-PIV of the TX40 record, 45,000 x 6, 34 parameters"
    except Exception as missing:  # the record is optional here
        print(f"(TX40 record not at hand: {missing})")
        problem, _ = scenarios.tx40_fine()
        label = "full IDIM-PIV of a simulated TX40 record, 34,500 x 6, 28 parameters"
    found = identify(problem, "piv")
    took = median_ms(lambda: identify(problem, "piv"), repeats)
    return [(f"{label}, {found.iterations} iterations", took, 1000.0, "", np.nan)]


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=5)
    options = parser.parse_args()
    rows = [
        *whole_job_row(options.repeats),
        *dynamics_rows(options.repeats),
        *smoother_row(options.repeats),
        *loop_rows(options.repeats),
    ]
    print(f"{SAMPLES} samples of the TX40; {os.cpu_count()} cores, {platform.processor()}")
    print(f"{'work':75s} {'ours':>8s} {'goal':>7s}   peer")
    for label, ours, goal, peer, theirs in rows:
        beside = f"{peer}: {theirs:.0f} ms, ratio {theirs / ours:.1f}" if peer else ""
        print(f"{label:75s} {ours:6.1f}ms {goal:5.0f}ms   {beside}")
    target = Path(__file__).parent / "results"
    target.mkdir(exist_ok=True)
    keys = ("work", "milliseconds", "goal_ms", "peer", "peer_ms")
    plain = [dict(zip(keys, row, strict=True)) for row in rows]
    for row in plain:
        row["peer_ms"] = None if np.isnan(row["peer_ms"]) else row["peer_ms"]
    (target / "speed.json").write_text(json.dumps(plain, indent=1))


if __name__ == "__main__":
    main()
