"""The symbols of a mechanism with closed loops: all joints by the motion of independent ones.

    c(q) = 0,    N_d = -A_d⁻¹ A_a,    γ_d = -A_d⁻¹ (dA/dt dq),    dq = N dq_a,    ddq = N ddq_a + γ

Positions come from `closed_positions`; where those leave some to Newton's method they are symbols,
and a program has a `LoopClosing` that finds them. Everything else follows in symbols, so that
every model of a tree is one of the mechanism, projected by Nᵀ.

The equations c(q) = 0 are put into blocks that are solved one after the other. A block is

- linear, of gears and belts: solved at once, with numbers;
- whole proportions: a parallelogram;
- a triangle of two joints of a planar loop, or one joint alone in its equation: type equations,
  unless it matters how many turns such a joint has made;
- or left to Newton's method, together with all such blocks that depend on it.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import lru_cache

import numpy as np

from pivident.dynamics.closed_chains.closed_motion import ClosedChains
from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ONE, ZERO, Expression, constant
from pivident.models.symbolic.assignments import (
    Assignments,
    Input,
    LoopClosing,
    Output,
    output_array,
)
from pivident.models.symbolic.closures import (
    ClosureEquation,
    LinearEquation,
    closing_equations,
    jacobian,
)
from pivident.models.symbolic.linear_solution import Block, block_order, solved, solved_by_blocks
from pivident.models.symbolic.model_symbols import (
    NOTHING,
    ModelSymbols,
    bare_symbols,
    motion_input,
)
from pivident.models.symbolic.sums import collected
from pivident.models.symbolic.type_equations import (
    alone,
    chosen_solution,
    triangle,
    whole_proportion,
)
from pivident.robot.closed_chains import equations
from pivident.robot.description import Robot

#: Postures at random at which an element has to be zero to count as one that always is.
POSTURES, ZERO_BELOW = 24, 1e-10

#: How far postures at which loops are open are from the one where they close [rad or m].
OPENED = 0.3


@dataclass(eq=False)
class ClosedPositions:
    """Positions of all joints, and how they were found.

    Attributes:
        model: the tree; ``q`` are symbols of independent joints and of those of Newton's method,
            and expressions of the others.
        proportions: factors K of joints that move in whole proportions, by joint.
        iterated: joints that Newton's method finds, ascending.
        equations: number, among the kept ones, of the equations that it solves.
        pattern: where A may differ from zero in closed postures, shape (equations, tree joints).
    """

    model: ModelSymbols
    pattern: np.ndarray
    proportions: dict[int, np.ndarray] = field(default_factory=dict)
    iterated: list[int] = field(default_factory=list)
    equations: list[int] = field(default_factory=list)

    def iterated_in(self, joints: Iterable[int]) -> bool:
        """Whether Newton's method finds one of some joints."""
        return not set(self.iterated).isdisjoint(joints)


def closed_positions(robot: Robot, model: ModelSymbols) -> ClosedPositions:
    """Positions of all joints of a mechanism.

    Args:
        robot: with `Robot.constraints`.
        model: its tree with a symbol for every position.
    """
    samples = _postures(robot)
    result = ClosedPositions(model, _pattern(robot, samples))
    places = list(robot.places)
    others = [i for i in range(robot.tree.size) if i not in places]
    for block in block_order(_open_pattern(robot)[:, others]):
        joints = [others[k] for k in block.columns]
        rows = list(block.rows)
        found = (
            _gears(robot, result, rows, joints)
            or _parallelogram(result, places, samples, joints)
            or _typed(robot, result, rows, joints, samples)
        )
        if found is None:
            result.iterated += joints
            result.equations += rows
            continue
        q = tuple(found.get(i, own) for i, own in enumerate(result.model.q))
        result.model = replace(result.model, q=q)
    result.iterated.sort()
    result.equations.sort()
    return result


def _postures(robot: Robot) -> np.ndarray:
    """Positions of all joints in closed postures, the description's first."""
    chains = ClosedChains(robot)
    own = chains.random_postures(np.random.default_rng(20260601), POSTURES)
    first = chains.table.posture[chains.table.places]
    return np.array([chains.start(q).q for q in (first, *own)])


def _pattern(robot: Robot, samples: np.ndarray) -> np.ndarray:
    """Where A may differ from zero, in the postures that are given."""
    assert robot.constraints is not None
    kept = list(robot.constraints.kept)
    sizes = [np.abs(equations(robot.tree, robot.constraints, q)[1][kept]) for q in samples]
    largest = np.max(sizes, axis=0)
    return largest > ZERO_BELOW * largest.max(axis=1, keepdims=True)


def _open_pattern(robot: Robot) -> np.ndarray:
    """Which joint each equation depends on where loops need not be closed."""
    assert robot.constraints is not None
    rng = np.random.default_rng(20260602)
    spread = rng.uniform(-OPENED, OPENED, (POSTURES, robot.tree.size))
    return _pattern(robot, robot.constraints.posture + spread)


def _gears(
    robot: Robot, result: ClosedPositions, rows: Sequence[int], joints: Sequence[int]
) -> dict[int, Expression] | None:
    """Joints that only linear constraints move, where the others do not wait for Newton's method.

    Newton's method takes those along, because its A has to know all that moves with its joints.
    """
    model = result.model
    own = _equations(robot, model, rows)
    if not all(isinstance(equation, LinearEquation) for equation in own):
        return None
    if any(result.iterated_in(equation.slope(model, True)) for equation in own):
        return None
    q = tuple(ZERO if i in joints else q for i, q in enumerate(model.q))
    rights = [-equation.gap() for equation in _equations(robot, replace(model, q=q), rows)]
    slopes = [equation.slope(model, True) for equation in own]
    matrix = np.array([[slope.get(i, ZERO) for i in joints] for slope in slopes], dtype=object)
    (values,) = solved(matrix, [rights])
    return {i: collected(value) for i, value in zip(joints, values, strict=True)}


def _parallelogram(
    result: ClosedPositions, places: Sequence[int], samples: np.ndarray, joints: Sequence[int]
) -> dict[int, Expression] | None:
    """Joints that move in whole proportions to the independent ones."""
    independent = samples[:, places]
    positions: dict[int, Expression] = {}
    proportions: dict[int, np.ndarray] = {}
    for i in joints:
        found = whole_proportion(independent, samples[:, i])
        if found is None:
            return None
        proportions[i], offset = found
        total: Expression = constant(offset)
        for factor, place in zip(proportions[i].tolist(), places, strict=True):
            total = total + factor * result.model.q[place]
        positions[i] = total
    result.proportions.update(proportions)
    return positions


def _typed(
    robot: Robot,
    result: ClosedPositions,
    rows: Sequence[int],
    joints: Sequence[int],
    samples: np.ndarray,
) -> dict[int, Expression] | None:
    """One joint or two of a loop whose others do not wait for Newton's method."""
    own = _equations(robot, result.model, rows)
    ends, *others = (e.ends if isinstance(e, ClosureEquation) else None for e in own)
    if ends is None or not all(one is not None and one.closure is ends.closure for one in others):
        return None
    loop = {*ends.beyond[0], *ends.beyond[1]}
    if not loop.issuperset(joints) or result.iterated_in(loop):
        return None
    if not _counting_turns(robot).isdisjoint(joints):
        return None
    assert robot.constraints is not None and isinstance(own[0], ClosureEquation)
    solutions: list[dict[int, Expression]] = []
    every, posture = robot.tree.joints, robot.constraints.posture
    if len(joints) == 2:
        solutions = triangle(ends, every, joints, posture)
    elif len(joints) == 1 and isinstance(own[0].axes, int):
        solutions = alone(ends, own[0].axes, every, joints[0], posture)
    places = list(robot.places)
    return chosen_solution(solutions, [f"q{i + 1}" for i in places], samples[:, places], samples)


def _counting_turns(robot: Robot) -> set[int]:
    """Joints whose angle is not the same after a whole turn: of gears, with springs or ripple.

    Type equations count angles within half a turn of the description's, Newton's method goes on.
    """
    assert robot.constraints is not None
    geared = {i for one in robot.constraints.linear for i in np.flatnonzero(one.ratios).tolist()}
    joints = enumerate(robot.tree.joints)
    sprung = {i for i, j in joints if any(term.depends_on_position for term in j.friction.terms)}
    return geared | sprung


def _equations(
    robot: Robot, model: ModelSymbols, rows: Sequence[int]
) -> list[ClosureEquation | LinearEquation]:
    """Some of the kept equations."""
    assert robot.constraints is not None
    every = closing_equations(model, robot.constraints)
    return [every[row] for row in rows]


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
    blocks: list[Block] = block_order(positions.pattern[np.ix_(rows, joints)])
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


def _hints(
    tree: ModelSymbols, gain: np.ndarray, others: list[int]
) -> Iterator[tuple[str, Expression]]:
    """Names of positions, speeds and accelerations of dependent joints, of N and γ."""
    for i in others:
        yield from [(f"q{i + 1}", tree.q[i]), (f"dq{i + 1}", tree.dq[i])]
        yield from [(f"ddq{i + 1}", tree.ddq[i]), (f"drift{i + 1}", tree.drift[i])]
        yield from [(f"gain{i + 1}_{a + 1}", x) for a, x in enumerate(gain[i])]
