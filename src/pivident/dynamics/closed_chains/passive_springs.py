"""Springs, struts and ripple of passive joints: torques of the position, their slopes and partials.

    f(q) = ks q,   sin(q - φ) (cbf/l + cbk),   A cos(n q) + B sin(n q)

Passive joints have no integrator of their own: where they are follows from the loops, and their
torques are bias torques of the tree.
"""

from __future__ import annotations

from pivident.compiled import inner, shared
from pivident.dynamics.elementary import sine_and_cosine
from pivident.dynamics.friction_table import spring_torque
from pivident.dynamics.path_partials import spring_partials, spring_slopes
from pivident.robot.friction import FrictionColumn

_COSINE = int(FrictionColumn.COSINE)


@shared
def position_torque(path_index, path_value, vectors, position, out):
    """Add f at the positions of a row to another row of ``vectors``, (rows, joints)."""
    spring_torque(path_index, path_value, vectors, position, out)
    for k in range(path_index.shape[0]):
        if path_index[k, 1] == _COSINE:
            j = path_index[k, 0]
            sine, cosine = sine_and_cosine(path_value[k, 2] * vectors[position, j])
            vectors[out, j] += path_value[k, 0] * cosine + path_value[k, 1] * sine


@inner
def position_slopes(path_index, path_value, vectors, position, by_position):
    """Add ∂f/∂q to a matrix, (joints, joints)."""
    spring_slopes(path_index, path_value, vectors, position, by_position)
    for k in range(path_index.shape[0]):
        if path_index[k, 1] == _COSINE:
            j, order = path_index[k, 0], path_value[k, 2]
            sine, cosine = sine_and_cosine(order * vectors[position, j])
            by_position[j, j] += order * (path_value[k, 1] * cosine - path_value[k, 0] * sine)


@inner
def position_partial(path_index, path_value, k, column, q):
    """Derivative of f by one of the values of an entry."""
    if path_index[k, 1] != _COSINE:
        return spring_partials(path_index, path_value, k, column, q)
    sine, cosine = sine_and_cosine(path_value[k, 2] * q)
    if column == 0:
        return cosine
    if column == 1:
        return sine
    return q * (path_value[k, 1] * cosine - path_value[k, 0] * sine)
