"""The symbols of a mechanism with closed loops: all joints by the motion of independent ones.

    c(q) = 0,    N_d = -A_d⁻¹ A_a,    γ_d = -A_d⁻¹ (dA/dt dq),    dq = N dq_a,    ddq = N ddq_a + γ

Positions come from `closed_positions`; where those leave some to Newton's method they are symbols,
and a program has a `LoopClosing` that finds them. Everything else follows in symbols, so that
every model of a tree is one of the mechanism, projected by Nᵀ.
"""

from __future__ import annotations

from dataclasses import replace
from functools import lru_cache

import numpy as np

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ONE, ZERO, Expression, constant
from pivident.robot.description import Robot
from pivident.symbolic.assignments import Assignments, Input, LoopClosing, Output, output_array
from pivident.symbolic.closed_positions import ClosedPositions, closed_positions
from pivident.symbolic.closures import closing_equations, jacobian
from pivident.symbolic.linear_solution import Block, block_order, solved_by_blocks
from pivident.symbolic.model_symbols import (
    NOTHING,
    ModelSymbols,
    bare_symbols,
    motion_input,
)
from pivident.symbolic.sums import collected


@lru_cache(maxsize=8)
def closed_symbols(robot: Robot) -> ModelSymbols:
    """Symbols of a mechanism's motion: its tree, without parameters.

    Args:
        robot: with `Robot.constraints`.
    """
    assert robot.constraints is not None
    places = list(robot.places)
    positions = closed_positions(robot, bare_symbols(robot.tree))
    tree = positions.model
    others = [i for i in range(tree.robot.size) if i not in places]
    slope = _masked(positions, robot, tree)
    square = slope[:, others]
    blocks = block_order(positions.pattern[:, others])
    known: dict[int, list[Expression]] = {
        k: [constant(x) for x in positions.proportions[i].tolist()]
        for k, i in enumerate(others)
        if i in positions.proportions
    }
    gain = np.full((tree.robot.size, len(places)), ZERO, dtype=object)
    gain[places, range(len(places))] = ONE
    rights = [[-x for x in slope[:, place]] for place in places]
    gain[others] = solved_by_blocks(square, rights, blocks, known)
    moving = np.array([tree.dq[i] for i in places], dtype=object)
    tree = replace(tree, dq=_moved(gain, moving))
    equations = closing_equations(tree, robot.constraints)
    drift = np.full(tree.robot.size, ZERO, dtype=object)
    still: dict[int, list[Expression]] = {k: [ZERO] for k in known}
    right = [[-equation.drift() for equation in equations]]
    drift[others] = solved_by_blocks(square, right, blocks, still)[:, 0]
    pushed = _moved(gain, np.array([tree.ddq[i] for i in places], dtype=object))
    tree = replace(
        tree,
        ddq=tuple(a + b for a, b in zip(pushed, drift, strict=True)),
        drift=tuple(drift),
        places=robot.places,
        gain=gain,
        closing=_closing(robot, positions, gain),
    )
    return replace(tree, hints=tuple(_hints(tree, gain, others)))


def _masked(positions: ClosedPositions, robot: Robot, tree: ModelSymbols) -> np.ndarray:
    """A where the loops are closed, without what is always zero there."""
    assert robot.constraints is not None
    slope = jacobian(closing_equations(tree, robot.constraints), tree, closed=True)
    slope[~positions.pattern] = ZERO
    return slope


def _moved(gain: np.ndarray, speeds: np.ndarray) -> tuple[Expression, ...]:
    """N times speeds or accelerations of the independent joints."""
    total = []
    for row in gain:
        own: Expression = ZERO
        for share, speed in zip(row, speeds, strict=True):
            own = own + share * speed
        total.append(collected(own))
    return tuple(total)


def _closing(robot: Robot, positions: ClosedPositions, gain: np.ndarray) -> LoopClosing | None:
    """One step of Newton's method: (c, -A_x⁻¹ (c + A_a way)), for positions x without closed form.

    ``way`` is how far the independent joints move along with the step, so that one step after the
    other follows the mechanism from posture to posture.
    """
    joints, rows = positions.iterated, positions.equations
    if not joints:
        return None
    assert robot.constraints is not None
    tree, places = positions.model, robot.places
    equations = closing_equations(tree, robot.constraints)
    slope = _masked(positions, robot, tree)[rows]
    gaps = [equations[row].gap() for row in rows]
    way = tuple(symbol(f"way{i + 1}") for i in places)
    known = [i for i in range(robot.tree.size) if i not in joints]
    moved = _moved(gain[known], np.array(way, dtype=object))
    right = [-(gap + _along(slope[k, known], moved)) for k, gap in enumerate(gaps)]
    pattern = positions.pattern[np.ix_(rows, joints)]
    blocks: list[Block] = block_order(pattern)
    step = solved_by_blocks(slope[:, joints], [right], blocks)[:, 0]
    unknown = Input(
        "passive",
        tuple(tree.q[i] for i in joints),  # type: ignore[misc]
        "positions of " + ", ".join(robot.tree.joints[i].name for i in joints),
    )
    q = motion_input(robot.tree, "q", places)
    program = Assignments.build(
        "closing_step",
        [q, unknown, Input("way", way, "how far the independent joints move along")],
        NOTHING,
        [
            Output("gap", output_array(gaps), "what is left of the equations c(q) = 0 [m or rad]"),
            Output("step", output_array(list(step)), "change of the passive positions"),
        ],
        title=f"Step of Newton's method for the loops of {robot.name}",
    )
    posture = robot.constraints.posture[[*places, *joints]]
    return LoopClosing(program, unknown, tuple(posture.tolist()))


def _along(row: np.ndarray, moved: tuple[Expression, ...]) -> Expression:
    total: Expression = ZERO
    for a, b in zip(row, moved, strict=True):
        total = total + a * b
    return total


def _hints(tree: ModelSymbols, gain: np.ndarray, others: list[int]) -> list[tuple[str, Expression]]:
    """Names of positions, speeds and accelerations of dependent joints, of N and γ."""
    named: list[tuple[str, Expression]] = []
    for i in others:
        named += [(f"q{i + 1}", tree.q[i]), (f"dq{i + 1}", tree.dq[i])]
        named += [(f"ddq{i + 1}", tree.ddq[i]), (f"drift{i + 1}", tree.drift[i])]
        named += [(f"gain{i + 1}_{a + 1}", x) for a, x in enumerate(gain[i])]
    return named
