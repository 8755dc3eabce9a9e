"""Linear equations of expressions, blocks, sums that cancel, and products of rotations."""

import numpy as np
import pytest
from hypothesis import given, settings, strategies as st

from pivident.dynamics.grouping.expression_graph import symbol
from pivident.dynamics.grouping.expressions import ONE, ZERO, constant, evaluate, operation_count
from pivident.models.symbolic.linear_solution import block_order, solved, solved_by_blocks
from pivident.models.symbolic.sums import Rotations, collected, joint_frame
from pivident.robot.description import Joint
from pivident.robot.frames import rotation_x, rotation_z
from tests.dynamics.closed.mechanisms import random_rotation

SEEDS = st.integers(0, 2**32 - 1)
X, Y, Z = (symbol(name) for name in "xyz")


def symbols(stem, *shape):
    names = np.empty(shape, dtype=object)
    for place in np.ndindex(*shape):
        names[place] = symbol(f"{stem}_{'_'.join(map(str, place))}")
    return names


def values_of(names, numbers):
    return {s.name: x for s, x in zip(names.ravel(), np.ravel(numbers), strict=True)}


@settings(max_examples=20, deadline=None)
@given(SEEDS, st.integers(1, 6))
def test_solutions(seed, size):
    rng = np.random.default_rng(seed)
    numbers, right = rng.normal(size=(size, size)), rng.normal(size=(2, size))
    matrix, rights = symbols("a", size, size), symbols("b", 2, size)
    found = solved(matrix, [list(row) for row in rights])
    values = values_of(matrix, numbers) | values_of(rights, right)
    ours = [evaluate(x, values) for x in found]
    accuracy = 1e-13 * np.linalg.cond(numbers) ** 2
    np.testing.assert_allclose(ours, np.linalg.solve(numbers, right.T).T, rtol=0, atol=accuracy)


def test_pivots_that_are_zero_do_no_harm():
    """The larger block needs no exchange of rows."""
    numbers = np.eye(5)[[1, 2, 3, 4, 0]]
    matrix = symbols("a", 5, 5)
    (found,) = solved(matrix, [[constant(float(k)) for k in range(5)]])
    ours = evaluate(found, values_of(matrix, numbers))
    np.testing.assert_allclose(ours, [4.0, 0.0, 1.0, 2.0, 3.0], rtol=0, atol=1e-15)


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_blocks(seed):
    """A hidden block triangle: each block depends on those before, and is solved alone."""
    rng = np.random.default_rng(seed)
    label = np.sort(rng.integers(0, 4, 7))
    numbers = rng.normal(size=(7, 7)) * (label[:, None] >= label) * (rng.random((7, 7)) < 0.7)
    numbers[np.diag_indices(7)] += 3.0
    numbers = numbers[rng.permutation(7)][:, rng.permutation(7)]
    if np.linalg.cond(numbers) > 1e3:
        return
    pattern = numbers != 0.0
    blocks = block_order(pattern)
    assert sorted(c for block in blocks for c in block.columns) == list(range(7))
    assert len(blocks) >= len(set(label))
    later: set = set()
    for block in reversed(blocks):
        assert not pattern[np.ix_(block.rows, sorted(later))].any()
        later.update(block.columns)
    matrix = np.where(pattern, symbols("a", 7, 7), ZERO)
    right = rng.normal(size=7)
    found = solved_by_blocks(matrix, [[constant(x) for x in right.tolist()]], blocks)[:, 0]
    ours = evaluate(found, values_of(symbols("a", 7, 7), numbers))
    np.testing.assert_allclose(ours, np.linalg.solve(numbers, right), rtol=1e-8, atol=1e-8)


def test_an_empty_row_is_refused():
    with pytest.raises(ValueError, match="singular"):
        block_order(np.array([[True, True], [False, False]]))


def test_terms_that_cancel():
    assert collected(X + (Y - X)) is Y
    assert collected((X + 2.0 * Y) - (Y + X) + 1.0 - Y) is ONE
    plain = X + (Y + Z)
    assert collected(plain) is plain


def test_neighbouring_rotations_are_one():
    """Parallel and opposite axes turn together; angles that cancel leave nothing."""
    rng = np.random.default_rng(1)
    half = rotation_x(np.pi)
    turns = [np.eye(3), half, half, rotation_z(0.4)]
    joints = [Joint(f"j{k}", "revolute", k - 1, turn, np.zeros(3)) for k, turn in enumerate(turns)]
    way = Rotations()
    angles = [X, Y, Z, -X - Y]
    for joint, angle in zip(joints, angles, strict=True):
        way.into(joint_frame(joint, angle))
    assert len(way.factors) == 1
    numbers = dict(zip("xyz", rng.uniform(-2.0, 2.0, 3), strict=True))
    whole = np.eye(3)
    for turn, angle in zip(turns, evaluate(angles, numbers), strict=True):
        whole = whole @ turn @ rotation_z(angle)
    ours = [evaluate(way.back(tuple(map(constant, axis))), numbers) for axis in np.eye(3)]
    np.testing.assert_allclose(np.transpose(ours), whole, rtol=0, atol=1e-14)
    for joint, angle in zip(reversed(joints), reversed(angles), strict=True):
        way.out_of(joint_frame(joint, angle))
    assert not way.factors


@settings(max_examples=20, deadline=None)
@given(SEEDS)
def test_rotations_of_general_frames(seed):
    rng = np.random.default_rng(seed)
    joints = [
        Joint(f"j{k}", "revolute", k - 1, random_rotation(rng), np.zeros(3)) for k in range(3)
    ]
    way, whole = Rotations(), np.eye(3)
    numbers = dict(zip("xyz", rng.uniform(-2.0, 2.0, 3), strict=True))
    for joint, angle in zip(joints, (X, Y, Z), strict=True):
        way.into(joint_frame(joint, angle))
        whole = whole @ joint.rotation @ rotation_z(numbers[angle.name])
    vector = rng.normal(size=3)
    given = tuple(map(constant, vector.tolist()))
    np.testing.assert_allclose(evaluate(way.back(given), numbers), whole @ vector, atol=1e-13)
    np.testing.assert_allclose(evaluate(way.out(given), numbers), whole.T @ vector, atol=1e-13)
    assert operation_count(way.back((X, Y, Z))).multiplications <= 48
