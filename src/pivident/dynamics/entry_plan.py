"""What the compiled loops of the observation matrix compute: a plan built once per regressor."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from pivident.dynamics.kernels import Tree, tree_of
from pivident.dynamics.parameters import Parameter
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction_column import SignFunction
from pivident.robot.friction_term import MAX_SHAPES
from pivident.robot.friction_terms.coulomb import COULOMB
from pivident.robot.friction_terms.viscous import VISCOUS

#: Uses of the screw of a joint, seen from a link: for the links further out, for the columns of
#: the inertias, for those of first moments and mass.
CARRY, INERTIAS, MOMENTS = 1, 2, 4

#: Functions of entries that are an acceleration or an inner signal; the others have the numbers
#: of a ``FrictionColumn``.
ACCELERATION, INNER = 100, 101


#: Place of an inertial parameter among the ten of its link, by its stem.
_PLACES = {stem: place for place, stem in enumerate(INERTIAL)}

#: γ and constants of an entry that has none.
_NO_SHAPE = (0.0,) * (1 + MAX_SHAPES)


class EntryPlan(NamedTuple):
    """Which entries of the observation matrix are computed, as arrays for the kernels.

    A *block* is the ten columns of one link in the row of one of its ancestors. Blocks are
    computed in the order of links and ancestors; the *joint entries*, those without inertial
    parameter, follow. ``work`` says what the screw of each link's k-th ancestor (0: its own joint)
    is used for, a sum of ``CARRY INERTIAS MOMENTS``. A row of ``joint_index`` holds the function,
    the sign function and the joints a and b that a joint entry depends on (of an inner signal,
    memory or load, a is its number); a row of ``joint_value`` its factor, c in the speed
    dq_a + c dq_b, γ and the constants of a friction term.
    """

    tree: Tree
    moved: np.ndarray  # 1 for links whose motion is needed, (links,)
    work: np.ndarray  # (links, depth)
    joint_index: np.ndarray  # (joint entries, 4)
    joint_value: np.ndarray  # (joint entries, 3 + MAX_SHAPES)
    source: np.ndarray  # computed column of each entry, (entries,)
    columns: int  # number of columns computed


def make_entry_plan(
    robot: Robot, parameters: Sequence[Parameter], entries: Sequence[tuple[int, int]]
) -> EntryPlan:
    """Plan the computation of entries (joint, index of the parameter)."""
    chains = [robot.ancestors(i) for i in range(robot.size)]
    work = np.zeros((robot.size, max(len(chain) for chain in chains)), dtype=np.int64)
    places = [_PLACES.get(p.stem) for p in parameters]  # None: no inertial parameter
    wanted = {(parameters[c].joint, joint, place) for joint, c in entries
              if (place := places[c]) is not None}  # fmt: skip
    for link, joint, place in wanted:
        work[link, chains[link].index(joint)] |= INERTIAS if place < _PLACES["mx"] else MOMENTS
    moved = np.zeros(robot.size, dtype=np.int64)
    moved[[j for link in {link for link, _, _ in wanted} for j in chains[link]]] = 1
    for i in range(robot.size - 1, -1, -1):
        for k in range(1, len(chains[i])):
            if work[i, k]:
                work[chains[i][1], k - 1] |= CARRY
    blocks = {
        (int(i), chains[i][k]): 10 * n
        for n, (i, k) in enumerate(np.argwhere(work & (INERTIAS | MOMENTS)))
    }
    index: list[tuple[int, int, int, int]] = []
    value: list[tuple[float, ...]] = []
    source: list[int] = []
    inner = 0
    for joint, c in entries:
        p, place = parameters[c], places[c]
        if place is not None:
            source.append(blocks[p.joint, joint] + place)
        else:
            source.append(10 * len(blocks) + len(index))
            if has_inner_signal(p):
                index.append((INNER, 0, inner, inner))
                value.append((1.0, 0.0, *_NO_SHAPE))
                inner += 1
                continue
            function, factors = joint_entry(robot, p, joint)
            index.append(function)
            value.append(factors)
    return EntryPlan(
        tree_of(robot),
        moved,
        work,
        np.array(index, dtype=np.int64).reshape(-1, 4),
        np.array(value, dtype=float).reshape(-1, 3 + MAX_SHAPES),
        np.array(source, dtype=np.int64),
        10 * len(blocks) + len(index),
    )


def has_inner_signal(p: Parameter) -> bool:
    """Whether a parameter's column is an inner signal: friction with memory or load."""
    return p.friction is not None and p.friction.has_inner_signal


def joint_entry(
    robot: Robot, p: Parameter, joint: int, simulated: bool = False
) -> tuple[tuple[int, int, int, int], tuple[float, ...]]:
    """Row of ``joint_index`` and of ``joint_value`` for a rotor, friction or coupling entry.

    ``simulated`` replaces the hard sign by the arctangent.
    """
    if p.friction is not None:
        column, sign, shape = p.friction.encoded(simulated)
        return (column, sign, joint, joint), (1.0, 0.0, *shape)
    if p.coupling is None:
        return (ACCELERATION, 0, joint, joint), (1.0, 0.0, *_NO_SHAPE)
    c = p.coupling
    if p.stem == "fcm":
        sign, gamma = coupling_sign(robot, c.motor, simulated)
        factor = c.ratio if joint == c.joint else 1.0
        return (int(COULOMB), sign, c.motor, c.joint), (factor, c.ratio, gamma, *_NO_SHAPE[1:])
    other = c.motor if joint == c.joint else c.joint
    function = ACCELERATION if p.stem == "iam" else int(VISCOUS)
    return (function, 0, other, other), (c.ratio, 0.0, *_NO_SHAPE)


def coupling_sign(robot: Robot, motor: int, simulated: bool = False) -> tuple[int, float]:
    """Code and γ of a coupling's Coulomb term: the sign function of the motor's own joint.

    Where the joint's Coulomb friction has no sign function, because it has a state, the joint's
    default arctangent is used. ``simulated`` replaces the hard sign by the arctangent.
    """
    for term in robot.joints[motor].friction.terms:
        if term.has_sign and term.stem.startswith("fc"):
            _, sign, shape = term.encoded(simulated)
            return sign, shape[0]
    return int(SignFunction.ATAN), robot.joints[motor].default_gamma
