"""Forward dynamics: mass matrix, bias torques and acceleration from linear parameters.

    M(q) ddq + h(q, dq) + friction(dq) = tau

Base parameters are enough: they are lifted to links some of which have no mass, and the kernels
work on the linear ten-parameter form, where that is allowed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from pivident.dynamics.entry_plan import coupling_sign
from pivident.dynamics.friction import friction_value_and_slope, smooth_sign_and_slope
from pivident.dynamics.kernels import (
    Tree,
    invert_mass_matrix,
    mass_matrix_and_bias,
    rigid_body_work,
    tree_of,
)
from pivident.dynamics.parameters import Parameter
from pivident.errors import MassMatrixNotPositiveDefinite
from pivident.robot.description import INERTIAL, Robot
from pivident.robot.friction import FrictionColumn


class FrictionTable(NamedTuple):
    """Friction of all joints as the simulator evaluates it.

    Attributes:
        linear: viscous parameter and constant torque of each joint, shape (joints, 2).
        term_index: joint, function and smoothed sign of each nonlinear term, shape (terms, 3).
        term_value: parameter, γ, v_s, δ of each nonlinear term, shape (terms, 4).
        pair_index: motor, joint and smoothed sign of each coupling, shape (couplings, 3).
        pair_value: ratio, fvm, fcm, γ of each coupling, shape (couplings, 4).
    """

    linear: np.ndarray
    term_index: np.ndarray
    term_value: np.ndarray
    pair_index: np.ndarray
    pair_value: np.ndarray


class Model(NamedTuple):
    """A robot with parameter values, as arrays for the compiled loops.

    Attributes:
        tree: geometry.
        inertia: ten inertial parameters of every link, shape (joints, 10).
        rotor: rotor inertias with couplings, shape (joints, joints).
        friction: friction terms and their values.
    """

    tree: Tree
    inertia: np.ndarray
    rotor: np.ndarray
    friction: FrictionTable


def make_model(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, clip: bool = False
) -> Model:
    """Arrange parameter values for the compiled loops; parameters not given are zero.

    Args:
        robot: the robot.
        parameters: standard parameters (or heads of base groups).
        theta: their values, shape (parameters,).
        clip: replace negative friction levels by zero. A friction that feeds energy in makes the
            simulated loop diverge; an estimator on its way may pass there.
    """
    n = robot.size
    inertia, rotor = np.zeros((n, 10)), np.zeros((n, n))
    linear, terms = np.zeros((n, 2)), []
    pairs = {c: np.array([c.ratio, 0.0, 0.0, 0.0]) for c in robot.couplings}
    for p, given in zip(parameters, np.asarray(theta, dtype=float), strict=True):
        value = float(given)
        if clip and p.is_dissipative and p.stem not in ("ia", "iam"):
            value = max(value, 0.0)
        if p.is_inertial:
            inertia[p.joint, INERTIAL.index(p.stem)] = value
        elif p.stem == "ia":
            rotor[p.joint, p.joint] = value
        elif p.coupling is not None and p.stem == "iam":
            i, j = p.coupling.motor, p.coupling.joint
            rotor[i, j] = rotor[j, i] = p.coupling.ratio * value
        elif p.coupling is not None:
            pairs[p.coupling][1 if p.stem == "fvm" else 2] = value
        elif p.friction is not None:
            code, sign, shape = p.friction.encoded(simulated=True)
            if code == FrictionColumn.VISCOUS:
                linear[p.joint, 0] += value
            elif code == FrictionColumn.OFFSET:
                linear[p.joint, 1] += value
            else:
                terms.append(((p.joint, code, sign), (value, *shape)))
    signs = [coupling_sign(robot, c.motor, simulated=True) for c in robot.couplings]
    for c, (_, gamma) in zip(robot.couplings, signs, strict=True):
        pairs[c][3] = gamma
    table = FrictionTable(
        linear,
        np.array([index for index, _ in terms], dtype=np.int64).reshape(-1, 3),
        np.array([value for _, value in terms], dtype=float).reshape(-1, 4),
        np.array(
            [(c.motor, c.joint, sign) for c, (sign, _) in zip(pairs, signs, strict=True)],
            dtype=np.int64,
        ).reshape(-1, 3),
        np.array(list(pairs.values()), dtype=float).reshape(-1, 4),
    )
    return Model(tree_of(robot), inertia, rotor, table)


@njit(cache=True, nogil=True, error_model="numpy", forceinline=True)
def friction_torque(
    linear, term_index, term_value, pair_index, pair_value, vectors, speed, out, slopes, row
):
    """Friction torques and the slopes of the own and of the coupled terms.

    Args:
        linear: see :class:`FrictionTable`; likewise the next four.
        term_index: nonlinear terms.
        term_value: their values.
        pair_index: couplings.
        pair_value: their values.
        vectors: rows of joint quantities, shape (rows, joints).
        speed: row of ``vectors`` that holds the speeds.
        out: row of ``vectors`` that receives the friction torques.
        slopes: receives in ``row`` d torque / d v of each joint, then of each coupling's dry
            friction over the speed of its rotor, shape (rows, joints + couplings).
        row: row of ``slopes``.
    """
    n = vectors.shape[1]
    for j in range(n):
        vectors[out, j] = linear[j, 0] * vectors[speed, j] + linear[j, 1]
        slopes[row, j] = linear[j, 0]
    for k in range(term_index.shape[0]):
        j = term_index[k, 0]
        f, df = friction_value_and_slope(
            term_index[k, 1],
            term_index[k, 2],
            term_value[k, 1],
            term_value[k, 2],
            term_value[k, 3],
            vectors[speed, j],
        )
        vectors[out, j] += term_value[k, 0] * f
        slopes[row, j] += term_value[k, 0] * df
    for k in range(pair_index.shape[0]):
        i, j = pair_index[k, 0], pair_index[k, 1]
        ratio, viscous, dry = pair_value[k, 0], pair_value[k, 1], pair_value[k, 2]
        vi, vj = vectors[speed, i], vectors[speed, j]
        f, df = smooth_sign_and_slope(pair_index[k, 2], pair_value[k, 3], vi + ratio * vj)
        vectors[out, i] += ratio * viscous * vj + dry * f
        vectors[out, j] += ratio * (viscous * vi + dry * f)
        slopes[row, n + k] = dry * df


@njit(cache=True, nogil=True, error_model="numpy")
def _accelerations(model, q, dq, tau, out, failure):
    """Accelerations at many states; the first indefinite mass matrix is reported."""
    n = q.shape[1]
    f = model.friction
    work = rigid_body_work(n)
    mass, factor, inverse, bias = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n)), np.zeros(n)
    vectors = np.zeros((2, n))
    slopes = np.zeros((1, n + f.pair_index.shape[0]))
    for s in range(q.shape[0]):
        mass_matrix_and_bias(model.tree, model.inertia, model.rotor, q[s], dq[s], work, mass, bias)
        joint = invert_mass_matrix(mass, factor, inverse)
        if joint >= 0:
            failure[0] = factor[joint, joint]
            return joint, s
        vectors[0] = dq[s]
        friction_torque(
            f.linear,
            f.term_index,
            f.term_value,
            f.pair_index,
            f.pair_value,
            vectors,
            0,
            1,
            slopes,
            0,
        )
        for i in range(n):
            out[s, i] = 0.0
            for j in range(n):
                out[s, i] += inverse[i, j] * (tau[s, j] - bias[j] - vectors[1, j])
    return -1, -1


@njit(cache=True, nogil=True, error_model="numpy")
def _mass_matrices(model, q, out):
    """M(q) at many positions, both triangles."""
    n = q.shape[1]
    work = rigid_body_work(n)
    bias, still = np.zeros(n), np.zeros(n)
    for s in range(q.shape[0]):
        mass_matrix_and_bias(
            model.tree, model.inertia, model.rotor, q[s], still, work, out[s], bias
        )
        for i in range(n):
            for j in range(i):
                out[s, j, i] = out[s, i, j]


def mass_matrix(
    robot: Robot, parameters: tuple[Parameter, ...], theta: np.ndarray, q: np.ndarray
) -> np.ndarray:
    """M(q), shape (samples, joints, joints) [kg m², kg m or kg].

    Args:
        robot: the robot.
        parameters: standard parameters or heads of base groups.
        theta: their values, shape (parameters,).
        q: joint positions [rad or m], shape (samples, joints).

    Raises:
        ValueError: positions of another number of joints.
    """
    (q,) = _states(robot, q)
    out = np.zeros((len(q), robot.size, robot.size))
    _mass_matrices(make_model(robot, parameters, theta), q, out)
    return out


def acceleration(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q: np.ndarray,
    dq: np.ndarray,
    tau: np.ndarray,
) -> np.ndarray:
    """Ddq = M(q)⁻¹ (tau - h(q, dq) - friction(dq)), shape (samples, joints) [rad/s² or m/s²].

    Args:
        robot: the robot; a friction law with the hard sign is used in its smooth form.
        parameters: standard parameters or heads of base groups.
        theta: their values, shape (parameters,).
        q: joint positions [rad or m], shape (samples, joints); ``dq tau`` likewise.
        dq: joint speeds.
        tau: joint torques or forces [N m or N].

    Raises:
        MassMatrixNotPositiveDefinite: names the joint; its time is the sample's index.
        ValueError: arrays that do not belong together.
    """
    q, dq, tau = _states(robot, q, dq, tau)
    out, failure = np.zeros(q.shape), np.zeros(1)
    joint, sample = _accelerations(make_model(robot, parameters, theta), q, dq, tau, out, failure)
    if joint >= 0:
        raise MassMatrixNotPositiveDefinite(robot.joint_names[joint], float(sample), failure[0])
    return out


def _states(robot: Robot, *signals: np.ndarray) -> list[np.ndarray]:
    """Signals (samples, joints) as the compiled loops want them; those do not look at shapes."""
    wanted = (len(signals[0]), robot.size)
    if any(np.shape(x) != wanted for x in signals):
        shapes = ", ".join(str(np.shape(x)) for x in signals)
        raise ValueError(f"arrays have shapes {shapes}, (samples, joints) = {wanted} is needed")
    return [np.ascontiguousarray(x, dtype=float) for x in signals]
