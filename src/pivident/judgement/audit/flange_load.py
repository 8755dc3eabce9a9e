"""A load on the flange that the robot's description lacks, or has too much.

A gripper of a kilogram multiplies the torque of the wrist, which carries little else, and hardly
changes that of the shoulder. Held against the description joint by joint, its torque looks like
gains that differ from joint to joint. Held against all joints at once, the load shows itself: one
body, fixed to the last link, with ten inertial parameters θ, moves all of them,

    τ_j = a_j (d_j + Φ_j θ) + b_j ddq_j + friction_j,

where d_j is the torque that the description gives, Φ_j the regressor of the last link, and a_j
the logged torque per N m. The links before the last one set the scale. The equations are bilinear
in a and θ and solved by Gauss-Newton steps, all from the same products of d_j, Φ_j, the joint's own
columns and τ_j.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.parameters import standard_parameters
from pivident.dynamics.robot_regressor import regressor_of
from pivident.judgement.audit.blocked_fit import BlockedFit, jackknife
from pivident.judgement.audit.inverse_model import InverseModel
from pivident.robot.description import INERTIAL

#: Standard errors by which the mass of a load must differ from zero.
CLEAR = 6.0

#: A load must leave at most this share of the error that gains alone leave, in squares.
BETTER = 0.5

#: Parameters of the body.
BODY = len(INERTIAL)

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
    products = _products(model, 1.0 / np.where(size > 0, size, 1.0))
    # The joints nearest to the base feel a load least; theirs is the gain to begin with.
    typical = float(np.abs(factors[np.isfinite(factors)][0]))
    a = np.where(np.isfinite(factors), np.sign(factors), 1.0) * typical
    theta = np.zeros(BODY)
    start = _equations(products, a, theta)
    others = np.delete(np.arange(start.shape[1]), np.s_[joints : joints + BODY])
    alone = _rest(start[:, others][:, :, others])
    if sum(_rest(own) for own in products) >= BETTER * alone:
        return None  # not even with a body for each joint, whose equations are linear
    for _ in range(STEPS):
        equations = _equations(products, a, theta)
        fit, length = _fit(equations)
        estimate = fit.estimate / length
        change = np.abs(estimate[:joints] - a).max() / np.abs(a).max()
        a, theta = estimate[:joints], estimate[joints : joints + BODY]
        if change < SETTLED:
            break
    else:
        return None
    standard_error = jackknife(fit.replicates / length)
    together = _rest(_equations(products, a, theta))
    mass = INERTIAL.index("m")
    least = -float(robot.links[-1].inertia[mass])  # no more than the link has can be too much
    is_clear = abs(theta[mass]) > CLEAR * standard_error[joints + mass] and theta[mass] > least
    if not (together < BETTER * alone and is_clear):
        return None
    return FlangeLoad(
        float(theta[mass]), float(standard_error[joints + mass]), a, standard_error[:joints]
    )


def _products(model: InverseModel, weights: np.ndarray) -> list[np.ndarray]:
    """Products of d_j, Φ_j, the joint's own columns and τ_j, by block, for each joint.

    Each of shape (blocks, columns, columns). The joint's own are its friction and, where the
    description has none, the rotor.
    """
    robot, parameters = model.robot, model.base.parameters
    last = [p for p in standard_parameters(robot) if p.is_inertial and p.joint == robot.size - 1]
    body = np.asarray(regressor_of(robot, last).matrix(model.q, model.dq, model.ddq))
    body = body.reshape(len(model.at), robot.size, BODY)
    described, tau = model.gravity + model.inertial, model.tau()
    blocks = np.unique(model.block[model.moving.any(axis=1)])
    made = []
    for j in range(robot.size):
        kept = [
            k
            for k, index in enumerate(model.own[j])
            if parameters[index].friction is not None or parameters[index].coupling is not None
        ]
        own = [described[:, j], body[:, j], model.columns[j][:, kept]]
        if robot.rotor_inertia[j] == 0.0:
            own.append(model.ddq[:, j])
        every = weights[j] * np.column_stack([*own, tau[:, j]])
        parts = [every[model.moving[:, j] & (model.block == block)] for block in blocks]
        made.append(np.array([part.T @ part for part in parts]))
    return made


def _equations(products: list[np.ndarray], a: np.ndarray, theta: np.ndarray) -> np.ndarray:
    """Products of the columns and, last, the torque of all joints' equations, by block.

    With a_j (d_j + Φ_j θ) ≈ a_j (d_j + Φ_j θ₀) + a₀_j Φ_j (θ - θ₀), linear about a₀ and θ₀, the
    unknowns are the factors, the body's parameters, and what each joint has of its own.
    """
    joints = len(products)
    first = at = joints + BODY
    counts = [own.shape[1] - BODY - 2 for own in products]
    total = np.zeros((len(products[0]), first + sum(counts) + 1, first + sum(counts) + 1))
    for j, (own, count) in enumerate(zip(products, counts, strict=True)):
        made = np.zeros((total.shape[1], own.shape[1]))  # of what the products are of
        made[j, 0], made[j, 1 : 1 + BODY] = 1.0, theta
        made[joints:first, 1 : 1 + BODY] = a[j] * np.eye(BODY)
        made[at : at + count, 1 + BODY : -1] = np.eye(count)
        made[-1, 1 : 1 + BODY], made[-1, -1] = a[j] * theta, 1.0
        total += made @ own @ made.T
        at += count
    return total


def _fit(products: np.ndarray) -> tuple[BlockedFit, np.ndarray]:
    """The torque by the other columns, each of unit length, and these lengths."""
    length = np.sqrt(np.diag(products.sum(axis=0))[:-1])
    length[length == 0.0] = 1.0
    grams = products[:, :-1, :-1] / np.outer(length, length)
    return BlockedFit(grams, products[:, :-1, -1] / length), length


def _rest(products: np.ndarray) -> float:
    """Sum of squares that the other columns leave of the torque."""
    fit, _ = _fit(products)
    square = float(products[:, -1, -1].sum())
    return square - float(fit.estimate @ fit.rights.sum(axis=0))
