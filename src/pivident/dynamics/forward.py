"""Forward dynamics: mass matrix, bias torques and acceleration from linear parameters.

    M(q) ddq + h(q, dq) + friction(dq) = tau

Base parameters are enough: they are lifted to links some of which have no mass, and the kernels
work on the linear ten-parameter form, where that is allowed.
"""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numba import njit

from pivident.dynamics.friction import friction_value_and_slope, smooth_sign_and_slope
from pivident.dynamics.kernels import (
    Tree,
    invert_mass_matrix,
    mass_matrix_and_bias,
    rigid_body_work,
)
from pivident.dynamics.parameters import Parameter
from pivident.dynamics.regressor import coupling_sign, tree_of
from pivident.errors import MassMatrixNotPositiveDefinite
from pivident.robot.description import INERTIAL, Robot


class FrictionTable(NamedTuple):
    """Friction of all joints as the simulator evaluates it.

    Attributes:
        joint: joint of each term, shape (terms,); ``code`` and ``sign`` likewise.
        code: function of each term.
        sign: its smoothed sign function.
        shape: γ, v_s, δ of each term, shape (terms, 3).
        value: the parameter of each term [N m, N m s/rad …], shape (terms,).
        pair: motor and joint of each coupling, shape (couplings, 2).
        pair_sign: sign function of each coupling, shape (couplings,).
        pair_value: ratio, fvm, fcm, γ of each coupling, shape (couplings, 4).
    """

    joint: np.ndarray
    code: np.ndarray
    sign: np.ndarray
    shape: np.ndarray
    value: np.ndarray
    pair: np.ndarray
    pair_sign: np.ndarray
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
    terms = []
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
            terms.append((p.joint, *p.friction.encoded(simulated=True), value))
    signs = [coupling_sign(robot, c.motor, simulated=True) for c in robot.couplings]
    for c, (_, gamma) in zip(robot.couplings, signs, strict=True):
        pairs[c][3] = gamma
    table = FrictionTable(
        np.array([t[0] for t in terms], dtype=np.int64),
        np.array([t[1] for t in terms], dtype=np.int64),
        np.array([t[2] for t in terms], dtype=np.int64),
        np.array([t[3] for t in terms], dtype=float).reshape(-1, 3),
        np.array([t[4] for t in terms], dtype=float),
        np.array([(c.motor, c.joint) for c in pairs], dtype=np.int64).reshape(-1, 2),
        np.array([sign for sign, _ in signs], dtype=np.int64),
        np.array(list(pairs.values()), dtype=float).reshape(-1, 4),
    )
    return Model(tree_of(robot), inertia, rotor, table)


@njit(cache=True, nogil=True)
def friction_torque(friction, v, torque, slope):
    """Friction torque of every joint and the slopes of its own and coupled terms.

    Args:
        friction: the table.
        v: joint speeds, shape (joints,).
        torque: receives the friction torques, shape (joints,).
        slope: receives d torque / d v: joints on the first entries, then one per coupling (its
            slope over the speed of the coupled rotor), shape (joints + couplings,).
    """
    n = v.size
    for j in range(n):
        torque[j] = 0.0
        slope[j] = 0.0
    for k in range(friction.joint.size):
        j = friction.joint[k]
        shape = friction.shape[k]
        f, df = friction_value_and_slope(
            friction.code[k], friction.sign[k], shape[0], shape[1], shape[2], v[j]
        )
        torque[j] += friction.value[k] * f
        slope[j] += friction.value[k] * df
    for k in range(friction.pair_sign.size):
        i, j = friction.pair[k, 0], friction.pair[k, 1]
        ratio, viscous, coulomb, gamma = (
            friction.pair_value[k, 0],
            friction.pair_value[k, 1],
            friction.pair_value[k, 2],
            friction.pair_value[k, 3],
        )
        f, df = smooth_sign_and_slope(friction.pair_sign[k], gamma, v[i] + ratio * v[j])
        torque[i] += ratio * viscous * v[j] + coulomb * f
        torque[j] += ratio * (viscous * v[i] + coulomb * f)
        slope[n + k] = coulomb * df + abs(viscous)


@njit(cache=True, nogil=True)
def _accelerations(model, q, dq, tau, out, failure):
    """Accelerations at many states; the first indefinite mass matrix is reported."""
    n = q.shape[1]
    work = rigid_body_work(n)
    mass, factor, inverse = np.zeros((n, n)), np.zeros((n, n)), np.zeros((n, n))
    bias, torque = np.zeros(n), np.zeros(n)
    slope = np.zeros(n + model.friction.pair_sign.size)
    for s in range(q.shape[0]):
        mass_matrix_and_bias(model.tree, model.inertia, model.rotor, q[s], dq[s], work, mass, bias)
        joint = invert_mass_matrix(mass, factor, inverse)
        if joint >= 0:
            failure[0] = factor[joint, joint]
            return joint, s
        friction_torque(model.friction, dq[s], torque, slope)
        for i in range(n):
            total = 0.0
            for j in range(n):
                total += inverse[i, j] * (tau[s, j] - bias[j] - torque[j])
            out[s, i] = total
    return -1, -1


@njit(cache=True, nogil=True)
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
    """
    out = np.zeros((len(q), robot.size, robot.size))
    _mass_matrices(make_model(robot, parameters, theta), np.ascontiguousarray(q, float), out)
    return out


def acceleration(
    robot: Robot,
    parameters: tuple[Parameter, ...],
    theta: np.ndarray,
    q: np.ndarray,
    dq: np.ndarray,
    tau: np.ndarray,
) -> np.ndarray:
    """ddq = M(q)⁻¹ (tau - h(q, dq) - friction(dq)), shape (samples, joints) [rad/s² or m/s²].

    Args:
        robot: the robot; a friction law with the hard sign is used in its smooth form.
        parameters: standard parameters or heads of base groups.
        theta: their values, shape (parameters,).
        q: joint positions [rad or m], shape (samples, joints); ``dq tau`` likewise.
        dq: joint speeds.
        tau: joint torques or forces [N m or N].

    Raises:
        MassMatrixNotPositiveDefinite: names the joint; its time is the sample's index.
    """
    q, dq, tau = (np.ascontiguousarray(x, dtype=float) for x in (q, dq, tau))
    out, failure = np.zeros(q.shape), np.zeros(1)
    joint, sample = _accelerations(make_model(robot, parameters, theta), q, dq, tau, out, failure)
    if joint >= 0:
        raise MassMatrixNotPositiveDefinite(robot.joint_names[joint], float(sample), failure[0])
    return out
