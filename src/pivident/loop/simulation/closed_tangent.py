"""Tangents of a closed mechanism's h_a and M_a; see ``loop_tangent`` and ``closed_slopes``."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np

from pivident.dynamics.closed_chains.closed_dynamics import ClosedModel
from pivident.dynamics.closed_chains.closed_slopes import (
    ClosedSlopes,
    closed_slopes,
    project_columns,
)
from pivident.dynamics.friction_table import OF_POSITION
from pivident.dynamics.lanes import row_array
from pivident.dynamics.path_partials import position_partial
from pivident.dynamics.rigid_body_slopes import inertial_columns
from pivident.foundation.compiled import inner
from pivident.loop.simulation.friction_tangent import PATH, constant_torque


class ClosedTangent(NamedTuple):
    """What the tangents of a closed mechanism need beside its slopes."""

    slopes: ClosedSlopes
    #: Joint, table, row, column and direction of constants of friction of passive joints,
    #: (entries, 5), and their slopes, (entries,).
    friction: np.ndarray
    friction_slope: np.ndarray
    columns: np.ndarray  # ∂u/∂θ, u the torques in all joints, (tree joints, directions)
    masses: np.ndarray  # ∂M/∂θ, (tree joints, tree joints, directions)


def closed_tangent(
    model: ClosedModel, friction: np.ndarray, friction_slope: np.ndarray, directions: int
) -> ClosedTangent:
    """Empty tangents along so many directions."""
    n = model.table.posture.size
    return ClosedTangent(
        closed_slopes(model), friction, friction_slope, row_array(n, directions),
        row_array(n, n, directions),
    )  # fmt: skip


@inner
def parameter_torques(run, tangent, inertial, links, out):
    """∂h_a/∂θ = Nᵀ ∂u/∂θ, added to ``out``, (joints, directions); after ``bias_slopes``."""
    columns, friction = tangent.columns, run.model.friction
    for i in range(columns.shape[0]):
        for d in range(columns.shape[1]):
            columns[i, d] = 0.0
    inertial_columns(run.model.table.tree.parent, inertial, links, columns)
    for e in range(tangent.friction.shape[0]):
        table, row, column = tangent.friction[e, 1], tangent.friction[e, 2], tangent.friction[e, 3]
        if table == PATH:
            joint = friction.path_index[row, 0]
            torque = position_partial(
                friction.path_index,
                friction.path_value,
                row,
                column,
                run.place.q[joint],
                OF_POSITION,
            )
        else:
            joint, torque = constant_torque(
                friction.term_index, friction.term_value, table, row, column, run.place.dq
            )
        columns[joint, tangent.friction[e, 4]] += tangent.friction_slope[e] * torque
    project_columns(run.place.gain, columns, out)
