"""Records of closed mechanisms by MuJoCo: other bodies, motions and noise with every seed."""

from __future__ import annotations

import hashlib
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from benchmarks.closed_mechanisms import RATE, gains_of, reference
from benchmarks.mujoco_mechanism import mujoco_record

import pivident as pv
from pivident.robot.description import Link, Robot

from .models import Forced

#: Where records are kept.
RESULTS = Path(__file__).resolve().parents[1] / "results" / "forced_trees"

#: Encoder noise [rad or m], noise of the torques as a share of their limits.
ENCODER, TORQUE = 2e-5, 0.002

#: Shares of the ranges of the joints that are moved, in turn.
SHARES = (0.35, 0.25, 0.30)


@dataclass(frozen=True)
class Record:
    """What a machine logs.

    Attributes:
        machine: with its true bodies, rotors and friction.
        q, tau, q_ref: shape (samples, joints).
        gains: kp and kd of its law.
    """

    machine: Robot
    q: np.ndarray
    tau: np.ndarray
    q_ref: np.ndarray
    gains: tuple[np.ndarray, np.ndarray]


def machine_of(name: str, seed: int) -> Robot:
    """The mechanism of the gallery; with every seed but 0 other bodies, rotors and friction."""
    robot = pv.load_robot(name)
    if not seed:
        return robot
    rng = np.random.default_rng([seed, 1])

    def heavier(links: tuple[Link, ...]) -> tuple[Link, ...]:
        return tuple(replace(link, inertia=rng.uniform(0.7, 1.4) * link.inertia) for link in links)

    return replace(
        robot,
        links=heavier(robot.links),
        passive_links=heavier(robot.passive_links),
        rotor_inertia=robot.rotor_inertia * rng.uniform(0.7, 1.4, robot.size),
        friction_nominal={
            stem: value * rng.uniform(0.6, 1.5) for stem, value in robot.friction_nominal.items()
        },
    )


def record_of(name: str, seed: int = 0, seconds: float = 12.0, noise: float = 1.0) -> Record:
    """A record; the simulation is kept, so that the next call is quick.

    Args:
        name: of the mechanism in the gallery.
        seed: decides bodies, motion and noise.
        seconds: its length [s].
        noise: over the standard one.
    """
    machine = machine_of(name, seed)
    q_ref = reference(machine, seconds, 11 + seed, SHARES[seed % len(SHARES)])
    gains = gains_of(machine, q_ref[0])
    encoder = np.full(machine.size, noise * ENCODER)
    key = hashlib.sha256(repr((name, seed, seconds, noise)).encode()).hexdigest()[:16]
    path = RESULTS / f"{name}-{seed}-{key}.npz"
    if path.exists():
        with np.load(path) as kept:
            q, tau = kept["q"], kept["tau"]
    else:
        made = mujoco_record(machine, q_ref, RATE, gains, encoder, seed)
        q, tau = made.q, made.tau
        path.parent.mkdir(parents=True, exist_ok=True)
        np.savez(path, q=q, tau=tau)
    limits = np.array([joint.torque_limit for joint in machine.joints])
    rng = np.random.default_rng([seed, 2])
    tau = tau + noise * TORQUE * limits * rng.normal(size=tau.shape)
    return Record(machine, q, tau, q_ref, gains)


def problem_of(record: Record, forced: Forced | None) -> pv.Problem:
    """The record with a forced description, or the right one, and the law of the machine."""
    robot = record.machine if forced is None else forced.robot
    given = None if forced is None else forced.ratio
    ratio = np.ones(robot.size) if given is None else np.array(given)
    if forced is not None and forced.reading is not None:
        q, tau = forced.reading(record.q, record.tau)
        made = pv.Recording.from_arrays(q, tau, RATE, joint_names=robot.joint_names)
        return pv.Problem(robot, (made,))
    kp, kd = (gain / ratio**2 for gain in record.gains)
    made = pv.Recording.from_arrays(
        record.q * ratio,
        record.tau / ratio,
        RATE,
        joint_names=robot.joint_names,
        name="record",
        q_ref=record.q_ref * ratio,
    )
    return pv.Problem(robot, (made,), pv.Loop(pv.PD(kp=kp, kd=kd)))
