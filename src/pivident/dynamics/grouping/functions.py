"""Torques of a joint alone, as functions of its motion that are independent of each other."""

from __future__ import annotations

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.grouping.reach import ROUNDING
from pivident.robot.description import Coupling, Robot
from pivident.robot.friction_column import Functions, SignFunction
from pivident.robot.friction_term import FrictionTerm


def friction_functions(term: FrictionTerm) -> Functions:
    """The column of a term as a sum of independent functions.

    ``1`` is the function of an offset, ``cos`` and ``sin`` of order 1 are those of a weight.
    """
    functions = term.column.functions
    if functions is None:
        return {("own", term.stem): 1.0}
    _, code, (gamma, *_) = term.encoded()
    return {
        (name, 1.0)
        if name in ("cos", "sin") and abs(constants[0] - 1.0) < ROUNDING
        else key: factor
        for key, factor in functions(_sign(code, gamma), *term.values).items()
        for name, *constants in (key,)
    }


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
