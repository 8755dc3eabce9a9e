"""Gains and limits of the controller beside those that the log shows.

With e = q_ref - q the error of joint j, a PD loop makes u_j = kp e + kd (s dq_ref - dq)/dt with
s = 1, a cascade u_j = kv kp e + kv (s dq_ref - dq)/dt with s = 0. Both are linear in two products
of gains, which least squares finds from the log in no time. Where they explain the torque, they are
compared with the gains of the file. A torque that is logged late by d shows kd - kp d for kd, of
any sign: gains that explain the torque as well at another shift are no other gains.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from pivident.data.logs.log import Log
from pivident.experiment.check.remark import usable_rows
from pivident.experiment.file_keys import ControllerEntry
from pivident.foundation.text.finding import Finding, FindingKind, Quantity, Topic
from pivident.foundation.text.repair import Edit, Repair, Scaled
from pivident.foundation.text.sentences import capital
from pivident.judgement.audit.timing import Timing

#: What this check looks at.
CONTROLLER = Topic("controller")

SIGN = FindingKind(CONTROLLER, "sign", ("recording", "columns", "q_ref"))
LIMIT = FindingKind(CONTROLLER, "limit", ("controller", "limit"))
GAIN = FindingKind(CONTROLLER, "gain")

#: Share of the torque that error and speed must explain before the gains are judged.
EXPLAINED = 0.98

#: Factor between a gain and what the log says that is worth a remark.
DIFFERENT = 1.3

#: Samples by which torque and position may be apart in a log.
LATE = 2.0

#: Shifts of the torque that are tried [s].
MAX_SHIFT = 0.04

#: Ratios of units that a gain may be off by, with their cause.
CAUSES = (
    (180 / np.pi, "the gains seem to be per degree; they are per radian"),
    (np.pi / 180, "the gains seem to have been converted from degrees twice"),
    (2 * np.pi, 'a factor of 2π: positions in turns? set units = {q = "rev", q_ref = "rev"}'),
    (1000.0, "a factor of 1000: mm for m, or mN m for N m"),
    (1e-3, "a factor of 1000: m for mm, or N m for mN m"),
)


def check_gains(
    log: Log, timing: Timing, entry: ControllerEntry, reversed_joints: tuple[int, ...]
) -> Iterator[Finding]:
    """The gains of the file beside those that the log shows."""
    if "q_ref" not in log.channels or "tau" not in log.channels or not timing.rate:
        return
    q, q_ref, tau = (log.channels[c] for c in ("q", "q_ref", "tau"))
    if not q.shape == q_ref.shape == tau.shape or not timing.regular:
        return
    for j, name in enumerate(log.joint_names[: q.shape[1]]):
        rows = usable_rows(q[:, [j]], q_ref[:, [j]], tau[:, [j]])
        if len(rows) < 200 or j in reversed_joints:
            continue
        signals = np.stack([q[rows, j], q_ref[rows, j], tau[rows, j]])
        rest, found = _products(signals, timing.rate, entry)
        if rest > 1 - EXPLAINED:
            continue
        if found[0] < 0:
            yield SIGN.finding(
                "error",
                f"The torque of {name} pushes away from the reference: its gain on "
                f"q_ref - q is {found[0]:.4g}.",
                name,
                "Reference and measurement are swapped, or the sign of the torque is wrong.",
                {"gain": Quantity(found[0])},
            )
            continue
        said = [*_compared(name, j, found, entry, timing.rate)]
        reach = min(round(MAX_SHIFT * timing.rate), len(rows) // 4)
        fits = (_products(signals, timing.rate, entry, k) for k in range(-reach, reach + 1))
        if said and not any(
            left <= rest and not any(_compared(name, j, gains, entry, timing.rate))
            for left, gains in fits
        ):
            yield from said


def check_limit(log: Log, entry: ControllerEntry) -> list[Finding]:
    """Outputs in the log that the declared limit of the controller does not allow."""
    tau = log.channels.get("tau")
    if entry.limit is None or tau is None or not np.isfinite(tau).any():
        return []
    findings, unlimited = [], Repair((Edit(LIMIT.place),))
    for j, name in enumerate(log.joint_names[: tau.shape[1]]):
        gain = abs(of_joint(entry.gain, j))
        limit, largest = of_joint(entry.limit, j), float(np.nanmax(np.abs(tau[:, j])))
        if largest <= 1.02 * gain * limit:
            continue
        findings.append(
            LIMIT.finding(
                "error",
                f"The limit of {name} is {gain * limit:.4g} N m (or N), drive gain included, but "
                f"the log reaches {largest:.4g} N m.",
                name,
                "It is the largest output of the controller, in its own unit; correct it, or "
                "the drive gain.",
                {"limit": Quantity(gain * limit), "log": Quantity(largest)},
                repairs=[unlimited],
            )
        )
    return findings


def _products(
    signals: np.ndarray, rate: float, entry: ControllerEntry, late: int = 0
) -> tuple[float, tuple[float, float]]:
    """Share of the torque's variance that error and speed leave, and the gains on the two.

    Args:
        signals: position, reference and torque of a joint, shape (3, samples).
        rate: their rate [Hz].
        entry: the declared law.
        late: samples by which the torque is later than the others.
    """
    q, q_ref, tau = signals
    share = entry.feed_forward_share
    slope = (share * np.diff(q_ref, prepend=q_ref[:1]) - np.diff(q, prepend=q[:1])) * rate
    columns = np.column_stack([q_ref - q, slope, np.ones_like(q)])
    columns = columns[2 + max(-late, 0) : len(q) - max(late, 0)]
    tau = tau[2 + max(late, 0) : len(q) + min(late, 0)]
    size = np.linalg.norm(columns, axis=0)
    if not size.all():
        return 1.0, (0.0, 0.0)
    gains = np.linalg.lstsq(columns / size, tau, rcond=None)[0] / size
    rest = np.var(tau - columns @ gains) / max(np.var(tau), 1e-300)
    return float(rest), (float(gains[0]), float(gains[1]))


def _compared(
    name: str, j: int, found: tuple[float, float], entry: ControllerEntry, rate: float
) -> Iterator[Finding]:
    """Declared gains that differ from the log's; a sample of delay may take kp/rate from kd."""
    late = LATE * abs(found[0]) / rate
    gain = of_joint(entry.gain, j)
    kp = of_joint(entry.kp, j)
    if entry.type == "cascade":
        kv = of_joint(entry.kv, j)
        declared = {"kp": (gain * kp * kv, found[0]), "kv": (gain * kv, found[1])}
    else:
        declared = {"kp": (gain * kp, found[0]), "kd": (gain * of_joint(entry.kd, j), found[1])}
    for key, (said, seen) in declared.items():
        ratio = seen / said if said else np.inf
        if 1 / DIFFERENT < ratio < DIFFERENT or (key != "kp" and abs(seen - said) <= late):
            continue
        cause = next((c for r, c in CAUSES if 0.8 < ratio / r < 1.25), "")
        if ratio < 0 and key == "kp":
            key, cause = "drive_gain", "the sign of drive_gain is reversed"
        product = "kp kv" if key == "kp" and entry.type == "cascade" else key
        product = "The gain" if key == "drive_gain" else product
        cause = cause or (
            f"check {key}, drive_gain, and the units of tau and q; with "
            'controller = "identify" the law is identified from the log'
        )
        place = ("controller", key)
        scaled = Scaled(place, ((name, seen / said),)) if said else None
        yield GAIN.finding(
            "error" if not 1 / 3 < ratio < 3 else "warning",
            f"{product} of {name}, drive gain included, is {said:.5g} in the file; reference, "
            f"position and torque of the log give {seen:.5g}.",
            name,
            f"{capital(cause)}.",
            {"file": Quantity(said, digits=5), "log": Quantity(seen, digits=5)},
            place=place,
            repairs=[Repair((scaled,))] if scaled is not None and entry.type != "cascade" else [],
        )
        if key == "drive_gain":
            return


def of_joint(value: object, j: int) -> float:
    """A gain of one joint; zero where there is none."""
    if value is None:
        return 0.0
    listed = np.ravel(np.asarray(value, dtype=float))
    return float(listed[j] if listed.size > 1 else listed[0])
