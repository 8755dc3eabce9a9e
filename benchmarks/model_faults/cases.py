"""A case: a ready problem with a planted fault, and the truth beside it."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.unknown_arms import motion as motions
from benchmarks.unknown_arms.truth import true_base_parameters

import pivident as pv
from pivident.dynamics.base_parameters import base_parameters
from pivident.estimation.control_law.unknown_loop import reconstruct_loop
from pivident.foundation.errors import IdentificationError
from pivident.robot.description import Coupling, Robot
from pivident.robot.friction import FrictionLaw, coulomb, offset, viscous
from pivident.robot.transmission import Transmission
from pivident.robot.urdf import parse_urdf

from .faults import FAULTS, Cause, Planted, is_possible
from .machines import SLOPE_AT_RATED_SPEED, Setup, draw
from .simulator import Trace, simulate

#: Length of a record [s].
SECONDS = 8.0

#: Farthest instants of a sample that trembles, in sampling periods.
_NEAR = np.array([-0.9, 0.9])

#: Where traces are kept.
RESULTS = Path(__file__).resolve().parents[1] / "results" / "model_faults"

#: Raised when the simulator changes, so that older traces are not taken.
EDITION = 2


@dataclass(frozen=True)
class Case:
    """A problem as a user would pose it, and what is true.

    Attributes:
        arm, fault, seed: what it was made from.
        problem: robot as the user believes it, two recordings, the true control law or, of a
            cascade, the one that the recordings show.
        truth: true base parameters by name, in the grouping of ``problem``'s robot; where the
            fault is in positions or torques, those of the machine nevertheless.
        corrected_robot: the robot as the user should have described it.
        corrected_truth: true base parameters in its grouping.
        expected: causes of which each is right to name, (kind, joint or None); empty: none.
        size: how large the fault is, in ``unit``.
        unit: its unit.
        setup: the machine, its log and what is believed, in full.
    """

    arm: str
    fault: str
    seed: int
    problem: pv.Problem
    truth: dict[str, float]
    corrected_robot: Robot
    corrected_truth: dict[str, float]
    expected: tuple[Cause, ...]
    size: float
    unit: str
    setup: Setup


def make_case(
    arm: str,
    fault: str = "none",
    seed: int = 0,
    *,
    rate: float | None = None,
    seconds: float = SECONDS,
    records: int = 2,
) -> Case:
    """A case; its simulation is kept, so that the next call is quick.

    Args:
        arm: ``scara``, ``cobot6``, ``link7`` or ``telescope``.
        fault: one of `FAULTS`.
        seed: decides machine, motion, noise and fault.
        rate: of control and log [Hz]; None: 1000 Hz, that of ``cobot6`` 500 Hz.
        seconds: length of a record [s].
        records: how many; sines and moves in turn.

    Raises:
        ValueError: the fault cannot be seen on this arm.
    """
    if not is_possible(fault, arm):
        raise ValueError(f"{fault} does not change the torques of {arm}")
    number = list(FAULTS).index(fault)
    drawn = draw(arm, seed, rate)
    planted = FAULTS[fault](drawn, np.random.default_rng([seed, 13, number]))
    setup = planted.setup
    traces = [_trace(setup, k, records, seconds) for k in range(records)]
    robot = users_robot(setup)
    corrected = users_robot(
        setup if planted.corrected is None else replace(setup, believed=planted.corrected)
    )
    names = robot.joint_names
    recordings = tuple(_recording(setup, t, k, names) for k, t in enumerate(traces))
    loop: pv.Loop | None = pv.Loop(pv.PD(setup.kp, setup.kd), feed_forward=setup.feed_forward)
    if np.isfinite(setup.integral_time):  # which the user does not know
        try:
            recordings, loop = reconstruct_loop(robot, recordings)
        except IdentificationError:  # an experiment goes on without a simulated loop, too
            loop = None
    return Case(
        arm,
        fault,
        seed,
        pv.Problem(robot, recordings, loop, parameters=_parameters(robot, planted)),
        true_base_parameters(setup.made, robot),
        corrected,
        true_base_parameters(setup.made, corrected),
        planted.expected,
        planted.size,
        planted.unit,
        setup,
    )


def users_robot(setup: Setup) -> Robot:
    """The user's robot: their URDF, gears of the data sheet, friction of the right γ."""
    robot = parse_urdf(setup.description)
    laws = {
        name: FrictionLaw((viscous(), coulomb(gamma=SLOPE_AT_RATED_SPEED / speed), offset()))
        for name, speed in zip(robot.joint_names, setup.arm.speeds.tolist(), strict=True)
    }
    shafts = tuple(Coupling(s.motor, s.joint, s.ratio) for s in setup.made.shafts)
    ratios = np.diag(np.array(setup.arm.gear_ratio, dtype=float))
    drives = replace(Transmission.direct(robot.size), reduction=ratios)
    return replace(robot, couplings=shafts, transmission=drives).with_friction(laws)


def _parameters(robot: Robot, planted: Planted) -> tuple[str, ...] | None:
    """All base parameters but those that the user leaves out."""
    left_out = planted.setup.left_out
    if not left_out:
        return None
    return tuple(name for name in base_parameters(robot).names if name not in left_out)


def _trace(setup: Setup, record: int, records: int, seconds: float) -> Trace:
    """The simulation of a record, from the folder of results if it is there."""
    rng = np.random.default_rng([setup.made.seed, 14, record])
    make = motions.moves if record % 2 else motions.sum_of_sines
    motion = make(f"record {record + 1}", setup.arm, rng, setup.rate, seconds)
    # what the log and the list of parameters lack does not change the motion
    cause = replace(setup, logged_late=0, lost=0.0, tremble=0.0, left_out=())
    if setup.feed_forward == "none":
        cause = replace(cause, believed=())
    what = (EDITION, cause, record, records, seconds, *([setup.extra] if setup.extra else []))
    key = hashlib.sha256(repr(what).encode()).hexdigest()
    path = RESULTS / f"{setup.arm.name}-{setup.made.seed}-{key[:16]}.npz"
    if path.exists():
        with np.load(path) as kept:
            return Trace(motion, kept["q"], kept["tau"], kept["moved"])
    trace = simulate(setup, motion, record, records)
    path.parent.mkdir(parents=True, exist_ok=True)
    np.savez(path, q=trace.q, tau=trace.tau, moved=trace.moved)
    return trace


def _recording(setup: Setup, trace: Trace, record: int, names: tuple[str, ...]) -> pv.Recording:
    """What the user has of a record."""
    tau = trace.tau
    if setup.logged_late:
        tau = np.vstack([tau[: setup.logged_late], tau[: -setup.logged_late]])
    q, rows = trace.q, np.arange(len(tau))
    rng = np.random.default_rng([setup.made.seed, 15, record])
    if setup.tremble:  # within a period a joint's speed is nearly constant
        apart = np.clip(setup.tremble * rng.standard_normal((len(q), 1)), *_NEAR / setup.rate)
        q = q + apart * trace.moved
    if setup.lost:
        rows = np.flatnonzero(rng.random(len(tau)) >= setup.lost)
    m = trace.motion
    return pv.Recording.from_arrays(
        q[rows],
        tau[rows],
        setup.rate,
        joint_names=names,
        name=m.name,
        q_ref=m.q[rows],
        dq_ref=m.dq[rows],
        ddq_ref=m.ddq[rows],
        torque_timing="held",
        saturation="allow",
    )
