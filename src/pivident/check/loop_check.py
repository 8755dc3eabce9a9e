"""Controller and reference against the log: which is which, gains, and whether the loop holds.

With e = q_ref - q the error of joint j, a PD loop makes u_j = kp e + kd de/dt, a cascade
u_j = kv kp e - kv dq/dt (+ kv dq_ref/dt). Both are linear in two products of gains, which least
squares finds from the log in no time. Where they explain the torque, they are compared with the
gains of the file.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.audit.log import Log
from pivident.audit.timing import Timing
from pivident.check.channels import usable_rows
from pivident.check.remark import Place, Remark
from pivident.dynamics.base_parameters import base_parameters
from pivident.dynamics.forward import mass_matrix
from pivident.dynamics.parameters import nominal_values
from pivident.experiment.schema import ControllerEntry
from pivident.robot.description import Robot

#: Share of the torque that error and speed must explain before the gains are judged.
EXPLAINED = 0.98

#: Factor between a gain and what the log says that is worth a remark.
DIFFERENT = 1.3

#: Samples by which torque and position may be apart in a log.
LATE = 2.0

#: Distance between reference and position, relative to the motion, that is plausible.
CLOSE = 0.25

#: Share of the variance that another reading of the reference must explain.
ALIKE = 0.97

#: Travel below which a joint's reference is not judged [rad or m].
MOTION = 0.05

#: Growth per control period from which a loop is called unstable.
GROWTH = 1.002

#: Ratios of units that a gain may be off by, with their cause.
CAUSES = (
    (180 / np.pi, "the gains seem to be per degree; they are per radian"),
    (np.pi / 180, "the gains seem to have been converted from degrees twice"),
    (2 * np.pi, 'a factor of 2π: positions in turns? set units = {q = "rev", q_ref = "rev"}'),
    (1000.0, "a factor of 1000: mm for m, or mN m for N m"),
    (1e-3, "a factor of 1000: m for mm, or N m for mN m"),
)


def check_reference(log: Log, table: Place) -> list[Remark]:
    """Whether the reference is one: of the same joints, in the same unit, before the position.

    Args:
        log: one log.
        table: table of the recording.
    """
    if "q_ref" not in log.channels or "q" not in log.channels:
        return []
    q, q_ref = log.channels["q"], log.channels["q_ref"]
    if q.shape != q_ref.shape:
        return []
    rows = usable_rows(q, q_ref)
    if len(rows) < 50:
        return []
    return [*_reference(log, q[rows], q_ref[rows], (*table, "columns", "q_ref"))]


def _reference(log: Log, q: np.ndarray, q_ref: np.ndarray, place: Place) -> Iterator[Remark]:
    names, units = log.joint_names, (*place[:-2], "units", "q_ref")
    distance = np.std(q_ref - q, axis=0) / np.maximum(np.std(q, axis=0), 1e-12)
    copies = [names[j] for j in range(q.shape[1]) if np.array_equal(q[:, j], q_ref[:, j])]
    if copies:
        yield Remark(
            "wrong",
            "reference",
            "copy",
            f"The reference of {', '.join(copies)} is the measured position itself.",
            "Name the column of the setpoint; without one leave q_ref out and set "
            'reference = "reconstruct".',
            copies[0],
            place,
        )
        return
    for j, name in enumerate(names[: q.shape[1]]):
        if np.std(q_ref[:, j]) == 0 and np.std(q[:, j]) > 0:
            yield Remark(
                "wrong",
                "reference",
                "constant",
                f"The reference of {name} never changes, but {name} moves.",
                "Name the column of this joint's setpoint.",
                name,
                place,
            )
            return
    far = [j for j in range(q.shape[1]) if distance[j] > CLOSE and np.ptp(q[:, j]) > MOTION]
    if not far:
        moving = np.ptp(q, axis=0) > MOTION
        apart = moving * np.abs(np.mean(q_ref - q, axis=0)) / np.maximum(np.ptp(q, axis=0), MOTION)
        for j in np.flatnonzero(apart > 0.1).tolist():
            yield Remark(
                "look",
                "reference",
                "offset",
                f"The reference of {names[j]} lies {np.mean(q_ref - q, axis=0)[j]:.4g} rad (or "
                "m) away from the position all the time.",
                "The two have another zero; correct one of them in the log.",
                names[j],
                place,
            )
        return
    fit = np.abs(_correlations(q, q_ref))
    best = fit.argmax(axis=1)
    swapped = [j for j in far if best[j] != j and fit[j, best[j]] ** 2 > ALIKE]
    if swapped:
        pairs = ", ".join(f"{names[j]} follows the reference of {names[best[j]]}" for j in swapped)
        yield Remark(
            "wrong",
            "reference",
            "order",
            f"The columns of q and q_ref are in different order: {pairs}.",
            "List both in the order of the robot's joints.",
            names[swapped[0]],
            place,
        )
        return
    for j in far:
        signed = _correlations(q[:, [j]], q_ref[:, [j]])[0, 0]
        factor = signed * float(np.std(q_ref[:, j]) / np.std(q[:, j]))
        if signed**2 > ALIKE:
            cause, step = f"{factor:.4g} times the position", "Check the units of q and q_ref."
            if signed < 0:
                step = "One of the two has a reversed sign; correct it in the log."
            elif 0.9 < factor * np.pi / 180 < 1.1:
                step = 'It seems to be in degrees: set units = {q_ref = "deg"}.'
            elif 0.9 < factor * 180 / np.pi < 1.1:
                step = 'The positions seem to be in degrees: set units = {q = "deg"}.'
            yield Remark(
                "wrong", "reference", "unit", f"The reference of {names[j]} is {cause}.", step,
                names[j], units,
            )  # fmt: skip
            continue
        speed_of_ref = abs(_correlations(q[:, [j]], np.gradient(q_ref[:, [j]], axis=0))[0, 0])
        speed_of_q = abs(_correlations(q_ref[:, [j]], np.gradient(q[:, [j]], axis=0))[0, 0])
        if max(speed_of_ref, speed_of_q) ** 2 > 0.9:
            which, other = ("q", "q_ref") if speed_of_ref > speed_of_q else ("q_ref", "q")
            yield Remark(
                "wrong",
                "reference",
                "speed",
                f"{which} of {names[j]} is the derivative of {other}: it holds a speed.",
                f"Name the column of the position for {which}.",
                names[j],
                (*place[:-1], which),
            )
            continue
        yield Remark(
            "look",
            "reference",
            "far",
            f"{names[j]} does not follow its reference: they are {100 * distance[j]:.3g} % of the "
            "motion apart.",
            "Another column, another joint, or a reference in another frame; IV and PIV simulate "
            "the loop along it.",
            names[j],
            place,
        )


def _correlations(x: np.ndarray, y: np.ndarray) -> np.ndarray:
    """Correlation of every column of x with every column of y."""
    x, y = x - x.mean(axis=0), y - y.mean(axis=0)
    size = np.outer(np.linalg.norm(x, axis=0), np.linalg.norm(y, axis=0))
    return (x.T @ y) / np.where(size > 0, size, 1.0)


def check_gains(
    log: Log, timing: Timing, entry: ControllerEntry, reversed_joints: tuple[int, ...], table: Place
) -> list[Remark]:
    """The gains of the file beside those that the log shows.

    Args:
        log: one log with a recorded reference.
        timing: its clock.
        entry: the table ``[controller]``.
        reversed_joints: joints whose torque is known to have the wrong sign.
        table: table of the recording.
    """
    if "q_ref" not in log.channels or "tau" not in log.channels or not timing.rate:
        return []
    q, q_ref, tau = (log.channels[c] for c in ("q", "q_ref", "tau"))
    if not q.shape == q_ref.shape == tau.shape or not timing.regular:
        return []
    remarks: list[Remark] = []
    for j, name in enumerate(log.joint_names[: q.shape[1]]):
        rows = usable_rows(q[:, [j]], q_ref[:, [j]], tau[:, [j]])
        if len(rows) < 200 or j in reversed_joints:
            continue
        found = _products(q[rows, j], q_ref[rows, j], tau[rows, j], timing.rate, entry)
        if found is None:
            continue
        if found[0] < 0:
            remarks.append(
                Remark(
                    "wrong",
                    "controller",
                    "sign",
                    f"The torque of {name} pushes away from the reference: its gain on "
                    f"q_ref - q is {found[0]:.4g}.",
                    "Reference and measurement are swapped, or the sign of the torque is wrong.",
                    name,
                    (*table, "columns", "q_ref"),
                )
            )
            continue
        remarks += [*_compared(name, j, found, entry, timing.rate)]
    return remarks


def check_limit(log: Log, entry: ControllerEntry) -> list[Remark]:
    """Outputs in the log that the declared limit of the controller does not allow.

    Args:
        log: one log.
        entry: the table ``[controller]``.
    """
    tau = log.channels.get("tau")
    if entry.limit is None or tau is None or not np.isfinite(tau).any():
        return []
    remarks = []
    for j, name in enumerate(log.joint_names[: tau.shape[1]]):
        gain = abs(_of_joint(entry.drive_gain, j))
        limit, largest = _of_joint(entry.limit, j), float(np.nanmax(np.abs(tau[:, j])))
        if largest <= 1.02 * gain * limit:
            continue
        remarks.append(
            Remark(
                "wrong",
                "controller",
                "limit",
                f"The limit of {name} is {gain * limit:.4g} N m (or N), drive gain included, but "
                f"the log reaches {largest:.4g} N m.",
                "It is the largest output of the controller, in its own unit; correct it, or "
                "the drive gain.",
                name,
                ("controller", "limit"),
            )
        )
    return remarks


def _products(
    q: np.ndarray, q_ref: np.ndarray, tau: np.ndarray, rate: float, entry: ControllerEntry
) -> tuple[float, float] | None:
    """Gains on error and on speed, or None where they do not explain the torque."""
    e = q_ref - q
    slope = np.diff(e, prepend=e[:1]) * rate
    if entry.type == "cascade":
        slope = entry.speed_feed_forward * np.diff(q_ref, prepend=q_ref[:1]) * rate
        slope = slope - np.diff(q, prepend=q[:1]) * rate
    columns = np.column_stack([e, slope, np.ones_like(e)])[2:]
    size = np.linalg.norm(columns, axis=0)
    if not size.all():
        return None
    gains, *_ = np.linalg.lstsq(columns / size, tau[2:], rcond=None)
    rest = tau[2:] - columns / size @ gains
    if 1 - np.var(rest) / max(np.var(tau[2:]), 1e-300) < EXPLAINED:
        return None
    return float(gains[0] / size[0]), float(gains[1] / size[1])


def _compared(
    name: str, j: int, found: tuple[float, float], entry: ControllerEntry, rate: float
) -> Iterator[Remark]:
    """Declared gains that differ from those of the log.

    A torque that is a sample late takes kp/rate from the gain on the speed, which is no fault.
    """
    late = LATE * abs(found[0]) / rate
    gain = _of_joint(entry.drive_gain, j)
    kp = _of_joint(entry.kp, j)
    if entry.type == "cascade":
        kv = _of_joint(entry.kv, j)
        declared = {"kp": (gain * kp * kv, found[0]), "kv": (gain * kv, found[1])}
    else:
        declared = {
            "kp": (gain * kp, found[0]),
            "kd": (gain * _of_joint(entry.kd, j), found[1]),
        }
    for key, (said, seen) in declared.items():
        ratio = seen / said if said else np.inf
        if 1 / DIFFERENT < ratio < DIFFERENT or (key != "kp" and abs(seen - said) <= late):
            continue
        cause = next((c for r, c in CAUSES if 0.8 < ratio / r < 1.25), "")
        if ratio < 0:
            key, cause = "drive_gain", "the sign of drive_gain is reversed"
        product = "kp kv" if key == "kp" and entry.type == "cascade" else key
        product = "The gain" if key == "drive_gain" else product
        cause = cause or (
            f"check {key}, drive_gain, and the units of tau and q; with "
            'controller = "identify" the law is found from the log'
        )
        yield Remark(
            "wrong" if not 1 / 3 < ratio < 3 else "look",
            "controller",
            "gain",
            f"{product} of {name}, drive gain included, is {said:.5g} in the file; reference, "
            f"position and torque of the log say {seen:.5g}.",
            cause[:1].upper() + cause[1:] + ".",
            name,
            ("controller", key),
        )
        if ratio < 0:
            return


def _of_joint(value: object, j: int) -> float:
    """A gain of one joint."""
    if value is None:
        return 0.0
    listed = np.ravel(np.asarray(value, dtype=float))
    return float(listed[j] if listed.size > 1 else listed[0])


def check_stability(
    robot: Robot, entry: ControllerEntry, rate: float, posture: np.ndarray
) -> list[Remark]:
    """Whether the sampled loop around the described robot holds a posture.

    With M the mass matrix, x = (δq, δdq) and a torque held for a period h,

        δq⁺ = δq + h δdq + ½h² M⁻¹δτ,  δdq⁺ = δdq + h M⁻¹δτ,  δτ = -Kp δq - Kd (δq - δq⁻)/h,

    without gravity and friction, which are slow beside the loop. The loop is unstable where an
    eigenvalue of this map exceeds one.

    Args:
        robot: a robot whose description has masses.
        entry: the table ``[controller]``, of a law with gains.
        rate: of the control loop [Hz].
        posture: joint positions [rad or m], shape (joints,).
    """
    base = base_parameters(robot)
    theta = base.values(nominal_values(robot, base.standard))
    if not np.any(theta) or entry.kp is None or not all(np.any(k.inertia) for k in robot.links):
        return []
    n, h = robot.size, 1.0 / rate
    inverse = np.linalg.inv(mass_matrix(robot, base.parameters, theta, posture[None])[0])
    gain = np.array([_of_joint(entry.drive_gain, j) for j in range(n)])
    kp = gain * [_of_joint(entry.kp, j) for j in range(n)]
    kd = gain * [_of_joint(entry.kd if entry.kv is None else entry.kv, j) for j in range(n)]
    if entry.type == "cascade":
        kp = kp * [_of_joint(entry.kv, j) for j in range(n)]
    one, zero = np.eye(n), np.zeros((n, n))
    law = np.hstack([-np.diag(kp + kd / h), zero, np.diag(kd / h)])  # on δq, δdq, δq⁻
    step = np.block([[one, h * one, zero], [zero, one, zero], [one, zero, zero]])
    step[:n] += 0.5 * h**2 * inverse @ law
    step[n : 2 * n] += h * inverse @ law
    values, vectors = np.linalg.eig(step)
    k = int(np.argmax(np.abs(values)))
    growth = float(abs(values[k]))
    if growth <= GROWTH or not np.all(kd):
        return []
    worst = robot.joint_names[int(np.argmax(np.abs(vectors[:n, k])))]
    causes = "Check the units of kp and kd (N m per rad and per rad/s on the joint side), "
    causes += "drive_gain, control_rate, and the masses of the description."
    bare = not np.any(robot.rotor_inertia)
    if bare:
        causes = "The description has no rotor inertias, which count in full behind a gear: give "
        causes += "rotor_inertia under [robot]. Else check the units of kp and kd."
    return [
        Remark(
            "look" if bare else "wrong",
            "controller",
            "unstable",
            f"The loop of {worst} is unstable with these gains at {rate:.5g} Hz: errors grow by a "
            f"factor of {growth:.3g} in each control period.",
            causes,
            worst,
            ("controller", "kd" if entry.type != "cascade" else "kv"),
        )
    ]
