"""Signs by power and by gravity: friction takes energy, and a resting arm carries its weight.

The friction that a joint's own equation finds takes the power

    P_j = mean( f_j(dq_j) dq_j ),    f_j the terms of its friction law

from the arm. It cannot be negative; where it is, torque or position of that joint has the wrong
sign. At rest the torque lies within static friction of gravity's torque g_j(q). The weight of a
vertical slide is the same everywhere: there the constant part c of the torque,

    τ_j = c + m ddq_j + f_j(dq_j),

is compared with it, whether it rests or not. An estimate would take it for an offset of the drive.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.data.logs.log import Log
from pivident.foundation.text.finding import (
    Finding,
    FindingKind,
    Quantity,
    Severity,
    Topic,
    at_sample,
)
from pivident.foundation.text.numbers import with_spread
from pivident.foundation.text.repair import Repair, Reversed
from pivident.judgement.audit.blocked_fit import BLOCKS, blocked_fit, jackknife, orthonormal
from pivident.judgement.audit.examination import Examination, LogCheck
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.judgement.audit.spoilt_checks import GEOMETRY
from pivident.robot.friction_terms.offset import OFFSET

#: What these checks look at, and the unit that holds the sign of a torque.
SIGNS, TORQUES = Topic("power", "Signs: power and gravity"), ("recording", "units", "tau")

SIGN = FindingKind(SIGNS, "sign", TORQUES, reservation=True, spoils=GEOMETRY)
GIVES_ENERGY = FindingKind(SIGNS, "gives energy")
WEIGHT = FindingKind(SIGNS, "weight", TORQUES, reservation=True)
GRAVITY_AT_REST = FindingKind(SIGNS, "gravity at rest", ("robot", "gravity"))

#: A power counts as negative from this many of its standard errors on.
CLEAR = 3.0

#: … and if it is at least this share of the power that goes back and forth.
SHARE = 0.02

#: Relative error of a joint's model up to which its sign is certain.
EXPLAINED = 0.5

#: Speed below which a joint rests, as share of its fastest.
REST = 2e-3

#: Shortest time at rest [s].
MIN_REST = 0.1

#: Share of gravity's torque by which a description may be off.
DESCRIPTION = 0.5

#: Share by which a weight changes that is the same everywhere, and share of the force that it has
#: to be: a horizontal slide carries next to nothing.
SAME_WEIGHT, LEAST_WEIGHT = 0.01, 0.05


@dataclass(frozen=True, eq=False)
class Power:
    """What power and gravity say about the signs."""

    findings: tuple[Finding, ...]
    friction: np.ndarray  # power that friction takes from each joint [W], NaN where it is not known
    standard_errors: np.ndarray  # of that power [W]
    reversed: tuple[int, ...]  # joints whose sign is reversed: friction would clearly give energy
    right: tuple[int, ...]  # joints whose sign is right: friction clearly takes energy
    static: np.ndarray  # friction level of each joint [N m or N], NaN where it is not known


class PowerCheck(LogCheck):
    """The signs of the torques."""

    name = "power"

    def examine(self, seen: Examination) -> Examination:
        """See `LogCheck.examine`."""
        power = check_power(seen.log, seen.model)
        return seen.after(self.name, power.findings, power)


def check_power(log: Log, model: InverseModel) -> Power:
    """Judge the sign of every torque."""
    joints = model.robot.size
    tau = model.tau()
    power, standard_errors, static = (np.full(joints, np.nan) for _ in range(3))
    for j in range(joints):
        if model.usable(j):
            power[j], standard_errors[j], static[j] = _friction_power(model, j, tau[:, j])
    swing = np.mean(np.abs(tau * model.dq), axis=0)
    clear = np.abs(power) > np.maximum(CLEAR * standard_errors, SHARE * swing)
    negative = [j for j in range(joints) if clear[j] and power[j] < 0]
    findings = [
        _power_finding(model, j, power[j], standard_errors[j], negative, clear[j])
        for j in range(joints)
        if np.isfinite(power[j])
    ]
    weights = _constant_weights(log, model, tau)
    said = {finding.subject for finding in weights if finding.severity != "ok"}
    findings += [f for f in _gravity_at_rest(log, model, tau, static) if f.subject not in said]
    findings += weights
    positive = tuple(j for j in range(joints) if clear[j] and power[j] > 0)
    return Power(tuple(findings), power, standard_errors, tuple(negative), positive, static)


def mechanical_power(log: Log) -> list[Finding]:
    """Without a robot: an arm that gives energy all the time is a sign that is reversed."""
    q, tau = log.channels["q"], log.channels["tau"]
    findings: list[Finding] = []
    if q.shape != tau.shape or not (np.isfinite(q).all() and np.isfinite(tau).all()):
        return findings
    middle = 0.5 * (tau[1:] + tau[:-1])
    work = middle * np.diff(q, axis=0)
    turnover = np.abs(work).sum(axis=0)
    for j, name in enumerate(log.joint_names):
        parts = np.array([part.sum() for part in np.array_split(work[:, j], BLOCKS)])
        total, standard_error = float(parts.sum()), float(np.std(parts) * np.sqrt(BLOCKS))
        if total + CLEAR * standard_error < 0 and total < -0.05 * turnover[j]:
            text = f"{name} supplies {abs(total):.3g} J instead of taking energy from its drive."
            step = "Torque or position may have the wrong sign; --robot makes it certain."
            evidence = {
                "energy": Quantity(
                    total,
                    "J",
                    bound=0.0,
                    interval=(total - 2 * standard_error, total + 2 * standard_error),
                )
            }
            repairs = [_other_sign(name)]
            findings.append(
                GIVES_ENERGY.finding("warning", text, name, step, evidence, repairs=repairs)
            )
    return findings


def _friction_power(model: InverseModel, j: int, tau: np.ndarray) -> tuple[float, float, float]:
    """Power of one joint's friction, its standard error, and its level at typical speed."""
    rows = model.moving[:, j]
    columns, dq = model.columns[j][rows], model.dq[rows, j]
    parameters = model.base.parameters
    own = [
        k
        for k, index in enumerate(model.own[j])
        if (p := parameters[index]).friction is not None
        and p.joint == model.robot.places[j]
        and p.friction.column != OFFSET
        and not p.friction.depends_on_position
    ]
    if not own:
        return float("nan"), float("nan"), float("nan")
    basis, back = orthonormal(columns)
    fit = blocked_fit(basis, tau[rows], model.block[rows])
    taken = np.mean(columns[:, own] * dq[:, None], axis=0) @ back[own]
    level = np.mean(columns[:, own] * np.sign(dq)[:, None], axis=0) @ back[own]
    return (
        float(taken @ fit.estimate),
        float(jackknife(fit.replicates @ taken)),
        float(abs(level @ fit.estimate)),
    )


def _power_finding(
    model: InverseModel,
    j: int,
    power: float,
    standard_error: float,
    negative: list[int],
    clear: bool,
) -> Finding:
    name = model.robot.joints[j].name
    severity: Severity = "ok"
    step = ""
    if j in negative:
        # Of a torque that the model hardly explains, a fraction proves nothing.
        severity = "error" if model.relative_errors[j] < EXPLAINED else "warning"
        step = (
            f"Reverse the sign of tau or q of {name}: a list under units with -1.0 in place of N "
            "m, N, rad or m."
        )
        if len(negative) == model.robot.size and len(negative) > 1:
            step = "All joints supply power: reverse the sign of tau, units = {tau = -1.0}."
    size, spread = with_spread(power, 2 * standard_error)
    text = f"Friction of {name} dissipates {size} ± {spread} W"
    text += "." if power >= 0 else ", that is, it would supply energy."
    if not clear:
        text += " The motion does not determine its sign."
    evidence = {
        "friction power": Quantity(
            power, "W", bound=0.0, interval=(power - 2 * standard_error, power + 2 * standard_error)
        )
    }
    repairs = [_other_sign(name)] if j in negative else []
    return SIGN.finding(severity, text, name, step, evidence, repairs=repairs)


def _other_sign(joint: str) -> Repair:
    """The torque of a joint with the other sign."""
    return Repair((Reversed(channel="tau", joints=(joint,)),))


def _constant_weights(log: Log, model: InverseModel, tau: np.ndarray) -> list[Finding]:
    """The constant part of the torque of vertical slides against their weight.

    More than the weight is that of a load, which the estimate has as well.
    """
    findings, scaled = [], {scale.joint for scale in log.torque_scale}
    for j, joint in enumerate(model.robot.joints):
        rows = model.moving[:, j]
        if joint.kind != "prismatic" or j in log.commands or joint.name in scaled:
            continue
        if not model.usable(j):
            continue
        carried = model.gravity[rows, j]
        weight = float(np.mean(carried))
        least = LEAST_WEIGHT * float(np.sqrt(np.mean(tau[rows, j] ** 2)))
        if abs(weight) <= least or float(np.ptp(carried)) > SAME_WEIGHT * abs(weight):
            continue
        constant, spread = _constant_part(model, j, tau[rows, j])
        share, uncertain_share = constant / weight, CLEAR * spread / abs(weight)
        off = share + uncertain_share < 1.0 - DESCRIPTION
        severity: Severity = "error" if share < -DESCRIPTION else "warning" if off else "ok"
        size, uncertain = with_spread(constant, 2.0 * spread)
        text = (
            f"The constant part of the force of {joint.name} is {size} ± {uncertain} N; its weight "
            f"after the description is {weight:.3g} N."
        )
        step = (
            "Check which way the slide counts, the sign of its force and the direction of gravity; "
            "a counterbalance, or a part of the command that is not logged, takes weight off it."
        )
        interval = (constant - 2.0 * spread, constant + 2.0 * spread)
        evidence = {
            "force": Quantity(constant, "N", interval=interval),
            "weight": Quantity(weight, "N"),
        }
        step = step if off else ""
        findings.append(WEIGHT.finding(severity, text, joint.name, step, evidence))
    return findings


def _constant_part(model: InverseModel, j: int, tau: np.ndarray) -> tuple[float, float]:
    """The constant c of one joint on its moving rows, and its standard error."""
    rows, parameters = model.moving[:, j], model.base.parameters
    friction = [
        k
        for k, index in enumerate(model.own[j])
        if (p := parameters[index]).friction is not None and p.friction.column != OFFSET
    ]
    columns = np.column_stack([model.columns[j][rows][:, friction], model.ddq[rows, j]])
    basis = orthonormal(np.column_stack([np.ones(len(columns)), columns]))
    fit = blocked_fit(basis[0], tau, model.block[rows])
    return float(basis[1][0] @ fit.estimate), float(jackknife(fit.replicates @ basis[1][0]))


def _gravity_at_rest(
    log: Log, model: InverseModel, tau: np.ndarray, static: np.ndarray
) -> list[Finding]:
    """Torque of the resting arm against gravity after the description."""
    fastest = np.abs(model.dq).max(axis=0)
    resting = np.all(np.abs(model.dq) < REST * np.where(fastest > 0, fastest, 1.0), axis=1)
    period = float(np.median(np.diff(model.at))) / model.rate
    findings: list[Finding] = []
    if resting.sum() * period < MIN_REST or not np.abs(model.gravity).max():
        return findings
    for j, joint in enumerate(model.robot.joints):
        heaviest = np.flatnonzero(resting)[np.argmax(np.abs(model.gravity[resting, j]))]
        weight, held = float(model.gravity[heaviest, j]), float(tau[heaviest, j])
        friction = float(static[j]) if np.isfinite(static[j]) else 0.0
        if abs(weight) < 2.0 * friction + 1e-9 or j in log.commands:
            continue
        allowed = friction + DESCRIPTION * abs(weight)
        off = abs(held - weight) > allowed
        opposite = held * weight < 0 and abs(held) > friction
        severity: Severity = "error" if opposite else "warning" if off else "ok"
        unit = "N m" if joint.kind == "revolute" else "N"
        sample = model.first + int(model.at[heaviest])
        text = (
            f"At rest {joint.name} holds {held:.3g} {unit}; gravity of the description is "
            f"{weight:.3g} {unit}, friction {friction:.2g} {unit}."
        )
        step = (
            ""
            if severity == "ok"
            else "Check the sign of the torque, the direction of gravity, the zero of the "
            "position and the gain."
        )
        worse = weight + float(np.copysign(allowed, held - weight))
        evidence = {
            "torque": Quantity(held, unit, bound=worse),
            **at_sample(sample, log.time_of(sample)),
        }
        findings.append(GRAVITY_AT_REST.finding(severity, text, joint.name, step, evidence))
    return findings
