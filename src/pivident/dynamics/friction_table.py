"""Friction of a whole robot in the simulator: tables of terms and their torques.

Terms of speed alone have a table of their own, so that laws with no other terms cost no more. What
depends on the position, on the path so far or on the load is in the *path* table. In a step,
friction is a function F(x, v) of the travels and speeds; slope ∂F/∂v, stiffness ∂F/∂x.

Friction fl |L| s(v) that grows with the load L = τ - f of the joint is solved in closed form. With
f₀ all other friction and a = fl s(v),

    f = f₀ + a |τ - f|   ⇔   L = τ - f = (τ - f₀)/(1 + a sign(τ - f₀)),   |a| < 1

and every slope and stiffness of f₀ is multiplied by 1/(1 + a sign(τ - f₀)), the *share*. Springs
carry load as gravity does, so they belong to the torques of the rigid body.
"""

from __future__ import annotations

import math
from typing import NamedTuple

import numpy as np

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.friction_kernels import (
    BY_LOAD,
    BY_POSITION,
    SLOPE,
    VALUE,
    friction_value_and_slope,
    level_and_slope,
    motion_value,
    position_value_and_slope,
    presliding_stiffness,
    slip_stiffness,
    smooth_sign_and_slope,
    state_after_way,
    travel_to_reversal,
)
from pivident.dynamics.parameters import Parameter
from pivident.foundation.compiled import inlined as _inline, inner, kernel, rows, shared
from pivident.foundation.errors import UnusableValue
from pivident.robot.description import Robot
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_term import MAX_SHAPES, FrictionTerm
from pivident.robot.friction_terms import friction_columns
from pivident.robot.friction_terms.coulomb import LOAD
from pivident.robot.friction_terms.offset import OFFSET
from pivident.robot.friction_terms.presliding import MAXWELL, PRESLIDING, PRESLIDING_RATE
from pivident.robot.friction_terms.viscous import VISCOUS

_LOAD, _PRESLIDING, _MAXWELL = int(LOAD), int(PRESLIDING), int(MAXWELL)

#: Signs of entries of the path table that are functions of the position: of springs, of all.
SPRINGS, OF_POSITION = rows(int(SignFunction.SPRING), int(SignFunction.NONE))

#: Largest fl after clipping; at 1 friction would hold any torque.
MAX_LOAD_SHARE = 0.9

#: Steps of Newton's method for the load under friction of one's own, which end at rounding.
MAX_LOAD_STEPS, LOAD_ROUNDING = 50, 1e-15

# Rows of ``path``, shape (PATH_ROWS, entries): states and levels at the start of the step, then
# states, levels and dz/dx at some travel: at the end of the step, at its middle.
STATE, START_LEVEL, AHEAD, MIDWAY = rows(0, 1, 2, 5)
PATH_ROWS = 8
RATE = AHEAD + 2  # dz/dx at the end of the step


class FrictionTable(NamedTuple):
    """Friction of all joints in the simulator.

    Rows of ``path_value`` are two parameters and four constants. Functions of the position: the
    parameter, 0 and their constants. Presliding: fc, fd, 1/d, ρ, 1/v_s, δ; slip: fm, 0, then the
    same. Load: fl, 0, γ.
    """

    linear: np.ndarray  # viscous parameter and constant torque, (joints, 2)
    term_index: np.ndarray  # joint, function, sign of nonlinear terms of speed, (terms, 3)
    term_value: np.ndarray  # parameter, γ, two constants of shape, (terms, 4)
    pair_index: np.ndarray  # motor, joint, sign, (couplings, 3)
    pair_value: np.ndarray  # ratio, fvm, fcm, γ, (couplings, 4)
    path_index: np.ndarray  # joint, function, sign; those of load last, (entries, 3)
    path_value: np.ndarray  # (entries, 6)

    @property
    def memories(self) -> np.ndarray:
        """Entries of the path table that have a state."""
        return np.flatnonzero(np.isin(self.path_index[:, 1], (_PRESLIDING, _MAXWELL)))


def make_friction_table(
    robot: Robot, parameters: tuple[Parameter, ...], values: np.ndarray
) -> FrictionTable:
    """Arrange the values of friction and coupling parameters; others are left out."""
    linear = np.zeros((robot.size, 2))
    terms: list[tuple[tuple[int, ...], tuple[float, ...]]] = []
    pairs = {c: np.array([c.ratio, 0.0, 0.0, 0.0]) for c in robot.couplings}
    for p, value in zip(parameters, values.tolist(), strict=True):
        if p.coupling is not None and p.stem in ("fvm", "fcm"):
            pairs[p.coupling][1 if p.stem == "fvm" else 2] = value
        if p.friction is None or not p.friction.is_of_speed_alone:
            continue
        code, sign, shape = p.friction.encoded(simulated=True)
        if p.friction.column == VISCOUS:
            linear[p.joint, 0] += value
        elif p.friction.column == OFFSET:
            linear[p.joint, 1] += value
        else:
            terms.append(((p.joint, code, sign), (value, *shape[:3])))
    signs = [coupling_sign(robot, c.motor, simulated=True) for c in robot.couplings]
    for c, (_, gamma) in zip(robot.couplings, signs, strict=True):
        pairs[c][3] = gamma
    path = path_entries(parameters, values)
    return FrictionTable(
        linear,
        np.array([index for index, _ in terms], dtype=np.int64).reshape(-1, 3),
        np.array([value for _, value in terms], dtype=float).reshape(-1, 4),
        np.array(
            [(c.motor, c.joint, sign) for c, (sign, _) in zip(pairs, signs, strict=True)],
            dtype=np.int64,
        ).reshape(-1, 3),
        np.array(list(pairs.values()), dtype=float).reshape(-1, 4),
        np.array([e.codes for e in path], dtype=np.int64).reshape(-1, 3),
        np.array([e.values for e in path], dtype=float).reshape(-1, 2 + MAX_SHAPES),
    )


class PathEntry(NamedTuple):
    """One entry of the path table."""

    name: str  # of its first parameter
    codes: tuple[int, int, int]  # joint, function and smoothed sign
    values: tuple[float, ...]  # two parameters and four constants


def path_entries(parameters: tuple[Parameter, ...], values: np.ndarray) -> list[PathEntry]:
    """Entries of the path table, joint by joint, those of load last."""
    found: dict[tuple, tuple[str, list[float]]] = {}
    for p, value in zip(parameters, values.tolist(), strict=True):
        if p.friction is None or p.friction.is_of_speed_alone:
            continue
        code, sign, shape = p.friction.encoded(simulated=True)
        if code == _LOAD and not abs(value) < 1.0:
            raise UnusableValue(
                f"{p.name} = {value:g}: friction must grow slower than the load",
                advice="give a value between 0 and 1",
            )
        # the rate of presliding has the state of its entry
        head, place = (_PRESLIDING, 1) if code == int(PRESLIDING_RATE) else (code, 0)
        _, both = found.setdefault(
            (p.friction.depends_on_load, p.joint, head, sign, shape), (p.name, [0.0, 0.0])
        )
        both[place] += value
    ordered = sorted(found.items(), key=lambda item: item[0][:2])
    loaded = [joint for (of_load, joint, *_), _ in ordered if of_load]
    if len(set(loaded)) < len(loaded):
        raise UnusableValue(
            "a joint has two terms of load-dependent friction", advice="give it one"
        )
    return [
        PathEntry(name, (joint, code, sign), (*both, *_constants(code, shape, of_load)))
        for (of_load, joint, code, sign, shape), (name, both) in ordered
    ]


def clipped_friction(term: FrictionTerm, value: float) -> float:
    """The value, or the nearest one that dissipates energy."""
    if term.is_dissipative:
        value = max(value, 0.0)
    return min(value, MAX_LOAD_SHARE) if term.column == LOAD else value


def dry_friction_level(friction: FrictionTable, joints: int) -> np.ndarray:
    """Largest dry friction of each joint, the scale of the integrator's tolerance.

    Friction that grows with speed sets the scale only where there is no other.
    """
    grows = [int(column) for column in friction_columns().values() if column.speed_power]
    fast = np.isin(friction.term_index[:, 1], grows)
    fast &= friction.term_index[:, 2] == SignFunction.SHARP
    level, other = np.full(joints, 1e-9), np.zeros(joints)
    for where, into in ((~fast, level), (fast, other)):
        np.add.at(into, friction.term_index[where, 0], np.abs(friction.term_value[where, 0]))
    ratio, _, dry, _ = friction.pair_value.T
    np.add.at(level, friction.pair_index[:, 0], np.abs(dry))
    np.add.at(level, friction.pair_index[:, 1], np.abs(ratio * dry))
    waves: dict[tuple[float, ...], float] = {}
    entries = zip(friction.path_index.tolist(), friction.path_value.tolist(), strict=True)
    for (joint, column, sign), (value, _, *constants) in entries:
        if column in (_PRESLIDING, _MAXWELL) or (column < 0 and not constants[1]):
            level[joint] += abs(value)
        elif sign == OF_POSITION:  # sine and cosine of one order are one wave
            wave = (joint, *constants)
            waves[wave] = math.hypot(waves.get(wave, 0.0), value)
    for (joint, *_), height in waves.items():
        level[int(joint)] += height
    return np.where(level > 1e-9, level, level + other)


def _constants(column: int, shape: tuple[float, ...], of_load: bool) -> tuple[float, ...]:
    """The four constants of an entry of the path table from γ and the term's shape."""
    gamma, first, second, third, fourth = shape
    if column == _LOAD or column < 0:
        return gamma, float(of_load), 0.0, 0.0
    if column in (_PRESLIDING, _MAXWELL):
        return 1.0 / first, second, 1.0 / third if second else 0.0, fourth
    return first, second, third, fourth


@kernel
def friction_torque(
    linear, term_index, term_value, pair_index, pair_value, vectors, speed, out, slopes, row
):
    """Friction torques of terms of speed into row ``out`` of ``vectors`` (rows, joints).

    Row ``row`` of ``slopes`` receives d torque / d v of each joint, then of each coupling's dry
    friction over the speed of its rotor. ``speed`` is the row of the speeds.
    """
    n = vectors.shape[1]
    for j in range(n):
        vectors[out, j] = linear[j, 0] * vectors[speed, j] + linear[j, 1]
        slopes[row, j] = linear[j, 0]
    for k in range(term_index.shape[0]):
        j = term_index[k, 0]
        f, df = friction_value_and_slope(
            term_index[k, 1],
            term_index[k, 2],
            term_value[k, 1],
            term_value[k, 2],
            term_value[k, 3],
            vectors[speed, j],
        )
        vectors[out, j] += term_value[k, 0] * f
        slopes[row, j] += term_value[k, 0] * df
    for k in range(pair_index.shape[0]):
        i, j = pair_index[k, 0], pair_index[k, 1]
        ratio, viscous, dry = pair_value[k, 0], pair_value[k, 1], pair_value[k, 2]
        vi, vj = vectors[speed, i], vectors[speed, j]
        f, df = smooth_sign_and_slope(pair_index[k, 2], pair_value[k, 3], vi + ratio * vj)
        vectors[out, i] += ratio * viscous * vj + dry * f
        vectors[out, j] += ratio * (viscous * vi + dry * f)
        slopes[row, n + k] = dry * df


@shared
def slopes_width(joints, couplings):
    """Columns of ``slopes`` with a path table: D, coupled D, K, share and fl|L| of each joint."""
    return 4 * joints + couplings


@inner
def motion_friction(column, sign, gamma, v, q, value, net, of_load):
    """Friction of several quantities: torque, slopes by speed and position, and the load's share.

    Where it depends on the load L, that follows by Newton's method from

        L + c f(q, v, L) = τ - f₀ = ``net``

    and every slope is multiplied by the share 1/(1 + c ∂f/∂L).
    """
    load, share = 0.0, 1.0
    if of_load > 0.0:
        load = net
        for _ in range(MAX_LOAD_STEPS):
            f = motion_value(column, VALUE, sign, gamma, v, load, q)
            rise = value * motion_value(column, BY_LOAD, sign, gamma, v, load, q)
            share = 1.0 / max(1.0 + rise, 1.0 - MAX_LOAD_SHARE)
            step = (load + value * f - net) * share
            load -= step
            if not abs(step) > LOAD_ROUNDING * abs(net):
                break
    return (
        value * motion_value(column, VALUE, sign, gamma, v, load, q),
        value * motion_value(column, SLOPE, sign, gamma, v, load, q),
        value * motion_value(column, BY_POSITION, sign, gamma, v, load, q),
        share,
    )


@inner
def path_torque(
    path_index, path_value, path, at, couplings, torque,
    vectors, position, start_speed, elapsed, travel, speed, out, slopes, row,
):  # fmt: skip
    """Add friction of position, path and load to what ``friction_torque`` has found.

    ``position`` and ``start_speed`` are rows of ``vectors`` at the start of the step, ``elapsed``
    seconds ago; ``travel`` and ``speed`` rows of the travel since and of the speed after it. Writes
    the AHEAD or MIDWAY rows (``at``) of ``path``, and ``slopes`` as in ``slopes_width``.
    """
    n = vectors.shape[1]
    stiffness, share, carried = n + couplings, 2 * n + couplings, 3 * n + couplings
    for j in range(n):
        slopes[row, stiffness + j] = 0.0
        slopes[row, share + j] = 1.0
        slopes[row, carried + j] = 0.0
    for k in range(path_index.shape[0]):
        j, column = path_index[k, 0], path_index[k, 1]
        x, v = vectors[travel, j], vectors[speed, j]
        first, second, constant = path_value[k, 0], path_value[k, 1], path_value[k, 2]
        if path_index[k, 2] == OF_POSITION:
            f, df = position_value_and_slope(
                column, constant, path_value[k, 3], vectors[position, j] + x
            )
            vectors[out, j] += first * f
            slopes[row, stiffness + j] += first * df
        elif column == _PRESLIDING or column == _MAXWELL:
            excess, inverse_speed, exponent = path_value[k, 3], path_value[k, 4], path_value[k, 5]
            level, fall = level_and_slope(excess, inverse_speed, exponent, v)
            z, start_level, v_start = path[STATE, k], path[START_LEVEL, k], vectors[start_speed, j]
            if v_start * v < 0.0:
                way = travel_to_reversal(v_start, v, elapsed)
                z = state_after_way(
                    column, z, v_start, start_level, 0.0, 1.0 + excess, way,
                    constant, excess, inverse_speed, exponent,
                )  # fmt: skip
                v_start, start_level, x = 0.0, 1.0 + excess, x - way
            z = state_after_way(
                column, z, v_start, start_level, v, level, x,
                constant, excess, inverse_speed, exponent,
            )  # fmt: skip
            vectors[out, j] += first * z
            if column == _PRESLIDING:
                rate = presliding_stiffness(z, level, v, constant)
                # micro-damping fd d dz/dt = fd (v - |v| z/g)
                damping = second * rate / constant
                vectors[out, j] += damping * v
                slopes[row, j] += damping + second * abs(v) * z * fall / (level * level)
                slopes[row, stiffness + j] += (first - second * abs(v) / level) * rate
            else:
                rate = slip_stiffness(z, level, v, constant)
                slopes[row, stiffness + j] += first * rate
                if rate == 0.0:
                    slopes[row, j] += first * math.copysign(fall, z * fall)
            path[at, k], path[at + 1, k], path[at + 2, k] = z, level, rate
        elif column == _LOAD:
            s, slope = smooth_sign_and_slope(path_index[k, 2], constant, v)
            net = torque[j] - vectors[out, j]
            one = math.copysign(1.0, net)
            part = 1.0 / (1.0 + first * s * one)
            load = net * part
            vectors[out, j] = torque[j] - load
            slopes[row, share + j] = part
            slopes[row, carried + j] = abs(first * load)
            slopes[row, j] += abs(load) * first * slope
        elif column < 0:
            f, df, rise, part = motion_friction(
                column, path_index[k, 2], constant, v, vectors[position, j] + x, first,
                torque[j] - vectors[out, j], path_value[k, 3],
            )  # fmt: skip
            vectors[out, j] += f
            slopes[row, j] += df
            slopes[row, stiffness + j] += rise
            slopes[row, share + j] *= part
            slopes[row, carried + j] += abs(f)


@shared
def position_torque(path_index, path_value, vectors, position, out, kinds):
    """Add the torques of functions of the position at a row of ``vectors`` to another row.

    ``kinds``: ``SPRINGS``, whose torque the joint carries, or ``OF_POSITION``, all of them.
    """
    for k in range(path_index.shape[0]):
        if path_index[k, 2] <= kinds:
            j = path_index[k, 0]
            f, _ = position_value_and_slope(
                path_index[k, 1], path_value[k, 2], path_value[k, 3], vectors[position, j]
            )
            vectors[out, j] += path_value[k, 0] * f


@_inline
def accept_states(path):
    """Make the states and levels of the AHEAD rows those at the start of the next step."""
    for k in range(path.shape[1]):
        path[STATE, k], path[START_LEVEL, k] = path[AHEAD, k], path[AHEAD + 1, k]
