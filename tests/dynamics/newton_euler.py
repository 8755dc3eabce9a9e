"""The inverse dynamic model once more, for complex numbers: Newton–Euler in the base frame.

Written for tests from the equations of rigid bodies alone, one sample at a time, without spatial
vectors: complex steps through it give derivatives to the last digit.
"""

import numpy as np

from pivident.robot.description import INERTIAL, Robot


def torques(robot: Robot, columns, q, dq, ddq, weights):
    """Sum of weighted columns of the rigid-body regressor, shape (joints,), of one state.

    ``columns``: parameters; ``weights``: shape (joints, parameters).
    """
    n = robot.size
    turn, origin, axis = [], [], []
    omega, alpha, acceleration = [], [], []
    for i, joint in enumerate(robot.joints):
        p = joint.parent
        r0, o0 = (np.eye(3), np.zeros(3)) if p < 0 else (turn[p], origin[p])
        w, e, a = (
            (np.zeros(3), np.zeros(3), -np.asarray(robot.gravity))
            if p < 0
            else (omega[p], alpha[p], acceleration[p])
        )
        z = r0 @ joint.rotation[:, 2]
        c, s = np.cos(q[i]), np.sin(q[i])
        lever = joint.translation.astype(complex)
        turning = joint.kind == "revolute"
        spin = np.array([[c, -s, 0], [s, c, 0], [0, 0, 1]]) if turning else np.eye(3)
        if not turning:
            lever = lever + joint.rotation[:, 2] * q[i]
        arm = r0 @ lever
        a = a + np.cross(e, arm) + np.cross(w, np.cross(w, arm))
        if turning:
            e = e + np.cross(w, z) * dq[i] + z * ddq[i]
            w = w + z * dq[i]
        else:
            a = a + 2 * np.cross(w, z) * dq[i] + z * ddq[i]
        turn.append(r0 @ joint.rotation @ spin)
        origin.append(o0 + arm)
        axis.append(z)
        omega.append(w)
        alpha.append(e)
        acceleration.append(a)
    out = np.zeros(n, complex)
    for j in range(n):
        for i in range(n):
            if j not in robot.ancestors(i):
                continue
            g = np.zeros(10, complex)
            for k, p in enumerate(columns):
                if p.is_inertial and p.joint == i:
                    g[INERTIAL.index(p.stem)] = weights[j, k]
            local = np.array([[g[0], g[1], g[2]], [g[1], g[3], g[4]], [g[2], g[4], g[5]]])
            inertia, h = turn[i] @ local @ turn[i].T, turn[i] @ g[6:9]
            w, e, a = omega[i], alpha[i], acceleration[i]
            force = g[9] * a + np.cross(e, h) + np.cross(w, np.cross(w, h))
            moment = inertia @ e + np.cross(w, inertia @ w) + np.cross(h, a)
            if robot.joints[j].kind == "prismatic":
                out[j] += axis[j] @ force
            else:
                out[j] += axis[j] @ (moment + np.cross(origin[i] - origin[j], force))
    return out
