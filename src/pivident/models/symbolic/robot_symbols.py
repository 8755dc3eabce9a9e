"""The symbols of any robot's model, and the step from all joints to the independent ones.

By virtual work, torques of the joints of a tree whose loops are closed become those of the
independent joints by Nᵀ, and its mass matrix M becomes Nᵀ M N. For a tree N is the identity and is
never formed.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from pivident.dynamics.grouping.expressions import (
    ZERO,
    Expression,
    operation_count,
)
from pivident.foundation.errors import RobotDescriptionError
from pivident.models.symbolic.closed_symbols import closed_symbols
from pivident.models.symbolic.model_symbols import (
    Columns,
    ModelSymbols,
    bare_symbols,
    depends_on_load,
    has_memory,
    with_parameters,
)
from pivident.models.symbolic.sums import collected
from pivident.robot.description import Robot


def robot_symbols(
    robot: Robot, columns: Columns = "base", values: np.ndarray | None = None
) -> ModelSymbols:
    """Symbols for the motion and the parameters of a robot; other parameters are zero.

    Args:
        robot: a tree, or a mechanism with closed loops.
        columns: parameters of the model (base, standard or chosen ones).
        values: their values, shape (parameters,); None: they are symbols.

    Raises:
        RobotDescriptionError: values of another number; friction that closed loops do not handle.
    """
    if robot.constraints is None:
        return with_parameters(bare_symbols(robot), robot, columns, values)
    model = with_parameters(closed_symbols(robot), robot, columns, values)
    for p in model.parameters:
        if has_memory(p) or depends_on_load(p):
            raise RobotDescriptionError(
                f"{p.name}: friction with a memory, and friction that grows with the load, are "
                "not handled in mechanisms with closed loops",
                advice="choose viscous, Coulomb, Stribeck …",
            )
    return model


def on_given_joints(model: ModelSymbols, torques: Sequence[Expression]) -> list[Expression]:
    """Nᵀ τ: torques of all joints as those of the joints whose motion is given.

    Of the sum as it stands and the one in which moments that cancel are left out, the cheaper one.
    """
    if model.gain is None:
        return list(torques)
    plain = [_weighted(torques, column) for column in model.gain.T]
    return min(
        (plain, [collected(total) for total in plain]),
        key=lambda sums: operation_count(sums).price,
    )


def mass_of_given_joints(model: ModelSymbols, matrix: np.ndarray) -> np.ndarray:
    """Nᵀ M N of the mass matrix of all joints."""
    gain = model.gain
    if gain is None:
        return matrix
    moved = [[_weighted(row, column) for column in gain.T] for row in matrix]
    size = gain.shape[1]
    mass = np.full((size, size), ZERO, dtype=object)
    for a in range(size):
        for b in range(a + 1):
            total = _weighted([row[b] for row in moved], list(gain[:, a]))
            mass[a, b] = mass[b, a] = collected(total)
    return mass


def _weighted(values: Sequence[Expression], weights: Sequence[Expression]) -> Expression:
    total: Expression = ZERO
    for value, weight in zip(values, weights, strict=True):
        total = total + weight * value
    return total
