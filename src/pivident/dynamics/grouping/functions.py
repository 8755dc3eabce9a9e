"""Torques of a joint alone, as functions of its motion that are independent of each other."""

from __future__ import annotations

import numpy as np

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.reach import ROUNDING
from pivident.robot.description import Coupling, Robot
from pivident.robot.friction_term import FrictionColumn, FrictionTerm, SignFunction

#: Factor by function; a function is its name and its constants.
Functions = dict[tuple, float]


def friction_functions(term: FrictionTerm) -> Functions:
    """The column of a term as a sum of independent functions.

    ``1`` is the function of an offset, ``cos`` and ``sin`` of order 1 are those of a weight.
    """
    c = FrictionColumn
    _, code, (gamma, *a) = term.encoded()
    sign = _sign(code, gamma)
    if term.is_independent:
        return {("own", term.stem): 1.0}
    if term.column in (c.COSINE, c.SINE):
        order = 1.0 if abs(a[0] - 1.0) < ROUNDING else a[0]
        return {("cos" if term.column is c.COSINE else "sin", order): 1.0}
    if term.column is c.STRUT_STIFFNESS:  # sin(q - φ)
        return {("cos", 1.0): -float(np.sin(a[1])), ("sin", 1.0): float(np.cos(a[1]))}
    functions: dict[FrictionColumn, Functions] = {
        c.VISCOUS: {("dq",): 1.0},
        c.VISCOUS_POSITIVE: {("dq",): 0.5, ("|dq|",): 0.5},
        c.VISCOUS_NEGATIVE: {("dq",): 0.5, ("|dq|",): -0.5},
        c.COULOMB: {sign: 1.0},
        c.COULOMB_POSITIVE: {("1",): 0.5, sign: 0.5},
        c.COULOMB_NEGATIVE: {("1",): -0.5, sign: 0.5},
        c.OFFSET: {("1",): 1.0},
        c.SPRING: {("q",): 1.0},
        c.STRUT: {("strut", a[0], a[1]): 1.0},
    }
    return functions[term.column]


def coupling_functions(robot: Robot, stem: str, coupling: Coupling) -> Functions:
    """The columns ``fvm`` and ``fcm`` of a coupling likewise.

    They act on two joints at once and are independent of all others, unless the ratio is 0: then
    ``fvm`` has no effect and ``fcm`` is the Coulomb friction of the motor's own joint.
    """
    if coupling.ratio == 0.0:
        return {} if stem == "fvm" else {_sign(*coupling_sign(robot, coupling.motor)): 1.0}
    if stem == "fvm":  # the same for both directions
        pair = sorted((coupling.motor, coupling.joint))
        return {("dq dq", *pair): coupling.ratio}
    return {("s s", coupling.motor, coupling.joint, coupling.ratio): 1.0}


def _sign(code: int, gamma: float) -> tuple:
    """The (smoothed) sign as a function; a hard sign has no slope."""
    return ("s", code) if code == SignFunction.SIGN else ("s", code, gamma)
