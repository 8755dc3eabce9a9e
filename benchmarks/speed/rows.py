"""The table of speeds: our times and the peers', taken in turns in one process."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass

import numpy as np

from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import make_model
from pivident.estimation.auxiliary_model import AuxiliaryModel
from pivident.estimation.identify import identify
from pivident.estimation.kinematics import estimate_kinematics
from pivident.estimation.signal_recipes import RandomWalk
from pivident.experiment import simulated_tx40 as scenarios
from pivident.foundation.threads import thread_count
from pivident.loop.simulation.closed_loop import simulate
from pivident.robot.gallery import load_robot
from pivident.signals.random_walk import irwsm

from . import figaroh_peer, mujoco_peer, pinocchio_peer
from .report import RESULTS
from .timing import Timing, side_by_side, timed
from .workloads import RATE, SAMPLES, base_regressor, simulated_record, whole_job


@dataclass(frozen=True)
class Row:
    """One comparison.

    Attributes:
        work: what is done.
        ours: our time.
        goal: largest time [ms], or least ratio, that was asked for; empty where none was.
        peer: who is beside us; empty: nobody.
        theirs: the peer's time; None: nobody, or not to be had.
        ratio: theirs over ours on the clock.
        note: what one must know, or why the peer is missing.
    """

    work: str
    ours: Timing
    goal: str = ""
    peer: str = ""
    theirs: Timing | None = None
    note: str = ""

    @property
    def ratio(self) -> float:
        """How many times as fast as the peer."""
        return self.theirs.ms / self.ours.ms if self.theirs else float("nan")

    @property
    def work_ratio(self) -> float:
        """The same of the processor times: what is left where the machine is busy."""
        return self.theirs.cpu_ms / self.ours.cpu_ms if self.theirs else float("nan")


def all_rows(repeats: int) -> Iterator[Row]:
    """Every row of the table."""
    for rows in (whole_job_rows, matrix_rows, simulation_rows, smoother_rows, model_rows):
        yield from rows(repeats)


def whole_job_rows(repeats: int) -> Iterator[Row]:
    """Full IDIM-PIV, smoother included, without file reading and report; FIGAROH's LS beside it."""
    label, problem = whole_job()
    found = identify(problem, "piv")
    name = f"IDIM-PIV, {label}, {found.iterations} iterations, {thread_count()} threads"
    motion = estimate_kinematics(problem.recordings[0], RandomWalk())
    signals = [np.ascontiguousarray(x.T) for x in (motion.q, motion.dq, motion.ddq, motion.tau)]
    theirs, reason = figaroh_peer.least_squares(problem.robot, *signals)
    ours = timed(lambda: identify(problem, "piv"), repeats)
    peer = "FIGAROH, least squares only"
    if theirs is None:
        yield Row(name, ours, "<= 700 ms", peer, None, reason)
        return
    started, ticks = time.perf_counter(), time.process_time()
    theirs()
    took, cpu = time.perf_counter() - started, time.process_time() - ticks
    once = Timing(1e3 * took, 1e3 * cpu, 0.0, ours.load)
    yield Row(name, ours, "<= 700 ms", peer, once, "its smoothing not included; once")


def matrix_rows(repeats: int) -> Iterator[Row]:
    """Observation matrix of the base parameters beside Pinocchio's regressor."""
    robot = load_robot("staubli_tx40")
    regressor = base_regressor(robot)
    motion = scenarios.tx40_reference(SAMPLES)
    buffer = regressor.matrix(*motion)
    name = f"observation matrix, {len(regressor.parameters)} base columns, {SAMPLES:,} samples"
    ours, theirs = side_by_side(
        [
            lambda: regressor.matrix(*motion, buffer),
            pinocchio_peer.regressor_loop(robot, *motion),
        ],
        repeats,
    )
    yield Row(name, ours, ">= 10 x", "Pinocchio, loop in Python", theirs)
    build = RESULTS / "build"
    build.mkdir(parents=True, exist_ok=True)
    compiled, reason = pinocchio_peer.compiled_loops(robot, *motion, build, max(3, repeats))
    for work, key, peer in (
        (name, "regressor", "Pinocchio, loop in C++ (processor time, 1 thread)"),
        ("closed-loop simulation", "aba_four_times", "Pinocchio, 4 ABA a sample in C++, no law"),
    ):
        beside = ours if key == "regressor" else _simulation(repeats)
        if key in compiled:
            ms = compiled[key]
            yield Row(work, _processor(beside), "", peer, Timing(ms, ms, 0.0, ours.load))
        else:
            yield Row(work, beside, "", peer, None, reason)


def _processor(timing: Timing) -> Timing:
    """Processor time in place of the clock's, to stand beside another program's."""
    return Timing(timing.cpu_ms, timing.cpu_ms, timing.spread, timing.load)


def _simulation_setting():
    """Robot, truth, model, law and signals of the simulated record."""
    robot = load_robot("staubli_tx40")
    heads, truth = scenarios.tx40_truth(robot)
    model = make_model(robot, heads, np.array([truth[p.name] for p in heads]))
    problem = simulated_record(SAMPLES)
    assert problem.loop is not None
    ((signals, start),) = AuxiliaryModel(problem, differences=False).signals
    return robot, truth, model, problem.loop.controller, signals, start


def _simulation(repeats: int) -> Timing:
    robot, _, model, law, signals, start = _simulation_setting()
    return timed(lambda: simulate(model, law, signals, robot.joint_names, start), repeats)


def simulation_rows(repeats: int) -> Iterator[Row]:
    """Closed loop beside Pinocchio's loop in Python and MuJoCo's rollout, each on its own terms."""
    robot, truth, model, law, signals, start = _simulation_setting()
    kp, kd = (np.broadcast_to(np.asarray(x, float), (robot.size,)) for x in (law.kp, law.kd))
    viscous = np.array([truth.get(f"fv{j}", 0.0) for j in range(1, robot.size + 1)])
    coulomb = np.array([truth.get(f"fc{j}", 0.0) for j in range(1, robot.size + 1)])

    def ours() -> object:
        return simulate(model, law, signals, robot.joint_names, start)

    peers: dict[str, Callable[[], object]] = {
        "Pinocchio ABA, loop in Python, RK4 x 1, no friction": pinocchio_peer.runge_kutta_loop(
            robot, signals.q_ref, signals.dq_ref, kp, kd
        )
    }
    note, goals = "", {"Pinocchio ABA, loop in Python, RK4 x 1, no friction": ">= 18 x"}
    try:
        for integrator, dry in (("implicitfast", False), ("implicitfast", True), ("rk4", False)):
            its = mujoco_peer.model_of(
                robot, law, RATE, viscous, coulomb if dry else 0 * coulomb, integrator
            )
            peer = f"MuJoCo rollout, {integrator}, {'viscous and Coulomb' if dry else 'viscous'}"
            peers[peer] = mujoco_peer.rollout(its, signals, start)
            goals[peer] = "> 1 x"
    except ImportError as missing:
        note = str(missing)
    times = side_by_side([ours, *peers.values()], repeats)
    name = f"closed-loop simulation, {SAMPLES:,} samples, accurate to 1e-4, friction included"
    for (peer, run), theirs in zip(peers.items(), times[1:], strict=True):
        off = ""
        if peer.startswith("MuJoCo"):
            off = f"largest distance from its reference {_tracking(run, signals.q_ref):.2g} rad"
        yield Row(name, times[0], goals[peer], peer, theirs, off)
    if note:
        yield Row(name, times[0], "> 1 x", "MuJoCo rollout", None, note)


def _tracking(run: Callable[[], object], q_ref: np.ndarray) -> float:
    """Whether the peer's loop holds at all: its largest distance from the reference [rad]."""
    q = np.asarray(run())
    return float(np.abs(q[:-1] - q_ref[1:]).max())


def smoother_rows(repeats: int) -> Iterator[Row]:
    """Random walk smoother with maximum likelihood beside peers that only smooth."""
    y = simulated_record(SAMPLES).recordings[0].q[:, 0].copy()
    name = f"random walk smoother, m = 3, likelihood included, one channel of {SAMPLES:,}"
    import simdkalman
    from statsmodels.tsa.statespace.structural import UnobservedComponents

    kalman = simdkalman.KalmanFilter(
        state_transition=np.array([[1.0, 1.0], [0.0, 1.0]]),
        process_noise=np.diag([0.0, 1e-5]),
        observation_model=np.array([[1.0, 0.0]]),
        observation_noise=1.0,
    )
    structural = UnobservedComponents(y, "smooth trend")
    ours, simd, stats = side_by_side(
        [
            lambda: irwsm(y, RATE),
            lambda: kalman.smooth(y),
            lambda: structural.smooth([1.0, 1e-5]),
        ],
        max(3, repeats // 2),
    )
    yield Row(name, ours, ">= 100 x", "simdkalman, m = 2, smoothing only", simd)
    yield Row(name, ours, "<= 25 ms", "statsmodels, m = 2, smoothing only", stats)


def model_rows(repeats: int) -> Iterator[Row]:
    """Model of the arm from its description."""
    ours = timed(lambda: base_parameters(load_robot("staubli_tx40")), repeats)
    yield Row("model of the TX40 from its description, base parameters", ours, "<= 200 ms")
