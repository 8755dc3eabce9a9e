"""Derivatives of weighted torques ∂(Φ_j g_j)/∂(q, dq, ddq) by Newton–Euler recursions.

A gradient of anything that depends on the motion through the observation matrix, its information
or a torque, needs the derivatives of Φ_j g_j for parameters g_j that differ by sample and by joint.
In spatial vectors, with S_k the screw of joint k, V_k and A_k velocity and acceleration of its link
(gravity is an upward acceleration of the base) and p the parent of k, for every k that moves link i

    ∂V_i/∂dq_k = S_k                      ∂A_i/∂ddq_k = S_k
    ∂V_i/∂q_k  = V_p × S_k                ∂A_i/∂dq_k  = (2 V_k - V_i) × S_k
    ∂A_i/∂q_k  = A_p × S_k + (V_p × S_k) × (V_i - V_p)
    ∂S_j/∂q_k  = S_j × S_k  for j before k, else 0

as seen from link i (after Carpentier and Mansard 2018). The part of link i in the torque of joint j
is S_j · F with F = I A_i + V_i ×* I V_i, where I is the spatial inertia of the parameters g_j; so

    ∂/∂A_i = I S_j,      ∂/∂V_i = I (S_j × V_i) - S_j ×* I V_i,      ∂/∂S_j = F
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from pivident.dynamics.column_slopes import ColumnSlope, column_slopes
from pivident.dynamics.kernels import Tree, link_poses, tree_of
from pivident.dynamics.regressor import Regressor
from pivident.foundation.compiled import allocating, inlined as _inline
from pivident.foundation.errors import UnusableValue
from pivident.foundation.threads import run_in_threads
from pivident.robot.description import INERTIAL
from pivident.robot.refusals import without_loops

#: Samples of a thread's block.
BLOCK = 128

#: Position, speed and acceleration on the last axis of a derivative.
POSITION, SPEED, ACCELERATION = 0, 1, 2


@dataclass(frozen=True, eq=False)
class RegressorDerivatives:
    """Derivatives of a regressor's weighted torques.

    Friction with memory or load counts as constant, and the hard sign of a speed has the slope
    zero.

    Attributes:
        regressor: the observation matrix.
    """

    regressor: Regressor
    _tree: Tree
    _column: np.ndarray  # of each link's ten parameters, -1 where there is none, (links, 10)
    _slopes: tuple[ColumnSlope, ...]

    @classmethod
    def of(cls, regressor: Regressor) -> RegressorDerivatives:
        """Prepare the derivatives of a regressor.

        Args:
            regressor: the observation matrix.

        Raises:
            RobotDescriptionError: that of a robot with closed loops.
        """
        without_loops(regressor.robot, "the derivative of an observation matrix")
        column = np.full((regressor.robot.size, len(INERTIAL)), -1, dtype=np.int64)
        for c, p in enumerate(regressor.parameters):
            if p.is_inertial:
                column[p.joint, INERTIAL.index(p.stem)] = c
        return cls(regressor, tree_of(regressor.robot), column, column_slopes(regressor))

    def weighted(
        self, q: np.ndarray, dq: np.ndarray, ddq: np.ndarray, weights: np.ndarray
    ) -> np.ndarray:
        """∂(Φ_j g_j)/∂(q_k, dq_k, ddq_k) of every joint j, for weights g_j that are constants.

        Args:
            q: joint positions [rad or m], shape (samples, joints); ``dq ddq`` likewise.
            dq: joint speeds [rad/s or m/s].
            ddq: joint accelerations [rad/s² or m/s²].
            weights: g, shape (samples, joints, parameters).

        Returns:
            Derivatives, shape (samples, joints j, joints k, 3), the last axis for q, dq and ddq.

        Raises:
            ValueError: shapes that do not fit.
        """
        samples, n = np.shape(q)
        if np.shape(weights) != (samples, n, len(self.regressor.parameters)):
            raise UnusableValue(
                f"weights have shape {np.shape(weights)}",
                advice=f"{(samples, n, len(self.regressor.parameters))} is needed",
            )
        q, dq, ddq, weights = (np.ascontiguousarray(x, dtype=float) for x in (q, dq, ddq, weights))
        out = np.zeros((samples, n, n, 3))

        def block(part: slice) -> None:
            _rigid_derivatives(
                self._tree, self._column, q[part], dq[part], ddq[part], weights[part], out[part]
            )

        starts = range(0, samples, BLOCK)
        run_in_threads(block, [slice(s, min(s + BLOCK, samples)) for s in starts])
        for slope in self._slopes:
            value = slope.value(q[:, slope.motion_of], dq[:, slope.motion_of], dq[:, slope.other])
            value = value * weights[:, slope.joint, slope.column]
            out[:, slope.joint, slope.motion_of, slope.quantity] += value
            if slope.ratio:
                out[:, slope.joint, slope.other, slope.quantity] += slope.ratio * value
        return out


@_inline
def _turned(turn, x, y, z):
    """Rᵀ (x, y, z), R row by row."""
    return (
        turn[0] * x + turn[3] * y + turn[6] * z,
        turn[1] * x + turn[4] * y + turn[7] * z,
        turn[2] * x + turn[5] * y + turn[8] * z,
    )


@_inline
def _seen(turn, origin, source, target):
    """A motion vector (v, w) at the base's origin, seen from a link's frame."""
    wx, wy, wz = source[3], source[4], source[5]
    vx = source[0] + wy * origin[2] - wz * origin[1]
    vy = source[1] + wz * origin[0] - wx * origin[2]
    vz = source[2] + wx * origin[1] - wy * origin[0]
    target[0], target[1], target[2] = _turned(turn, vx, vy, vz)
    target[3], target[4], target[5] = _turned(turn, wx, wy, wz)


@_inline
def _to_base(turn, origin, force):
    """A force vector (f, n) of a link's frame, at the base's origin, in place."""
    f0, f1, f2, n0, n1, n2 = force[0], force[1], force[2], force[3], force[4], force[5]
    fx = turn[0] * f0 + turn[1] * f1 + turn[2] * f2
    fy = turn[3] * f0 + turn[4] * f1 + turn[5] * f2
    fz = turn[6] * f0 + turn[7] * f1 + turn[8] * f2
    force[0], force[1], force[2] = fx, fy, fz
    force[3] = turn[0] * n0 + turn[1] * n1 + turn[2] * n2 + origin[1] * fz - origin[2] * fy
    force[4] = turn[3] * n0 + turn[4] * n1 + turn[5] * n2 + origin[2] * fx - origin[0] * fz
    force[5] = turn[6] * n0 + turn[7] * n1 + turn[8] * n2 + origin[0] * fy - origin[1] * fx


@_inline
def _inertia_times(g, x, out):
    """I x: f = m v + w × h, n = I w + h × v, of parameters xx xy xz yy yz zz mx my mz m."""
    vx, vy, vz, wx, wy, wz = x[0], x[1], x[2], x[3], x[4], x[5]
    hx, hy, hz, m = g[6], g[7], g[8], g[9]
    out[0] = m * vx + wy * hz - wz * hy
    out[1] = m * vy + wz * hx - wx * hz
    out[2] = m * vz + wx * hy - wy * hx
    out[3] = g[0] * wx + g[1] * wy + g[2] * wz + hy * vz - hz * vy
    out[4] = g[1] * wx + g[3] * wy + g[4] * wz + hz * vx - hx * vz
    out[5] = g[2] * wx + g[4] * wy + g[5] * wz + hx * vy - hy * vx


@_inline
def _motion_cross(x, y, out):
    """(v, w) × (v', w') = (w × v' + v × w', w × w')."""
    out[0] = x[4] * y[2] - x[5] * y[1] + x[1] * y[5] - x[2] * y[4]
    out[1] = x[5] * y[0] - x[3] * y[2] + x[2] * y[3] - x[0] * y[5]
    out[2] = x[3] * y[1] - x[4] * y[0] + x[0] * y[4] - x[1] * y[3]
    out[3] = x[4] * y[5] - x[5] * y[4]
    out[4] = x[5] * y[3] - x[3] * y[5]
    out[5] = x[3] * y[4] - x[4] * y[3]


@_inline
def _add_force_cross(sign, x, f, out):
    """Add ± (v, w) ×* (f, n) = ± (w × f, w × n + v × f)."""
    out[0] += sign * (x[4] * f[2] - x[5] * f[1])
    out[1] += sign * (x[5] * f[0] - x[3] * f[2])
    out[2] += sign * (x[3] * f[1] - x[4] * f[0])
    out[3] += sign * (x[4] * f[5] - x[5] * f[4] + x[1] * f[2] - x[2] * f[1])
    out[4] += sign * (x[5] * f[3] - x[3] * f[5] + x[2] * f[0] - x[0] * f[2])
    out[5] += sign * (x[3] * f[4] - x[4] * f[3] + x[0] * f[1] - x[1] * f[0])


@_inline
def _dot(x, f):
    total = 0.0
    for k in range(6):
        total += x[k] * f[k]
    return total


@allocating
def _rigid_derivatives(tree, column, q, dq, ddq, weights, out):
    """Add the rigid-body part of the derivatives to ``out``, sample by sample."""
    samples, n = q.shape
    pose = np.empty((n, 12))
    turn, origin = np.empty((n, 9)), np.empty((n, 3))
    screw, velocity, acceleration = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 6))
    base = np.zeros(6)
    base[0], base[1], base[2] = -tree.gravity[0], -tree.gravity[1], -tree.gravity[2]
    chain = np.empty(n, np.int64)
    by_position, by_speed, by_bend = np.empty((n, 6)), np.empty((n, 6)), np.empty((n, 6))
    own_v, own_a, own_s, other = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    momentum, force, of_a, of_v = np.empty(6), np.empty(6), np.empty(6), np.empty(6)
    g = np.empty(10)
    for t in range(samples):
        link_poses(tree.prismatic, tree.rotation, tree.translation, q[t], pose)
        for i in range(n):
            _link_motion(
                tree, pose, i, dq[t, i], ddq[t, i], base, turn, origin, screw, velocity,
                acceleration, other,
            )  # fmt: skip
        for i in range(n):
            _seen(turn[i], origin[i], velocity[i], own_v)
            _seen(turn[i], origin[i], acceleration[i], own_a)
            depth, k = 0, i
            while k >= 0:
                chain[depth] = k
                depth += 1
                k = tree.parent[k]
            for d in range(depth):
                _derivatives_of_link(
                    tree, chain[d], i, screw, velocity, acceleration, base, other,
                    by_position[d], by_speed[d], by_bend[d],
                )  # fmt: skip
            for d in range(depth):
                j = chain[d]
                some = False
                for p in range(10):
                    g[p] = 0.0
                    if column[i, p] >= 0:
                        g[p] = weights[t, j, column[i, p]]
                        some = some or g[p] != 0.0
                if not some:
                    continue
                _seen(turn[i], origin[i], screw[j], own_s)
                _inertia_times(g, own_v, momentum)
                _inertia_times(g, own_a, force)
                _add_force_cross(1.0, own_v, momentum, force)
                _inertia_times(g, own_s, of_a)
                _motion_cross(own_s, own_v, other)
                _inertia_times(g, other, of_v)
                _add_force_cross(-1.0, own_s, momentum, of_v)
                _to_base(turn[i], origin[i], force)
                _to_base(turn[i], origin[i], of_a)
                _to_base(turn[i], origin[i], of_v)
                for e in range(depth):
                    k = chain[e]
                    out[t, j, k, 2] += _dot(screw[k], of_a)
                    out[t, j, k, 1] += _dot(screw[k], of_v) + _dot(by_speed[e], of_a)
                    out[t, j, k, 0] += _dot(by_bend[e], of_v) + _dot(by_position[e], of_a)
                    if e < d:  # the chain runs towards the base: j lies before k
                        _motion_cross(screw[j], screw[k], other)
                        out[t, j, k, 0] += _dot(other, force)


@_inline
def _link_motion(
    tree, pose, i, speed, rate_of_speed, base, turn, origin, screw, velocity, acceleration, other
):
    """Pose of link i in the base, the screw of its joint, its velocity and acceleration."""
    parent = tree.parent[i]
    for r in range(3):
        if parent < 0:
            origin[i, r] = pose[i, 9 + r]
        else:
            origin[i, r] = origin[parent, r]
            for k in range(3):
                origin[i, r] += turn[parent, 3 * r + k] * pose[i, 9 + k]
        for c in range(3):
            if parent < 0:
                turn[i, 3 * r + c] = pose[i, 3 * r + c]
            else:
                total = 0.0
                for k in range(3):
                    total += turn[parent, 3 * r + k] * pose[i, 3 * k + c]
                turn[i, 3 * r + c] = total
    zx, zy, zz = turn[i, 2], turn[i, 5], turn[i, 8]
    if tree.prismatic[i]:
        screw[i, 0], screw[i, 1], screw[i, 2] = zx, zy, zz
        screw[i, 3], screw[i, 4], screw[i, 5] = 0.0, 0.0, 0.0
    else:
        screw[i, 0] = origin[i, 1] * zz - origin[i, 2] * zy
        screw[i, 1] = origin[i, 2] * zx - origin[i, 0] * zz
        screw[i, 2] = origin[i, 0] * zy - origin[i, 1] * zx
        screw[i, 3], screw[i, 4], screw[i, 5] = zx, zy, zz
    for k in range(6):
        velocity[i, k] = screw[i, k] * speed
        acceleration[i, k] = base[k] + screw[i, k] * rate_of_speed
        if parent >= 0:
            velocity[i, k] += velocity[parent, k]
            acceleration[i, k] += acceleration[parent, k] - base[k]
    _motion_cross(velocity[i], screw[i], other)
    for k in range(6):
        acceleration[i, k] += other[k] * speed


@_inline
def _derivatives_of_link(
    tree, k, i, screw, velocity, acceleration, base, other, by_position, by_speed, by_bend
):
    """∂A_i/∂q_k, ∂A_i/∂dq_k and ∂V_i/∂q_k."""
    parent = tree.parent[k]
    for c in range(6):
        other[c] = 2.0 * velocity[k, c] - velocity[i, c]
    _motion_cross(other, screw[k], by_speed)
    _motion_cross(velocity[k], screw[k], by_bend)  # V_k × S_k = V_p × S_k
    for c in range(6):
        other[c] = velocity[i, c] - (velocity[parent, c] if parent >= 0 else 0.0)
    _motion_cross(by_bend, other, by_position)
    if parent >= 0:
        _motion_cross(acceleration[parent], screw[k], other)
    else:
        _motion_cross(base, screw[k], other)
    for c in range(6):
        by_position[c] += other[c]
