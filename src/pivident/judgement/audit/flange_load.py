"""A load on the flange that the robot's description lacks, or has too much.

A gripper of a kilogram multiplies the torque of the wrist, which carries little else, and hardly
changes that of the shoulder. Held against the description joint by joint, its torque looks like
gains that differ from joint to joint. Held against all joints at once, the load shows itself: one
body, fixed to the last link, with ten inertial parameters θ, moves all of them,

    τ_j = a_j (d_j + Φ_j θ) + b_j ddq_j + friction_j,

where d_j is the torque that the description gives, Φ_j the regressor of the last link, and a_j
the logged torque per N m. The links before the last one set the scale. The equations are bilinear
in a and θ and solved by Gauss-Newton steps.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.judgement.audit.blocked_fit import blocked_fit, jackknife
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.robot.description import INERTIAL

#: Standard errors by which the mass of a load must differ from zero.
CLEAR = 6.0

#: A load must leave at most this share of the error that gains alone leave, in squares.
BETTER = 0.5

#: Gauss-Newton steps at most, and the change of the factors that ends them.
STEPS, SETTLED = 30, 1e-4


@dataclass(frozen=True, eq=False)
class FlangeLoad:
    """A body on the last link, and the torques beside description and body."""

    mass: float  # its mass [kg], negative where the description has more than the arm carried
    standard_error: float  # the standard error of the mass
    factors: np.ndarray  # logged torque per torque of description and body, by joint
    standard_errors: np.ndarray  # of the factors


def flange_load(model: InverseModel, factors: np.ndarray) -> FlangeLoad | None:
    """The load that explains the torques of all joints together, if there is one."""
    robot = model.robot
    joints = robot.size
    if joints < 2 or not robot.is_chain or not all(model.usable(j) for j in range(joints)):
        return None
    if not np.isfinite(factors).any():
        return None
    size = np.linalg.norm(model.tau(), axis=0) * np.maximum(model.relative_errors, 1e-4)
    weights = 1.0 / np.where(size > 0, size, 1.0)
    body = _last_link(model)
    # The joints nearest to the base feel a load least; theirs is the gain to begin with.
    typical = float(np.abs(factors[np.isfinite(factors)][0]))
    a = np.where(np.isfinite(factors), np.sign(factors), 1.0) * typical
    theta = np.zeros(len(INERTIAL))
    alone = _squares(model, body, a, theta, weights, with_load=False)
    for _ in range(STEPS):
        columns, y, block = _equations(model, body, a, theta, weights)
        length = np.linalg.norm(columns, axis=0)
        length[length == 0.0] = 1.0
        fit = blocked_fit(columns / length, y, block)
        estimate = fit.estimate / length
        change = np.abs(estimate[:joints] - a).max() / np.abs(a).max()
        a, theta = estimate[:joints], estimate[joints : joints + len(INERTIAL)]
        if change < SETTLED:
            break
    else:
        return None
    standard_error = jackknife(fit.replicates / length)
    together = _squares(model, body, a, theta, weights, with_load=True)
    mass = INERTIAL.index("m")
    least = -float(robot.links[-1].inertia[mass])  # no more than the link has can be too much
    is_clear = abs(theta[mass]) > CLEAR * standard_error[joints + mass] and theta[mass] > least
    if not (together < BETTER * alone and is_clear):
        return None
    return FlangeLoad(
        float(theta[mass]), float(standard_error[joints + mass]), a, standard_error[:joints]
    )


def _squares(
    model: InverseModel,
    body: list[np.ndarray],
    a: np.ndarray,
    theta: np.ndarray,
    weights: np.ndarray,
    with_load: bool,
) -> float:
    """Weighted sum of squares that factors leave, with a load or without."""
    columns, y, _ = _equations(model, body, a, theta, weights)
    if not with_load:
        columns = np.delete(columns, np.s_[len(a) : len(a) + len(INERTIAL)], axis=1)
    length = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(length > 0, length, 1.0)
    rest = y - columns @ np.linalg.lstsq(columns, y, rcond=1e-12)[0]
    return float(rest @ rest)


def _last_link(model: InverseModel) -> list[np.ndarray]:
    """Regressor of the last link's ten inertial parameters, for each joint (rows, 10)."""
    robot = model.robot
    own = [p for p in standard_parameters(robot) if p.is_inertial and p.joint == robot.size - 1]
    full = regressor_of(robot, own).matrix(model.q, model.dq, model.ddq)
    rows = np.asarray(full).reshape(len(model.at), robot.size, -1)
    return [rows[:, j] for j in range(robot.size)]


def _equations(
    model: InverseModel,
    body: list[np.ndarray],
    a: np.ndarray,
    theta: np.ndarray,
    weights: np.ndarray,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """The equations of all joints, linear about a and θ: columns, torque and block of each row.

    With a_j (d_j + Φ_j θ) ≈ a_j (d_j + Φ_j θ₀) + a₀_j Φ_j (θ - θ₀), the unknowns are the factors,
    the body's parameters, and what each joint has of its own: friction and, where the description
    has none, the rotor.
    """
    robot, tau, parameters = model.robot, model.tau(), model.base.parameters
    described = model.gravity + model.inertial
    owns = []
    for j in range(robot.size):
        kept = [
            k
            for k, index in enumerate(model.own[j])
            if parameters[index].friction is not None or parameters[index].coupling is not None
        ]
        own = model.columns[j][:, kept]
        if robot.rotor_inertia[j] == 0.0:
            own = np.column_stack([own, model.ddq[:, j]])
        owns.append(own)
    first = robot.size + len(INERTIAL)
    width, at = first + sum(own.shape[1] for own in owns), first
    columns, y, block = [], [], []
    for j, own in enumerate(owns):
        rows = model.moving[:, j]
        load = body[j][rows]
        part = np.zeros((len(load), width))
        part[:, j] = described[rows, j] + load @ theta
        part[:, robot.size : first] = a[j] * load
        part[:, at : at + own.shape[1]] = own[rows]
        at += own.shape[1]
        columns.append(weights[j] * part)
        y.append(weights[j] * (tau[rows, j] + a[j] * (load @ theta)))
        block.append(model.block[rows])
    return np.vstack(columns), np.concatenate(y), np.concatenate(block)
