"""Branches of a robot that hang on the base side by side, and the delay that they share.

The legs of a robot whose base is held are robots of their own. Tangents along a joint of one leg
are zero in all others, so that four legs of three joints cost less than one robot of twelve.

One delay of all branches from their separate fits.

Each branch b has an estimate p_b with covariance C_b, in which its own delay T_b is element i. The
branches share nothing else, so that the least-squares estimate of all together is

    T = V Σ T_b/C_b,ii,   V = 1/Σ (1/C_b,ii),     p_b ← p_b - g_b (T_b - T),   g_b = C_b,·i/C_b,ii
    C_b ← C_b - C_b,·i C_b,i·/C_b,ii + V g_b g_bᵀ

and Σ (T_b - T)²/C_b,ii is χ² of one less than there are branches if the delay is one.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from pivident.foundation.distributions import chi_square
from pivident.loop.simulation.closed_loop import LoopSignals
from pivident.loop.simulation.controllers import PID, Cascade, Controller, PythonController
from pivident.robot.description import Robot
from pivident.robot.transmission import Transmission


def branches(robot: Robot) -> list[tuple[int, ...]]:
    """Indices of the joints of each branch; joints that a coupled motor moves count as one."""
    root = [joint.parent for joint in robot.joints]
    for i, parent in enumerate(root):
        root[i] = i if parent < 0 else root[parent]
    for coupling in robot.couplings:
        kept, gone = root[coupling.motor], root[coupling.joint]
        root = [kept if r == gone else r for r in root]
    return [tuple(np.flatnonzero(np.array(root) == r).tolist()) for r in dict.fromkeys(root)]


def branch_of(robot: Robot, joints: Sequence[int]) -> Robot:
    """A branch as a robot of its own.

    ``joints``: all joints of one or several branches, in order. The names of parameters are those
    of the new robot.
    """
    if len(joints) == robot.size:
        return robot
    place = {old: new for new, old in enumerate(joints)} | {-1: -1}
    drives, own = robot.transmission, np.array(joints)
    part = replace(
        robot,
        joints=tuple(replace(robot.joints[i], parent=place[robot.joints[i].parent]) for i in own),
        links=tuple(robot.links[i] for i in own),
        rotor_inertia=robot.rotor_inertia[own],
        transmission=Transmission(
            drives.reduction[np.ix_(own, own)],
            drives.drive_gain[own],
            drives.position_offset[own],
            np.asarray(drives.gain_given)[own],
        ),
        couplings=tuple(
            replace(c, motor=place[c.motor], joint=place[c.joint])
            for c in robot.couplings
            if c.motor in place
        ),
        friction_nominal={},
        urdf=None,
    )
    nominal = {
        f"{term.stem}{part.label(k)}": robot.friction_nominal.get(f"{term.stem}{robot.label(i)}")
        for k, i in enumerate(joints)
        for term in part.joints[k].friction.terms
    }
    return replace(part, friction_nominal={k: v for k, v in nominal.items() if v is not None})


def can_be_divided(controller: Controller) -> bool:
    """Whether a law has gains joint by joint, and no model of the whole robot."""
    return isinstance(controller, (PID, Cascade)) and not isinstance(controller, PythonController)


def law_of(controller: Controller, joints: Sequence[int], size: int) -> Controller:
    """The law of some of the joints."""
    if len(joints) == size:
        return controller
    own = list(joints)
    changed = {
        name: np.broadcast_to(np.asarray(getattr(controller, name), float), size)[own]
        for name in ("kp", "kd", "ki", "kv")
        if getattr(controller, name, None) is not None
    }
    if isinstance(controller, Cascade):
        return Cascade(
            changed["kp"], changed["kv"], changed.get("ki"), controller.averaged,
            controller.speed_feed_forward,
        )  # fmt: skip
    assert isinstance(controller, PID)
    return PID(
        changed["kp"], changed["kd"], changed.get("ki"), controller.derivative_time,
        controller.speed_feed_forward,
    )  # fmt: skip


def signals_of(signals: LoopSignals, joints: Sequence[int]) -> LoopSignals:
    """What drives some of the joints."""
    own = list(joints)

    def columns(x: np.ndarray | None) -> np.ndarray | None:
        return None if x is None else np.ascontiguousarray(x[:, own])

    reference = columns(signals.q_ref)
    assert reference is not None
    return replace(
        signals,
        q_ref=reference,
        dq_ref=columns(signals.dq_ref),
        inputs=columns(signals.inputs),
        noise=columns(signals.noise),
        drive_gain=signals.drive_gain[own],
        limit=signals.limit[own],
        bound=signals.bound[own],
        speed_bound=signals.speed_bound[own],
        count=None if signals.count is None else np.asarray(signals.count)[own],
    )


@dataclass(frozen=True, eq=False)
class BranchEstimate:
    """Values and covariance of a branch, and the index of its delay."""

    values: np.ndarray
    covariance: np.ndarray
    delay: int | None  # None: it is not sought


@dataclass(frozen=True, eq=False)
class SharedDelay:
    """Estimates with one delay.

    Attributes:
        branches: of each branch.
        p_value: of the hypothesis that all branches have it; NaN with less than two.
    """

    branches: tuple[BranchEstimate, ...]
    p_value: float


def with_shared_delay(estimates: Sequence[BranchEstimate]) -> SharedDelay:
    """Give all branches the same delay; a delay at its bound, without variance, is left out."""
    delays, variances = [], []
    for own in estimates:
        if own.delay is not None and own.covariance[own.delay, own.delay] > 0.0:
            delays.append(own.values[own.delay])
            variances.append(own.covariance[own.delay, own.delay])
    if len(delays) < 2:
        return SharedDelay(tuple(estimates), np.nan)

    weights = 1.0 / np.array(variances)
    variance = float(1.0 / weights.sum())
    delay = float(variance * weights @ np.array(delays))
    spread = float(weights @ (np.array(delays) - delay) ** 2)
    return SharedDelay(
        tuple(_conditioned(own, delay, variance) for own in estimates),
        float(chi_square.sf(spread, len(delays) - 1)),
    )


def _conditioned(own: BranchEstimate, delay: float, variance: float) -> BranchEstimate:
    """A branch given the delay of all."""
    i, c = own.delay, own.covariance
    if i is None or not c[i, i] > 0.0:
        return own
    g = c[:, i] / c[i, i]
    values = own.values - g * (own.values[i] - delay)
    covariance = c - np.outer(c[:, i], g) + variance * np.outer(g, g)
    return BranchEstimate(values, covariance, i)
